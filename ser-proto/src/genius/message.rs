//! The bus's own datagrams (function code 20h), parsed.

use core::fmt;

use super::datagram::ByteCount;
use super::{
    Address, BusAddress, Data, Datagram, FUNCTION_GENIUS, ForceTable, IoForces, MemoryContents,
    MemoryRange, MessageError, Priority, ReadIdReply, Subfunction, WritePoint,
};

/// A datagram of function code 20h. One whose layout is not known here keeps its bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Message {
    /// Asks a device what it is. A GENI board answers by itself.
    ReadId,
    /// The answer to Read ID.
    ReadIdReply(ReadIdReply),
    /// Asks for one of the four force tables.
    ReadIoForces(ForceTable),
    /// The answer to Read I/O Forces.
    ReadIoForcesReply(IoForces),
    /// Asks for a piece of a host's memory.
    ReadDevice(MemoryRange),
    /// The answer to Read Device.
    ReadDeviceReply(MemoryContents),
    /// Changes a piece of a host's memory.
    WriteDevice(MemoryContents),
    /// Changes single bits of a host's memory.
    WritePoint(WritePoint),
    /// Any other datagram, as it is.
    Unknown {
        /// Which one.
        subfunction: Subfunction,
        /// What it carries.
        data: Data,
    },
}

impl Message {
    /// Parses a datagram.
    ///
    /// # Errors
    /// See [`MessageError`]. An unknown subfunction is not an error.
    pub fn parse(datagram: &Datagram) -> Result<Message, MessageError> {
        if datagram.function != FUNCTION_GENIUS {
            return Err(MessageError::WrongFunction { function: datagram.function });
        }
        Message::from_data(datagram.subfunction, &datagram.data)
    }

    /// Parses the data of a datagram of function code 20h.
    ///
    /// # Errors
    /// See [`MessageError`]. An unknown subfunction is not an error.
    pub fn from_data(subfunction: u8, carried: &Data) -> Result<Message, MessageError> {
        let data = &carried[..];
        match Subfunction::from_code(subfunction) {
            Subfunction::ReadId if data.is_empty() => Ok(Message::ReadId),
            subfunction @ Subfunction::ReadId => {
                Err(MessageError::WrongLength { subfunction, length: data.len() })
            }
            Subfunction::ReadIdReply => ReadIdReply::parse(data).map(Message::ReadIdReply),
            Subfunction::ReadIoForces => ForceTable::parse(data).map(Message::ReadIoForces),
            Subfunction::ReadIoForcesReply => IoForces::parse(data).map(Message::ReadIoForcesReply),
            Subfunction::ReadDevice => MemoryRange::parse(data).map(Message::ReadDevice),
            subfunction @ Subfunction::ReadDeviceReply => {
                MemoryContents::parse(subfunction, data).map(Message::ReadDeviceReply)
            }
            subfunction @ Subfunction::WriteDevice => {
                MemoryContents::parse(subfunction, data).map(Message::WriteDevice)
            }
            Subfunction::WritePoint => WritePoint::parse(data).map(Message::WritePoint),
            subfunction => Ok(Message::Unknown { subfunction, data: carried.clone() }),
        }
    }

    /// The datagram that carries the message.
    #[must_use]
    pub fn to_datagram(
        &self,
        source: BusAddress,
        destination: Address,
        priority: Priority,
    ) -> Datagram {
        Datagram {
            source,
            destination,
            function: FUNCTION_GENIUS,
            subfunction: self.subfunction().code(),
            priority,
            data: self.to_data(),
        }
    }

    /// Which datagram it is.
    #[must_use]
    pub const fn subfunction(&self) -> Subfunction {
        match self {
            Message::ReadId => Subfunction::ReadId,
            Message::ReadIdReply(_) => Subfunction::ReadIdReply,
            Message::ReadIoForces(_) => Subfunction::ReadIoForces,
            Message::ReadIoForcesReply(_) => Subfunction::ReadIoForcesReply,
            Message::ReadDevice(_) => Subfunction::ReadDevice,
            Message::ReadDeviceReply(_) => Subfunction::ReadDeviceReply,
            Message::WriteDevice(_) => Subfunction::WriteDevice,
            Message::WritePoint(_) => Subfunction::WritePoint,
            Message::Unknown { subfunction, .. } => *subfunction,
        }
    }

    /// The data of the datagram.
    #[must_use]
    pub fn to_data(&self) -> Data {
        match self {
            Message::ReadId => Data::new(),
            Message::ReadIdReply(reply) => reply.to_data(),
            Message::ReadIoForces(table) => table.to_data(),
            Message::ReadIoForcesReply(forces) => forces.to_data(),
            Message::ReadDevice(range) => range.to_data(),
            Message::ReadDeviceReply(contents) | Message::WriteDevice(contents) => {
                contents.to_data()
            }
            Message::WritePoint(write) => write.to_data(),
            Message::Unknown { data, .. } => data.clone(),
        }
    }
}

/// As `Read Device 4 bytes at 000100h`.
impl fmt::Display for Message {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.subfunction().fmt(f)?;
        match self {
            Message::ReadId => Ok(()),
            Message::ReadIdReply(reply) => write!(f, ": {reply}"),
            Message::ReadIoForces(table) => write!(f, ": {table}"),
            Message::ReadIoForcesReply(forces) => {
                write!(f, ": {}, {}", forces.table, ByteCount(forces.contents.len()))
            }
            Message::ReadDevice(range) => {
                write!(f, " {} at {}", ByteCount(range.length.into()), range.address)
            }
            Message::ReadDeviceReply(piece) | Message::WriteDevice(piece) => {
                write!(f, " {} at {}", ByteCount(piece.contents.len()), piece.address)
            }
            Message::WritePoint(write) => write!(f, " at {}", write.address),
            Message::Unknown { data, .. } => write!(f, ", {}", ByteCount(data.len())),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::Model;
    use crate::genius::{MAX_DATA, MemoryAddress};

    const HOST: BusAddress = BusAddress::new(31).unwrap();
    const UNIT: BusAddress = BusAddress::new(5).unwrap();

    fn datagram(subfunction: u8, data: &[u8]) -> Datagram {
        Datagram {
            source: HOST,
            destination: UNIT.into(),
            function: FUNCTION_GENIUS,
            subfunction,
            priority: Priority::Normal,
            data: Data::from_slice(data).unwrap(),
        }
    }

    /// Any subfunction and data, mostly of a length that the subfunction can have.
    fn code_and_data() -> impl Strategy<Value = (u8, Vec<u8>)> {
        let bytes = |lengths| prop::collection::vec(any::<u8>(), lengths);
        prop_oneof![
            (Just(0x01), bytes(12..=12)),
            (Just(0x0B), bytes(8..=8)),
            (Just(0x1E), bytes(4..=4)),
            (prop::sample::select(vec![0x1F, 0x20, 0x41]), bytes(4..=132)),
            (any::<u8>(), bytes(0..=MAX_DATA)),
        ]
    }

    #[test]
    fn requests_read_well() {
        let address = MemoryAddress::new(0x100).unwrap();
        let texts = [
            (Message::ReadId, "Read ID"),
            (Message::ReadIoForces(ForceTable::InputValues), "Read I/O Forces: input values"),
            (
                Message::ReadIoForcesReply(IoForces::none(ForceTable::InputEnable, Model::Ser160)),
                "Read I/O Forces reply: input enable, 2 bytes",
            ),
            (
                Message::ReadDevice(MemoryRange { address, length: 4 }),
                "Read Device 4 bytes at 000100h",
            ),
            (
                Message::Unknown { subfunction: Subfunction::Unknown(0x33), data: Data::new() },
                "datagram 33h, no data",
            ),
            (
                Message::Unknown {
                    subfunction: Subfunction::ReportFault,
                    data: Data::from_array([1, 2, 3]),
                },
                "Report Fault, 3 bytes",
            ),
        ];
        for (message, text) in texts {
            assert_eq!(message.to_string(), text);
            let datagram = message.to_datagram(HOST, UNIT.into(), Priority::High);
            assert_eq!(Message::parse(&datagram), Ok(message));
        }
    }

    #[test]
    fn every_wrong_length_of_every_known_layout_is_refused() {
        let allowed = [
            (0x00, 0..=0),
            (0x01, 12..=12),
            (0x40, 1..=1),
            (0x41, 1..=129),
            (0x1E, 4..=4),
            (0x1F, 4..=132),
            (0x20, 4..=132),
            (0x0B, 8..=8),
        ];
        for (code, allowed) in allowed {
            let subfunction = Subfunction::from_code(code);
            for length in 0..=MAX_DATA {
                let parsed = Message::parse(&datagram(code, &[0; MAX_DATA][..length]));
                let refused = parsed == Err(MessageError::WrongLength { subfunction, length });
                assert_eq!(
                    refused,
                    !allowed.contains(&length),
                    "{subfunction} with {length} bytes"
                );
            }
        }
    }

    #[test]
    fn another_function_is_not_the_buss_own() {
        let other = Datagram { function: 0x40, ..datagram(0, &[]) };
        assert_eq!(Message::parse(&other), Err(MessageError::WrongFunction { function: 0x40 }));
    }

    proptest! {
        #[test]
        fn what_is_understood_comes_back_the_same(
            (code, mut data) in code_and_data(),
            fitting: bool,
        ) {
            // A random length inside the data would agree only by luck.
            if fitting && let [length, _, _, _, contents @ ..] = &mut data[..] {
                *length = u8::try_from(contents.len()).unwrap();
            }
            let before = datagram(code, &data);
            if let Ok(message) = Message::parse(&before) {
                let after = message.to_datagram(before.source, before.destination, before.priority);
                prop_assert_eq!(Message::parse(&after), Ok(message));
                // The lower half of the last byte of a Read ID reply means nothing.
                if code != 0x01 {
                    prop_assert_eq!(after, before);
                }
            } else {
                prop_assert!(Subfunction::NAMED.contains(&Subfunction::from_code(code)));
            }
        }
    }
}
