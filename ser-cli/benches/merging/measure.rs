//! Runs programs and tells what they took.

use std::io::Read;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use wait4::Wait4;

pub(crate) type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// A program with its arguments, and what to call it.
pub(crate) struct Job {
    pub(crate) name: &'static str,
    pub(crate) command: Command,
}

/// What one run took.
#[derive(Clone, Copy, Debug)]
struct Taken {
    wall: Duration,
    user: Duration,
    system: Duration,
    peak_bytes: u64,
}

/// Runs each several times, in turn, and prints a row for each: of the fastest run.
pub(crate) fn table(jobs: &[Job], repetitions: usize) -> Result<()> {
    let mut all: Vec<Vec<Taken>> = vec![Vec::new(); jobs.len()];
    for _ in 0..repetitions.max(1) {
        for (job, taken) in jobs.iter().zip(&mut all) {
            taken.push(run(job)?);
        }
    }
    println!("{:42} {:>17} {:>9} {:>9} {:>9}", "", "wall (to)", "user", "system", "peak");
    for (job, mut taken) in jobs.iter().zip(all) {
        taken.sort_by_key(|taken| taken.wall);
        let (Some(best), Some(worst)) = (taken.first(), taken.last()) else { continue };
        let seconds = |time: Duration| format!("{:.2} s", time.as_secs_f64());
        println!(
            "{:42} {:>8} {:>8} {:>9} {:>9} {:>6} MB",
            job.name,
            seconds(best.wall),
            seconds(worst.wall),
            seconds(best.user),
            seconds(best.system),
            best.peak_bytes / 1_000_000,
        );
    }
    Ok(())
}

fn run(job: &Job) -> Result<Taken> {
    let began = Instant::now();
    let mut child = again(job).stdout(Stdio::null()).spawn()?;
    let used = child.wait4()?;
    let wall = began.elapsed();
    if !used.status.success() {
        return Err(format!("{}: {}", job.name, used.status).into());
    }
    let rusage = used.rusage;
    Ok(Taken { wall, user: rusage.utime, system: rusage.stime, peak_bytes: rusage.maxrss })
}

/// Runs it once and returns what it prints.
pub(crate) fn output(job: &Job) -> Result<String> {
    let mut child = again(job).stdout(Stdio::piped()).spawn()?;
    let mut text = String::new();
    if let Some(out) = child.stdout.as_mut() {
        out.read_to_string(&mut text)?;
    }
    let status = child.wait()?;
    status.success().then_some(text).ok_or_else(|| format!("{}: {status}", job.name).into())
}

/// A command can be run again only if it is a new one.
fn again(job: &Job) -> Command {
    let mut command = Command::new(job.command.get_program());
    command.args(job.command.get_args()).stdin(Stdio::null());
    // No program looks for a zone or a language.
    command.env("TZ", "UTC").env("LC_ALL", "C");
    command
}
