//! Detects a standard output that was closed before this program started.
//!
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
