//! What all devices that are not controllers have in common: inputs to broadcast, outputs to take,
//! and a few datagrams to answer.

use std::collections::BTreeSet;

use super::datagram::{BROADCAST, Datagram, MessagePriority, subfunction};
use super::device::Message;
use super::identity::{BlockKind, Identity};
use super::outbox::Outbox;
use super::scan_time::BusTiming;

/// After this many scans without outputs a device falls back to its default outputs.
const SILENT_SCANS: u8 = 3;

pub(super) struct Station {
    pub(super) number: u8,
    pub(super) rate: BusTiming,
    pub(super) model: u8,
    pub(super) reference: u16,
    pub(super) kind: BlockKind,
    pub(super) inputs: Vec<u8>,
    pub(super) outputs: Vec<u8>,
    /// The longest datagram it understands.
    pub(super) max_datagram_len: usize,
    controllers: BTreeSet<u8>,
    silent_scans: u8,
    outbox: Outbox<()>,
}

impl Station {
    pub(super) fn new(number: u8, rate: BusTiming, model: u8, kind: BlockKind) -> Station {
        Station {
            number,
            rate,
            model,
            reference: 0,
            kind,
            inputs: Vec::new(),
            outputs: Vec::new(),
            max_datagram_len: 128,
            controllers: BTreeSet::new(),
            silent_scans: 0,
            outbox: Outbox::default(),
        }
    }

    pub(super) fn identity(&self, forced: bool) -> Identity {
        let len = |data: &[u8]| u8::try_from(data.len()).unwrap_or(u8::MAX);
        Identity {
            input_len: len(&self.inputs),
            output_len: len(&self.outputs),
            kind: self.kind,
            forced,
            monitor: false,
            reference: self.reference,
            revision: 0x10,
            controller: self.controllers.first().copied().unwrap_or(0xFF),
            model: self.model,
            rate: self.rate,
        }
    }

    pub(super) fn controllers(&self) -> impl Iterator<Item = u8> {
        self.controllers.iter().copied()
    }

    pub(super) fn adopt_controllers(&mut self, other: &Station) {
        self.controllers.clone_from(&other.controllers);
    }

    /// Takes its turn, with these inputs.
    pub(super) fn take_turn(&mut self, background_free: bool, inputs: Vec<u8>) -> Vec<Message> {
        self.silent_scans = self.silent_scans.saturating_add(1);
        if self.silent_scans > SILENT_SCANS {
            self.outputs.fill(0);
        }
        let background = self.outbox.take(background_free);
        background.into_iter().chain([Message::Control(inputs)]).collect()
    }

    pub(super) fn end_turn(&mut self) {
        self.outbox.sent();
    }

    /// Hears a message. `answer` knows the datagrams that only this kind of device answers.
    pub(super) fn receive(
        &mut self,
        from: u8,
        message: &Message,
        forced: bool,
        answer: impl FnOnce(&Datagram) -> Option<Datagram>,
    ) -> bool {
        let for_us = message.to().is_none_or(|to| to == self.number);
        match message {
            _ if !for_us => return false,
            Message::Control(_) => return false,
            Message::Directed { data, .. } => {
                let len = data.len().min(self.outputs.len());
                self.outputs[..len].copy_from_slice(&data[..len]);
                self.silent_scans = 0;
            }
            Message::AssignController { .. } => {
                self.controllers.insert(from);
            }
            Message::Datagram { datagram, .. } if datagram.data.len() > self.max_datagram_len => {
                return false;
            }
            Message::Datagram { to, datagram } => {
                let reply = if datagram.is(subfunction::READ_ID) {
                    let identity = self.identity(forced).to_bytes();
                    Some(Datagram::standard(subfunction::READ_ID_REPLY, identity))
                } else {
                    answer(datagram).filter(|_| *to != BROADCAST)
                };
                if let Some(datagram) = reply {
                    self.say(from, datagram);
                }
            }
        }
        true
    }

    /// Tells its controllers that it was reconfigured.
    ///
    /// The content of that datagram is not published. Here the device says what it would say to a
    /// Read ID.
    pub(super) fn report_configuration(&mut self, forced: bool) {
        let identity = self.identity(forced).to_bytes();
        for to in self.controllers.clone() {
            self.say(to, Datagram::standard(subfunction::CONFIGURATION_CHANGE, identity));
        }
    }

    fn say(&mut self, to: u8, datagram: Datagram) {
        self.outbox.push(MessagePriority::Normal, Message::Datagram { to, datagram }, ());
    }
}
