//! Programs of others read what `export` writes, as users' programs do.
#![cfg(unix)]

mod common;
mod readers;
