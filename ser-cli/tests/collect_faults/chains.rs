//! The chains of an archive, by the program that the page on the archive has.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::faults::Trial;

/// Python as `cargo xtask test` sets it up, or as it is here. The program needs nothing else.
fn python() -> PathBuf {
    let ours = Path::new(env!("CARGO_TARGET_TMPDIR")).join("../readers/bin/python");
    if ours.exists() { ours } else { PathBuf::from("python3") }
}

/// Reckons all digests of all archives of a trial. Nobody writes to them.
pub(crate) fn check(trial: &Trial) {
    let program = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = program.join("../crates/ser-archive/tests/judge/chain.py");
    for collector in &trial.collectors {
        let output = Command::new(python()).arg(&program).arg(collector.archive()).output();
        let Ok(output) = output else {
            assert!(std::env::var_os("CI").is_none(), "CI has Python");
            eprintln!("left out: without Python nobody reckons the digests");
            return;
        };
        let said = String::from_utf8_lossy(&output.stdout);
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{told}");
        let of_ours = said.lines().filter(|line| line.starts_with(collector.name())).count();
        assert_eq!(of_ours, trial.plant.recorders.len(), "a chain for each recorder: {said}");
        assert!(!said.contains("broken"), "{said}");
    }
}
