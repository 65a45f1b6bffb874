//! The board's private copies of inputs and outputs, and their way to and from the shared RAM
//! (chapters 8, 11 and 12).

use super::Board;
use crate::genius::map::{self, MAX_CONTROL_LEN};

type Buffer = [u8; MAX_CONTROL_LEN];

/// The tables of the bus processor. It goes on sending them while the host locks the shared tables.
pub(super) struct IoCopies {
    inputs: Vec<Option<Vec<u8>>>,
    outputs: Vec<Buffer>,
    global: Buffer,
    directed: Option<Vec<u8>>,
}

impl Default for IoCopies {
    fn default() -> Self {
        IoCopies {
            inputs: vec![None; 32],
            outputs: vec![[0; MAX_CONTROL_LEN]; 32],
            global: [0; MAX_CONTROL_LEN],
            directed: None,
        }
    }
}

impl IoCopies {
    /// Takes the inputs or global data of a device that is logged in.
    pub(super) fn set_inputs(&mut self, address: u8, data: &[u8]) {
        self.inputs[usize::from(address)] = Some(data.to_vec());
    }

    pub(super) fn set_directed(&mut self, data: &[u8]) {
        self.directed = Some(data.to_vec());
    }

    pub(super) fn outputs(&self, address: u8, len: u8) -> Vec<u8> {
        self.outputs[usize::from(address)][..usize::from(len)].to_vec()
    }

    pub(super) fn global(&self, len: u8) -> Vec<u8> {
        self.global[..usize::from(len)].to_vec()
    }

    /// Drops the inputs of a device that logged out before they reached the table.
    pub(super) fn forget_inputs(&mut self, address: u8) {
        self.inputs[usize::from(address)] = None;
    }
}

impl Board {
    /// Copies inputs to the host's tables and outputs from them, once per scan. Does nothing during
    /// a lockout.
    pub(super) fn exchange_tables(&mut self) {
        if self.live.lockout.granted {
            return;
        }
        let setup = self.live.setup;
        let copies = &mut self.live.copies;
        for (address, inputs) in (0..).zip(&mut copies.inputs) {
            if let Some(inputs) = inputs.take() {
                let len = inputs.len().min(setup.buffer_len.into());
                self.ram.write(map::input_buffer(address, setup.buffer_len), &inputs[..len]);
            }
        }
        if let Some(directed) = copies.directed.take() {
            let len = directed.len().min(setup.directed_len.into());
            self.ram.write(map::DIRECTED_IN, &directed[..len]);
        }
        let len = usize::from(setup.buffer_len);
        for (address, outputs) in (0..).zip(&mut copies.outputs) {
            outputs[..len]
                .copy_from_slice(self.ram.read(map::output_buffer(address, setup.buffer_len), len));
        }
        copies.global.copy_from_slice(self.ram.read(map::BROADCAST_OUT, MAX_CONTROL_LEN));
        self.live.log_ins.outputs_were_read();
    }
}
