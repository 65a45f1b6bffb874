//! The subcommands, one file each: arguments, help and action.

#[cfg(feature = "archive")]
pub(crate) mod archive;
pub(crate) mod audit;
pub(crate) mod clock;
#[cfg(feature = "archive")]
pub(crate) mod collect;
pub(crate) mod comm_req;
pub(crate) mod completions;
pub(crate) mod config;
pub(crate) mod decode;
pub(crate) mod demo;
pub(crate) mod diagnostics;
pub(crate) mod encode;
pub(crate) mod erase;
#[cfg(feature = "archive")]
pub(crate) mod events;
pub(crate) mod export;
pub(crate) mod filter;
#[cfg(unix)]
pub(crate) mod genius;
pub(crate) mod import;
#[cfg(feature = "archive")]
pub(crate) mod incident;
pub(crate) mod last_broadcast;
pub(crate) mod merge;
pub(crate) mod ports;
pub(crate) mod print;
pub(crate) mod read;
pub(crate) mod recording;
pub(crate) mod report;
pub(crate) mod sim;
pub(crate) mod site;
pub(crate) mod status;
pub(crate) mod time;
pub(crate) mod watch;
