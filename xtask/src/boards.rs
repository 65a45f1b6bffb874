//! The boards that images are built for.

use std::path::PathBuf;

use image_check::Limits;

use crate::places;
use crate::setup::cross::{self, Target};

/// A board.
#[derive(Clone, Debug)]
pub(crate) struct Board {
    /// The limits of its image.
    pub(crate) limits: &'static Limits,
    pub(crate) package: &'static str,
    pub(crate) target: Target,
    /// Features of other builds for the board. Clippy checks each of them.
    pub(crate) features: &'static [&'static str],
    /// The chip by its name in probe-rs; `None` for an emulated board.
    pub(crate) chip: Option<&'static str>,
}

/// The emulated board.
pub(crate) const MPS2_AN385: Board = Board {
    limits: &image_check::MPS2_AN385,
    package: "ser-mps2-an385",
    target: cross::CORTEX_M3,
    features: &[],
    chip: None,
};

/// The board to flash.
pub(crate) const STM32F407: Board = Board {
    limits: &image_check::STM32F407,
    package: "ser-stm32f407",
    target: cross::CORTEX_M4F,
    features: &["serialiser"],
    chip: Some("STM32F407ZGTx"),
};

/// All boards.
pub(crate) const BOARDS: [Board; 2] = [MPS2_AN385, STM32F407];

impl Board {
    /// The board's name.
    pub(crate) fn name(&self) -> &'static str {
        self.limits.board
    }

    /// The path at which cargo puts the image.
    pub(crate) fn image(&self) -> PathBuf {
        places::firmware_target().join(self.target).join("release").join(self.package)
    }

    /// The variable in which tests find the path of the image.
    pub(crate) fn image_variable(&self) -> String {
        format!("SER_IMAGE_{}", self.as_identifier().to_uppercase())
    }

    /// How the name of a test over its image ends.
    pub(crate) fn as_identifier(&self) -> String {
        self.name().replace('-', "_")
    }

    /// The board of this name.
    pub(crate) fn named(name: &str) -> Option<&'static Board> {
        const { &BOARDS }.iter().find(|board| board.name() == name)
    }
}
