//! The tables that are exchanged in every bus scan (chapters 8, 11 and 12).

use core::fmt;

use crate::device_table::{Device, Record, read_record};
use crate::map::{self, Region};
use crate::ram::SharedRam;

/// Why data could not be exchanged with a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TableError {
    /// The board is starting up, is off the bus or has failed.
    NotReady,
    /// The data are more than one byte and the board is not locked out: it might change or send
    /// half of them.
    NotLocked,
    /// No device is logged in at this bus address, or the address is above 31.
    NotPresent,
    /// The number of bytes is wrong.
    WrongLength {
        /// The right number of bytes.
        expected: u8,
    },
}

impl fmt::Display for TableError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TableError::NotReady => f.write_str("the GENI board is not ready"),
            TableError::NotLocked => f.write_str("the tables are not locked"),
            TableError::NotPresent => f.write_str("the device is not on the bus"),
            TableError::WrongLength { expected } => write!(f, "{expected} bytes belong there"),
        }
    }
}

impl core::error::Error for TableError {}

/// The buffer with the inputs of a device.
pub(crate) fn input_buffer(device_number: u8, buffer_len: u8) -> Region {
    buffer(u16::from(device_number), buffer_len)
}

/// The buffer with the outputs for a device. The output table directly follows the input table.
pub(crate) fn output_buffer(device_number: u8, buffer_len: u8) -> Region {
    buffer(u16::from(map::DEVICE_COUNT) + u16::from(device_number), buffer_len)
}

fn buffer(index: u16, buffer_len: u8) -> Region {
    let len = u16::from(buffer_len);
    Region { start: map::IO_TABLE.at(index * len), len }
}

pub(crate) fn present_device<R: SharedRam>(
    ram: &R,
    device_number: u8,
    buffer_len: u8,
) -> Result<Device, TableError> {
    match read_record(ram, device_number, buffer_len) {
        Record::Present(device) => Ok(device),
        Record::Absent | Record::Impossible => Err(TableError::NotPresent),
    }
}

/// The tables while the board is locked out of them. See [`Driver::tables`](crate::Driver::tables).
#[derive(Debug)]
pub struct Tables<'a, R> {
    ram: &'a mut R,
    buffer_len: u8,
    directed_len: u8,
}

impl<'a, R: SharedRam> Tables<'a, R> {
    pub(crate) fn new(ram: &'a mut R, buffer_len: u8, directed_len: u8) -> Tables<'a, R> {
        Tables { ram, buffer_len, directed_len }
    }

    /// Reads the inputs or the global data of a device into the beginning of `inputs` and returns
    /// the number of bytes.
    ///
    /// # Errors
    ///
    /// When the device is not logged in, or has more inputs than fit into `inputs`.
    pub fn inputs(&self, device_number: u8, inputs: &mut [u8]) -> Result<usize, TableError> {
        let device = present_device(self.ram, device_number, self.buffer_len)?;
        let len = usize::from(device.input_len);
        let inputs =
            inputs.get_mut(..len).ok_or(TableError::WrongLength { expected: device.input_len })?;
        self.ram.read_bytes(input_buffer(device_number, self.buffer_len).start, inputs);
        Ok(len)
    }

    /// Sets the outputs, or the directed control data, for a device.
    ///
    /// # Errors
    ///
    /// When the device is not logged in, or has another number of output bytes.
    pub fn set_outputs(&mut self, device_number: u8, outputs: &[u8]) -> Result<(), TableError> {
        let device = present_device(self.ram, device_number, self.buffer_len)?;
        if outputs.len() != usize::from(device.output_len) {
            return Err(TableError::WrongLength { expected: device.output_len });
        }
        self.ram.write_bytes(output_buffer(device_number, self.buffer_len).start, outputs);
        Ok(())
    }

    /// Reads the directed control data for this host into the beginning of `data` and returns the
    /// number of bytes.
    ///
    /// # Errors
    ///
    /// When more is configured than fits into `data`.
    pub fn directed_inputs(&self, data: &mut [u8]) -> Result<usize, TableError> {
        let len = usize::from(self.directed_len);
        let data =
            data.get_mut(..len).ok_or(TableError::WrongLength { expected: self.directed_len })?;
        self.ram.read_bytes(map::DIRECTED_INPUT.start, data);
        Ok(len)
    }
}
