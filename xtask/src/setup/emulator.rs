//! QEMU for ARM.

use crate::setup::apt;
use crate::steps::{Failure, Result, heading, note, unrelated, works};

const PROGRAM: &str = "qemu-system-arm";

/// Finds the emulator or installs it.
pub(crate) fn find() -> Result<()> {
    if cfg!(not(unix)) {
        return Err(Failure::new(
            "the emulator is driven through a pseudo-terminal and shared memory: it takes Linux or macOS",
        ));
    }
    if there() {
        return Ok(());
    }
    let why = if apt::there() {
        heading(&format!("Installing {PROGRAM}"));
        match apt::install(&[PROGRAM]) {
            Ok(()) if there() => return Ok(()),
            Ok(()) => None,
            Err(why) => Some(why),
        }
    } else {
        None
    };
    if let Some(why) = why {
        note(&why);
    }
    let how = if cfg!(target_os = "macos") {
        "brew install qemu"
    } else {
        "sudo apt-get install qemu-system-arm     (Debian, Ubuntu)\n  sudo dnf install qemu-system-arm-core    (Fedora)"
    };
    Err(Failure::new(format!("{PROGRAM} is missing; get it with\n  {how}")))
}

fn there() -> bool {
    works(unrelated(PROGRAM).arg("--version"))
}
