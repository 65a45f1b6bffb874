//! Finds out when datagrams arrived.
//!
//! A datagram may have arrived long before it can be read. The command block carries out one
//! command at a time, and a datagram that is being sent waits for its place in the scan.
//!
//! A host sees two signs of an arrival: the Receive-Queue flag, and the pulse of the interrupt
//! line. A *notice* is the tick of such a sign. The board hands datagrams out in the order of their
//! arrival, so the oldest notice belongs to the datagram that is read next. The two do not match in
//! four cases:
//!
//! - **Two datagrams, one flag.** Both came between two looks at the flag, so there is one notice
//!   less than there are datagrams. A datagram without a notice gets the notice of the one before
//!   it. That need not be the second of the two: if notices of later datagrams are waiting, each
//!   datagram takes the next one's, and the last of them has none. With the interrupt line each
//!   datagram has its own pulse, and this does not happen.
//! - **A flag, but no datagram.** The board has dropped the datagram. When the board reports an
//!   empty queue, all notices from before the question are void.
//! - **A datagram, but no flag.** The datagram came before the first look at the board, or its flag
//!   was lost. Its arrival is unknown, and it is handed out without a time. If a later datagram's
//!   notice waits, it takes that one instead.
//! - **The board has failed.** Its queue is gone, and so are the notices.

use heapless::Deque;

use crate::elapsed::elapsed_ms;

/// The most notices that wait. The board's queue holds 15 datagrams, and one more may be in the
/// read buffer. Beyond that the oldest notices no longer have a datagram.
const MAX_NOTICES: usize = 16;

/// Notices of datagrams that have not been read.
#[derive(Debug)]
pub(super) struct Arrivals {
    notices: Deque<u32, MAX_NOTICES>,
    /// How many of them existed when the latest Read Datagram was started.
    before_read: usize,
    /// Pulses of the interrupt line since the last look at the flag.
    pulses: Deque<u32, MAX_NOTICES>,
    /// The tick at which the flag was seen, while its pulse has not been handed in.
    awaits_pulse: Option<u32>,
    /// The tick at which the flag was last seen set.
    seen_ms: Option<u32>,
    /// The arrival of the datagram that was read last. It is kept while there may be others that
    /// came with it.
    latest: Option<u32>,
}

impl Arrivals {
    pub(super) const fn new() -> Arrivals {
        Arrivals {
            notices: Deque::new(),
            before_read: 0,
            pulses: Deque::new(),
            awaits_pulse: None,
            seen_ms: None,
            latest: None,
        }
    }

    /// Hands in a pulse of the line at this tick, which was for a datagram and nothing else.
    pub(super) fn pulsed(&mut self, tick_ms: u32) {
        // A flag seen just before its pulse was handed in already has its notice. The pulse has the
        // more precise tick.
        if let Some(seen_ms) = self.awaits_pulse.take()
            && elapsed_ms(tick_ms, seen_ms) <= 1
        {
            self.notices.back_mut().into_iter().for_each(|notice| *notice = tick_ms);
            return;
        }
        // The board takes no more datagrams than this between two looks, so the push does not fail.
        let _ = self.pulses.push_back(tick_ms);
    }

    /// Takes note of a look at the Receive-Queue flag, which was cleared if it was set.
    pub(super) fn looked(&mut self, is_set: bool, now_ms: u32) {
        // A pulse that has not been handed in by now does not belong to that flag.
        self.awaits_pulse = self.awaits_pulse.filter(|&seen_ms| elapsed_ms(now_ms, seen_ms) <= 1);
        if !is_set {
            while let Some(tick_ms) = self.pulses.pop_front() {
                // The pulse came after the other pulses were handed in and right before the look
                // that cleared its flag. Any other pulse without a flag means no datagram, for
                // instance the one after a reset.
                if self.seen_ms.is_some_and(|seen_ms| elapsed_ms(tick_ms, seen_ms) <= 1) {
                    self.notice(tick_ms);
                }
            }
            return;
        }
        self.seen_ms = Some(now_ms);
        if self.pulses.is_empty() {
            self.awaits_pulse = Some(now_ms);
            self.notice(now_ms);
        }
        while let Some(tick_ms) = self.pulses.pop_front() {
            self.notice(tick_ms);
        }
    }

    fn notice(&mut self, tick_ms: u32) {
        if self.notices.is_full() {
            self.notices.pop_front();
            self.before_read = self.before_read.saturating_sub(1);
        }
        let _ = self.notices.push_back(tick_ms);
    }

    /// Takes note that a Read Datagram is started.
    pub(super) fn read_started(&mut self) {
        self.before_read = self.notices.len();
    }

    /// Takes note that it fetched a datagram, and returns its arrival if known. The datagram may
    /// have come while the command was carried out, so the flag must have been looked at since.
    pub(super) fn read(&mut self) -> Option<u32> {
        self.latest = self.notices.pop_front().or(self.latest);
        self.latest
    }

    /// Takes note that it found the queue empty.
    pub(super) fn found_empty(&mut self) {
        for _ in 0..self.before_read {
            self.notices.pop_front();
        }
        self.before_read = 0;
        self.latest = None;
    }

    /// The arrival of the oldest datagram that is known to wait.
    pub(super) fn oldest(&self) -> Option<u32> {
        self.notices.front().or(self.pulses.front()).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Arrivals after looks that found the flag set at these ticks.
    fn seen(ticks_ms: impl IntoIterator<Item = u32>) -> Arrivals {
        let mut arrivals = Arrivals::new();
        ticks_ms.into_iter().for_each(|tick_ms| arrivals.looked(true, tick_ms));
        arrivals
    }

    fn read_all(arrivals: &mut Arrivals, count: usize) -> Vec<Option<u32>> {
        (0..count)
            .map(|_| {
                arrivals.read_started();
                arrivals.read()
            })
            .collect()
    }

    #[test]
    fn each_datagram_has_the_tick_of_its_flag_however_late_it_is_read() {
        let mut arrivals = seen([10, 13, 900]);
        assert_eq!(arrivals.oldest(), Some(10));
        assert_eq!(read_all(&mut arrivals, 3), [Some(10), Some(13), Some(900)]);
        assert_eq!(arrivals.oldest(), None);
    }

    #[test]
    fn two_datagrams_that_share_a_flag_both_have_its_tick() {
        let mut arrivals = seen([10]);
        assert_eq!(read_all(&mut arrivals, 2), [Some(10), Some(10)]);
        // The board reports that its queue is empty. A datagram read after that was not seen to
        // come.
        arrivals.read_started();
        arrivals.found_empty();
        assert_eq!(read_all(&mut arrivals, 1), [None]);
    }

    #[test]
    fn a_flag_whose_datagram_is_gone_is_not_taken_for_the_next_one() {
        let mut arrivals = seen([10]);
        arrivals.read_started();
        // Another datagram arrives meanwhile. The board answered before that.
        arrivals.looked(true, 20);
        arrivals.found_empty();
        assert_eq!(read_all(&mut arrivals, 1), [Some(20)]);
    }

    #[test]
    fn more_flags_than_the_board_can_have_datagrams_for_leave_the_latest() {
        let mut arrivals = seen(1..=20);
        assert_eq!(read_all(&mut arrivals, 1), [Some(5)]);
        arrivals.read_started();
        (21..=40).for_each(|tick_ms| arrivals.looked(true, tick_ms));
        // None of the earlier notices is left.
        arrivals.found_empty();
        assert_eq!(read_all(&mut arrivals, 1), [Some(25)]);
    }

    #[test]
    fn with_the_interrupt_line_two_datagrams_between_two_looks_have_their_own_ticks() {
        let mut arrivals = Arrivals::new();
        arrivals.pulsed(103);
        arrivals.pulsed(407);
        assert_eq!(arrivals.oldest(), Some(103));
        arrivals.looked(true, 500);
        assert_eq!(read_all(&mut arrivals, 2), [Some(103), Some(407)]);
    }

    #[test]
    fn a_pulse_that_is_handed_in_after_its_flag_was_seen_counts_once() {
        let mut arrivals = seen([100]);
        arrivals.pulsed(100);
        arrivals.pulsed(103);
        arrivals.looked(true, 104);
        assert_eq!(read_all(&mut arrivals, 2), [Some(100), Some(103)]);
        // A much later pulse belongs to another datagram.
        arrivals.looked(true, 200);
        arrivals.pulsed(203);
        arrivals.looked(true, 204);
        assert_eq!(read_all(&mut arrivals, 2), [Some(200), Some(203)]);
    }

    #[test]
    fn a_flag_that_is_seen_before_its_pulse_is_handed_in_gets_the_tick_of_the_pulse() {
        // The pulse comes between the handing in and the reading of the tick, or right after that.
        for (seen_ms, pulsed_ms) in
            [(101, 100), (100, 101), (100, 100), (0, u32::MAX), (u32::MAX, 0)]
        {
            let mut arrivals = seen([seen_ms]);
            arrivals.pulsed(pulsed_ms);
            assert_eq!(arrivals.oldest(), Some(pulsed_ms));
            arrivals.looked(false, seen_ms.wrapping_add(2));
            assert_eq!(read_all(&mut arrivals, 2), [Some(pulsed_ms), Some(pulsed_ms)]);
        }
    }

    #[test]
    fn a_pulse_whose_datagram_has_been_read_changes_no_other_ones_notice() {
        let mut arrivals = seen([100]);
        assert_eq!(read_all(&mut arrivals, 1), [Some(100)]);
        arrivals.pulsed(101);
        assert_eq!(arrivals.oldest(), None);
        arrivals.looked(true, 200);
        assert_eq!(read_all(&mut arrivals, 1), [Some(200)]);
    }

    #[test]
    fn a_pulse_whose_flag_went_with_that_of_an_earlier_one_has_its_own_tick() {
        let mut arrivals = Arrivals::new();
        // The first pulse is handed in. The second falls right before the look that clears their
        // flag.
        arrivals.pulsed(236);
        arrivals.looked(true, 626);
        arrivals.pulsed(626);
        arrivals.looked(false, 627);
        assert_eq!(read_all(&mut arrivals, 2), [Some(236), Some(626)]);
    }

    #[test]
    fn a_pulse_without_a_flag_is_no_datagram() {
        let mut arrivals = Arrivals::new();
        arrivals.pulsed(50);
        arrivals.looked(false, 50);
        assert_eq!(arrivals.oldest(), None);
        arrivals.looked(true, 90);
        assert_eq!(read_all(&mut arrivals, 1), [Some(90)]);
    }
}
