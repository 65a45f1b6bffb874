//! The answers of devices on a bus to the question that only recorders answer. An answer is valid
//! until the device logs in or out.

use std::collections::BTreeMap;

use ser_proto::Reply;

use super::inboxes::Inboxes;

/// The answers of devices, each since it logged in.
#[derive(Debug, Default)]
pub(super) struct Answers {
    /// By bus address; `false` for a device that was asked and did not answer.
    is_recorder: BTreeMap<u8, bool>,
}

impl Answers {
    /// Forgets a device that has logged in or out, because it may be another one.
    pub(super) fn forget(&mut self, node: u8) {
        self.is_recorder.remove(&node);
    }

    pub(super) fn forget_all(&mut self) {
        self.is_recorder.clear();
    }

    /// Takes the answer of a device from its inbox, if it is there.
    pub(super) fn collect(&mut self, node: u8, inboxes: &mut Inboxes) {
        let answers = |body: &[u8]| matches!(Reply::parse(body), Ok(Reply::LastBroadcast(_)));
        if inboxes.take_if(node, answers).is_some() {
            self.is_recorder.insert(node, true);
        }
    }

    /// Notes that the device was asked and did not answer.
    pub(super) fn was_silent(&mut self, node: u8) {
        self.is_recorder.insert(node, false);
    }

    /// Whether the device was asked and has answered, or had its time to.
    pub(super) fn knows(&self, node: u8) -> bool {
        self.is_recorder.contains_key(&node)
    }

    /// Whether the device has answered as recorders do.
    pub(super) fn is_recorder(&self, node: u8) -> bool {
        self.is_recorder.get(&node) == Some(&true)
    }
}
