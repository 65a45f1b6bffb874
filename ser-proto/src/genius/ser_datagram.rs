//! Messages of the recorder in datagrams (manual, section "Datagrams").
//!
//! ```text
//! | function 40 | subfunction 50 | data: the body, binary, without ESC, length and checksum |
//! ```

use core::fmt;

use super::{Address, BusAddress, Data, Datagram, Priority};
use crate::{Command, MAX_ENTRIES, Model, ParseError, READ_REPLY_HEADER_LEN, Reply};

/// Function code of the recorder's maker.
pub const FUNCTION_HORNER: u8 = 0x40;

/// Subfunction code of the recorder.
pub const SUBFUNCTION_SER: u8 = 0x50;

/// The most bytes of a message of the recorder (GENI manual, chapter 10, "Maximum Datagram
/// Length"). Other datagrams may be longer: see [`MAX_DATA`](super::MAX_DATA).
pub const MAX_SER_DATA: usize = 128;

/// The most entries that one read reply carries over the bus: 10 with 16 inputs, 7 with 32.
#[must_use]
pub const fn max_entries(model: Model) -> usize {
    let fit = (MAX_SER_DATA - READ_REPLY_HEADER_LEN) / model.entry_len();
    if fit < MAX_ENTRIES { fit } else { MAX_ENTRIES }
}

impl Datagram {
    /// A command to one recorder or to all. A recorder carries out a broadcast and does not answer
    /// it.
    #[must_use]
    pub fn from_command(source: BusAddress, destination: Address, command: &Command) -> Datagram {
        // No command is longer than a few bytes, so nothing is ever lost here.
        let data = Data::from_slice(&command.to_body()).unwrap_or_default();
        ser_datagram(source, destination, data)
    }

    /// A reply or an unsolicited report.
    ///
    /// # Errors
    /// [`SerDatagramError::TooLong`] for a read reply with more than [`max_entries`].
    pub fn from_reply(
        source: BusAddress,
        destination: BusAddress,
        reply: &Reply,
    ) -> Result<Datagram, SerDatagramError> {
        let body = reply.to_body();
        let too_long = SerDatagramError::TooLong { length: body.len() };
        let body = body.get(..).filter(|body| body.len() <= MAX_SER_DATA).ok_or(too_long)?;
        let data = Data::from_slice(body).map_err(|_| too_long)?;
        Ok(ser_datagram(source, destination.into(), data))
    }

    /// The command in a datagram that a recorder has received.
    ///
    /// # Errors
    /// See [`SerDatagramError`]. A datagram of another function or subfunction is not meant for a
    /// recorder.
    pub fn command(&self) -> Result<Command, SerDatagramError> {
        Command::parse(self.ser_body()?).map_err(SerDatagramError::Message)
    }

    /// The reply in a datagram that a host has received.
    ///
    /// # Errors
    /// See [`SerDatagramError`]. A datagram of another function or subfunction is not from a
    /// recorder.
    pub fn reply(&self) -> Result<Reply, SerDatagramError> {
        Reply::parse(self.ser_body()?).map_err(SerDatagramError::Message)
    }

    fn ser_body(&self) -> Result<&[u8], SerDatagramError> {
        match (self.function, self.subfunction) {
            (FUNCTION_HORNER, SUBFUNCTION_SER) => Ok(&self.data),
            (FUNCTION_HORNER, subfunction) => {
                Err(SerDatagramError::WrongSubfunction { subfunction })
            }
            (function, _) => Err(SerDatagramError::WrongFunction { function }),
        }
    }
}

fn ser_datagram(source: BusAddress, destination: Address, data: Data) -> Datagram {
    Datagram {
        source,
        destination,
        function: FUNCTION_HORNER,
        subfunction: SUBFUNCTION_SER,
        priority: Priority::Normal,
        data,
    }
}

/// Why a datagram holds no message of a recorder, or why a message does not fit a datagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SerDatagramError {
    /// The function code is not [`FUNCTION_HORNER`].
    WrongFunction {
        /// The code found.
        function: u8,
    },
    /// The function code is right, but the subfunction code is not [`SUBFUNCTION_SER`].
    WrongSubfunction {
        /// The code found.
        subfunction: u8,
    },
    /// The message is longer than the [`MAX_SER_DATA`] bytes allowed for one.
    TooLong {
        /// Bytes of the message.
        length: usize,
    },
    /// The datagram is to or from a recorder, but its body is not a message.
    Message(ParseError),
}

impl fmt::Display for SerDatagramError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            SerDatagramError::WrongFunction { function } => {
                write!(
                    f,
                    "function code {function:02X}h is not the recorder's ({FUNCTION_HORNER:02X}h)"
                )
            }
            SerDatagramError::WrongSubfunction { subfunction } => {
                write!(
                    f,
                    "subfunction code {subfunction:02X}h is not the recorder's \
                     ({SUBFUNCTION_SER:02X}h)"
                )
            }
            SerDatagramError::TooLong { length } => {
                write!(f, "a message of {length} bytes does not fit a datagram: {MAX_SER_DATA} do")
            }
            SerDatagramError::Message(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for SerDatagramError {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Entry, Inputs, ReadReply, TimeStamp};

    const HOST: BusAddress = BusAddress::new(31).unwrap();
    const UNIT: BusAddress = BusAddress::new(5).unwrap();

    fn read_reply(model: Model, count: usize) -> Reply {
        let time = TimeStamp {
            year: 96,
            month: 8,
            day: 15,
            hour: 14,
            minute: 30,
            second: 50,
            millisecond: 250,
        };
        let entry = Entry { changed: Inputs(1), state: Inputs(1), time };
        Reply::Read(ReadReply {
            start: 500,
            total: 32_000,
            next_slot: 2000,
            model: (count > 0).then_some(model),
            entries: core::iter::repeat_n(entry, count).collect(),
        })
    }

    #[test]
    fn ten_entries_of_16_inputs_and_seven_of_32_fit() {
        assert_eq!((max_entries(Model::Ser160), max_entries(Model::Ser320)), (10, 7));
        for (model, most, length) in [(Model::Ser160, 10, 128), (Model::Ser320, 7, 120)] {
            let reply = read_reply(model, most);
            let datagram = Datagram::from_reply(UNIT, HOST, &reply).unwrap();
            assert_eq!(datagram.data.len(), length);
            assert_eq!(datagram.reply(), Ok(reply));
        }
        assert_eq!(
            Datagram::from_reply(UNIT, HOST, &read_reply(Model::Ser320, 8)),
            Err(SerDatagramError::TooLong { length: 136 })
        );
    }

    #[test]
    fn the_data_are_the_body_and_nothing_else() {
        let command = Command::Read { start: 500, count: 5 };
        let datagram = Datagram::from_command(HOST, UNIT.into(), &command);
        assert_eq!((datagram.function, datagram.subfunction), (0x40, 0x50));
        assert_eq!(datagram.data, [0x52, 0x01, 0xF4, 0x05]);
        assert_eq!(datagram.priority, Priority::Normal);
        assert_eq!(datagram.command(), Ok(command));
        assert_eq!(datagram.to_string(), "31 to 5: SER message, 4 bytes");
    }

    #[test]
    fn every_command_fits() {
        let longest = Command::SetClock(TimeStamp {
            year: 96,
            month: 11,
            day: 21,
            hour: 22,
            minute: 30,
            second: 50,
            millisecond: 250,
        });
        for command in [longest, Command::Print { start: 1, count: 2048 }, Command::QueryMode] {
            let datagram = Datagram::from_command(HOST, Address::Broadcast, &command);
            assert_eq!(datagram.command(), Ok(command));
        }
    }

    #[test]
    fn what_is_not_the_recorders_is_told_from_what_is_damaged() {
        let mut datagram = Datagram::from_command(HOST, UNIT.into(), &Command::Erase);
        datagram.data.push(0).unwrap();
        assert_eq!(
            datagram.command(),
            Err(SerDatagramError::Message(ParseError::WrongLength { code: 0x45, length: 2 }))
        );
        datagram.data.clear();
        assert_eq!(datagram.reply(), Err(SerDatagramError::Message(ParseError::Empty)));
        datagram.subfunction = 0x51;
        assert_eq!(
            datagram.command(),
            Err(SerDatagramError::WrongSubfunction { subfunction: 0x51 })
        );
        datagram.function = 0x20;
        assert_eq!(datagram.reply(), Err(SerDatagramError::WrongFunction { function: 0x20 }));
    }
}
