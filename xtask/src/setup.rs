//! Finds the tools that do not come with Rust, and installs what is missing where that can be done
//! unasked.
//!
//! [`demand`] says what a run wants: what may be installed, and whether anything may be left out.
//! Each other file knows one kind of tool: whether it is there, and how to install it.

mod apt;
pub(crate) mod components;
pub(crate) mod cross;
pub(crate) mod demand;
pub(crate) mod emulator;
pub(crate) mod programs;

use crate::steps::{Result, note};

use cross::Target;
use demand::{Demand, Installing, Kind, Plan, Tool};

/// Makes ready what tests, checks and images need: says first what is missing and what will be
/// installed, installs it, and says what is left out for want of a tool. Only tools of these kinds
/// count.
///
/// # Errors
/// Something is left out and the demand is strict.
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

/// The tools that are not there.
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

/// Installs what can be. What cannot is missing afterwards, and the reason has been said.
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
