//! Addresses on the bus: who a device is, and where a datagram goes.

use core::fmt;

use crate::MAX_REPORT_ADDRESS;

/// A device on the bus, known by its bus address, 0–31.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BusAddress(u8);

impl BusAddress {
    /// Address 0, by custom that of a hand-held monitor.
    pub(super) const FIRST: BusAddress = BusAddress(0);

    /// The device with address `number`, 0–31.
    #[must_use]
    pub const fn new(number: u8) -> Option<BusAddress> {
        if number <= MAX_REPORT_ADDRESS { Some(BusAddress(number)) } else { None }
    }

    /// The address as a number, 0–31.
    #[must_use]
    pub const fn number(self) -> u8 {
        self.0
    }

    /// Every device that a bus can have, in the order of their turns.
    pub fn all() -> impl Iterator<Item = BusAddress> {
        (0..=MAX_REPORT_ADDRESS).map(BusAddress)
    }
}

/// As `5`.
impl fmt::Display for BusAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.0, f)
    }
}

/// Where a datagram goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Address {
    /// To one device.
    Device(BusAddress),
    /// To every device on the bus, number 255.
    Broadcast,
}

impl Address {
    /// The destination with that number: 0–31 or 255.
    #[must_use]
    pub const fn from_number(number: u8) -> Option<Address> {
        match (number, BusAddress::new(number)) {
            (u8::MAX, _) => Some(Address::Broadcast),
            (_, Some(device)) => Some(Address::Device(device)),
            (_, None) => None,
        }
    }

    /// The number, 0–31 or 255.
    #[must_use]
    pub const fn number(self) -> u8 {
        match self {
            Address::Device(device) => device.number(),
            Address::Broadcast => u8::MAX,
        }
    }
}

impl From<BusAddress> for Address {
    fn from(device: BusAddress) -> Address {
        Address::Device(device)
    }
}

/// As `5` or `all`.
impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Address::Device(device) => device.fmt(f),
            Address::Broadcast => f.pad("all"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_are_0_to_31_and_255_is_everybody() {
        for number in 0..=255 {
            let address = Address::from_number(number);
            assert_eq!(address.is_some(), number <= 31 || number == 255, "{number}");
            assert!(address.is_none_or(|address| address.number() == number));
            assert_eq!(
                BusAddress::new(number).map(BusAddress::number),
                (number <= 31).then_some(number)
            );
        }
        assert_eq!(BusAddress::all().count(), 32);
        assert_eq!(Address::Broadcast.to_string(), "all");
        assert_eq!(Address::from_number(7).unwrap().to_string(), "7");
    }
}
