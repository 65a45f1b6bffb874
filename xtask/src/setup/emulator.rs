//! QEMU for ARM.

use crate::setup::apt;
use crate::setup::demand::{Installing, Kind, Size, Tool};
use crate::steps::{Failure, Result, heading, note, output, unrelated, works};

const PROGRAM: &str = "qemu-system-arm";

/// The emulator. The size is that of Debian 12's package with its dependencies.
pub(crate) static TOOL: Tool = Tool {
    name: PROGRAM,
    serves: "the tests in the emulator",
    size: Size { download_mb: Some(16), disk_mb: 69 },
    instead: None,
    kind: Kind::Emulator,
};

/// Finds or installs the emulator.
pub(crate) fn find(installing: Installing) -> Result<()> {
    if cfg!(not(unix)) {
        return Err(Failure::new(
            "the emulator is driven through a pseudo-terminal and shared memory: it needs Linux \
             or macOS",
        ));
    }
    if there() {
        return Ok(());
    }
    let why = if installing == Installing::Allowed && apt::there() {
        heading(&format!("Installing {PROGRAM} ({})", TOOL.size));
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
        "sudo apt-get install qemu-system-arm     (Debian, Ubuntu)\n  sudo dnf install \
         qemu-system-arm-core    (Fedora)"
    };
    Err(Failure::new(format!("{PROGRAM} is missing; get it with\n  {how}")))
}

/// Whether the emulator is installed and this system can drive it.
pub(crate) fn there() -> bool {
    cfg!(unix) && works(unrelated(PROGRAM).arg("--version"))
}

/// The major version of the emulator.
pub(crate) fn major_version() -> Option<u32> {
    major(&output(unrelated(PROGRAM).arg("--version"))?)
}

fn major(printed: &str) -> Option<u32> {
    printed.split_once("version ")?.1.split('.').next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_is_read_from_what_the_emulator_prints() {
        assert_eq!(major("QEMU emulator version 7.2.22 (Debian 1:7.2+dfsg-7)\nCopyright"), Some(7));
        assert_eq!(major("QEMU emulator version 10.0.2"), Some(10));
        assert_eq!(major("something else"), None);
    }
}
