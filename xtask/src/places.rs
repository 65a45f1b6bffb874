//! The folders of the project.

use std::path::{Path, PathBuf};

/// The root of the repository.
pub(crate) fn root() -> &'static Path {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here)
}

/// The workspace of the firmware.
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

/// Where a copy of `ser-evidence` is made wrong.
pub(crate) fn evidence_mistakes() -> PathBuf {
    host_target().join("evidence-mistakes")
}

/// Where packages for Python are, which read what is exported. Tests look for them there.
pub(crate) fn python_readers() -> PathBuf {
    host_target().join("readers")
}

/// Where the package is that judges pages. The test looks for it there.
pub(crate) fn axe_core() -> PathBuf {
    host_target().join("axe")
}

/// Where the firmware is built. The folder is separate because the compiler may be another one.
pub(crate) fn firmware_target() -> PathBuf {
    match std::env::var_os("CARGO_TARGET_DIR") {
        Some(target) => root().join(target).join("firmware"),
        None => firmware().join("target"),
    }
}
