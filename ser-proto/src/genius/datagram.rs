//! A datagram: up to 134 bytes from one device to another, or to all.

use core::fmt;

use heapless::Vec;

use super::{
    Address, BusAddress, FUNCTION_GENIUS, FUNCTION_HORNER, Priority, SUBFUNCTION_SER, Subfunction,
};

/// The most data bytes of a datagram. It is the size of a GENI board's buffers (GENI manual,
/// chapter 10, tables of the Transmit Datagram commands). Messages of the recorder have at most
/// [`MAX_SER_DATA`](super::MAX_SER_DATA) bytes.
pub const MAX_DATA: usize = 134;

/// The data of a datagram.
pub type Data = Vec<u8, MAX_DATA>;

/// A datagram with everything that the bus tells about it.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Datagram {
    /// Who sent it.
    pub source: BusAddress,
    /// Where it goes.
    pub destination: Address,
    /// Which family of datagrams, e.g. [`FUNCTION_GENIUS`].
    pub function: u8,
    /// Which one of the family; its meaning depends on the function.
    pub subfunction: u8,
    /// How urgent it is. The bus does not tell a receiver; a received datagram has
    /// [`Priority::Normal`].
    pub priority: Priority,
    /// The data.
    pub data: Data,
}

impl Datagram {
    /// A datagram of normal priority.
    ///
    /// # Errors
    /// [`TooMuchData`] above [`MAX_DATA`] bytes.
    pub fn new(
        source: BusAddress,
        destination: Address,
        function: u8,
        subfunction: u8,
        data: &[u8],
    ) -> Result<Datagram, TooMuchData> {
        let data = TooMuchData::check(data)?;
        Ok(Datagram {
            source,
            destination,
            function,
            subfunction,
            priority: Priority::Normal,
            data,
        })
    }

    /// The function and subfunction codes in words, where they have a name here.
    fn subject(&self) -> Subject {
        Subject { function: self.function, subfunction: self.subfunction }
    }
}

/// As `5 to 31: Read ID, no data` or `31 to all: SER message, 9 bytes`.
impl fmt::Display for Datagram {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} to {}: {}, ", self.source, self.destination, self.subject())?;
        ByteCount(self.data.len()).fmt(f)?;
        match self.priority {
            Priority::Normal => Ok(()),
            Priority::High => f.write_str(", high priority"),
        }
    }
}

/// A function and a subfunction code as a person reads them.
pub(super) struct Subject {
    pub(super) function: u8,
    pub(super) subfunction: u8,
}

impl fmt::Display for Subject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.function, self.subfunction) {
            (FUNCTION_HORNER, SUBFUNCTION_SER) => f.write_str("SER message"),
            (FUNCTION_GENIUS, code) => Subfunction::from_code(code).fmt(f),
            (function, subfunction) => write!(f, "datagram {function:02X}h/{subfunction:02X}h"),
        }
    }
}

/// A number of bytes as a person reads it.
pub(super) struct ByteCount(pub(super) usize);

impl fmt::Display for ByteCount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            0 => f.write_str("no data"),
            1 => f.write_str("1 byte"),
            count => write!(f, "{count} bytes"),
        }
    }
}

/// The data are longer than the [`MAX_DATA`] bytes of a datagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TooMuchData {
    /// How many bytes there were.
    pub length: usize,
}

impl TooMuchData {
    /// The bytes as the data of a datagram, if they fit.
    pub(super) fn check(bytes: &[u8]) -> Result<Data, TooMuchData> {
        Data::from_slice(bytes).map_err(|_| TooMuchData { length: bytes.len() })
    }
}

impl fmt::Display for TooMuchData {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bytes do not fit a datagram of {MAX_DATA}", self.length)
    }
}

impl core::error::Error for TooMuchData {}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: BusAddress = BusAddress::new(5).unwrap();

    #[test]
    fn data_of_134_bytes_fit_and_135_do_not() {
        let datagram = |data| Datagram::new(UNIT, Address::Broadcast, 0x20, 0x20, data);
        assert_eq!(datagram(&[7; 134]).unwrap().data, [7; 134]);
        assert_eq!(datagram(&[7; 135]), Err(TooMuchData { length: 135 }));
    }

    #[test]
    fn a_datagram_reads_well() {
        let mut datagram =
            Datagram::new(UNIT, Address::Broadcast, FUNCTION_GENIUS, 0, &[]).unwrap();
        datagram.priority = Priority::High;
        assert_eq!(datagram.to_string(), "5 to all: Read ID, no data, high priority");
        datagram.priority = Priority::Normal;
        datagram.function = 0x41;
        datagram.data.push(1).unwrap();
        assert_eq!(datagram.to_string(), "5 to all: datagram 41h/00h, 1 byte");
    }
}
