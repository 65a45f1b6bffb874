//! Which log a recorder says that it has.
//!
//! Entries tell whether a log goes on from where it was read, unless it was erased and filled again
//! with the same. A recorder with our extension says so itself.

use ser_evidence::record::Life;
use ser_proto::{Identity, RecorderId};
use serde::{Deserialize, Serialize};

/// What a recorder says of its log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LogIdentity {
    /// The number that no other recorder has, all zero if it has none.
    pub id: [u8; RecorderId::LEN],
    /// How often it was powered up.
    pub power_ups: u32,
    /// The number of the life, as the recorder counts them.
    pub life: u32,
}

impl LogIdentity {
    /// How many bytes it has.
    pub const LEN: usize = RecorderId::LEN + 8;

    /// As bytes: the number, then the counts with four bytes each, high byte first.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; LogIdentity::LEN] {
        let mut bytes = [0; LogIdentity::LEN];
        let counts = [self.power_ups.to_be_bytes(), self.life.to_be_bytes()];
        let all = self.id.iter().chain(counts.iter().flatten());
        bytes.iter_mut().zip(all).for_each(|(byte, value)| *byte = *value);
        bytes
    }

    /// From bytes as [`to_bytes`](Self::to_bytes) makes them.
    #[must_use]
    pub fn from_bytes(bytes: [u8; LogIdentity::LEN]) -> LogIdentity {
        let [id @ .., a, b, c, d, e, f, g, h] = bytes;
        let (power_ups, life) =
            (u32::from_be_bytes([a, b, c, d]), u32::from_be_bytes([e, f, g, h]));
        LogIdentity { id, power_ups, life }
    }

    /// The number of the recorder, if it has one.
    #[must_use]
    pub fn recorder(&self) -> Option<[u8; RecorderId::LEN]> {
        (self.id != [0; RecorderId::LEN]).then_some(self.id)
    }

    /// The name that everybody gives to this life; see [`Life::of_recorder`].
    #[must_use]
    pub fn life_name(&self) -> Life {
        Life::of_recorder(&self.id, self.power_ups, self.life)
    }
}

impl From<&Identity> for LogIdentity {
    fn from(identity: &Identity) -> LogIdentity {
        let Identity { id, power_ups, life, .. } = identity;
        let id = id.map_or([0; RecorderId::LEN], |id| id.bytes());
        LogIdentity { id, power_ups: *power_ups, life: *life }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_give_the_same_again() {
        let log = LogIdentity { id: *b"0123456789ab", power_ups: 0x0102_0304, life: 0xFFFE_FDFC };
        let bytes = log.to_bytes();
        assert_eq!(bytes, *b"0123456789ab\x01\x02\x03\x04\xFF\xFE\xFD\xFC");
        assert_eq!(LogIdentity::from_bytes(bytes), log);
        assert_eq!(LogIdentity { id: [0; 12], ..log }.recorder(), None);
    }
}
