//! `demo`: the main use from end to end, without hardware.

mod bench;
mod plant;
mod story;

use std::path::{Path, PathBuf};

use ser_evidence::incident::Which;
use ser_observer::setting;

use self::bench::Bench;
use self::plant::Recorder;
use self::story::Story;
use super::report::{self, Shown};
use crate::error::{Failure, Result};
use crate::new_files::NewFiles;
use crate::outlet::{Outlet, file_named};

const EXAMPLES: &str = "\
Examples:
  ser-cli demo
  ser-cli demo -o trip.html          the report as a page, too
  ser-cli demo --image firmware.elf  the ARM image, in QEMU";

/// Play a breaker trip to two simulated recorders, and report what happened.
///
/// Only the contacts are simulated. The recorders' own code samples them every millisecond, and the
/// client asks for the events in the frames of the RS-232 protocol, at 19200 baud over TCP. The
/// report is that of `ser-cli report`. The demo takes a few seconds, and leaves nothing behind but
/// the page that you want.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Run this ARM image (mps2-an385) in QEMU as the first recorder.
    #[arg(long, value_name = "ELF")]
    image: Option<PathBuf>,

    /// Write the report as a page to this file as well.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// How many lines of the site file are shown: a point and what is expected of it.
const SHOWN_LINES: usize = 16;

pub(crate) fn run(args: &Args) -> Result<()> {
    let page = page(args.output.as_deref())?;
    let mut story = Story::begin();
    let bench = Bench::switch_on(args.image.as_deref())?;
    introduce(&bench, args.image.is_some(), &mut story)?;
    bench.set_up()?;
    set_clocks(&bench, &mut story)?;
    bench.play(Recorder::fault)?;
    bench.take_first_look()?;
    story.step(
        "There is a fault to ground: the relay trips the breaker, which takes its time.\n\
         What both recorders have of it is saved.",
        &["ser-cli merge --format jsonl > first.jsonl"],
    )?;
    bench.play(Recorder::afterwards)?;
    story.step(
        "The breaker's spring is charged again. Its limit switch chatters, and the small\n\
         log of SER2 goes round. What happened, what is wrong, and what is missing?",
        &["ser-cli report --input first.jsonl --live"],
    )?;
    let gathered = bench.gather_all()?;
    report::write(Outlet::Stdout, &gathered, Which::LastTrip, Shown::default())?;
    if let Some(page) = page {
        report::write(page, &gathered, Which::LastTrip, Shown::PAGE)?;
    }
    bench.switch_off()
}

/// The page that the user wants. A name that cannot be used is refused before the demo begins.
fn page(output: Option<&Path>) -> Result<Option<Outlet>> {
    let Some(output) = output else { return Ok(None) };
    let Some(path) = file_named(Some(output)) else {
        return Err(Failure::usage("standard output is where the demo tells its story")
            .hint("name a file for the page, as in -o trip.html"));
    };
    Outlet::open(Some(path), NewFiles::new(false)).map(Some)
}

fn introduce(bench: &Bench, has_image: bool, story: &mut Story) -> Result<()> {
    let first = if has_image { "the ARM image in QEMU" } else { "32 inputs" };
    story.step(
        &format!(
            "Two recorders watch a breaker: SER1 ({first}) at the relay, SER2 (16\n\
             inputs) at the switchgear. Only their contacts are simulated."
        ),
        &["ser-cli sim --tcp 127.0.0.1:4001 --paced --contacts trip1.csv &"],
    )?;
    story.end_of_file(
        "A site file says what is where. One contact of the breaker is wired to both, and\n\
         the breaker is to open within 50 ms:",
        &bench.site_text(),
        SHOWN_LINES,
    )
}

fn set_clocks(bench: &Bench, story: &mut Story) -> Result<()> {
    let mut exact = Vec::new();
    for recorder in &plant::RECORDERS {
        let set = bench.set_clock(recorder)?;
        exact.push(match set.observed.as_ref().and_then(setting::doubt_ms) {
            Some(doubt_ms) => format!("± {doubt_ms} ms"),
            None => "not known how exactly".to_owned(),
        });
    }
    story.step(
        &format!(
            "Both clocks are set, as exactly as the line allows: {}. SER2 is\n\
             given a log of 16 entries.",
            exact.join(" and ")
        ),
        &[
            "export SER_SITE=north.toml",
            "ser-cli config --recorder SER1 --line-baud 19200",
            "ser-cli config --recorder SER2 --line-baud 19200 --size 16",
            "ser-cli clock set --recorder SER1",
            "ser-cli clock set --recorder SER2",
        ],
    )
}
