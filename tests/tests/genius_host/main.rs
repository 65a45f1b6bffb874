//! A host at its window, in virtual time: how exact it is, how fresh what it sees is, and what it
//! says when board, bus, recorder or window fail. Nothing here waits in real time.
#![cfg(target_os = "linux")]

mod desk;
mod failures;
mod questions;
mod stale;
mod stations;
mod timing;
mod windows;
