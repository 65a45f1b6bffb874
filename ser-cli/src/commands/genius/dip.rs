//! `genius dip`: the DIP switches of a recorder, in both directions.

use std::io::{self, Write};

use ser_proto::genius::{BusAddress, BusSettings, DipSwitches};

use crate::error::{Failure, Result};
use crate::values::BusRateName;

/// Shows what the switches mean, or how to set them.
pub(super) fn run(
    switches: Option<DipSwitches>,
    address: Option<BusAddress>,
    rate: BusRateName,
) -> Result<()> {
    let switches = match (switches, address) {
        (Some(switches), _) => switches,
        (None, Some(address)) => BusSettings { address, rate: rate.into() }.switches(),
        (None, None) => {
            return Err(Failure::usage("neither switches nor an address are given")
                .hint("what do they say? ser-cli genius dip 10100111")
                .hint("how to set them? ser-cli genius dip --address 5"));
        }
    };
    let mut out = io::stdout().lock();
    writeln!(out, "{}", text(switches))?;
    out.flush()?;
    match switches.settings() {
        Ok(_) => Ok(()),
        Err(closed) => Err(Failure::new(closed).hint("open switch 8 of the recorder")),
    }
}

/// Eight digits, switch 1 first, 1 for an open switch.
pub(super) fn switches(text: &str) -> std::result::Result<DipSwitches, String> {
    let digits: Vec<char> = text.chars().collect();
    if digits.len() != 8 || digits.iter().any(|digit| !matches!(digit, '0' | '1')) {
        return Err("eight digits are needed, switch 1 first: 1 is open, 0 is closed".to_owned());
    }
    let bits = digits.iter().rev().fold(0, |bits, digit| bits << 1 | u8::from(*digit == '1'));
    Ok(DipSwitches(bits))
}

fn text(switches: DipSwitches) -> String {
    let digits: Vec<&str> =
        (1..=8).map(|number| if switches.is_open(number) { "1" } else { "0" }).collect();
    format!(
        "switch  1 2 3 4 5 6 7 8\n        {}   (1 is open)\naddress {}, {}",
        digits.join(" "),
        switches.address(),
        switches.rate()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn switches_are_read_and_set_alike() {
        let read = switches("10100111").expect("switches");
        assert_eq!(
            text(read),
            "switch  1 2 3 4 5 6 7 8\n        1 0 1 0 0 1 1 1   (1 is open)\naddress 5, 153.6K \
             standard"
        );
        let address = BusAddress::new(5).expect("an address");
        assert_eq!(BusSettings { address, rate: BusRateName::Standard.into() }.switches(), read);
        for wrong in ["", "1010011", "101001110", "10100112", "0xA7"] {
            assert!(switches(wrong).is_err(), "{wrong}");
        }
    }
}
