//! A bus interface unit (BIU): a station of modules behind one bus address. Some of its points may
//! be forced.

use super::datagram::{Datagram, subfunction};
use super::device::{Device, Message};
use super::faults::DeviceFault;
use super::identity::BlockKind;
use super::scan_time::BusTiming;
use super::station::Station;

const MODEL: u8 = 160;

/// How much data a unit has in one direction: a byte per 8 discrete points, then a word per analog
/// channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StationData {
    /// Bytes of discrete points.
    pub discrete_bytes: usize,
    /// Analog channels.
    pub channels: usize,
}

impl StationData {
    /// Bytes on the bus.
    #[must_use]
    pub fn len(self) -> usize {
        self.discrete_bytes + 2 * self.channels
    }

    /// Whether there is no data.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }
}

/// Inputs or outputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Towards the controller.
    Inputs,
    /// From the controller.
    Outputs,
}

/// The tables a unit keeps about one direction: which points are forced, and to what.
struct Forces {
    enabled: Vec<u8>,
    values: Vec<u8>,
}

impl Forces {
    fn new(len: usize) -> Forces {
        Forces { enabled: vec![0; len], values: vec![0; len] }
    }

    /// The values of the points, given their natural values.
    fn applied_to(&self, natural: &[u8]) -> Vec<u8> {
        let masks = self.enabled.iter().zip(&self.values);
        natural
            .iter()
            .zip(masks)
            .map(|(&byte, (&mask, &value))| byte & !mask | value & mask)
            .collect()
    }
}

/// A bus interface unit. It answers Read ID and Read I/O Forces.
pub struct BusInterfaceUnit {
    station: Station,
    inputs: StationData,
    outputs: StationData,
    input_forces: Forces,
    output_forces: Forces,
}

impl BusInterfaceUnit {
    /// A unit with nothing forced. It has at most 128 bytes each way.
    ///
    /// # Panics
    /// When there is more data than that.
    #[must_use]
    pub fn new(
        number: u8,
        rate: BusTiming,
        inputs: StationData,
        outputs: StationData,
    ) -> BusInterfaceUnit {
        assert!(
            inputs.len() <= 128 && outputs.len() <= 128,
            "a device has at most 128 bytes each way"
        );
        let kind = match (inputs.is_empty(), outputs.is_empty()) {
            (true, true) => BlockKind::Neither,
            (false, true) => BlockKind::Inputs,
            (true, false) => BlockKind::Outputs,
            (false, false) => BlockKind::Combination,
        };
        let mut station = Station::new(number, rate, MODEL, kind);
        station.inputs.resize(inputs.len(), 0);
        station.outputs.resize(outputs.len(), 0);
        let (input_forces, output_forces) = (Forces::new(inputs.len()), Forces::new(outputs.len()));
        BusInterfaceUnit { station, inputs, outputs, input_forces, output_forces }
    }

    /// Plugs in other modules. Nothing is forced any more, and the controllers are told.
    ///
    /// # Panics
    /// When there is more data than 128 bytes each way.
    pub fn replace_data(&mut self, inputs: StationData, outputs: StationData) {
        let Station { number, rate, .. } = self.station;
        let mut unit = BusInterfaceUnit::new(number, rate, inputs, outputs);
        unit.station.adopt_controllers(&self.station);
        unit.station.report_configuration(false);
        *self = unit;
    }

    /// Sets what the field side of the inputs is, from the first byte on.
    pub fn set_inputs(&mut self, inputs: &[u8]) {
        let len = inputs.len().min(self.station.inputs.len());
        self.station.inputs[..len].copy_from_slice(&inputs[..len]);
    }

    /// What the unit puts out, forces included.
    #[must_use]
    pub fn outputs(&self) -> Vec<u8> {
        self.output_forces.applied_to(&self.station.outputs)
    }

    /// Forces a discrete point, numbered from 0, or lets it go. A point that does not exist is
    /// ignored.
    pub fn force_point(&mut self, side: Side, point: usize, force: Option<bool>) {
        let (data, forces) = self.side(side);
        if point < 8 * data.discrete_bytes {
            let (byte, bit) = (point / 8, 1 << (point % 8));
            set_bit(&mut forces.enabled[byte], bit, force.is_some());
            set_bit(&mut forces.values[byte], bit, force == Some(true));
        }
    }

    /// Forces an analog channel, numbered from 0, or lets it go. A channel that does not exist is
    /// ignored.
    pub fn force_channel(&mut self, side: Side, channel: usize, force: Option<u16>) {
        let (data, forces) = self.side(side);
        if channel < data.channels {
            let at = data.discrete_bytes + 2 * channel;
            let enabled = if force.is_some() { 0xFF } else { 0 };
            forces.enabled[at..at + 2].fill(enabled);
            forces.values[at..at + 2].copy_from_slice(&force.unwrap_or(0).to_le_bytes());
        }
    }

    fn side(&mut self, side: Side) -> (StationData, &mut Forces) {
        match side {
            Side::Inputs => (self.inputs, &mut self.input_forces),
            Side::Outputs => (self.outputs, &mut self.output_forces),
        }
    }

    fn is_forced(&self) -> bool {
        self.input_forces.enabled.iter().chain(&self.output_forces.enabled).any(|&byte| byte != 0)
    }
}

fn set_bit(byte: &mut u8, bit: u8, on: bool) {
    *byte = if on { *byte | bit } else { *byte & !bit };
}

/// The answer to a Read I/O Forces: the number of the requested table, then the table.
fn read_forces(inputs: &Forces, outputs: &Forces, datagram: &Datagram) -> Option<Datagram> {
    if !datagram.is(subfunction::READ_IO_FORCES) {
        return None;
    }
    let &number = datagram.data.first()?;
    let table = [&inputs.enabled, &outputs.enabled, &inputs.values, &outputs.values];
    let table = table.get(usize::from(number))?;
    let data: Vec<u8> = [number].into_iter().chain(table.iter().copied()).collect();
    Some(Datagram::standard(subfunction::READ_IO_FORCES_REPLY, data))
}

impl Device for BusInterfaceUnit {
    fn address(&self) -> Option<u8> {
        Some(self.station.number)
    }

    fn rate(&self) -> BusTiming {
        self.station.rate
    }

    fn next_due_us(&self) -> Option<u64> {
        None
    }

    fn advance_to(&mut self, _now_us: u64) {}

    fn take_turn(&mut self, _now_us: u64, background_free: bool) -> Vec<Message> {
        let inputs = self.input_forces.applied_to(&self.station.inputs);
        self.station.take_turn(background_free, inputs)
    }

    fn end_turn(&mut self, _now_us: u64, _messages: &[Message], _arrived: &[bool]) {
        self.station.end_turn();
    }

    fn receive(&mut self, _now_us: u64, from: u8, message: &Message) -> bool {
        let forced = self.is_forced();
        let (inputs, outputs) = (&self.input_forces, &self.output_forces);
        self.station
            .receive(from, message, forced, |datagram| read_forces(inputs, outputs, datagram))
    }

    fn suffer(&mut self, _now_us: u64, fault: DeviceFault) {
        if let DeviceFault::ChangeAddress(address) = fault {
            self.station.number = address;
        }
    }
}
