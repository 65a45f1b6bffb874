//! rustfmt and clippy, which a minimal Rust installation lacks.

use crate::setup::demand::{Installing, Kind, Size, Tool};
use crate::steps::{self, Failure, Result, heading, works};

/// Both components. The size is that of Rust 1.95.
pub(crate) static TOOL: Tool = Tool {
    name: "rustfmt and clippy",
    serves: "the checks of format and code",
    size: Size { download_mb: None, disk_mb: 31 },
    instead: None,
    kind: Kind::Components,
};

/// One of the components.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Component {
    Rustfmt,
    Clippy,
}

/// Whether the toolchain in use has it.
pub(crate) fn has(component: Component) -> bool {
    let subcommand = match component {
        Component::Rustfmt => "fmt",
        Component::Clippy => "clippy",
    };
    works(steps::cargo().args([subcommand, "--version"]))
}

/// Whether both are installed.
pub(crate) fn there() -> bool {
    has(Component::Rustfmt) && has(Component::Clippy)
}

/// Finds both, or has rustup install them for the toolchain in use.
pub(crate) fn find(installing: Installing) -> Result<()> {
    if there() {
        return Ok(());
    }
    if installing == Installing::Allowed {
        heading(&format!("Installing rustfmt and clippy ({})", TOOL.size));
        if works(steps::in_use("rustup").args(["component", "add", "rustfmt", "clippy"])) && there()
        {
            return Ok(());
        }
    }
    Err(Failure::new(
        "rustfmt and clippy are missing; get them with\n  rustup component add rustfmt clippy",
    ))
}
