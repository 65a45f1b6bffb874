//! Handling a reply with events: which events its entries are, and whether they may be delivered.

use super::footing::Footing;
use super::growth::Growth;
use super::outstanding::{Asked, Purpose};
use super::progress::{Batch, Progress};
use crate::reading::delivery::Delivery;
use crate::reading::disturbed::Disturbed;
use crate::reading::read_request::ReadRequest;

/// What a reply shows of the anchor.
enum AnchorSeen {
    /// Nothing, because the anchor was not asked for, has been overwritten, or does not exist.
    NotAskedFor,
    /// The reply ends before it.
    Missing,
    /// Another entry is in its place.
    Replaced,
    InPlace,
}

impl Progress {
    /// Takes the entries of a reply whose header has been seen.
    pub(super) fn take(
        &mut self,
        asked: Asked,
        batch: Batch<'_>,
        on: &mut dyn FnMut(Delivery),
    ) -> Result<(), Disturbed> {
        let Asked { request, purpose } = asked;
        match purpose {
            Purpose::Abandoned => {}
            Purpose::Probe => self.probed(request, batch.entries.len(), on)?,
            Purpose::Plain => self.take_plain(request, batch, on)?,
            Purpose::Overrun => self.take_overrun(request, batch),
            Purpose::Events(first) => self.take_events(first, request, batch, on)?,
        }
        Ok(())
    }

    /// Takes events from index `first` on. If the anchor is among them and in its place, everything
    /// that was read before its turn is from the same log and is delivered.
    pub(super) fn take_events(
        &mut self,
        first: u64,
        request: ReadRequest,
        batch: Batch<'_>,
        on: &mut dyn FnMut(Delivery),
    ) -> Result<(), Disturbed> {
        let is_empty = batch.entries.is_empty();
        match self.look_for_anchor(first, request, batch) {
            // There are events in these slots if the ring is unchanged.
            AnchorSeen::NotAskedFor if is_empty => Err(Disturbed::Changed),
            // The log is shorter than it must be, or the reply is.
            AnchorSeen::Missing if is_empty => self.not_full(on),
            // The anchor was there a moment ago. The ring may have been resized, and the slots mean
            // something else now.
            AnchorSeen::Replaced if self.checked => Err(Disturbed::Changed),
            AnchorSeen::Replaced => {
                self.restart();
                Ok(())
            }
            AnchorSeen::InPlace => {
                self.checked = true;
                self.keep(first, request, batch);
                self.deliver(on);
                Ok(())
            }
            AnchorSeen::NotAskedFor | AnchorSeen::Missing => {
                self.keep(first, request, batch);
                // No anchor will prove these, also if events come slowly again meanwhile.
                if self.overrun.is_on() || !self.footing.is_anchor() {
                    self.footing = Footing::Unconfirmed;
                } else {
                    self.unproven += 1;
                }
                Ok(())
            }
        }
    }

    /// Looks for the anchor in a reply to a request for events from index `first` on.
    fn look_for_anchor(&self, first: u64, request: ReadRequest, batch: Batch<'_>) -> AnchorSeen {
        let Footing::Anchor(anchor) = self.footing else { return AnchorSeen::NotAskedFor };
        let place = (self.next - 1).checked_sub(first).filter(|&at| at < request.count.into());
        // If the anchor has been overwritten meanwhile, the ring is probed next.
        let Some(place) = place.filter(|_| self.behind() < self.head.size) else {
            return AnchorSeen::NotAskedFor;
        };
        match usize::try_from(place).ok().and_then(|place| batch.entries.get(place)) {
            None => AnchorSeen::Missing,
            Some(found) if *found == anchor => AnchorSeen::InPlace,
            Some(_) => AnchorSeen::Replaced,
        }
    }

    /// Takes events from `next` on that were asked for without an anchor.
    fn take_plain(
        &mut self,
        request: ReadRequest,
        batch: Batch<'_>,
        on: &mut dyn FnMut(Delivery),
    ) -> Result<(), Disturbed> {
        if batch.entries.is_empty() {
            return self.not_full(on);
        }
        self.footing = Footing::Total;
        let size = self.head.size;
        let overwritten = self.behind().saturating_sub(size);
        if overwritten < batch.entries.len() as u64 {
            self.keep(self.next, request, batch);
            self.skip_to(self.next + overwritten);
            self.deliver_or_hold(on);
            return Ok(());
        }
        // Everything that was asked for seems to have been overwritten on the way.
        if self.overrun.margin < size {
            self.overrun.widen_margin(self.head.happened);
            return Ok(());
        }
        // The ring turns during one request and is the same afterwards. Only the entries of the
        // reply are available.
        let slot = u64::from(request.start) - 1;
        self.skip_to(self.next.max(self.head.latest_in(slot)));
        self.keep(self.next, request, batch);
        self.deliver_or_hold(on);
        Ok(())
    }

    /// Delivers what was read without an anchor. If the ring has turned, it must first show its
    /// size once more, because another host may have changed it.
    fn deliver_or_hold(&mut self, on: &mut dyn FnMut(Delivery)) {
        if self.head.holds_all() {
            self.deliver(on);
        } else {
            self.footing = Footing::Unconfirmed;
            self.growth = Growth::Unasked;
        }
    }

    /// Keeps all new entries of a reply, whichever events are in these slots by now.
    fn take_overrun(&mut self, request: ReadRequest, batch: Batch<'_>) {
        for (slot, &entry) in (u64::from(request.start) - 1..).zip(batch.entries) {
            self.keep_event(self.head.latest_in(slot), entry, batch.model);
        }
        self.footing = Footing::Unconfirmed;
    }
}
