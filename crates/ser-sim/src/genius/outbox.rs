//! Messages other than control data, on their way from a device to the bus.

use std::collections::VecDeque;

use super::datagram::MessagePriority;
use super::device::Message;

/// What a device has to say besides its control data. `T` tells the owner why the message was sent.
#[derive(Clone, Debug)]
pub(super) struct Outbox<T> {
    waiting: VecDeque<(MessagePriority, Message, T)>,
    /// The reason for the message that goes out in the present turn.
    sending: Option<T>,
}

impl<T> Default for Outbox<T> {
    fn default() -> Self {
        Outbox { waiting: VecDeque::new(), sending: None }
    }
}

impl<T> Outbox<T> {
    pub(super) fn push(&mut self, priority: MessagePriority, message: Message, reason: T) {
        self.waiting.push_back((priority, message, reason));
    }

    pub(super) fn len(&self) -> usize {
        self.waiting.len()
    }

    /// The message for this turn: at most one. One of normal priority is sent only when the scan
    /// has had none yet.
    pub(super) fn take(&mut self, background_free: bool) -> Option<Message> {
        let high =
            self.waiting.iter().position(|(priority, ..)| *priority == MessagePriority::High);
        let index = high.or((background_free && !self.waiting.is_empty()).then_some(0))?;
        let (_, message, reason) = self.waiting.remove(index)?;
        self.sending = Some(reason);
        Some(message)
    }

    /// Why the message of this turn was sent, if there was one.
    pub(super) fn sent(&mut self) -> Option<T> {
        self.sending.take()
    }

    pub(super) fn remove(&mut self, mut unwanted: impl FnMut(&T) -> bool) {
        self.waiting.retain(|(_, _, reason)| !unwanted(reason));
    }

    pub(super) fn contains(&self, mut wanted: impl FnMut(&T) -> bool) -> bool {
        self.sending.iter().chain(self.waiting.iter().map(|(_, _, reason)| reason)).any(&mut wanted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn high_priority_goes_first_and_normal_priority_waits_for_its_place() {
        let mut outbox = Outbox::default();
        for (to, priority) in
            [(1, MessagePriority::Normal), (2, MessagePriority::High), (3, MessagePriority::Normal)]
        {
            outbox.push(priority, Message::AssignController { to }, to);
        }
        let mut turn = |background_free| {
            let message = outbox.take(background_free);
            (message.is_some(), outbox.sent())
        };
        assert_eq!(turn(true), (true, Some(2)));
        assert_eq!(turn(false), (false, None));
        assert_eq!(turn(true), (true, Some(1)));
        assert_eq!(turn(true), (true, Some(3)));
        assert_eq!(turn(true), (false, None));
    }
}
