//! What a device says about itself in a Read ID reply.

use super::scan_time::BusTiming;

/// Which way a device's control data goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlockKind {
    /// No control data at all.
    Neither = 0b00,
    /// Only inputs.
    Inputs = 0b01,
    /// Only outputs.
    Outputs = 0b10,
    /// Both.
    Combination = 0b11,
}

impl BlockKind {
    /// The kind that goes with the lengths of a device's inputs and outputs.
    #[must_use]
    pub fn of(input_len: u8, output_len: u8) -> BlockKind {
        match (input_len, output_len) {
            (0, 0) => BlockKind::Neither,
            (_, 0) => BlockKind::Inputs,
            (0, _) => BlockKind::Outputs,
            _ => BlockKind::Combination,
        }
    }
}

/// The content of a Read ID reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Bytes the device broadcasts in each scan.
    pub input_len: u8,
    /// Bytes it expects to be sent in each scan.
    pub output_len: u8,
    /// The direction of its circuits.
    pub kind: BlockKind,
    /// Whether a circuit is forced.
    pub forced: bool,
    /// Whether a hand-held monitor is plugged into it.
    pub monitor: bool,
    /// Where its data belongs in a controller's memory.
    pub reference: u16,
    /// Revision of its software.
    pub revision: u8,
    /// The controller that was assigned to it.
    pub controller: u8,
    /// Its model number.
    pub model: u8,
    /// Its speed.
    pub rate: BusTiming,
}

/// Length of a Read ID reply.
pub(super) const IDENTITY_LEN: usize = 12;

impl Identity {
    /// The reply's bytes.
    #[must_use]
    pub fn to_bytes(self) -> [u8; IDENTITY_LEN] {
        let [reference_low, reference_high] = self.reference.to_le_bytes();
        let status = u8::from(self.forced) | (self.kind as u8) << 1 | u8::from(self.monitor) << 3;
        [
            self.input_len,
            self.output_len,
            0,
            0,
            status,
            reference_low,
            reference_high,
            self.model,
            self.revision,
            self.controller,
            self.model,
            self.rate.code() << 4,
        ]
    }

    /// Reads a reply; `None` when it is too short.
    #[must_use]
    pub fn parse(data: &[u8]) -> Option<Identity> {
        let data: &[u8; IDENTITY_LEN] = data.first_chunk()?;
        let kind = match data[4] >> 1 & 0b11 {
            0b00 => BlockKind::Neither,
            0b01 => BlockKind::Inputs,
            0b10 => BlockKind::Outputs,
            _ => BlockKind::Combination,
        };
        let rate = BusTiming::ALL.into_iter().find(|rate| rate.code() == data[11] >> 4)?;
        Some(Identity {
            input_len: data[0],
            output_len: data[1],
            kind,
            forced: data[4] & 1 != 0,
            monitor: data[4] >> 3 & 1 != 0,
            reference: u16::from_le_bytes([data[5], data[6]]),
            revision: data[8],
            controller: data[9],
            model: data[10],
            rate,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reply_is_words_with_the_low_byte_first() {
        let identity = Identity {
            input_len: 2,
            output_len: 4,
            kind: BlockKind::Combination,
            forced: true,
            monitor: false,
            reference: 0x1234,
            revision: 0x21,
            controller: 31,
            model: 160,
            rate: BusTiming::K76,
        };
        let bytes = identity.to_bytes();
        assert_eq!(bytes, [2, 4, 0, 0, 0b0111, 0x34, 0x12, 160, 0x21, 31, 160, 0x20]);
        assert_eq!(Identity::parse(&bytes), Some(identity));
        assert_eq!(Identity::parse(&bytes[..11]), None);
    }
}
