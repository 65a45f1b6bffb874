//! `COMM_REQ` 14: a PLC sends a datagram (manual, table "Send Datagram").
//!
//! ```text
//! word  0–6      | 7      | 8        | 9           | 10       | 11            | 12 …
//!       common,  | target | function | subfunction | priority | data length   | the data, two bytes to a word,
//!       6: 14    |        |          |             |          | in bytes      | the first one in the low half
//! ```

use core::fmt;

use super::comm_req_block::{Block, HEADER_LEN, address, byte, exactly, start};
use super::datagram::{ByteCount, Subject};
use super::packing::gather;
use super::{
    Address, BusAddress, CommReqError, Data, Datagram, MAX_DATA, PlcReference, Priority, Words,
    bytes_of_words, words_of_bytes,
};

/// The command number.
pub(super) const SEND: u16 = 14;

/// The word at which the data start.
const DATA_INDEX: usize = 12;

/// A block that makes a PLC's bus controller send a datagram.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SendDatagram {
    /// Where the PLC is to put the outcome.
    pub status: PlcReference,
    /// Where the datagram goes.
    pub target: Address,
    /// Function code.
    pub function: u8,
    /// Subfunction code.
    pub subfunction: u8,
    /// How urgent it is; the manual's table has 0, normal.
    pub priority: Priority,
    /// The data of the datagram.
    pub data: Data,
}

impl SendDatagram {
    /// The block that sends `datagram`. The datagram's source is ignored: the PLC's bus controller
    /// sends it.
    #[must_use]
    pub fn new(datagram: Datagram, status: PlcReference) -> SendDatagram {
        SendDatagram {
            status,
            target: datagram.destination,
            function: datagram.function,
            subfunction: datagram.subfunction,
            priority: datagram.priority,
            data: datagram.data,
        }
    }

    /// The datagram as the bus controller at address `source` sends it.
    #[must_use]
    pub fn to_datagram(&self, source: BusAddress) -> Datagram {
        Datagram {
            source,
            destination: self.target,
            function: self.function,
            subfunction: self.subfunction,
            priority: self.priority,
            data: self.data.clone(),
        }
    }

    /// Word 0 by the manual's rule: (data length + 1) / 2 + 7.
    ///
    /// That is one more than the number of words after word 5. A PLC therefore reads one word more
    /// than the block needs; a bus controller sends the bytes that word 11 counts.
    #[must_use]
    pub fn command_length(&self) -> u16 {
        self.words_from_command() + 1
    }

    fn words_from_command(&self) -> u16 {
        let header = DATA_INDEX - HEADER_LEN;
        u16::try_from(header + self.data.len().div_ceil(2)).unwrap_or(u16::MAX)
    }

    /// The words of the block.
    #[must_use]
    pub fn to_words(&self) -> Words {
        let fields = [
            self.target.number().into(),
            self.function.into(),
            self.subfunction.into(),
            self.priority.code().into(),
            u16::try_from(self.data.len()).unwrap_or(u16::MAX),
        ];
        let start = start(self.command_length(), self.status, SEND);
        gather(start.into_iter().chain(fields).chain(words_of_bytes(&self.data)))
    }

    /// Parses the words of a block.
    ///
    /// Word 0 may also be the true count of the words from word 6 on. The one extra word that the
    /// manual's rule counts may follow the block.
    ///
    /// # Errors
    /// See [`CommReqError`].
    pub fn parse(words: &[u16]) -> Result<SendDatagram, CommReqError> {
        let block = Block(words);
        let status = block.parse_start(SEND)?;
        let target = block.word(7, address)?;
        let function = block.word(8, byte)?;
        let subfunction = block.word(9, byte)?;
        let priority = block.word(10, |code| byte(code).and_then(Priority::from_code))?;
        let length = block.word(11, |length| {
            byte(length).map(usize::from).filter(|&length| length <= MAX_DATA)
        })?;
        let count = length.div_ceil(2);
        let data = gather(bytes_of_words(block.rest(DATA_INDEX, count, count + 1)?, length));
        let send = SendDatagram { status, target, function, subfunction, priority, data };
        block
            .word(0, exactly(send.words_from_command()))
            .or_else(|_| block.word(0, exactly(send.command_length())))?;
        Ok(send)
    }
}

/// As `send to 5: SER message, 4 bytes, normal priority, status in %R100`.
impl fmt::Display for SendDatagram {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let subject = Subject { function: self.function, subfunction: self.subfunction };
        let (target, bytes) = (self.target, ByteCount(self.data.len()));
        write!(
            f,
            "send to {target}: {subject}, {bytes}, {} priority, status in {}",
            self.priority, self.status
        )
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::genius::MemoryType;
    use crate::{Command, TimeStamp};

    const PLC: BusAddress = BusAddress::new(31).unwrap();
    const UNIT: BusAddress = BusAddress::new(5).unwrap();
    const STATUS: PlcReference = PlcReference::register(100).unwrap();

    fn send(command: &Command) -> SendDatagram {
        SendDatagram::new(Datagram::from_command(PLC, UNIT.into(), command), STATUS)
    }

    /// Any block, and its words.
    fn any_block() -> impl Strategy<Value = SendDatagram> {
        let reference = (any::<u16>(), 1..=u16::MAX).prop_map(|(memory, number)| PlcReference {
            memory: MemoryType(memory),
            number: number.try_into().unwrap(),
        });
        let target = (0..=32_u8)
            .prop_map(|number| Address::from_number(number).unwrap_or(Address::Broadcast));
        let data = prop::collection::vec(any::<u8>(), 0..=MAX_DATA);
        (reference, target, any::<u8>(), any::<u8>(), any::<bool>(), data).prop_map(
            |(status, target, function, subfunction, high, data)| SendDatagram {
                status,
                target,
                function,
                subfunction,
                priority: if high { Priority::High } else { Priority::Normal },
                data: Data::from_slice(&data).unwrap(),
            },
        )
    }

    #[test]
    fn a_command_of_one_byte_is_one_word_of_data() {
        let words = send(&Command::Erase).to_words();
        assert_eq!(words, [8, 0, 8, 99, 0, 0, 14, 5, 0x40, 0x50, 0, 1, 0x0045]);
    }

    #[test]
    fn the_first_byte_is_in_the_low_half_and_an_odd_one_is_alone() {
        let time = TimeStamp {
            year: 96,
            month: 11,
            day: 21,
            hour: 22,
            minute: 30,
            second: 50,
            millisecond: 250,
        };
        let words = send(&Command::SetClock(time)).to_words();
        assert_eq!(words[0], 12);
        assert_eq!(words[11..], [9, 0x6053, 0x150B, 0x1E16, 0x0032, 0x00FA]);
    }

    #[test]
    fn word_0_follows_the_manuals_rule() {
        for length in 0..=MAX_DATA {
            let data = core::iter::repeat_n(0, length).collect();
            let block = SendDatagram { data, ..send(&Command::Erase) };
            let words = block.to_words();
            assert_eq!(usize::from(words[0]), length.div_ceil(2) + 7);
            assert_eq!(usize::from(words[11]), length);
            assert_eq!(words.len(), 12 + length.div_ceil(2));
        }
    }

    #[test]
    fn the_true_count_and_the_word_counted_in_excess_are_understood() {
        let block = send(&Command::Erase);
        let mut words = block.to_words();
        words[0] = 7;
        assert_eq!(SendDatagram::parse(&words).as_ref(), Ok(&block));
        words[0] = 8;
        words.push(0xABCD).unwrap();
        assert_eq!(SendDatagram::parse(&words).as_ref(), Ok(&block));
        words.push(0).unwrap();
        assert_eq!(SendDatagram::parse(&words), Err(CommReqError::TooManyWords { words: 15 }));
    }

    #[test]
    fn a_bad_word_is_named_by_index_and_value() {
        let bad = [
            (0, 6),
            (0, 9),
            (1, 1),
            (3, 0xFFFF),
            (4, 1),
            (5, 1),
            (6, 13),
            (7, 32),
            (7, 254),
            (7, 256),
            (8, 0x140),
            (9, 0x150),
            (10, 2),
            (11, 135),
            (11, 0x101),
        ];
        for (index, value) in bad {
            let mut words = send(&Command::Erase).to_words();
            words[index] = value;
            assert_eq!(SendDatagram::parse(&words), Err(CommReqError::BadWord { index, value }));
        }
    }

    #[test]
    fn a_block_reads_well() {
        let block = send(&Command::Read { start: 500, count: 5 });
        let text = "send to 5: SER message, 4 bytes, normal priority, status in %R100";
        assert_eq!(block.to_string(), text);
        assert_eq!(block.to_datagram(PLC).command(), Ok(Command::Read { start: 500, count: 5 }));
    }

    proptest! {
        #[test]
        fn every_block_survives(block in any_block(), spare: u16) {
            let mut words = block.to_words().to_vec();
            prop_assert_eq!(SendDatagram::parse(&words), Ok(block.clone()));
            for length in 0..words.len() {
                // The command word is checked first.
                let missing = if length <= 6 { 6 } else { length };
                let cut = SendDatagram::parse(&words[..length]);
                prop_assert_eq!(cut, Err(CommReqError::Missing { index: missing }));
            }
            words.push(spare);
            prop_assert_eq!(SendDatagram::parse(&words), Ok(block.clone()));
        }
    }
}
