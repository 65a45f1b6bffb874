//! A small disk that can be full: a file system in memory, where this test may mount one.

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// What it holds, in the notation of `mount`.
const SIZE: &str = "size=96m";

/// A folder, perhaps on a disk of its own.
pub(crate) struct Disk {
    folder: tempfile::TempDir,
    is_small: bool,
}

impl Disk {
    pub(crate) fn new() -> Disk {
        let folder = tempfile::tempdir().expect("a folder");
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", SIZE, "ser-trial"]).arg(folder.path());
        let mounted = mount.stdout(Stdio::null()).stderr(Stdio::null()).status();
        let is_small = mounted.is_ok_and(|status| status.success());
        if !is_small {
            assert!(std::env::var_os("CI").is_none(), "CI may mount a small disk");
            eprintln!("left out: no disk is full, because this user may not mount a small one");
        }
        Disk { folder, is_small }
    }

    pub(crate) fn path(&self) -> &Path {
        self.folder.path()
    }

    fn ballast(&self) -> PathBuf {
        self.path().join("ballast")
    }

    /// Leaves no room. Returns whether that is so.
    pub(crate) fn fill(&self) -> bool {
        if !self.is_small {
            return false;
        }
        let mut ballast = File::create(self.ballast()).expect("a file");
        for block in [&[0xAA; 1 << 16][..], &[0xAA; 512]] {
            while ballast.write_all(block).is_ok() {}
        }
        true
    }

    /// Makes room again.
    pub(crate) fn free(&self) {
        if self.is_small {
            _ = fs::remove_file(self.ballast());
        }
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        if self.is_small {
            _ = Command::new("umount").arg("--lazy").arg(self.folder.path()).status();
        }
    }
}
