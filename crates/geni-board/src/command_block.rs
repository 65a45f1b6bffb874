//! The command block (chapter 10): four commands, carried out one at a time.

use crate::datagram::{
    Completion, Data, MAX_DEVICE_NUMBER, ReceivedDatagram, Transmission, TransmitPriority,
};
use crate::map;
use crate::ram::SharedRam;

/// Asks the board to set the status to 0 as soon as it has taken the command, and to report nothing
/// more about it: "bit 8".
const CLEAR_STATUS: u8 = 0x80;

/// Status that the host writes to start a command.
const INCOMING: u8 = 1;

/// Marks a directed datagram. Any other value means broadcast: the table has 0, the example
/// structure has 2.
const DIRECTED: u8 = 1;

/// The commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CommandCode {
    /// Read Datagram.
    Read,
    /// Transmit Datagram.
    Transmit,
    /// Transmit Datagram with Reply.
    TransmitWithReply,
    /// Configuration Change.
    Configure,
}

impl CommandCode {
    const fn to_byte(self) -> u8 {
        match self {
            CommandCode::Read => 1,
            CommandCode::Transmit => 2,
            CommandCode::TransmitWithReply => 3,
            CommandCode::Configure => 4,
        }
    }
}

/// Status of the command block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CommandStatus {
    /// 0: no command, or a command whose outcome was not asked for.
    Cleared,
    /// 1, 2: the board has not finished. Also 3, which is neither free nor complete.
    Pending,
    /// 4: the command is complete.
    Complete,
    /// 8: the command makes no sense, or there is no datagram to read.
    SyntaxError,
    /// 10h: the command failed, or the configuration is in force already.
    ProcessError,
    /// Anything else; the block is free.
    Unknown(u8),
}

impl CommandStatus {
    /// The status that the byte in the command block stands for.
    #[must_use]
    pub const fn from_byte(byte: u8) -> CommandStatus {
        match byte {
            0 => CommandStatus::Cleared,
            1..=3 => CommandStatus::Pending,
            4 => CommandStatus::Complete,
            8 => CommandStatus::SyntaxError,
            0x10 => CommandStatus::ProcessError,
            unknown => CommandStatus::Unknown(unknown),
        }
    }

    pub(crate) fn read<R: SharedRam>(ram: &R) -> CommandStatus {
        CommandStatus::from_byte(ram.read(map::COMMAND_STATUS))
    }

    /// Whether the next command may be written.
    #[must_use]
    pub fn is_free(self) -> bool {
        self != CommandStatus::Pending
    }
}

/// Starts a command whose options are in place. The status byte is written last because it
/// interrupts the board.
fn start<R: SharedRam>(ram: &mut R, command: u8) {
    ram.write(map::COMMAND_CODE, command);
    ram.write(map::COMMAND_STATUS, INCOMING);
}

/// Starts a Read Datagram, which fetches the oldest datagram of the receive queue.
pub(crate) fn start_read<R: SharedRam>(ram: &mut R) {
    start(ram, CommandCode::Read.to_byte());
}

/// Starts a Configuration Change, which makes the board take the setup table.
pub(crate) fn start_configure<R: SharedRam>(ram: &mut R) {
    start(ram, CommandCode::Configure.to_byte());
}

/// Starts sending a datagram.
pub(crate) fn start_transmission<R: SharedRam>(ram: &mut R, transmission: &Transmission) {
    // The capacity of the data is 134, so the length fits a byte.
    let len = u8::try_from(transmission.data.len()).unwrap_or(0);
    let priority = match transmission.priority {
        TransmitPriority::Normal => 0,
        TransmitPriority::High => 1,
    };
    ram.write_bytes(map::TRANSMIT_BUFFER.start, &transmission.data);
    ram.write(map::TRANSMIT_DESTINATION, transmission.destination.to_byte());
    ram.write(map::TRANSMIT_FUNCTION, transmission.function);
    ram.write(map::TRANSMIT_SUBFUNCTION, transmission.subfunction);
    let command = match transmission.completion {
        Completion::Taken | Completion::Acknowledged => {
            ram.write(map::TRANSMIT_PRIORITY, priority);
            ram.write(map::TRANSMIT_LEN, len);
            let clear = if transmission.completion == Completion::Taken { CLEAR_STATUS } else { 0 };
            CommandCode::Transmit.to_byte() | clear
        }
        Completion::Reply { subfunction } => {
            ram.write(map::REPLY_SUBFUNCTION, subfunction);
            ram.write(map::REPLY_PRIORITY, priority);
            ram.write(map::REPLY_TRANSMIT_LEN, len);
            ram.write(map::REPLY_LEN, 0);
            CommandCode::TransmitWithReply.to_byte()
        }
    };
    start(ram, command);
}

/// The datagram that a finished Read Datagram command has fetched; `None` when it makes no sense.
pub(crate) fn read_datagram<R: SharedRam>(ram: &R) -> Option<ReceivedDatagram> {
    let source = ram.read(map::READ_SOURCE);
    if source > MAX_DEVICE_NUMBER {
        return None;
    }
    Some(ReceivedDatagram {
        source,
        function: ram.read(map::READ_FUNCTION),
        subfunction: ram.read(map::READ_SUBFUNCTION),
        broadcast: ram.read(map::READ_DIRECTED) != DIRECTED,
        arrived_ms: None,
        data: read_data(ram, ram.read(map::READ_LEN))?,
    })
}

/// The reply that a finished Transmit Datagram with Reply command has fetched; `None` when it makes
/// no sense.
///
/// The board may have cleared the block, so the source and the codes of the reply are not read from
/// it.
pub(crate) fn read_reply<R: SharedRam>(
    ram: &R,
    source: u8,
    function: u8,
    subfunction: u8,
) -> Option<ReceivedDatagram> {
    let data = read_data(ram, ram.read(map::REPLY_LEN))?;
    Some(ReceivedDatagram {
        source,
        function,
        subfunction,
        broadcast: false,
        arrived_ms: None,
        data,
    })
}

fn read_data<R: SharedRam>(ram: &R, len: u8) -> Option<Data> {
    let mut data = Data::new();
    data.resize_default(len.into()).ok()?;
    ram.read_bytes(map::READ_BUFFER.start, &mut data);
    Some(data)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ArrayRam, Destination};

    fn block(ram: &ArrayRam) -> [u8; 9] {
        let mut block = [0; 9];
        ram.read_bytes(0x08C2, &mut block);
        block
    }

    fn transmission(completion: Completion) -> Transmission {
        Transmission {
            destination: Destination::Device(30),
            function: 0x40,
            subfunction: 0x50,
            priority: TransmitPriority::High,
            completion,
            data: Data::from_slice(&[7, 8, 9]).expect("short"),
        }
    }

    #[test]
    fn commands_have_the_layout_of_their_tables() {
        let mut ram = ArrayRam::new();
        start_transmission(&mut ram, &transmission(Completion::Acknowledged));
        assert_eq!(block(&ram), [1, 2, 30, 0x40, 0x50, 1, 3, 0, 0]);
        let mut data = [0; 4];
        ram.read_bytes(0x08D2, &mut data);
        assert_eq!(data, [7, 8, 9, 0]);

        start_transmission(&mut ram, &transmission(Completion::Taken));
        assert_eq!(block(&ram), [1, 0x82, 30, 0x40, 0x50, 1, 3, 0, 0]);

        start_transmission(&mut ram, &transmission(Completion::Reply { subfunction: 0x51 }));
        assert_eq!(block(&ram), [1, 3, 30, 0x40, 0x50, 0x51, 1, 3, 0]);

        start_read(&mut ram);
        assert_eq!(block(&ram)[..2], [1, 1]);
        start_configure(&mut ram);
        assert_eq!(block(&ram)[..2], [1, 4]);
    }

    #[test]
    fn broadcasts_go_to_device_255() {
        let mut ram = ArrayRam::new();
        let broadcast = Transmission {
            destination: Destination::Broadcast,
            ..transmission(Completion::Acknowledged)
        };
        start_transmission(&mut ram, &broadcast);
        assert_eq!(block(&ram)[2], 255);
    }

    #[test]
    fn the_longest_datagram_fits_both_ways() {
        let mut ram = ArrayRam::new();
        let data = Data::from_slice(&[0xA5; 134]).expect("134 bytes");
        start_transmission(
            &mut ram,
            &Transmission { data, ..transmission(Completion::Acknowledged) },
        );
        assert_eq!(
            (ram.read(0x08C8), ram.read(0x08D2 + 133), ram.read(0x08D2 + 134)),
            (134, 0xA5, 0)
        );
        ram.write_bytes(0x08C4, &[31, 0x40, 0x50, 1, 134]);
        assert_eq!(read_datagram(&ram).map(|received| received.data.len()), Some(134));
    }

    #[test]
    fn anything_but_one_means_broadcast() {
        let mut ram = ArrayRam::new();
        for (indicator, broadcast) in [(0, true), (1, false), (2, true), (0xFF, true)] {
            ram.write_bytes(0x08C4, &[31, 0x40, 0x50, indicator, 2]);
            ram.write_bytes(0x09C2, &[0x4D, 1]);
            let received = read_datagram(&ram).expect("a datagram");
            assert_eq!(
                (received.source, received.function, received.subfunction),
                (31, 0x40, 0x50)
            );
            assert_eq!(
                (received.broadcast, &received.data[..]),
                (broadcast, &[0x4D, 1][..]),
                "{indicator}"
            );
        }
    }

    #[test]
    fn impossible_sources_and_lengths_are_refused() {
        let mut ram = ArrayRam::new();
        ram.write_bytes(0x08C4, &[32, 0x40, 0x50, 1, 2]);
        assert_eq!(read_datagram(&ram), None);
        ram.write_bytes(0x08C4, &[31, 0x40, 0x50, 1, 135]);
        assert_eq!(read_datagram(&ram), None);
        ram.write(0x08CA, 255);
        assert_eq!(read_reply(&ram, 1, 2, 3), None);
    }

    #[test]
    fn a_block_is_free_at_zero_and_from_four_on() {
        for byte in 0..=255 {
            assert_eq!(CommandStatus::from_byte(byte).is_free(), byte == 0 || byte >= 4, "{byte}");
        }
        assert_eq!(CommandStatus::from_byte(0x10), CommandStatus::ProcessError);
        assert_eq!(CommandStatus::from_byte(10), CommandStatus::Unknown(10));
    }
}
