//! What a recorder can do beyond the manual, a bit for each.

use core::fmt;

/// A set of capabilities. Bits without a name here belong to later recorders, and are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Capabilities(pub u32);

impl Capabilities {
    /// It answers `T`. Bit 0.
    pub const TIME: Capabilities = Capabilities(1);
    /// It answers `F`. Bit 1.
    pub const FILTERS: Capabilities = Capabilities(1 << 1);
    /// It answers `D`. Bit 2.
    pub const DIAGNOSTICS: Capabilities = Capabilities(1 << 2);
    /// Its counts of power-ups and of lives outlive a power cut, so no number comes twice. Bit 3.
    pub const LASTING_COUNTS: Capabilities = Capabilities(1 << 3);

    /// Those with a name, in the order of their bits.
    const NAMED: [(Capabilities, &'static str); 4] = [
        (Capabilities::TIME, "time"),
        (Capabilities::FILTERS, "filters"),
        (Capabilities::DIAGNOSTICS, "diagnostics"),
        (Capabilities::LASTING_COUNTS, "lasting counts"),
    ];

    /// Whether the set has all of `wanted`.
    #[must_use]
    pub const fn contains(self, wanted: Capabilities) -> bool {
        self.0 & wanted.0 == wanted.0
    }

    /// This set and those of `more`.
    #[must_use]
    pub const fn with(self, more: Capabilities) -> Capabilities {
        Capabilities(self.0 | more.0)
    }

    /// The bits that have no name here.
    #[must_use]
    pub fn unnamed(self) -> u32 {
        Capabilities::NAMED.iter().fold(self.0, |bits, (named, _)| bits & !named.0)
    }
}

/// As `time, filters` or `time, bits 00000100h`; `nothing` for the empty set.
impl fmt::Display for Capabilities {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut gap = "";
        for (_, name) in Capabilities::NAMED.iter().filter(|(named, _)| self.contains(*named)) {
            write!(f, "{gap}{name}")?;
            gap = ", ";
        }
        match self.unnamed() {
            0 if gap.is_empty() => f.write_str("nothing"),
            0 => Ok(()),
            bits => write!(f, "{gap}bits {bits:08X}h"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn named_bits_read_by_name_and_all_others_are_kept() {
        let known = Capabilities::TIME.with(Capabilities::DIAGNOSTICS);
        assert_eq!(known.to_string(), "time, diagnostics");
        assert!(known.contains(Capabilities::TIME) && !known.contains(Capabilities::FILTERS));
        let later = known.with(Capabilities(0x8000_0100));
        assert_eq!(later.to_string(), "time, diagnostics, bits 80000100h");
        assert_eq!(later.unnamed(), 0x8000_0100);
        assert_eq!(Capabilities::default().to_string(), "nothing");
        assert_eq!(Capabilities(1 << 31).to_string(), "bits 80000000h");
    }

    #[test]
    fn the_names_stand_for_different_bits() {
        for (position, (named, _)) in (0..).zip(Capabilities::NAMED) {
            assert_eq!(named.0, 1 << position);
        }
    }
}
