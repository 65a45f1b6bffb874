//! Which of the devices on a bus are recorders.
//!
//! A recorder is behind a GENI board, and so may other things be; what the bus tells of a device
//! does not say which. So every device that sends as much as a recorder does, and takes nothing, is
//! asked a question that only recorders answer: what they heard last by broadcast (`L`, which
//! original recorders answer, too, and which changes nothing). What came out is remembered until
//! the device logs in anew.

use std::time::Duration;

use geni_board::{BlockKind, Destination};
use ser_proto::Command;
use ser_proto::genius::GlobalData;

use super::host::{BusDevice, GeniHost, Host, PACE, ser_message};
use crate::session::options::Options;
use crate::transport::genius_error::GeniusError;

/// The question that only recorders answer. [`Answers`](super::answers::Answers) knows the answer.
const QUESTION: Command = Command::LastBroadcast;

/// How recorders are told from other devices with as many inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Recognition {
    /// They are asked, all at the same time and each once for each log-in. A device that does not
    /// answer in time is asked again, as often as the options say.
    Asking(Options),
    /// By the model number that their GENI boards have. Nobody is asked.
    ModelNumber(u8),
}

/// The recorders on a bus.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BusRecorders {
    /// Their numbers and inputs, all of the same bus scan.
    pub recorders: Vec<(u8, GlobalData)>,
    /// Numbers of devices that send as much as a recorder does, and did not answer. Such a device
    /// is something else, or a recorder that hangs.
    pub silent: Vec<u8>,
}

impl BusDevice {
    /// What its inputs would be if it were a recorder; `None` when it cannot be one: a recorder
    /// sends 2 or 4 bytes in every scan, and takes nothing.
    #[must_use]
    pub fn candidate_inputs(&self) -> Option<GlobalData> {
        let sends_only = self.device.output_len == 0
            && matches!(self.device.kind, BlockKind::Inputs | BlockKind::Unknown);
        GlobalData::parse(&self.inputs).ok().filter(|_| sends_only)
    }
}

impl GeniHost {
    /// The recorders that are logged in. While devices come and go this waits as
    /// [`devices`](Self::devices) does; asking takes as long as the options say where somebody does
    /// not answer.
    ///
    /// # Errors
    /// When the board fails.
    pub fn recorders(&self, how: Recognition) -> Result<BusRecorders, GeniusError> {
        let mut devices = self.devices()?;
        if let Recognition::Asking(options) = how
            && self.ask(&devices, options)?
        {
            // Asking takes its time; the inputs have to be those of now.
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

    /// Asks those that have not been asked since they logged in; says whether there were any.
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
                    // It is gone, or the bus has damaged the question: it stays unknown.
                    Err(GeniusError::Undelivered(_) | GeniusError::NotOnBus { .. }) => {}
                    Err(error) => return Err(error),
                }
            }
            self.wait_for_answers(&mut unknown, options.timeout)?;
        }
        // Who has not even heard the question is asked again the next time.
        let mut host = self.lock();
        for node in unknown.into_iter().filter(|node| !unheard.contains(node)) {
            host.answers.was_silent(node);
        }
        Ok(any)
    }

    /// Waits until nobody is unknown any more, or until the time is over.
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
            // Without the lock, so that recorders can be spoken to meanwhile.
            self.clock.wait(PACE);
        }
    }
}

impl Host {
    /// Looks at the board, and strikes those out that have answered.
    fn collect_answers(&mut self, unknown: &mut Vec<u8>) -> Result<(), GeniusError> {
        self.look()?;
        unknown.iter().for_each(|&node| self.answers.collect(node, &mut self.inboxes));
        unknown.retain(|&node| !self.answers.knows(node));
        Ok(())
    }
}
