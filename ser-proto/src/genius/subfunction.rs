//! Function code 20h: the datagrams that every Genius device speaks, and their subfunction codes.
//!
//! The manuals at hand name most of these datagrams and print few of the codes. A code marked
//! *unchecked* is from general knowledge of Genius, not from a manual.

use core::fmt;

/// Function code of the bus's own datagrams.
pub const FUNCTION_GENIUS: u8 = 0x20;

/// The highest function code that a GENI board sends; it refuses higher ones (GENI manual, chapter
/// 10).
pub const HIGHEST_FUNCTION: u8 = 112;

/// A datagram of function code 20h. A code without a name here is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Subfunction {
    /// 00h: asks a device what it is.
    ReadId,
    /// 01h: the answer to Read ID.
    ReadIdReply,
    /// 02h: asks for a device's configuration.
    ReadConfiguration,
    /// 03h: the answer to Read Configuration.
    ReadConfigurationReply,
    /// 04h: sets a device's configuration.
    WriteConfiguration,
    /// 05h: report faults to this device too.
    AssignMonitor,
    /// 06h: begins a sequence of datagrams that belong together.
    BeginPacketSequence,
    /// 07h: ends such a sequence.
    EndPacketSequence,
    /// 08h (unchecked): asks for a device's faults.
    ReadDiagnostics,
    /// 09h (unchecked): the answer to Read Diagnostics.
    ReadDiagnosticsReply,
    /// 0Bh (unchecked): set and clear single bits of a host's memory.
    WritePoint,
    /// 0Fh (unchecked): a block reports a fault to its controllers.
    ReportFault,
    /// 10h: checks the outputs with a pulse.
    PulseTest,
    /// 12h (unchecked): clears the faults of one circuit.
    ClearCircuitFault,
    /// 13h: clears all faults.
    ClearAllFaults,
    /// 1Eh: reads a host's memory.
    ReadDevice,
    /// 1Fh: the answer to Read Device.
    ReadDeviceReply,
    /// 20h: writes a host's memory.
    WriteDevice,
    /// 22h (unchecked): a device tells its controllers that its configuration has changed.
    ConfigurationChange,
    /// 2Ah: asks which references a station uses.
    ReadMap,
    /// 2Bh: the answer to Read Map.
    ReadMapReply,
    /// 2Ch: sets the references that a station uses.
    WriteMap,
    /// 40h: asks which inputs or outputs are forced, and to what.
    ReadIoForces,
    /// 41h: the answer to Read I/O Forces.
    ReadIoForcesReply,
    /// Any other code. [`Subfunction::from_code`] never returns this for a code that has a name.
    Unknown(u8),
}

impl Subfunction {
    /// The subfunctions that have a name, in the order of their codes.
    pub const NAMED: [Subfunction; 24] = [
        Subfunction::ReadId,
        Subfunction::ReadIdReply,
        Subfunction::ReadConfiguration,
        Subfunction::ReadConfigurationReply,
        Subfunction::WriteConfiguration,
        Subfunction::AssignMonitor,
        Subfunction::BeginPacketSequence,
        Subfunction::EndPacketSequence,
        Subfunction::ReadDiagnostics,
        Subfunction::ReadDiagnosticsReply,
        Subfunction::WritePoint,
        Subfunction::ReportFault,
        Subfunction::PulseTest,
        Subfunction::ClearCircuitFault,
        Subfunction::ClearAllFaults,
        Subfunction::ReadDevice,
        Subfunction::ReadDeviceReply,
        Subfunction::WriteDevice,
        Subfunction::ConfigurationChange,
        Subfunction::ReadMap,
        Subfunction::ReadMapReply,
        Subfunction::WriteMap,
        Subfunction::ReadIoForces,
        Subfunction::ReadIoForcesReply,
    ];

    /// The subfunction with code `code`.
    #[must_use]
    pub fn from_code(code: u8) -> Subfunction {
        Subfunction::NAMED
            .into_iter()
            .find(|subfunction| subfunction.code() == code)
            .unwrap_or(Subfunction::Unknown(code))
    }

    /// The code.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Subfunction::ReadId => 0x00,
            Subfunction::ReadIdReply => 0x01,
            Subfunction::ReadConfiguration => 0x02,
            Subfunction::ReadConfigurationReply => 0x03,
            Subfunction::WriteConfiguration => 0x04,
            Subfunction::AssignMonitor => 0x05,
            Subfunction::BeginPacketSequence => 0x06,
            Subfunction::EndPacketSequence => 0x07,
            Subfunction::ReadDiagnostics => 0x08,
            Subfunction::ReadDiagnosticsReply => 0x09,
            Subfunction::WritePoint => 0x0B,
            Subfunction::ReportFault => 0x0F,
            Subfunction::PulseTest => 0x10,
            Subfunction::ClearCircuitFault => 0x12,
            Subfunction::ClearAllFaults => 0x13,
            Subfunction::ReadDevice => 0x1E,
            Subfunction::ReadDeviceReply => 0x1F,
            Subfunction::WriteDevice => 0x20,
            Subfunction::ConfigurationChange => 0x22,
            Subfunction::ReadMap => 0x2A,
            Subfunction::ReadMapReply => 0x2B,
            Subfunction::WriteMap => 0x2C,
            Subfunction::ReadIoForces => 0x40,
            Subfunction::ReadIoForcesReply => 0x41,
            Subfunction::Unknown(code) => code,
        }
    }

    /// The subfunction of the reply, for a request that has one.
    #[must_use]
    pub const fn reply(self) -> Option<Subfunction> {
        match self {
            Subfunction::ReadId => Some(Subfunction::ReadIdReply),
            Subfunction::ReadConfiguration => Some(Subfunction::ReadConfigurationReply),
            Subfunction::ReadDiagnostics => Some(Subfunction::ReadDiagnosticsReply),
            Subfunction::ReadDevice => Some(Subfunction::ReadDeviceReply),
            Subfunction::ReadMap => Some(Subfunction::ReadMapReply),
            Subfunction::ReadIoForces => Some(Subfunction::ReadIoForcesReply),
            _ => None,
        }
    }

    /// Whether it reads or writes a host's memory. A GENI board puts such datagrams into its
    /// request queue.
    #[must_use]
    pub const fn is_memory_access(self) -> bool {
        matches!(self, Subfunction::ReadDevice | Subfunction::WriteDevice | Subfunction::WritePoint)
    }

    /// Its name; a code without a name is just called datagram.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Subfunction::ReadId => "Read ID",
            Subfunction::ReadIdReply => "Read ID reply",
            Subfunction::ReadConfiguration => "Read Configuration",
            Subfunction::ReadConfigurationReply => "Read Configuration reply",
            Subfunction::WriteConfiguration => "Write Configuration",
            Subfunction::AssignMonitor => "Assign Monitor",
            Subfunction::BeginPacketSequence => "Begin Packet Sequence",
            Subfunction::EndPacketSequence => "End Packet Sequence",
            Subfunction::ReadDiagnostics => "Read Diagnostics",
            Subfunction::ReadDiagnosticsReply => "Read Diagnostics reply",
            Subfunction::WritePoint => "Write Point",
            Subfunction::ReportFault => "Report Fault",
            Subfunction::PulseTest => "Pulse Test",
            Subfunction::ClearCircuitFault => "Clear Circuit Fault",
            Subfunction::ClearAllFaults => "Clear All Faults",
            Subfunction::ReadDevice => "Read Device",
            Subfunction::ReadDeviceReply => "Read Device reply",
            Subfunction::WriteDevice => "Write Device",
            Subfunction::ConfigurationChange => "Configuration Change",
            Subfunction::ReadMap => "Read Map",
            Subfunction::ReadMapReply => "Read Map reply",
            Subfunction::WriteMap => "Write Map",
            Subfunction::ReadIoForces => "Read I/O Forces",
            Subfunction::ReadIoForcesReply => "Read I/O Forces reply",
            Subfunction::Unknown(_) => "datagram",
        }
    }
}

/// As `Read ID` or `datagram 33h`.
impl fmt::Display for Subfunction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Subfunction::Unknown(code) => write!(f, "{} {code:02X}h", self.name()),
            named => f.pad(named.name()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::genius::{
        BusRate, FUNCTION_HORNER, ForceTable, MemoryType, Priority, SUBFUNCTION_SER,
    };

    /// Every number that the manuals fix is checked in this one place.
    #[test]
    fn every_code_is_the_one_of_its_table() {
        assert_eq!((FUNCTION_GENIUS, FUNCTION_HORNER, SUBFUNCTION_SER), (0x20, 0x40, 0x50));
        assert_eq!(HIGHEST_FUNCTION, 0x70);
        let subfunctions = [
            (Subfunction::ReadId, 0x00),
            (Subfunction::ReadIdReply, 0x01),
            (Subfunction::ReadConfiguration, 0x02),
            (Subfunction::ReadConfigurationReply, 0x03),
            (Subfunction::WriteConfiguration, 0x04),
            (Subfunction::AssignMonitor, 0x05),
            (Subfunction::BeginPacketSequence, 0x06),
            (Subfunction::EndPacketSequence, 0x07),
            (Subfunction::ReadDiagnostics, 0x08),
            (Subfunction::ReadDiagnosticsReply, 0x09),
            (Subfunction::WritePoint, 0x0B),
            (Subfunction::ReportFault, 0x0F),
            (Subfunction::PulseTest, 0x10),
            (Subfunction::ClearCircuitFault, 0x12),
            (Subfunction::ClearAllFaults, 0x13),
            (Subfunction::ReadDevice, 0x1E),
            (Subfunction::ReadDeviceReply, 0x1F),
            (Subfunction::WriteDevice, 0x20),
            (Subfunction::ConfigurationChange, 0x22),
            (Subfunction::ReadMap, 0x2A),
            (Subfunction::ReadMapReply, 0x2B),
            (Subfunction::WriteMap, 0x2C),
            (Subfunction::ReadIoForces, 0x40),
            (Subfunction::ReadIoForcesReply, 0x41),
        ];
        assert_eq!(subfunctions.map(|(subfunction, _)| subfunction), Subfunction::NAMED);
        for (subfunction, code) in subfunctions {
            assert_eq!(subfunction.code(), code);
            assert_eq!(Subfunction::from_code(code), subfunction);
        }
        let rates =
            [BusRate::K153_6Extended, BusRate::K153_6Standard, BusRate::K76_8, BusRate::K38_4];
        assert_eq!(rates.map(BusRate::code), [0, 1, 2, 3]);
        let tables = [
            ForceTable::InputEnable,
            ForceTable::OutputEnable,
            ForceTable::InputValues,
            ForceTable::OutputValues,
        ];
        assert_eq!(tables.map(ForceTable::code), [0, 1, 2, 3]);
        assert_eq!([Priority::Normal, Priority::High].map(Priority::code), [0, 1]);
        let memory = [
            (MemoryType::REGISTERS, 8, "%R"),
            (MemoryType::ANALOG_INPUTS, 10, "%AI"),
            (MemoryType::ANALOG_OUTPUTS, 12, "%AQ"),
            (MemoryType::INPUTS, 70, "%I"),
            (MemoryType::OUTPUTS, 72, "%Q"),
            (MemoryType::BULK, 196, "%W"),
        ];
        for (memory, code, name) in memory {
            assert_eq!((memory.0, memory.name()), (code, Some(name)));
        }
    }

    #[test]
    fn every_code_survives() {
        for code in 0..=255 {
            assert_eq!(Subfunction::from_code(code).code(), code);
        }
        assert_eq!(Subfunction::from_code(0x33), Subfunction::Unknown(0x33));
        assert_eq!(Subfunction::from_code(0x33).to_string(), "datagram 33h");
        assert_eq!(Subfunction::from_code(0x1E).to_string(), "Read Device");
    }

    #[test]
    fn a_reply_has_the_code_after_its_request() {
        for subfunction in Subfunction::NAMED {
            if let Some(reply) = subfunction.reply() {
                assert_eq!(reply.code(), subfunction.code() + 1);
            }
        }
    }
}
