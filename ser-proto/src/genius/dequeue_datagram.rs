//! `COMM_REQ` 13: a PLC fetches a datagram that its bus controller has received (manual, table
//! "Dequeue Datagram").
//!
//! ```text
//! word  0: 7 | 1–6      | 7       | 8              | 9          | 10       | 11          | 12
//!            | common,  | maximum | memory type of | number in  | function | subfunction | sender, or
//!            | 6: 13    | words   | the data       | it minus 1 |          |             | 255: global
//! ```

use core::fmt;

use super::comm_req_block::{Block, HEADER_LEN, address, byte, exactly, start};
use super::datagram::Subject;
use super::packing::gather;
use super::{Address, CommReqError, FUNCTION_HORNER, PlcReference, SUBFUNCTION_SER, Words};

/// The command number.
pub(super) const DEQUEUE: u16 = 13;

/// Words of the block; it carries no data.
const LEN: usize = 13;

/// Word 0: the number of words from the command word on. The manual's rule gives 7 for a datagram
/// length of 0.
const COMMAND_LENGTH: u16 = 7;
const _: () = assert!(HEADER_LEN + COMMAND_LENGTH as usize == LEN);

/// A block that fetches the next datagram of one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DequeueDatagram {
    /// Where the PLC is to put the outcome.
    pub status: PlcReference,
    /// How many words may be fetched, at least 1.
    pub max_words: u16,
    /// Where the first fetched word goes.
    pub into: PlcReference,
    /// Function code of the datagram.
    pub function: u8,
    /// Subfunction code of the datagram.
    pub subfunction: u8,
    /// Who sent it; [`Address::Broadcast`] (255) for a global message.
    pub sender: Address,
}

impl DequeueDatagram {
    /// The block that fetches a message of a recorder.
    #[must_use]
    pub const fn from_recorder(
        sender: Address,
        max_words: u16,
        into: PlcReference,
        status: PlcReference,
    ) -> DequeueDatagram {
        let (function, subfunction) = (FUNCTION_HORNER, SUBFUNCTION_SER);
        DequeueDatagram { status, max_words, into, function, subfunction, sender }
    }

    /// The words of the block.
    #[must_use]
    pub fn to_words(&self) -> Words {
        let fields = [
            self.max_words,
            self.into.memory.0,
            self.into.offset(),
            self.function.into(),
            self.subfunction.into(),
            self.sender.number().into(),
        ];
        gather(start(COMMAND_LENGTH, self.status, DEQUEUE).into_iter().chain(fields))
    }

    /// Parses the words of a block.
    ///
    /// # Errors
    /// See [`CommReqError`].
    pub fn parse(words: &[u16]) -> Result<DequeueDatagram, CommReqError> {
        let block = Block(words);
        let status = block.parse_start(DEQUEUE)?;
        let dequeue = DequeueDatagram {
            status,
            max_words: block.word(7, |words| (words > 0).then_some(words))?,
            into: block.reference(8)?,
            function: block.word(10, byte)?,
            subfunction: block.word(11, byte)?,
            sender: block.word(12, address)?,
        };
        block.rest(LEN, 0, 0)?;
        block.word(0, exactly(COMMAND_LENGTH))?;
        Ok(dequeue)
    }
}

/// As `fetch SER message from 5, at most 70 words into %R200, status in %R100`.
impl fmt::Display for DequeueDatagram {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let subject = Subject { function: self.function, subfunction: self.subfunction };
        let (sender, max_words, into, status) =
            (self.sender, self.max_words, self.into, self.status);
        write!(
            f,
            "fetch {subject} from {sender}, at most {max_words} words into {into}, status in \
             {status}"
        )
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::genius::{BusAddress, MemoryType};

    const BLOCK: DequeueDatagram = DequeueDatagram::from_recorder(
        Address::Device(BusAddress::new(5).unwrap()),
        70,
        PlcReference::register(200).unwrap(),
        PlcReference::register(100).unwrap(),
    );

    const WORDS: [u16; 13] = [7, 0, 8, 99, 0, 0, 13, 70, 8, 199, 0x40, 0x50, 5];

    #[test]
    fn every_field_is_in_its_word() {
        assert_eq!(BLOCK.to_words(), WORDS);
        assert_eq!(DequeueDatagram::parse(&WORDS), Ok(BLOCK));
        let text = "fetch SER message from 5, at most 70 words into %R200, status in %R100";
        assert_eq!(BLOCK.to_string(), text);
    }

    #[test]
    fn a_global_message_is_fetched_with_device_number_ff() {
        let global = DequeueDatagram { sender: Address::Broadcast, ..BLOCK };
        assert_eq!(global.to_words()[12], 0xFF);
        assert_eq!(DequeueDatagram::parse(&global.to_words()), Ok(global));
    }

    #[test]
    fn a_bad_word_is_named_by_index_and_value() {
        let bad = [
            (0, 8),
            (1, 1),
            (3, 0xFFFF),
            (4, 1),
            (5, 1),
            (6, 14),
            (7, 0),
            (9, 0xFFFF),
            (10, 0x100),
            (11, 0x100),
            (12, 32),
            (12, 0xFFFF),
        ];
        for (index, value) in bad {
            let mut words = WORDS;
            words[index] = value;
            assert_eq!(DequeueDatagram::parse(&words), Err(CommReqError::BadWord { index, value }));
        }
    }

    #[test]
    fn other_lengths_are_refused() {
        for length in 0..13 {
            let index = if length <= 6 { 6 } else { length };
            assert_eq!(
                DequeueDatagram::parse(&WORDS[..length]),
                Err(CommReqError::Missing { index })
            );
        }
        let long = [&WORDS[..], &[0]].concat();
        assert_eq!(DequeueDatagram::parse(&long), Err(CommReqError::TooManyWords { words: 14 }));
    }

    proptest! {
        #[test]
        fn every_block_survives(
            places: [(u16, std::num::NonZeroU16); 2],
            max_words in 1..=u16::MAX,
            codes: (u8, u8),
            sender in 0..=32_u8,
        ) {
            let [status, into] =
                places.map(|(memory, number)| PlcReference { memory: MemoryType(memory), number });
            let block = DequeueDatagram {
                status,
                max_words,
                into,
                function: codes.0,
                subfunction: codes.1,
                sender: Address::from_number(sender).unwrap_or(Address::Broadcast),
            };
            prop_assert_eq!(DequeueDatagram::parse(&block.to_words()), Ok(block));
        }
    }
}
