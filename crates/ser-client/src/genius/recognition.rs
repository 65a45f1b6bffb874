//! Finds the recorders among the devices on a bus.
//!
//! A recorder is behind a GENI board, and so are other devices; the bus does not tell which is
//! which. So every device that sends as much as a recorder and receives nothing is asked a question
//! that only recorders answer: their last broadcast (`L`). Original recorders answer it, too, and
//! it changes nothing. The result is remembered until the device logs in again.

use std::time::Duration;

use geni_board::{BlockKind, Destination};
use ser_proto::Command;
use ser_proto::genius::GlobalData;

use super::host::{BusDevice, GeniHost, Host, PACE, ser_message};
use crate::session::options::Options;
use crate::transport::genius_error::GeniusError;

/// The question that only recorders answer. [`Answers`](super::answers::Answers) recognises the
/// answer.
const QUESTION: Command = Command::LastBroadcast;

/// How recorders are told from other devices with as many inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Recognition {
    /// The devices are asked, all at the same time and each once after each log-in. A device that
    /// does not answer in time is asked again, as often as the options say.
    Asking(Options),
    /// By the model number of their GENI boards. No device is asked.
    ModelNumber(u8),
}

/// The recorders on a bus.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BusRecorders {
    /// Their bus addresses and inputs, all from the same bus scan.
    pub recorders: Vec<(u8, GlobalData)>,
    /// Bus addresses of devices that send as much as a recorder but did not answer. Such a device
    /// is something else, or a recorder that hangs.
    pub silent: Vec<u8>,
}

impl BusDevice {
    /// Its inputs as a recorder's; `None` when it cannot be a recorder, which sends 2 or 4 bytes in
    /// every scan and receives nothing.
    #[must_use]
    pub fn candidate_inputs(&self) -> Option<GlobalData> {
        let sends_only = self.device.output_len == 0
            && matches!(self.device.kind, BlockKind::Inputs | BlockKind::Unknown);
        GlobalData::parse(&self.inputs).ok().filter(|_| sends_only)
    }
}

impl GeniHost {
    /// The recorders that are logged in. While devices come and go this waits as
    /// [`devices`](Self::devices) does. If a device does not answer, asking takes as long as the
    /// options allow.
    ///
    /// # Errors
    /// When the board fails.
    pub fn recorders(&self, how: Recognition) -> Result<BusRecorders, GeniusError> {
        let mut devices = self.devices()?;
        if let Recognition::Asking(options) = how
            && self.ask(&devices, options)?
        {
            // Asking takes time, and the inputs must be the present ones.
            devices = self.devices()?;
        }
        let host = self.lock();
        let mut found = BusRecorders::default();
        for device in &devices {
            let Some(inputs) = device.candidate_inputs() else { continue };
            let is_recorder = match how {
                Recognition::ModelNumber(model) if device.device.model == model => true,
                Recognition::ModelNumber(_) => continue,
                Recognition::Asking(_) => host.answers.is_recorder(device.number),
            };
            if is_recorder {
                found.recorders.push((device.number, inputs));
            } else {
                found.silent.push(device.number);
            }
        }
        Ok(found)
    }

    /// Asks the devices that have not been asked since they logged in. Returns whether there were
    /// any.
    fn ask(&self, devices: &[BusDevice], options: Options) -> Result<bool, GeniusError> {
        let candidates = devices.iter().filter(|device| device.candidate_inputs().is_some());
        let mut unknown: Vec<u8> = candidates.map(|device| device.number).collect();
        unknown.retain(|&node| !self.lock().answers.knows(node));
        let any = !unknown.is_empty();
        let mut unheard = unknown.clone();
        for _ in 0..=options.retries {
            if unknown.is_empty() {
                break;
            }
            for &node in &unknown {
                match self.lock().deliver(ser_message(Destination::Device(node), &QUESTION)?) {
                    Ok(()) => unheard.retain(|&other| other != node),
                    // The device is gone, or the bus has damaged the question; the device stays
                    // unknown.
                    Err(GeniusError::Undelivered(_) | GeniusError::NotOnBus { .. }) => {}
                    Err(error) => return Err(error),
                }
            }
            self.wait_for_answers(&mut unknown, options.timeout)?;
        }
        // A device that did not receive the question is asked again the next time.
        let mut host = self.lock();
        for node in unknown.into_iter().filter(|node| !unheard.contains(node)) {
            host.answers.was_silent(node);
        }
        Ok(any)
    }

    /// Waits until no device is unknown, or until the time is over.
    fn wait_for_answers(
        &self,
        unknown: &mut Vec<u8>,
        timeout: Duration,
    ) -> Result<(), GeniusError> {
        let until = self.clock.now() + timeout;
        loop {
            self.lock().collect_answers(unknown)?;
            if unknown.is_empty() || self.clock.now() >= until {
                return Ok(());
            }
            // The lock is not held here, so recorders can be used meanwhile.
            self.clock.wait(PACE);
        }
    }
}

impl Host {
    /// Polls the board and removes the devices that have answered from `unknown`.
    fn collect_answers(&mut self, unknown: &mut Vec<u8>) -> Result<(), GeniusError> {
        self.look()?;
        unknown.iter().for_each(|&node| self.answers.collect(node, &mut self.inboxes));
        unknown.retain(|&node| !self.answers.knows(node));
        Ok(())
    }
}
