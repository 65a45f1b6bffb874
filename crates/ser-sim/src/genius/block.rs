//! A discrete input/output block.

use super::device::{Device, Message};
use super::faults::DeviceFault;
use super::identity::BlockKind;
use super::scan_time::BusTiming;
use super::station::Station;

/// How many circuits a block has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Circuits {
    /// 8, one byte of data each way.
    Eight,
    /// 16, two bytes.
    Sixteen,
    /// 32, four bytes.
    ThirtyTwo,
}

impl Circuits {
    fn bytes(self) -> usize {
        match self {
            Circuits::Eight => 1,
            Circuits::Sixteen => 2,
            Circuits::ThirtyTwo => 4,
        }
    }

    /// Model numbers of common blocks of this size.
    fn model(self) -> u8 {
        match self {
            Circuits::Eight => 69,
            Circuits::Sixteen => 73,
            Circuits::ThirtyTwo => 75,
        }
    }
}

/// A block of discrete circuits. It takes no datagram of more than 16 bytes.
pub struct DiscreteBlock {
    station: Station,
    circuits: Circuits,
}

impl DiscreteBlock {
    /// A block whose circuits work as `kind` says.
    #[must_use]
    pub fn new(number: u8, rate: BusTiming, circuits: Circuits, kind: BlockKind) -> DiscreteBlock {
        let mut station = Station::new(number, rate, circuits.model(), kind);
        station.max_datagram_len = 16;
        let mut block = DiscreteBlock { station, circuits };
        block.fit_data();
        block
    }

    fn fit_data(&mut self) {
        let bytes = self.circuits.bytes();
        let len = |used: bool| if used { bytes } else { 0 };
        let Station { kind, inputs, outputs, .. } = &mut self.station;
        inputs.resize(len(matches!(kind, BlockKind::Inputs | BlockKind::Combination)), 0);
        outputs.resize(len(matches!(kind, BlockKind::Outputs | BlockKind::Combination)), 0);
    }

    /// Sets what the field side of the inputs is. Circuit 1 is bit 0.
    pub fn set_inputs(&mut self, inputs: u32) {
        let len = self.station.inputs.len();
        self.station.inputs.copy_from_slice(&inputs.to_le_bytes()[..len]);
    }

    /// What the block puts out. Circuit 1 is bit 0. All outputs are off when no controller has sent
    /// outputs for three scans.
    #[must_use]
    pub fn outputs(&self) -> u32 {
        self.station.outputs.iter().rev().fold(0, |outputs, &byte| outputs << 8 | u32::from(byte))
    }

    /// The controllers to which it reports.
    pub fn controllers(&self) -> impl Iterator<Item = u8> {
        self.station.controllers()
    }

    /// Reconfigures its circuits, as one would from a hand-held monitor.
    pub fn configure(&mut self, kind: BlockKind, reference: u16) {
        self.station.kind = kind;
        self.station.reference = reference;
        self.fit_data();
        self.station.report_configuration(false);
    }
}

impl Device for DiscreteBlock {
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
        let inputs = self.station.inputs.clone();
        self.station.take_turn(background_free, inputs)
    }

    fn end_turn(&mut self, _now_us: u64, _messages: &[Message], _arrived: &[bool]) {
        self.station.end_turn();
    }

    fn receive(&mut self, _now_us: u64, from: u8, message: &Message) -> bool {
        self.station.receive(from, message, false, |_| None)
    }

    fn suffer(&mut self, _now_us: u64, fault: DeviceFault) {
        if let DeviceFault::ChangeAddress(address) = fault {
            self.station.number = address;
        }
    }
}
