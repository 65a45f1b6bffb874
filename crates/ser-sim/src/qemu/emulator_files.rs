//! What the emulator reads and writes besides its standard streams, and how it gets it.
//!
//! # Design
//! A name that is looked up twice may lead to two things, because anyone who may write to the
//! folder can put a link there in between. So we open a file, check what we have got, and let the
//! emulator inherit it. The only names that the emulator gets are the image's, which it reads, and
//! those of sockets in a folder of our own.

use std::ffi::OsString;
use std::fs::{self, File, Metadata};
use std::io::{self, ErrorKind};
use std::os::fd::{AsFd, AsRawFd, OwnedFd};
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::termios::isatty;

use crate::error::SimError;
use crate::options::EmulatorOptions;
use crate::qemu::external_bus::{ExternalBus, MEMORY_LEN};

/// How often the log's pipe is tried while nobody reads it.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// The folder of a process's own descriptors.
const DESCRIPTORS: &str = if cfg!(target_os = "linux") { "/proc/self/fd" } else { "/dev/fd" };

/// Files for the emulator, for as many starts as there are.
pub struct EmulatorFiles {
    image: PathBuf,
    log: Option<File>,
}

impl EmulatorFiles {
    /// Makes the log. If the log is a pipe, waits until somebody reads it, or until told to stop.
    ///
    /// # Errors
    /// When the image is no file, or the log cannot be made or is something that is not ours.
    pub fn open(options: &EmulatorOptions, stop: &AtomicBool) -> Result<EmulatorFiles, SimError> {
        options.check_image()?;
        let log = options.log.as_deref().map(|path| open_log(path, stop)).transpose()?;
        Ok(EmulatorFiles { image: options.image.clone(), log })
    }

    /// Copies for an emulator that is about to be started. It must be started before they are
    /// dropped.
    ///
    /// # Errors
    /// When this process can open no more files.
    pub fn hand_over(&self, bus: &ExternalBus) -> io::Result<HandedOver> {
        let memory = inherited(bus.file())?;
        let log = self.log.as_ref().map(inherited).transpose()?;
        let arguments = arguments(&self.image, &memory, log.as_ref());
        Ok(HandedOver { arguments, _memory: memory, _log: log })
    }
}

/// Descriptors that every process started meanwhile inherits.
pub struct HandedOver {
    /// The emulator's arguments that say what the board is made of.
    pub arguments: Vec<OsString>,
    _memory: OwnedFd,
    _log: Option<OwnedFd>,
}

fn inherited(file: impl AsFd) -> io::Result<OwnedFd> {
    // The copy is not closed when a process starts, as the original is.
    Ok(rustix::io::dup(file)?)
}

fn arguments(image: &Path, memory: &OwnedFd, log: Option<&OwnedFd>) -> Vec<OsString> {
    let memory = format!(
        "memory-backend-file,id=ext,size={MEMORY_LEN},share=on,mem-path={DESCRIPTORS}/{}",
        memory.as_raw_fd()
    );
    let mut arguments: Vec<OsString> = [
        "-M",
        "mps2-an385,memory-backend=ext",
        "-display",
        "none",
        "-monitor",
        "none",
        "-chardev",
        "stdio,id=rs232,signal=off",
        "-serial",
        "chardev:rs232",
        "-serial",
        "chardev:log",
        "-object",
        &memory,
        "-chardev",
    ]
    .map(OsString::from)
    .to_vec();
    match log {
        None => arguments.push("null,id=log".into()),
        Some(log) => {
            // New text is appended to the log, because the board may have been off in between.
            arguments.push("file,id=log,append=on,path=/dev/fdset/1".into());
            arguments.extend(["-add-fd".into(), format!("fd={},set=1", log.as_raw_fd()).into()]);
        }
    }
    arguments.extend(["-kernel".into(), image.into()]);
    arguments
}

/// Makes the file for the log. A pipe, a terminal or the null device may be there already, because
/// writing to one destroys nothing.
fn open_log(path: &Path, stop: &AtomicBool) -> Result<File, SimError> {
    let failed = |error| SimError::io(format!("make the log {}", path.display()))(error);
    let taken = || SimError::LogTaken(path.to_owned());
    match File::options().append(true).create_new(true).open(path) {
        Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
        made => return made.map_err(failed),
    }
    // Checked before it is opened, because some devices react to being opened. A link may lead
    // nowhere.
    let kind = fs::metadata(path).map_err(|_| taken())?.file_type();
    if !kind.is_fifo() && !kind.is_char_device() {
        return Err(taken());
    }
    let file = loop {
        match open_device(path) {
            // A pipe that nobody reads yet.
            Err(rustix::io::Errno::NXIO) if kind.is_fifo() => {}
            opened => break opened.map_err(|errno| failed(errno.into()))?,
        }
        if stop.load(Ordering::Relaxed) {
            return Err(SimError::Ended);
        }
        thread::sleep(LOOK_EVERY);
    };
    // It may be something else by now.
    let found = file.metadata().map_err(failed)?;
    if !found.file_type().is_fifo() && !isatty(&file) && !is_null(&found) {
        return Err(taken());
    }
    let flags = fcntl_getfl(&file).map_err(|errno| failed(errno.into()))?;
    fcntl_setfl(&file, flags - OFlags::NONBLOCK).map_err(|errno| failed(errno.into()))?;
    Ok(file)
}

/// Opens what is already there to write to it, without waiting for anybody.
fn open_device(path: &Path) -> rustix::io::Result<File> {
    let flags = OFlags::WRONLY | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
    rustix::fs::open(path, flags, rustix::fs::Mode::empty()).map(File::from)
}

fn is_null(found: &Metadata) -> bool {
    let null = fs::metadata("/dev/null");
    null.is_ok_and(|null| found.file_type().is_char_device() && found.rdev() == null.rdev())
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    fn open_log(path: &Path) -> Result<File, SimError> {
        super::open_log(path, &AtomicBool::new(false))
    }

    #[test]
    fn a_log_takes_the_place_of_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let (log, link) = (folder.path().join("log"), folder.path().join("link"));
        symlink(&log, &link).unwrap();
        assert!(matches!(open_log(&link), Err(SimError::LogTaken(_))));
        assert!(!log.exists());
        open_log(&log).unwrap();
        for text in ["", "a report"] {
            fs::write(&log, text).unwrap();
            for path in [&log, &link, &folder.path().to_owned()] {
                assert!(matches!(open_log(path), Err(SimError::LogTaken(_))), "{}", path.display());
            }
            assert_eq!(fs::read_to_string(&log).unwrap(), text);
        }
        open_log(Path::new("/dev/null")).unwrap();
        let nowhere = open_log(Path::new("/nonexistent/log")).unwrap_err().to_string();
        assert!(nowhere.starts_with("cannot make the log /nonexistent/log"), "{nowhere}");
    }

    #[test]
    fn a_device_that_may_keep_what_it_is_given_is_no_log() {
        assert!(matches!(open_log(Path::new("/dev/zero")), Err(SimError::LogTaken(_))));
    }

    #[test]
    fn a_pipe_that_nobody_reads_is_waited_for_until_told_to_stop() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        rustix::fs::mkfifoat(rustix::fs::CWD, &pipe, rustix::fs::Mode::RWXU).unwrap();
        let stopped = super::open_log(&pipe, &AtomicBool::new(true));
        assert!(matches!(stopped, Err(SimError::Ended)));
        let reader =
            rustix::fs::open(&pipe, OFlags::RDONLY | OFlags::NONBLOCK, rustix::fs::Mode::empty());
        let log = super::open_log(&pipe, &AtomicBool::new(true)).unwrap();
        assert!(!fcntl_getfl(&log).unwrap().contains(OFlags::NONBLOCK));
        drop(reader);
    }

    #[test]
    fn the_emulator_gets_no_name_of_what_it_writes() {
        let folder = tempfile::tempdir().unwrap();
        let [image, log, memory] = ["image", "log", "memory"].map(|name| folder.path().join(name));
        fs::write(&image, "").unwrap();
        let options = EmulatorOptions { log: Some(log), ..EmulatorOptions::new(&image) };
        let files = EmulatorFiles::open(&options, &AtomicBool::new(false)).unwrap();
        let handed_over = files.hand_over(&ExternalBus::open(&memory).unwrap()).unwrap();
        let ours = folder.path().to_str().unwrap();
        let named: Vec<_> = handed_over
            .arguments
            .iter()
            .filter(|text| text.to_str().unwrap().contains(ours))
            .collect();
        assert_eq!(named, [image.as_os_str()]);
    }

    #[test]
    fn an_image_is_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        rustix::fs::mkfifoat(rustix::fs::CWD, &pipe, rustix::fs::Mode::RWXU).unwrap();
        for path in [&pipe, folder.path()] {
            let refused = EmulatorOptions::new(path).check_image().unwrap_err().to_string();
            assert!(refused.ends_with("it is not a regular file"), "{refused}");
        }
        assert!(EmulatorOptions::new("/nonexistent/image").check_image().is_err());
    }
}
