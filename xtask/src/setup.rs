//! Finds the tools that do not come with Rust, and installs missing ones if that needs no question.
//!
//! [`demand`] says what a run requires: which tools may be installed, and whether anything may be
//! left out. Each other file handles one kind of tool: whether it is installed, and how to install
//! it.

mod apt;
pub(crate) mod components;
pub(crate) mod cross;
pub(crate) mod demand;
pub(crate) mod emulator;
pub(crate) mod programs;

use crate::steps::{Result, note};

use cross::Target;
use demand::{Demand, Installing, Kind, Plan, Tool};

/// Prepares the tools for tests, checks and images, of these `kinds` only. It lists the missing
/// tools, installs those that it may, and reports what is left out without the others.
///
/// # Errors
/// If something is left out although the demand is strict.
pub(crate) fn make_ready(demand: Demand, targets: &[Target], kinds: &[Kind]) -> Result<()> {
    let missing = || {
        let mut missing = missing(targets);
        missing.retain(|tool| kinds.contains(&tool.kind));
        missing
    };
    let plan = demand.plan(&missing());
    plan.announcement().iter().for_each(|line| note(line));
    install(&plan, targets);
    let left_out = missing();
    demand.verdict(&left_out)?;
    Plan::remarks(&left_out).iter().for_each(|line| note(line));
    Ok(())
}

/// The tools that are not installed.
fn missing(targets: &[Target]) -> Vec<&'static Tool> {
    let mut missing = Vec::new();
    let mut look = |there: bool, tool| _ = (!there).then(|| missing.push(tool));
    look(components::there(), &components::TOOL);
    look(cross::there(targets), &cross::TOOL);
    look(cross::clippy_there(targets), &cross::CLIPPY);
    look(emulator::there(), &emulator::TOOL);
    missing.extend(programs::missing());
    missing
}

/// Installs what it can. What fails stays missing, and the reason has been reported.
fn install(plan: &Plan, targets: &[Target]) {
    for tool in &plan.install {
        let installed = match tool.kind {
            Kind::Components => components::find(Installing::Allowed),
            Kind::CrossRust => cross::find(targets, Installing::Allowed)
                .into_iter()
                .try_for_each(|found| found.map(drop)),
            Kind::CrossClippy => cross::install_clippy(),
            Kind::Emulator => emulator::find(Installing::Allowed),
            Kind::Program => programs::install(tool.name),
        };
        if let Err(failure) = installed {
            note(&failure.to_string());
        }
    }
}
