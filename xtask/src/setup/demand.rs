//! What a run demands of the machine: which missing tools may be installed, and whether anything
//! may be left out.
//!
//! On a newcomer's machine the usual tools are installed and the rest is left out; both are
//! reported. With `--strict`, or if `CI` is `true`, everything is installed and nothing may be left
//! out.

use std::ffi::OsStr;

use crate::steps::{Failure, Result};

/// A tool that does not come with Rust.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Tool {
    /// Its name; for a program, the name on the PATH.
    pub(crate) name: &'static str,
    /// What is left out without the tool.
    pub(crate) serves: &'static str,
    /// The measured size of the installation.
    pub(crate) size: Size,
    /// What is installed if the tool is unavailable.
    pub(crate) instead: Option<(&'static str, Size)>,
    pub(crate) kind: Kind,
}

/// The kinds of tools.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// rustfmt and clippy.
    Components,
    /// The toolchains that build the images.
    CrossRust,
    /// Clippy for the code of the images.
    CrossClippy,
    Emulator,
    /// An external program that single tests need.
    Program,
}

impl Kind {
    /// All kinds.
    pub(crate) const ALL: [Kind; 5] =
        [Kind::Components, Kind::CrossRust, Kind::CrossClippy, Kind::Emulator, Kind::Program];

    /// What the checks of the sources need.
    pub(crate) const OF_LINT: [Kind; 3] = [Kind::Components, Kind::CrossRust, Kind::CrossClippy];

    /// Whether it is installed without asking, because the project itself is built, checked and run
    /// with it.
    const fn is_usual(self) -> bool {
        !matches!(self, Kind::Program)
    }
}

/// The size of an installation, in megabytes rounded up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    /// To download, if known.
    pub(crate) download_mb: Option<u32>,
    /// On disk.
    pub(crate) disk_mb: u32,
}

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.download_mb {
            Some(download_mb) => {
                write!(f, "{download_mb} MB to download, {} MB on disk", self.disk_mb)
            }
            None => write!(f, "{} MB on disk", self.disk_mb),
        }
    }
}

/// Whether missing tools may be installed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Installing {
    /// They are installed without asking.
    Allowed,
    /// Nothing is installed, and the network is not used.
    Forbidden,
}

/// What may be installed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scope {
    Nothing,
    Usual,
    Everything,
}

/// The options for tools on the command line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::Args)]
pub(crate) struct Options {
    /// Leave nothing out: install everything that a check or a test needs, and fail if that does
    /// not work. The same applies if the variable CI is "true".
    #[arg(long)]
    pub(crate) strict: bool,

    /// Also install the external programs that single tests need.
    #[arg(long)]
    pub(crate) all: bool,
}

/// The demand of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Demand {
    scope: Scope,
    strict: bool,
}

impl Demand {
    /// The demand by the command line and the environment's `CI`.
    pub(crate) fn new(options: Options, installing: Installing, ci: Option<&OsStr>) -> Demand {
        let strict = options.strict || ci.is_some_and(|ci| ci == "true" || ci == "1");
        let scope = match installing {
            Installing::Forbidden => Scope::Nothing,
            Installing::Allowed if strict || options.all => Scope::Everything,
            Installing::Allowed => Scope::Usual,
        };
        Demand { scope, strict }
    }

    /// The demand in this process's environment.
    pub(crate) fn here(options: Options, installing: Installing) -> Demand {
        Demand::new(options, installing, std::env::var_os("CI").as_deref())
    }

    /// Whether nothing may be left out.
    pub(crate) fn is_strict(self) -> bool {
        self.strict
    }

    /// What is to be installed of the missing tools.
    pub(crate) fn plan(self, missing: &[&'static Tool]) -> Plan {
        let wanted = |tool: &&&Tool| match self.scope {
            Scope::Nothing => false,
            Scope::Usual => tool.kind.is_usual(),
            Scope::Everything => true,
        };
        Plan { install: missing.iter().filter(wanted).copied().collect() }
    }

    /// Judges what is still missing after all attempts to install it.
    ///
    /// # Errors
    /// If something is missing although the demand is strict.
    pub(crate) fn verdict(self, missing: &[&'static Tool]) -> Result<()> {
        if !self.strict || missing.is_empty() {
            return Ok(());
        }
        let lines = missing.iter().map(|tool| format!("\n  {}: {}", tool.name, tool.serves));
        let how = match self.scope {
            Scope::Nothing => "run again without --offline to try to install them",
            _ => "the lines above say why they could not be installed",
        };
        Err(Failure::new(format!(
            "nothing may be left out here, and these tools are missing:{}\n{how}",
            lines.collect::<String>()
        )))
    }
}

/// What a run installs first.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Plan {
    pub(crate) install: Vec<&'static Tool>,
}

impl Plan {
    /// The text before anything is installed.
    pub(crate) fn announcement(&self) -> Vec<String> {
        if self.install.is_empty() {
            return Vec::new();
        }
        let head = "these tools are missing and will be installed (--offline installs nothing):";
        let tools = self.install.iter().flat_map(|tool| {
            let instead = |(name, size)| format!("    or, if that is unavailable, {name}: {size}");
            let line = format!("  {}: {}; for {}", tool.name, tool.size, tool.serves);
            std::iter::once(line).chain(tool.instead.map(instead))
        });
        std::iter::once(head.to_owned()).chain(tools).collect()
    }

    /// A note for each tool that stays missing.
    pub(crate) fn remarks(missing: &[&'static Tool]) -> Vec<String> {
        let how = |tool: &Tool| if tool.kind.is_usual() { "" } else { "; --all installs it" };
        missing
            .iter()
            .map(|tool| format!("left out for lack of {}: {}{}", tool.name, tool.serves, how(tool)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EMULATOR: Tool = Tool {
        name: "emulator",
        serves: "the tests in the emulator",
        size: Size { download_mb: Some(16), disk_mb: 69 },
        instead: Some(("another", Size { download_mb: None, disk_mb: 80 })),
        kind: Kind::Emulator,
    };
    const DATABASE: Tool = Tool {
        name: "database",
        serves: "the test that imports a log",
        size: Size { download_mb: None, disk_mb: 3 },
        instead: None,
        kind: Kind::Program,
    };
    const BOTH: [&Tool; 2] = [&EMULATOR, &DATABASE];

    const LENIENT: Options = Options { strict: false, all: false };

    fn demand(options: Options, installing: Installing, ci: &str) -> Demand {
        Demand::new(options, installing, Some(OsStr::new(ci)).filter(|ci| !ci.is_empty()))
    }

    #[test]
    fn a_newcomer_gets_the_usual_tools_and_is_told_what_is_left_out() {
        let demand = demand(LENIENT, Installing::Allowed, "");
        let plan = demand.plan(&BOTH);
        assert_eq!(plan.install, [&EMULATOR]);
        assert_eq!(
            plan.announcement(),
            [
                "these tools are missing and will be installed (--offline installs nothing):",
                "  emulator: 16 MB to download, 69 MB on disk; for the tests in the emulator",
                "    or, if that is unavailable, another: 80 MB on disk"
            ]
        );
        assert!(demand.verdict(&BOTH).is_ok());
        assert_eq!(
            Plan::remarks(&BOTH),
            [
                "left out for lack of emulator: the tests in the emulator",
                "left out for lack of database: the test that imports a log; --all installs it"
            ]
        );
    }

    #[test]
    fn ci_and_strict_install_everything_and_leave_nothing_out() {
        let strict = Options { strict: true, ..LENIENT };
        for demand in [
            demand(LENIENT, Installing::Allowed, "true"),
            demand(LENIENT, Installing::Allowed, "1"),
            demand(strict, Installing::Allowed, ""),
        ] {
            assert!(demand.is_strict());
            assert_eq!(demand.plan(&BOTH).install, BOTH);
            assert!(demand.verdict(&[]).is_ok());
            let failure = demand.verdict(&[&DATABASE]).unwrap_err().to_string();
            assert!(failure.contains("database: the test that imports a log"), "{failure}");
        }
        assert!(!demand(LENIENT, Installing::Allowed, "false").is_strict());
    }

    #[test]
    fn offline_installs_nothing_and_is_as_strict_as_asked() {
        let lenient = demand(LENIENT, Installing::Forbidden, "");
        assert_eq!(lenient.plan(&BOTH).install, Vec::<&Tool>::new());
        assert_eq!(lenient.plan(&BOTH).announcement(), Vec::<String>::new());
        assert!(lenient.verdict(&BOTH).is_ok());
        let strict = demand(LENIENT, Installing::Forbidden, "true");
        assert_eq!(strict.plan(&BOTH).install, Vec::<&Tool>::new());
        let failure = strict.verdict(&[&EMULATOR]).unwrap_err().to_string();
        assert!(failure.contains("without --offline"), "{failure}");
    }

    #[test]
    fn all_installs_the_rest_too_and_goes_on_without_it() {
        let all = demand(Options { all: true, ..LENIENT }, Installing::Allowed, "");
        assert_eq!(all.plan(&BOTH).install, BOTH);
        assert!(all.verdict(&[&DATABASE]).is_ok());
    }
}
