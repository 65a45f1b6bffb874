//! What is on a simulated Genius bus.

use std::path::PathBuf;

use ser_proto::Model;

use crate::genius::{BusTiming, Noise};

/// The most recorders on a bus. Bus addresses are 0 to 31, and one of them is the host's.
pub const MAX_NODES: usize = 31;

/// A Genius bus with recorders, and a host that is another program.
#[derive(Clone, Debug)]
pub struct GeniusOptions {
    /// The file that becomes the host's GENI window. It is removed when the simulator ends.
    pub window: PathBuf,
    /// Bus addresses and models of the recorders.
    pub nodes: Vec<(u8, Model)>,
    /// The host's bus address.
    pub host_number: u8,
    /// How fast the bus is.
    pub rate: BusTiming,
    /// What goes wrong on the bus.
    pub noise: Noise,
}

impl GeniusOptions {
    /// A bus at the usual rate on which nothing goes wrong. The host has the highest bus address
    /// that is free.
    #[must_use]
    pub fn new(window: impl Into<PathBuf>, nodes: Vec<(u8, Model)>) -> GeniusOptions {
        let taken = |number| nodes.iter().any(|&(node, _)| node == number);
        let host_number = (0..=31).rev().find(|&number| !taken(number)).unwrap_or(31);
        let (rate, noise) = (BusTiming::default(), Noise::default());
        GeniusOptions { window: window.into(), nodes, host_number, rate, noise }
    }
}
