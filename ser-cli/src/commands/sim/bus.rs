//! The properties of a simulated Genius bus: its rate, its noise, and the host's bus address.

use ser_sim::GeniusOptions;
use ser_sim::genius::Noise;

use super::device;
use crate::error::{Failure, Result};
use crate::values::BusRateName;

/// The heading of the bus options in `sim --help`.
pub(super) const HEADING: &str = "Genius bus";

/// The options of `sim` that concern only the bus.
#[derive(Debug, clap::Args)]
pub(super) struct BusArgs {
    /// Rate of the Genius bus.
    #[arg(
        long,
        value_name = "RATE",
        requires = "genius",
        default_value = "153.6K",
        ignore_case = true,
        help_heading = HEADING
    )]
    bus_rate: BusRateName,

    /// The host's bus address on the Genius bus, 0-31; the highest free one if not given.
    #[arg(
        long,
        value_name = "N",
        requires = "genius",
        value_parser = host_number,
        help_heading = HEADING
    )]
    host_number: Option<u8>,

    /// Disturb the Genius bus: this percentage of all messages is damaged, as many are missed by
    /// one receiver, and as many arrive without the sender knowing.
    #[arg(
        long,
        value_name = "PERCENT",
        requires = "genius",
        value_parser = ppm,
        help_heading = HEADING
    )]
    bus_noise: Option<u32>,

    /// Selects the disturbed messages; the same number gives the same sequence of disturbances.
    #[arg(
        long,
        value_name = "N",
        requires = "bus_noise",
        default_value_t = 1,
        help_heading = HEADING
    )]
    seed: u64,
}

impl BusArgs {
    /// Applies the user's options to a bus.
    pub(super) fn apply(&self, bus: GeniusOptions) -> Result<GeniusOptions> {
        let host_number = self.host_number.unwrap_or(bus.host_number);
        if bus.nodes.iter().any(|&(node, _)| node == host_number) {
            return Err(Failure::usage(format!(
                "{host_number} is the bus address of a --node, and the host's too"
            ))
            .hint("every device on a bus has its own address")
            .hint("leave --host-number out, and the host gets one that is free"));
        }
        let ppm = self.bus_noise.unwrap_or(0);
        let noise =
            Noise { seed: self.seed, damaged_ppm: ppm, lost_ppm: ppm, unacknowledged_ppm: ppm };
        Ok(GeniusOptions { host_number, rate: self.bus_rate.into(), noise, ..bus })
    }
}

fn host_number(text: &str) -> std::result::Result<u8, String> {
    device(text).ok_or_else(|| "not a bus address: 0 to 31".to_string())
}

/// A percentage in millionths.
fn ppm(text: &str) -> std::result::Result<u32, String> {
    match text.parse() {
        Ok(percent @ 0.0..=100.0) => {
            let percent: f64 = percent;
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "0 to 1000000"
            )]
            let ppm = (percent * 10_000.0).round() as u32;
            Ok(ppm)
        }
        _ => Err("not a percentage: 0 to 100, as in 0.5".to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percent_are_millionths() {
        for (text, millionths) in [("0", 0), ("0.5", 5_000), ("2", 20_000), ("100", 1_000_000)] {
            assert_eq!(ppm(text), Ok(millionths));
        }
        for text in ["", "-1", "100.1", "nan", "2%"] {
            assert!(ppm(text).is_err(), "{text}");
        }
    }
}
