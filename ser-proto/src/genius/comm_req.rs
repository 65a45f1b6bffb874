//! The two blocks that a PLC program hands to `COMM_REQ` to talk with a recorder.

use core::fmt;

use heapless::Vec;

use super::comm_req_block::Block;
use super::dequeue_datagram::DEQUEUE;
use super::send_datagram::SEND;
use super::{CommReqError, DequeueDatagram, MAX_DATA, SendDatagram};

/// Words of the longest block, a SEND with a full datagram.
pub const MAX_WORDS: usize = 12 + MAX_DATA / 2;

/// The words of a block, as they stand in a PLC's registers.
pub type Words = Vec<u16, MAX_WORDS>;

/// A `COMM_REQ` block.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CommReq {
    /// Command 14: send a datagram.
    Send(SendDatagram),
    /// Command 13: fetch a datagram.
    Dequeue(DequeueDatagram),
}

impl CommReq {
    /// Parses the words of a block; word 6 says which one it is.
    ///
    /// # Errors
    /// See [`CommReqError`].
    pub fn parse(words: &[u16]) -> Result<CommReq, CommReqError> {
        let command = Block(words).word(6, |command| match command {
            SEND | DEQUEUE => Some(command),
            _ => None,
        })?;
        match command {
            SEND => SendDatagram::parse(words).map(CommReq::Send),
            _ => DequeueDatagram::parse(words).map(CommReq::Dequeue),
        }
    }

    /// The words of the block.
    #[must_use]
    pub fn to_words(&self) -> Words {
        match self {
            CommReq::Send(send) => send.to_words(),
            CommReq::Dequeue(dequeue) => dequeue.to_words(),
        }
    }
}

/// As the block it holds.
impl fmt::Display for CommReq {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CommReq::Send(send) => send.fmt(f),
            CommReq::Dequeue(dequeue) => dequeue.fmt(f),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::genius::CommReqError;

    #[test]
    fn word_6_says_which_block_it_is() {
        let send = [8, 0, 8, 99, 0, 0, 14, 5, 0x40, 0x50, 0, 1, 0x45];
        let dequeue = [7, 0, 8, 99, 0, 0, 13, 70, 8, 199, 0x40, 0x50, 5];
        assert!(matches!(CommReq::parse(&send), Ok(CommReq::Send(_))));
        assert!(matches!(CommReq::parse(&dequeue), Ok(CommReq::Dequeue(_))));
        let mut other = dequeue;
        other[6] = 15;
        assert_eq!(CommReq::parse(&other), Err(CommReqError::BadWord { index: 6, value: 15 }));
        assert_eq!(CommReq::parse(&[]), Err(CommReqError::Missing { index: 6 }));
    }

    proptest! {
        #[test]
        fn any_words_are_understood_or_refused(
            mut words in prop::collection::vec(prop_oneof![0..20_u16, any::<u16>()], 0..90),
            command in 12..16_u16,
        ) {
            if let Some(word) = words.get_mut(6) {
                *word = command;
            }
            if let Ok(block) = CommReq::parse(&words) {
                prop_assert_eq!(CommReq::parse(&block.to_words()), Ok(block));
            }
        }
    }
}
