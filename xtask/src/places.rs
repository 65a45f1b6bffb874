//! Where things are.

use std::path::{Path, PathBuf};

/// The root of the repository.
pub(crate) fn root() -> &'static Path {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here)
}

/// The workspace of what is flashed.
pub(crate) fn firmware() -> PathBuf {
    root().join("firmware")
}

/// Where the host's crates are built.
pub(crate) fn host_target() -> PathBuf {
    match std::env::var_os("CARGO_TARGET_DIR") {
        Some(target) => root().join(target),
        None => root().join("target"),
    }
}

/// Where the firmware is built: apart from the host's crates, for it may have another compiler.
pub(crate) fn firmware_target() -> PathBuf {
    match std::env::var_os("CARGO_TARGET_DIR") {
        Some(target) => root().join(target).join("firmware"),
        None => firmware().join("target"),
    }
}
