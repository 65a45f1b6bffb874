//! What must hold whatever arrives: one function per part of the system that takes bytes from
//! outside.
//!
//! Each target takes any bytes and panics when a property does not hold. That the code under test
//! never panics is the least of them. The fuzzer in `tests/fuzz` looks for bytes that break a
//! property, and the tests in `tests/fuzz_seeds.rs` run those that are kept as seeds. Nothing here
//! reads a clock or waits, so the same bytes always do the same.

mod body_rules;
mod captures;
mod cli_files;
mod client;
mod comm_req;
mod commands;
mod datagrams;
mod dribble;
mod extension_rules;
mod foreign_lists;
mod frames;
mod framing;
mod geni_driver;
mod node;
mod records;
mod replies;
mod script;
pub mod seeds;
mod site_files;
mod state_files;

pub use captures::captures;
pub use cli_files::cli_files;
pub use client::client;
pub use comm_req::comm_req;
pub use commands::commands;
pub use datagrams::datagrams;
pub use foreign_lists::foreign_lists;
pub use frames::frames;
pub use geni_driver::geni_driver;
pub use node::node;
pub use records::records;
pub use replies::replies;
pub use site_files::site_files;
pub use state_files::state_files;

/// A function that takes any bytes and panics when something does not hold.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// The name of the function, of the program around it, and of the folder with its seeds.
    pub name: &'static str,
    /// The function.
    pub run: fn(&[u8]),
}

/// All targets.
pub const TARGETS: [Target; 14] = [
    Target { name: "frames", run: frames },
    Target { name: "commands", run: commands },
    Target { name: "replies", run: replies },
    Target { name: "datagrams", run: datagrams },
    Target { name: "comm_req", run: comm_req },
    Target { name: "geni_driver", run: geni_driver },
    Target { name: "node", run: node },
    Target { name: "client", run: client },
    Target { name: "cli_files", run: cli_files },
    Target { name: "captures", run: captures },
    Target { name: "state_files", run: state_files },
    Target { name: "records", run: records },
    Target { name: "foreign_lists", run: foreign_lists },
    Target { name: "site_files", run: site_files },
];
