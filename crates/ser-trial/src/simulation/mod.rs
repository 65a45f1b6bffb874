//! The whole system in one virtual time, with random operations and a full account: recorders with
//! both their ports, the hosts that read them with the client's own code, boards, bus and contacts,
//! and everything that goes wrong with them.
//!
//! - [`world`] runs it all: [`mod@unit`] is a recorder, [`line_host`] and [`bus`] are its
//!   surroundings, [`activity`] moves the contacts, [`orders`] says what hosts want, [`noise`]
//!   spoils the line.
//! - [`ledger`] works out which events a recorder must have recorded, and with which stamps, from
//!   what was done to it. [`taps`] tell it what the recorder was given, and [`debounce_model`]
//!   which input changes count.
//! - [`chatter_model`] says which of them the chatter filter leaves out, and [`questions`] what a
//!   recorder must answer to the questions of our extension.
//! - [`counts`] says what a recorder must have counted, exactly or within bounds.
//! - [`filter_orders`] knows when a recorder has set a filter.
//! - [`printout`] reads what a recorder prints.
//! - [`account`] compares what a reader was told with the ledger: every event once and in order, or
//!   reported as lost with the right count.
//!
//! Everything follows from one seed. [`run`] returns a [`Report`] with a digest of all that
//! happened, and the [`Paces`] of the run, or a [`Failure`] that says how to repeat it.

pub mod account;
pub mod activity;
pub mod bus;
pub mod chance;
pub mod chatter_model;
pub mod conversation;
pub mod counts;
pub mod debounce_model;
pub mod digest;
pub mod filter_orders;
pub mod ledger;
pub mod line_host;
pub mod noise;
pub mod orders;
pub mod pace;
pub mod port;
pub mod printout;
pub mod questions;
pub mod recorded;
pub mod report;
pub mod taps;
pub mod trail;
pub mod unit;
pub mod world;
pub mod wrong;

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};

pub use pace::Paces;
pub use report::Report;
pub use trail::{Trail, VirtualTime};
pub use world::{Options, World};

/// A run that found something.
#[derive(Clone, Debug)]
pub struct Failure {
    options: Options,
    /// Further options of the command line that repeats the run.
    load: &'static str,
    what: String,
    at_ms: u64,
    trail: String,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Options { seed, duration_ms, bus_one_in } = self.options;
        #[expect(clippy::cast_precision_loss, reason = "exact up to a quarter of a million years")]
        let hours = duration_ms as f64 / 3_600_000.0;
        let load = self.load;
        writeln!(f, "seed {seed} fails at {}", VirtualTime(self.at_ms))?;
        writeln!(f, "{}\n", self.what)?;
        writeln!(
            f,
            "to repeat it:\n  cargo xtask simulate --seed {seed} --hours {hours} --bus-one-in \
             {bus_one_in}{load}\n"
        )?;
        write!(f, "what was done last:\n{}", self.trail)
    }
}

impl std::error::Error for Failure {}

/// Runs a seed.
///
/// # Errors
/// When something is not as it must be. A panic counts as such.
pub fn run(options: Options) -> Result<(Report, Paces), Box<Failure>> {
    live(options, "", World::run)
}

/// Runs a recorder at the limit of what it can record, with both ports busy all the time. The seed
/// matters little.
///
/// # Errors
/// As [`run`].
pub fn run_flat_out(options: Options) -> Result<(Report, Paces), Box<Failure>> {
    live(options, " --load", World::run_flat_out)
}

fn live(
    options: Options,
    load: &'static str,
    live: impl FnOnce(World) -> Result<(Report, Paces), String>,
) -> Result<(Report, Paces), Box<Failure>> {
    let trail = Trail::default();
    let world = World::new(options, trail.clone());
    let result =
        catch_unwind(AssertUnwindSafe(|| live(world))).unwrap_or_else(|panic| Err(words(&*panic)));
    result.map_err(|what| {
        Box::new(Failure { options, load, what, at_ms: trail.now_ms(), trail: trail.to_string() })
    })
}

/// The message of a panic.
fn words(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
    format!("a panic: {}", text.unwrap_or("without a word"))
}
