//! Detects a standard output that nobody reads: one whose reader has gone away, and one that was
//! closed before this program started.
//!
//! Who writes now and then only finds out late that the reader has gone, and keeps the line until
//! then. So commands without end ask.
//!
//! Of an output that was closed before, no write tells.
//! Rust then opens `/dev/null` in its place, for reading and writing, before `main`, and writing
//! there succeeds. A user who sends output there on purpose (`> /dev/null`) opens it for writing
//! only. A few programs open it for both for their children, so only commands whose purpose is
//! their output check for it.

use crate::error::{Failure, Result};

/// Fails if the command's output would reach nobody.
pub(crate) fn check() -> Result<()> {
    if !was_closed() {
        return Ok(());
    }
    Err(Failure::new("standard output is closed: the output would reach nobody")
        .hint("send it to a file or to a program; > /dev/null drops it"))
}

#[cfg(unix)]
fn was_closed() -> bool {
    use std::fs::metadata;
    use std::io::stdout;
    use std::os::unix::fs::MetadataExt;

    use rustix::fs::{FileType, OFlags, fcntl_getfl, fstat};

    let both_ways = fcntl_getfl(stdout()).is_ok_and(|flags| flags & OFlags::RWMODE == OFlags::RDWR);
    let (Ok(found), Ok(null)) = (fstat(stdout()), metadata("/dev/null")) else { return false };
    let is_device = FileType::from_raw_mode(found.st_mode) == FileType::CharacterDevice;
    both_ways && is_device && found.st_rdev == null.rdev()
}

/// Other systems do not let closed outputs be told apart.
#[cfg(not(unix))]
fn was_closed() -> bool {
    false
}

/// Whether the program at the other end of a pipe has ended.
#[cfg(unix)]
pub(crate) fn reader_is_gone() -> bool {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};

    let stdout = std::io::stdout();
    let mut asked = [PollFd::new(&stdout, PollFlags::empty())];
    let at_once = Timespec { tv_sec: 0, tv_nsec: 0 };
    let is_told = poll(&mut asked, Some(&at_once)).is_ok_and(|told| told > 0);
    is_told && asked.iter().any(|asked| asked.revents().contains(PollFlags::ERR))
}

/// Other systems tell with the next write.
#[cfg(not(unix))]
pub(crate) const fn reader_is_gone() -> bool {
    false
}
