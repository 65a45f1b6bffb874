//! What the ring shows of the log: whether it is full, and so whether it was erased or resized.
//!
//! A full ring holds the last `size` events, so its size says which event an entry is. A ring that
//! is not full holds every event since the erase, unless it was made larger.

use super::footing::Footing;
use super::growth::Growth;
use super::head::{BASE, low_16};
use super::progress::Progress;
use crate::reading::cursor::Cursor;
use crate::reading::delivery::Delivery;
use crate::reading::disturbed::Disturbed;
use crate::reading::read_request::ReadRequest;
use ser_proto::MAX_ENTRIES;

/// Totals are shown modulo this.
const TOTAL_WRAPS_AT: u64 = 1 << 16;

impl Progress {
    /// Takes the reply to a probe: `entries` of the probed slots hold an entry.
    pub(super) fn probed(
        &mut self,
        request: ReadRequest,
        entries: usize,
        on: &mut dyn FnMut(Delivery),
    ) -> Result<(), Disturbed> {
        if self.growth == Growth::Asking {
            return match self.growth.answered(request, entries, self.head)? {
                false => Ok(()),
                true if self.footing == Footing::Unknown => self.count(self.head.slot, on),
                true => self.not_full(on),
            };
        }
        if entries > 1 {
            return Err(Disturbed::WrongSize);
        }
        let is_full = entries == 1;
        if self.footing != Footing::Unknown {
            return if is_full { self.full(on) } else { self.not_full(on) };
        }
        if is_full {
            self.count(self.head.size, on)
        } else if self.growth.explains(self.head) {
            self.count(self.head.slot, on)
        } else {
            Ok(())
        }
    }

    /// The log is full: the ring has the size that was given.
    fn full(&mut self, on: &mut dyn FnMut(Delivery)) -> Result<(), Disturbed> {
        let size = self.head.size;
        if self.footing == Footing::Unconfirmed || self.overrun.is_on() {
            self.footing = Footing::RingSize;
            self.deliver_past_gaps(on);
            if self.behind() < size || self.next >= self.target || self.overrun.is_on() {
                return Ok(());
            }
            self.overrun.widen_margin(self.head.happened);
        } else if self.behind() < size {
            // The probe was made while the reading was overrun, which is over.
            return Ok(());
        } else if self.overrun.is_fast() && (self.checked || self.keeps_up) {
            // Nothing was lost a moment ago, and events still come faster than they are read.
            self.overrun.widen_margin(self.overrun.pace);
        }
        // What was read ahead can no longer be proven, because it may be from a log that is gone.
        self.forget_read_ahead();
        self.skip_to(self.head.oldest() + self.overrun.margin.min(size / 2));
        self.footing = Footing::RingSize;
        Ok(())
    }

    /// The log is not full: entries 1 … next slot exist, and no others.
    pub(super) fn not_full(&mut self, on: &mut dyn FnMut(Delivery)) -> Result<(), Disturbed> {
        let held = self.head.slot;
        let behind = self.behind();
        // Nothing has been discarded since the erase, so the anchor would be there.
        let is_anchored = self.footing.is_anchor();
        if self.head.holds_all() && (is_anchored || behind > held) {
            self.restart();
            return Ok(());
        }
        if held == 0 {
            return Err(Disturbed::WrongSize);
        }
        let all_there = self.footing == Footing::Unconfirmed && behind <= held;
        if !all_there {
            self.ahead.clear();
        }
        if !self.growth.explains(self.head) {
            return Ok(());
        }
        self.footing = Footing::RingSize;
        if all_there {
            self.deliver(on);
            return Ok(());
        }
        // The ring is larger than before, and what did not fit the smaller ring is gone.
        self.skip_to(self.next.max(self.head.total - held));
        Ok(())
    }

    /// Begins a log of which only the number of entries is known.
    fn count(&mut self, held: u64, on: &mut dyn FnMut(Delivery)) -> Result<(), Disturbed> {
        let shown = u64::from(low_16(self.head.total));
        if held == 0 && shown != 0 {
            return Err(Disturbed::WrongSize);
        }
        // Only the total is known of a log that is seen for the first time. If it is less than the
        // number of entries, it has wrapped.
        let total = BASE + if shown < held { shown + TOTAL_WRAPS_AT } else { shown };
        self.head.total = total;
        self.next = total - held;
        self.target = total;
        self.is_exact = held < self.head.size && shown == held;
        self.losses.log_begun(self.next - BASE);
        self.footing = Footing::RingSize;
        if held == 0 {
            self.losses.deliver(self.cursor, on);
            let sequence = total - BASE;
            self.cursor = Some(Cursor { sequence, is_exact: self.is_exact, anchor: None });
        }
        Ok(())
    }

    /// Begins anew, because the log is not the one that was read last. It is read from its
    /// beginning.
    pub(super) fn restart(&mut self) {
        self.losses.log_restarted(self.cursor.is_some());
        self.footing = Footing::Unknown;
        self.is_exact = false;
        self.overrun.restart();
        self.forget_read_ahead();
        self.most = MAX_ENTRIES as u64;
        self.outstanding.abandon();
        self.next = self.head.total;
    }
}
