//! QEMU as a process: how it is started and ended, and what it prints.

use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::os::fd::AsFd;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command as Process};

use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};

use crate::error::SimError;

/// The program that is started where no other one is named.
pub const PROGRAM: &str = "qemu-system-arm";

/// How much of QEMU's printed text is shown. QEMU has less than that to say about itself.
const MAX_PRINTED_LEN: u64 = 16_384;

/// The process. It is killed when this is dropped.
pub struct Qemu(pub Child);

impl Drop for Qemu {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Starts the emulator in a process group of its own.
///
/// # Errors
/// When it is not installed, or cannot be started.
pub fn spawn(process: &mut Process, program: &Path) -> Result<Qemu, SimError> {
    // Ctrl-C at the terminal is for us. We end the emulator when we end.
    process.process_group(0);
    match process.spawn() {
        Err(error) if error.kind() == ErrorKind::NotFound => {
            Err(SimError::EmulatorMissing { program: program.to_owned() })
        }
        spawned => spawned.map(Qemu).map_err(SimError::io(format!("start {}", program.display()))),
    }
}

/// What the emulator has printed, cut at the limit.
#[must_use]
pub fn read_printed(path: &Path) -> String {
    let mut printed = Vec::new();
    // The text only adds to a failure that is reported in any case.
    let _ = File::open(path).and_then(|file| file.take(MAX_PRINTED_LEN).read_to_end(&mut printed));
    String::from_utf8_lossy(&printed).trim().to_owned()
}

/// Makes reads and writes fail with `WouldBlock` where they would wait.
///
/// # Errors
/// Those of the system.
pub fn never_wait(descriptor: impl AsFd) -> io::Result<()> {
    let flags = fcntl_getfl(&descriptor)?;
    Ok(fcntl_setfl(&descriptor, flags | OFlags::NONBLOCK)?)
}

/// Whether the operation is worth trying again.
#[must_use]
pub fn is_temporary(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_what_the_emulator_prints_without_end_the_beginning_is_shown() {
        let file = tempfile::NamedTempFile::new().unwrap();
        file.as_file().set_len(1 << 40).unwrap();
        assert_eq!(read_printed(file.path()).len() as u64, MAX_PRINTED_LEN);
    }
}
