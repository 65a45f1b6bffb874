//! What tests of several crates share: which of the two recorders they run against, and how long
//! anything may take.

use std::path::PathBuf;
use std::time::Duration;

use crate::options::{Backend, EmulatorOptions};

/// How long anything may take, because tests run on machines that stall for seconds.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// Where the ARM image is: set by `cargo xtask test`, which builds it.
pub const IMAGE_VARIABLE: &str = "SER_IMAGE_MPS2_AN385";

/// The ARM image.
///
/// # Panics
/// When the environment variable that names it is not set.
#[must_use]
pub fn image() -> PathBuf {
    std::env::var_os(IMAGE_VARIABLE)
        .unwrap_or_else(|| panic!("{IMAGE_VARIABLE} is not set: run `cargo xtask test`"))
        .into()
}

/// What plays the recorder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The recorder in this process.
    Native,
    /// The ARM image in the emulator.
    Emulated,
}

impl Kind {
    /// The simulator's back end of this kind.
    ///
    /// # Panics
    /// When the image is wanted and the environment variable that names it is not set.
    #[must_use]
    pub fn backend(self) -> Backend {
        match self {
            Kind::Native => Backend::default(),
            Kind::Emulated => Backend::Emulator(EmulatorOptions::new(image())),
        }
    }
}

/// Makes two tests of each function that takes a [`Kind`]: `native::…` and, for `cargo xtask test`,
/// `emulated::…`.
#[macro_export]
macro_rules! with_both_kinds {
    ($($test:ident),* $(,)?) => {
        mod native {
            $(#[test]
            fn $test() {
                super::$test($crate::testing::Kind::Native);
            })*
        }
        mod emulated {
            $(#[test]
            #[ignore = "needs the emulator and the image: cargo xtask test"]
            fn $test() {
                super::$test($crate::testing::Kind::Emulated);
            })*
        }
    };
}
