//! `evidence-mistakes`: shows that the judge of `ser-evidence` notices mistakes.
//!
//! Each mistake is a file that says what is right and what is wrong. The crate is copied, made
//! wrong, and tried by its judge, which has to object.

mod copy;
mod mistake;

use std::process::Command;

use crate::places;
use crate::steps::{self, Failure, Result, heading, note};
use copy::Copy;
use mistake::Mistake;

const EXAMPLES: &str = "\
Examples:
  cargo xtask evidence-mistakes            all of them
  cargo xtask evidence-mistakes drift      those whose file name has this in it

A mistake is a file in crates/ser-evidence/tests/mistakes/. Exit code 1 if the judge does not \
notice one, or if one does not fit the code any more.";

/// How many worlds the judge looks at to notice a mistake.
const SEEDS: &str = "600";

/// Plant mistakes in a copy of `ser-evidence`, one after the other, and see that its judge notices
/// each.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    /// Only mistakes whose file name has this in it.
    filter: Option<String>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    all(arguments.filter.as_deref().unwrap_or_default())
}

/// Plants the mistakes whose file name has `filter` in it.
pub(crate) fn all(filter: &str) -> Result<()> {
    heading("Mistakes in a copy of ser-evidence");
    let mistakes = Mistake::all(filter)?;
    let copy = Copy::make()?;
    build(&copy)?;
    if !is_content(&copy)? {
        return Err(Failure::new(
            "the judge objects without a mistake; to see why:\n  cargo test -p ser-evidence",
        ));
    }
    let mut unnoticed = Vec::new();
    for mistake in &mistakes {
        let right = copy.plant(mistake)?;
        build(&copy).map_err(|failure| {
            Failure::new(format!("{} does not compile{failure}", mistake.name))
        })?;
        let is_noticed = !is_content(&copy)?;
        copy.mend(mistake, &right)?;
        let what = if is_noticed { "noticed" } else { "NOT NOTICED" };
        note(&format!("{what}: {}", mistake.title));
        if !is_noticed {
            unnoticed.push(mistake.name.as_str());
        }
    }
    if unnoticed.is_empty() {
        return Ok(());
    }
    Err(Failure::new(format!("the judge does not notice: {}", unnoticed.join(", "))))
}

/// The judge, in the copy. What is there already is built with, so nothing is downloaded.
fn judge(copy: &Copy) -> Command {
    let mut judge = steps::in_use("cargo");
    judge
        .current_dir(copy.root())
        .env("CARGO_TARGET_DIR", places::evidence_mistakes().join("target"))
        .env("SER_RULES_SEEDS", SEEDS)
        .env("SER_RULES_WRONG", "1")
        .env("CARGO_PROFILE_DEV_DEBUG", "0")
        // A mistake may leave something unused.
        .env("RUSTFLAGS", "-Awarnings")
        .args(["test", "--quiet", "--offline", "--package", "ser-evidence", "--test", "rules"]);
    judge
}

fn build(copy: &Copy) -> Result<()> {
    steps::run(judge(copy).arg("--no-run"))
}

/// Whether the judge has nothing to object.
fn is_content(copy: &Copy) -> Result<bool> {
    let output = judge(copy).args(["--", "what_is_said_is_true", "--exact"]).output();
    let output = output.map_err(|error| Failure::new(format!("cannot run cargo: {error}")))?;
    Ok(output.status.success())
}
