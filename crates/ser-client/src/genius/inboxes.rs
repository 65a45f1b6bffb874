//! Received messages of recorders, sorted by sender.

use std::collections::{BTreeMap, VecDeque};

use geni_board::ReceivedDatagram;
use ser_proto::genius::{FUNCTION_HORNER, SUBFUNCTION_SER};

/// Most messages in one inbox; beyond that the oldest are dropped.
const CAPACITY: usize = 1024;

/// One inbox for every sender.
#[derive(Debug, Default)]
pub(super) struct Inboxes {
    boxes: BTreeMap<u8, VecDeque<ReceivedDatagram>>,
    dropped: u64,
    ignored: u64,
}

impl Inboxes {
    /// Keeps a recorder's message to this host. Broadcasts and other datagrams answer nobody here,
    /// so they are only counted.
    pub(super) fn put(&mut self, received: ReceivedDatagram) {
        let of_recorder =
            (received.function, received.subfunction) == (FUNCTION_HORNER, SUBFUNCTION_SER);
        if received.broadcast || !of_recorder {
            self.ignored += 1;
            return;
        }
        let inbox = self.boxes.entry(received.source).or_default();
        if inbox.len() == CAPACITY {
            inbox.pop_front();
            self.dropped += 1;
        }
        inbox.push_back(received);
    }

    /// Takes the oldest message of a device.
    pub(super) fn take(&mut self, node: u8) -> Option<ReceivedDatagram> {
        self.boxes.get_mut(&node)?.pop_front()
    }

    /// Takes the oldest message of a device whose data `fits` accepts; the others stay.
    pub(super) fn take_if(
        &mut self,
        node: u8,
        fits: impl Fn(&[u8]) -> bool,
    ) -> Option<ReceivedDatagram> {
        let inbox = self.boxes.get_mut(&node)?;
        let place = inbox.iter().position(|received| fits(&received.data))?;
        inbox.remove(place)
    }

    /// Empties all inboxes.
    pub(super) fn throw_away(&mut self) {
        let thrown_away: usize = self.boxes.values().map(VecDeque::len).sum();
        self.boxes.clear();
        self.dropped += thrown_away as u64;
    }

    /// How many datagrams were not a message to this host, and how many messages were dropped.
    pub(super) const fn lost(&self) -> (u64, u64) {
        (self.ignored, self.dropped)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn received(source: u8, broadcast: bool, subfunction: u8, data: u8) -> ReceivedDatagram {
        let data = geni_board::Data::from_slice(&[data]).unwrap();
        ReceivedDatagram {
            source,
            function: FUNCTION_HORNER,
            subfunction,
            broadcast,
            arrived_ms: None,
            data,
        }
    }

    #[test]
    fn messages_wait_in_the_box_of_their_sender() {
        let mut inboxes = Inboxes::default();
        inboxes.put(received(5, false, SUBFUNCTION_SER, 1));
        inboxes.put(received(6, false, SUBFUNCTION_SER, 2));
        inboxes.put(received(5, true, SUBFUNCTION_SER, 3));
        inboxes.put(received(5, false, 0x51, 4));
        inboxes.put(received(5, false, SUBFUNCTION_SER, 5));
        let data = |received: Option<ReceivedDatagram>| received.map(|received| received.data[0]);
        let taken = [5, 5, 5, 6, 7].map(|node| data(inboxes.take(node)));
        assert_eq!(taken, [Some(1), Some(5), None, Some(2), None]);
        assert_eq!(inboxes.lost(), (2, 0));
    }

    #[test]
    fn one_kind_of_message_is_taken_from_among_others() {
        let mut inboxes = Inboxes::default();
        for data in [1, 2, 3, 2] {
            inboxes.put(received(5, false, SUBFUNCTION_SER, data));
        }
        let taken = inboxes.take_if(5, |data| data == [2]).map(|received| received.data[0]);
        assert_eq!((taken, inboxes.take_if(5, |data| data == [4])), (Some(2), None));
        let left = [5; 4].map(|node| inboxes.take(node).map(|received| received.data[0]));
        assert_eq!(left, [Some(1), Some(3), Some(2), None]);
        assert_eq!(inboxes.take_if(9, |_| true), None);
    }

    #[test]
    fn a_box_that_nobody_empties_keeps_the_newest() {
        let mut inboxes = Inboxes::default();
        for _ in 0..=CAPACITY {
            inboxes.put(received(5, false, SUBFUNCTION_SER, 0));
        }
        assert_eq!(inboxes.lost(), (0, 1));
    }

    #[test]
    fn what_is_thrown_away_is_counted() {
        let mut inboxes = Inboxes::default();
        for source in [5, 5, 9] {
            inboxes.put(received(source, false, SUBFUNCTION_SER, 0));
        }
        inboxes.throw_away();
        assert!(inboxes.take(5).is_none() && inboxes.take(9).is_none());
        assert_eq!(inboxes.lost(), (0, 3));
    }
}
