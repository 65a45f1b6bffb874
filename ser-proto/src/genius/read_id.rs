//! Read ID reply, subfunction 01h: what a device is.
//!
//! ```text
//! | input length | output length | configuration length | diagnostic length | status | reference (2, low first) |
//! | application | software revision | controller | model | rate, upper half |    12 bytes
//! ```

use core::fmt;

use nom::Parser;
use nom::number::complete::{be_u8, le_u16};

use super::message_error::parse_data;
use super::{BusRate, Data, MessageError, Subfunction};
use crate::fields::byte;

/// Data bytes of the reply.
const LEN: usize = 12;

/// What a device tells about itself when a bus controller logs it in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ReadIdReply {
    /// Bytes that it sends in every scan, as inputs or as global data.
    pub input_len: u8,
    /// Bytes that it receives in every scan, as outputs or as directed control data.
    pub output_len: u8,
    /// Bytes of its configuration.
    pub configuration_len: u8,
    /// Bytes of its diagnostics.
    pub diagnostic_len: u8,
    /// The kind of device, and its state.
    pub status: DeviceStatus,
    /// The reference address assigned to it.
    pub reference_address: u16,
    /// Model or application number, depending on the kind of device.
    pub application: u8,
    /// Revision of its software.
    pub software_revision: u8,
    /// The address of the bus controller to which it is assigned.
    pub controller: u8,
    /// Model number.
    pub model: u8,
    /// The bus rate at which it works.
    pub rate: BusRate,
}

impl ReadIdReply {
    pub(super) fn parse(data: &[u8]) -> Result<ReadIdReply, MessageError> {
        // The lower half of the byte means nothing.
        let rate = byte(|rate| BusRate::from_code(rate >> 4));
        let lengths = (be_u8, be_u8, be_u8, be_u8);
        let fields = (lengths, be_u8.map(DeviceStatus), le_u16, be_u8, be_u8, be_u8, be_u8, rate);
        let reply = fields.map(
            |(
                lengths,
                status,
                reference_address,
                application,
                software_revision,
                controller,
                model,
                rate,
            )| {
                let (input_len, output_len, configuration_len, diagnostic_len) = lengths;
                ReadIdReply {
                    input_len,
                    output_len,
                    configuration_len,
                    diagnostic_len,
                    status,
                    reference_address,
                    application,
                    software_revision,
                    controller,
                    model,
                    rate,
                }
            },
        );
        parse_data(Subfunction::ReadIdReply, data, LEN, reply)
    }

    pub(super) fn to_data(self) -> Data {
        let [reference_low, reference_high] = self.reference_address.to_le_bytes();
        Data::from_array([
            self.input_len,
            self.output_len,
            self.configuration_len,
            self.diagnostic_len,
            self.status.0,
            reference_low,
            reference_high,
            self.application,
            self.software_revision,
            self.controller,
            self.model,
            self.rate.code() << 4,
        ])
    }
}

/// As `model 16, revision 3, inputs 4 bytes, outputs 0 bytes, 153.6K standard`.
impl fmt::Display for ReadIdReply {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "model {}, revision {}, inputs {} bytes, outputs {} bytes, {}",
            self.model, self.software_revision, self.input_len, self.output_len, self.rate
        )
    }
}

/// The status bits of a Read ID reply.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DeviceStatus(pub u8);

impl DeviceStatus {
    /// The status bits of a device with these directions, nothing forced and no hand-held monitor.
    #[must_use]
    pub const fn new(directions: Directions) -> DeviceStatus {
        DeviceStatus((directions as u8) << 1)
    }

    /// Whether any point is forced.
    #[must_use]
    pub const fn forced(self) -> bool {
        self.0 & 0x01 != 0
    }

    /// Whether the device has inputs, outputs or both; `None` if it does not say.
    #[must_use]
    pub const fn directions(self) -> Option<Directions> {
        match self.0 >> 1 & 0b11 {
            0b01 => Some(Directions::Inputs),
            0b10 => Some(Directions::Outputs),
            0b11 => Some(Directions::Both),
            _ => None,
        }
    }

    /// Whether a hand-held monitor is connected to it.
    #[must_use]
    pub const fn monitor_present(self) -> bool {
        self.0 & 0x08 != 0
    }
}

/// The directions in which a device exchanges data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Directions {
    /// Inputs only.
    Inputs = 0b01,
    /// Outputs only.
    Outputs = 0b10,
    /// Inputs and outputs.
    Both = 0b11,
}

#[cfg(test)]
mod tests {
    use super::*;

    const RECORDER: ReadIdReply = ReadIdReply {
        input_len: 4,
        output_len: 0,
        configuration_len: 6,
        diagnostic_len: 2,
        status: DeviceStatus::new(Directions::Inputs),
        reference_address: 0x1234,
        application: 9,
        software_revision: 3,
        controller: 31,
        model: 0x10,
        rate: BusRate::K38_4,
    };

    const BYTES: [u8; 12] = [4, 0, 6, 2, 0x02, 0x34, 0x12, 9, 3, 31, 0x10, 0x30];

    #[test]
    fn every_field_is_in_its_place() {
        assert_eq!(RECORDER.to_data(), BYTES);
        assert_eq!(ReadIdReply::parse(&BYTES), Ok(RECORDER));
    }

    #[test]
    fn the_lower_half_of_the_rate_byte_means_nothing_and_the_upper_half_must() {
        let mut bytes = BYTES;
        bytes[11] = 0x3F;
        assert_eq!(ReadIdReply::parse(&bytes), Ok(RECORDER));
        bytes[11] = 0x40;
        let bad = MessageError::BadValue {
            subfunction: Subfunction::ReadIdReply,
            offset: 11,
            value: 0x40,
        };
        assert_eq!(ReadIdReply::parse(&bytes), Err(bad));
    }

    #[test]
    fn the_status_bits_are_told_apart() {
        assert!(DeviceStatus(0x01).forced());
        assert!(DeviceStatus(0x08).monitor_present());
        let directions =
            [None, Some(Directions::Inputs), Some(Directions::Outputs), Some(Directions::Both)];
        for (bits, expected) in (0..).zip(directions) {
            let status = DeviceStatus(bits << 1);
            assert_eq!(status.directions(), expected);
            assert!(!status.forced() && !status.monitor_present());
        }
    }
}
