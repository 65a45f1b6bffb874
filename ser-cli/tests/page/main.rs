//! The page of a report: what is in the file, and what a browser makes of it.
#![cfg(unix)]

mod browser;
#[path = "../common/mod.rs"]
mod common;
mod file;
mod incident;
mod needs_chromedriver;
