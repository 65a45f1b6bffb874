//! Places in a PLC, bus addresses and words, as people write them.

use clap::ValueEnum;
use ser_proto::genius::{Address, MemoryType, PlcReference, Priority};

use crate::values::bus_address;

/// How urgent a datagram is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum PriorityName {
    /// In a bus scan in which no other device sends one.
    Normal,
    /// In any case; the scan gets longer.
    High,
}

impl From<PriorityName> for Priority {
    fn from(name: PriorityName) -> Priority {
        match name {
            PriorityName::Normal => Priority::Normal,
            PriorityName::High => Priority::High,
        }
    }
}

/// A bus address, or `all`.
pub(super) fn address(text: &str) -> Result<Address, String> {
    match text {
        "all" | "255" => Ok(Address::Broadcast),
        _ => bus_address(text)
            .map(Address::from)
            .map_err(|_| "not a bus address: 0 to 31, or all".to_string()),
    }
}

const MEMORIES: [(&str, MemoryType); 6] = [
    ("R", MemoryType::REGISTERS),
    ("AI", MemoryType::ANALOG_INPUTS),
    ("AQ", MemoryType::ANALOG_OUTPUTS),
    ("I", MemoryType::INPUTS),
    ("Q", MemoryType::OUTPUTS),
    ("W", MemoryType::BULK),
];

/// A place in a PLC like `%R100`; the percent sign may be left out.
pub(super) fn reference(text: &str) -> Result<PlcReference, String> {
    let name = text.strip_prefix('%').unwrap_or(text).to_ascii_uppercase();
    MEMORIES
        .into_iter()
        .filter_map(|(prefix, memory)| Some((memory, name.strip_prefix(prefix)?)))
        .find_map(|(memory, digits)| Some(PlcReference { memory, number: digits.parse().ok()? }))
        .ok_or_else(|| {
            "not a place like %R100 (%R, %AI, %AQ, %I, %Q or %W, and a number from 1)".to_string()
        })
}

/// A word: decimal, with a sign as PLCs show them, or hex as `0045h` or `0x45`.
pub(super) fn word(text: &str) -> Result<u16, String> {
    let hex = text
        .strip_suffix(['h', 'H'])
        .or_else(|| text.strip_prefix("0x"))
        .or_else(|| text.strip_prefix("0X"))
        .or_else(|| text.strip_prefix("16#"));
    let word = match hex {
        Some(digits) => u16::from_str_radix(digits, 16).ok(),
        None => text.parse().ok().or_else(|| text.parse::<i16>().ok().map(i16::cast_unsigned)),
    };
    word.ok_or_else(|| "not a word: -32768 to 65535, or hex like 0045h".to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_a_memory_and_a_number() {
        for (text, shown) in
            [("%R100", "%R100"), ("r1", "%R1"), ("%ai7", "%AI7"), ("%W65535", "%W65535")]
        {
            assert_eq!(reference(text).map(|place| place.to_string()), Ok(shown.to_string()));
        }
        for text in ["", "%", "%R", "%R0", "%R65536", "%M1", "100", "%R-1"] {
            assert!(reference(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_word_may_be_written_in_the_ways_of_plcs() {
        for (text, value) in [
            ("69", 69),
            ("0045h", 69),
            ("0x45", 69),
            ("16#45", 69),
            ("-1", 65535),
            ("65535", 65535),
        ] {
            assert_eq!(word(text), Ok(value), "{text}");
        }
        for text in ["", "h", "65536", "-32769", "10000h", "4G", "1.5"] {
            assert!(word(text).is_err(), "{text}");
        }
    }

    #[test]
    fn an_address_is_a_device_or_all() {
        assert_eq!(address("all"), Ok(Address::Broadcast));
        assert_eq!(address("31").map(Address::number), Ok(31));
        assert!(
            address("32").is_err() && bus_address("all").is_err() && bus_address("-1").is_err()
        );
    }
}
