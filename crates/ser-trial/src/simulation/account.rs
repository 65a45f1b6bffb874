//! What one reader was told, compared with the ledger: each event once and in order, and each loss
//! reported as what it was.

mod silence;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;
use std::ops::Range;

use ser_client::{Delivery, Lost};
use ser_proto::Entry;

use super::ledger::Ledger;
use super::recorded::{Erase, Recorded};
use super::wrong::{Told, Wrong, erases};
use silence::Silence;
pub use silence::{Known, Unreported};

/// The recorder's total counts modulo this, so a reader may miss a multiple of it without a trace.
const TOTAL_WRAPS_AT: usize = 65_536;

/// How many events a reader may give up that are still in the log, as a multiple of those that came
/// during its reading. It gives up the oldest when events come too fast for it.
const HASTE: usize = 4;

/// What became of the events of a recorder, for one reader. Each event is in one of these.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Delivered, once and in order.
    pub delivered: u64,
    /// Reported as overwritten, with the right count.
    pub overwritten: u64,
    /// Went unread with an erase or the power, and reported.
    pub gone: u64,
    /// Went unread with an erase or the power, and not reported, for one of the allowed reasons.
    pub unreported: Unreported,
    /// Recorded while this reader's port was not connected.
    pub unwatched: u64,
    /// Places at which inputs had changed unrecorded, and reported.
    pub unrecorded: u64,
    /// Restarts of the log that were reported.
    pub restarts: u64,
    /// Restarts of the log that left no trace for a reader to find.
    pub traceless: u64,
    /// Losses whose count was too low by a multiple of 65536.
    pub wrapped: u64,
}

impl Tally {
    /// All events that are in one of the columns.
    #[must_use]
    pub fn accounted(&self) -> u64 {
        self.delivered + self.overwritten + self.gone + self.unreported.all() + self.unwatched
    }
}

/// A reader's place in the ledger.
#[derive(Clone, Debug)]
pub struct Account {
    name: &'static str,
    life: u64,
    /// Index of the next event to be delivered.
    next: usize,
    /// How many erases of this life, counted from the first one, are behind the reader.
    erases_behind: usize,
    /// Whether the log began anew with the power and the reader has not got past that.
    new_life: bool,
    /// Whether a restart of the log was reported since the latest event.
    restart_told: bool,
    /// The first event that can have come after the reported restart, if that was told of an empty
    /// log. Events from this one on are not among those the report told of.
    told_up_to: usize,
    lost_told: usize,
    /// Inputs that were told to have changed unrecorded.
    unrecorded_told: u32,
    /// The total in the latest reply of the reading, and how far it has gone on since the first
    /// reply.
    seen_total: Option<u16>,
    came_meanwhile: usize,
    /// What the reader knows, and would therefore miss.
    known: Known,
    /// Events that went unread with the power, until it is seen whether that is reported.
    cut_off: u64,
    /// The same events. A reading that the power cut through may still hold some of them.
    in_hand: VecDeque<Recorded>,
    /// Whether the log of that life had begun unseen. If so, its count of losses is worthless.
    in_hand_uncounted: bool,
    tally: Tally,
}

impl Account {
    /// A reader that has read nothing.
    #[must_use]
    pub fn new(name: &'static str) -> Account {
        Account {
            name,
            life: 0,
            next: 0,
            erases_behind: 0,
            new_life: true,
            restart_told: false,
            told_up_to: 0,
            lost_told: 0,
            unrecorded_told: 0,
            seen_total: None,
            came_meanwhile: 0,
            known: Known::Nothing,
            cut_off: 0,
            in_hand: VecDeque::new(),
            in_hand_uncounted: false,
            tally: Tally::default(),
        }
    }

    /// Who it is.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Says what the reader has to go by.
    pub fn set_known(&mut self, known: Known) {
        self.known = known;
    }

    /// A reading begins.
    pub fn begin_reading(&mut self) {
        self.seen_total = None;
        self.came_meanwhile = 0;
        self.in_hand.clear();
    }

    /// Notes the log's total from a reply of the reading. Replies may be late, so the reader cannot
    /// go by the number of events that there are by now.
    pub fn see_total(&mut self, total: u16) {
        let before = self.seen_total.replace(total).unwrap_or(total);
        self.came_meanwhile += usize::from(total.wrapping_sub(before));
    }

    /// What became of all events up to the reader's place.
    #[must_use]
    pub fn tally(&self) -> Tally {
        let unreported = Unreported { not_read_since: self.cut_off, ..self.tally.unreported };
        Tally { unreported, ..self.tally }
    }

    /// The next event to be delivered, if the reader has read in this life.
    #[must_use]
    pub fn place(&self, ledger: &Ledger) -> Option<usize> {
        (self.life == ledger.life()).then_some(self.next)
    }

    /// Notes that the power goes. What is unread is gone. If this reader was connected, it has to
    /// be told.
    pub fn power_goes(&mut self, ledger: &Ledger, connected: bool) {
        let mut place = self.place(ledger).unwrap_or(0);
        if self.restart_told {
            self.tally.gone +=
                std::mem::take(&mut self.cut_off) + told(place..ledger.len(), self.told_up_to);
            place = place.max(self.told_up_to);
            self.end_restart();
        }
        let unread = (ledger.len() - place) as u64;
        *(if connected { &mut self.cut_off } else { &mut self.tally.unwatched }) += unread;
        self.in_hand =
            (place..ledger.len()).filter_map(|index| ledger.event(index).copied()).collect();
        if !connected || self.in_hand.len() as u64 != unread {
            self.in_hand.clear();
        }
        self.in_hand_uncounted = self.new_life && self.known == Known::Event;
        self.life = ledger.life() + 1;
        self.next = 0;
        self.erases_behind = 0;
        self.new_life = true;
        self.lost_told = 0;
    }

    /// Checks something that the reader is told.
    ///
    /// # Errors
    /// When it is not true.
    pub fn take(&mut self, delivery: &Delivery, ledger: &Ledger) -> Result<(), String> {
        self.life = ledger.life();
        match *delivery {
            Delivery::Event { entry, .. } => self.take_event(&entry, ledger),
            Delivery::Lost { lost: Lost::LogRestarted, .. } => self.take_restart(ledger),
            Delivery::Lost { lost: Lost::Unrecorded { inputs }, .. } => {
                self.unrecorded_told = inputs.0;
                Ok(())
            }
            Delivery::Lost { lost, .. } => {
                self.lost_told += lost.known_count() as usize;
                Ok(())
            }
        }
    }

    fn take_restart(&mut self, ledger: &Ledger) -> Result<(), String> {
        let explained = self.new_life || self.restart_told || self.has_wrapped(ledger);
        if !explained && self.erases_ahead(ledger).next().is_none() {
            return Wrong::new(format!(
                "{}: a restart of the log is reported, and there was none",
                self.name
            ))
            .fact("due", ledger.numbered(self.next))
            .fact("erases", erases(ledger.erases().iter().copied()))
            .err();
        }
        self.restart_told = true;
        self.told_up_to =
            self.erases_ahead(ledger).last().map_or(self.next, |erase| erase.from.max(self.next));
        self.lost_told = 0;
        Ok(())
    }

    /// Erases that the reader may not have got past. It is not always known exactly where they
    /// were.
    fn erases_ahead(&self, ledger: &Ledger) -> impl DoubleEndedIterator<Item = Erase> {
        let next = self.next;
        ledger.erases()[self.erases_behind..].iter().copied().filter(move |erase| erase.to >= next)
    }

    fn take_event(&mut self, entry: &Entry, ledger: &Ledger) -> Result<(), String> {
        let lost = std::mem::take(&mut self.lost_told);
        let unrecorded = std::mem::take(&mut self.unrecorded_told);
        if let Some(skipped) = self.in_hand_before(entry, lost) {
            self.deliver_in_hand(skipped);
            return Ok(());
        }
        let is = |index: usize| ledger.event(index).is_some_and(|event| event.is(entry));
        if !self.restart_told || self.new_life {
            // The log goes on, or has just begun.
            let straight = self.next + lost;
            if let Some(wraps) = self.wraps_until(straight, ledger, is) {
                if lost == 0 && wraps == 0 {
                    self.check_unrecorded(straight, unrecorded, ledger)?;
                }
                return self.go_on(straight + wraps * TOTAL_WRAPS_AT, wraps, lost, ledger);
            }
        }
        let power_up = self.new_life.then_some(Erase::POWER_UP);
        let erases =
            self.erases_ahead(ledger).rev().chain(power_up).chain(self.looks_erased(ledger));
        let after_erase = { erases }.find_map(|erase| {
            let index = if self.known == Known::Event && !self.restart_told {
                self.after_traceless(erase, ledger, is)
            } else {
                after_exactly(erase, lost, ledger, is)
            };
            index.map(|index| (index, erase))
        });
        match after_erase.filter(|&(index, _)| index >= self.next) {
            Some((index, erase)) => self.restarted_at(index, erase, lost, ledger),
            None => Err(self.explain(entry, lost, ledger)),
        }
    }

    /// Checks the changes that were reported between the latest delivery and the event right after
    /// it. Where an erase can have been between them, the reader need not know the earlier event.
    fn check_unrecorded(
        &mut self,
        index: usize,
        inputs: u32,
        ledger: &Ledger,
    ) -> Result<(), String> {
        let erased = self.erases_ahead(ledger).any(|erase| erase.from <= index);
        let actual = ledger.event(index).map_or(0, |event| event.unrecorded);
        self.tally.unrecorded += u64::from(inputs != 0);
        if inputs == actual || self.new_life || self.known != Known::Event || erased {
            return Ok(());
        }
        Wrong::new(format!("{}: changes that were not recorded are told wrongly", self.name))
            .fact("before", ledger.numbered(index))
            .fact("told", format_args!("{inputs:08x}"))
            .fact("not recorded", format_args!("{actual:08x}"))
            .err()
    }

    /// How many of the events in hand were skipped before this one, if it is one of them and the
    /// skipped ones are reported as lost.
    fn in_hand_before(&self, entry: &Entry, lost: usize) -> Option<usize> {
        let first = if self.in_hand_uncounted { 0 } else { lost };
        let is = |skipped: &usize| self.in_hand.get(*skipped).is_some_and(|event| event.is(entry));
        (first..=lost.min(self.in_hand.len())).find(is).filter(|_| !self.restart_told)
    }

    /// Delivers an event that was read before the power went. A small ring that is full again, and
    /// looks as if the log had gone on, leaves no trace of that. The next reading misses the event
    /// that was delivered last.
    fn deliver_in_hand(&mut self, skipped: usize) {
        self.in_hand.drain(..=skipped);
        self.cut_off -= skipped as u64 + 1;
        self.tally.overwritten += skipped as u64;
        self.tally.delivered += 1;
        self.known = Known::Event;
    }

    /// Whether so much has happened since the latest delivery that the total tells little about it.
    /// It may look as if the event delivered last must still be there; its absence then looks like
    /// an erase.
    fn has_wrapped(&self, ledger: &Ledger) -> bool {
        ledger.len() - self.next >= TOTAL_WRAPS_AT
    }

    /// The erase from which on the total counts, where the reader seems to see another erase since.
    fn looks_erased(&self, ledger: &Ledger) -> Option<Erase> {
        let latest =
            ledger.erases()[..self.erases_behind].last().copied().unwrap_or(Erase::POWER_UP);
        (self.restart_told && self.has_wrapped(ledger)).then_some(latest)
    }

    /// The event after an erase that was not reported, for a reader that knows the event before.
    /// Where the log is full again, the erase leaves no trace. The count of the loss is then the
    /// difference of two unrelated totals.
    fn after_traceless(
        &self,
        erase: Erase,
        ledger: &Ledger,
        is: impl Fn(usize) -> bool,
    ) -> Option<usize> {
        let found = || (erase.from..ledger.len()).find(|&index| is(index));
        self.silence(erase, ledger).and_then(|_| found())
    }

    /// Why the reader finds no trace of an erase, if it is allowed to find none.
    fn silence(&self, erase: Erase, ledger: &Ledger) -> Option<Silence> {
        let full_again = ledger.overwritten_before() > erase.from
            || ledger.len() - erase.from >= ledger.smallest_size().into();
        self.known.silence(full_again)
    }

    /// An erase between the latest delivery and the event of this index that the reader must have
    /// seen and that was not reported.
    fn silent_erase(&self, index: usize, ledger: &Ledger) -> Option<Erase> {
        if self.restart_told {
            return None;
        }
        let between = |erase: &Erase| erase.certain && erase.from >= self.next && erase.to <= index;
        let erases = self
            .erases_ahead(ledger)
            .filter(between)
            .chain(self.new_life.then_some(Erase::POWER_UP));
        { erases }.find(|&erase| self.silence(erase, ledger).is_none())
    }

    /// How many times the total has wrapped unseen before the event, which is the one at `index` or
    /// lies a multiple of the wrap further on.
    fn wraps_until(
        &self,
        index: usize,
        ledger: &Ledger,
        is: impl Fn(usize) -> bool,
    ) -> Option<usize> {
        let wraps = ledger.len().saturating_sub(index) / TOTAL_WRAPS_AT;
        (0..=wraps).find(|wraps| is(index + wraps * TOTAL_WRAPS_AT))
    }

    /// Delivers an event of the same log, after `lost` events that were reported as lost.
    fn go_on(
        &mut self,
        index: usize,
        wraps: usize,
        lost: usize,
        ledger: &Ledger,
    ) -> Result<(), String> {
        if let Some(erase) = self.silent_erase(index, ledger) {
            return Err(self.explain_silence(index, erase, ledger));
        }
        let missing = index - self.next;
        if missing > 0 {
            self.check_overwritten(index, lost, ledger)?;
        }
        self.tally.wrapped += u64::from(wraps > 0);
        self.tally.overwritten += missing as u64;
        self.deliver(index, ledger)
    }

    /// Delivers the first event after an erase.
    fn restarted_at(
        &mut self,
        index: usize,
        erase: Erase,
        lost: usize,
        ledger: &Ledger,
    ) -> Result<(), String> {
        if let Some(erase) = self.silent_erase(index, ledger) {
            return Err(self.explain_silence(index, erase, ledger));
        }
        if lost > 0 || index > erase.to {
            self.check_overwritten(index, lost, ledger)?;
        }
        let overwritten = if self.restart_told { lost.min(index - self.next) } else { 0 };
        self.tally.overwritten += overwritten as u64;
        self.count_gone(self.next..index - overwritten, erase, ledger)?;
        self.deliver(index, ledger)
    }

    /// Checks that the events before `index` that the reader was not given can have been
    /// overwritten.
    fn check_overwritten(&self, index: usize, lost: usize, ledger: &Ledger) -> Result<(), String> {
        let came = self.came_meanwhile;
        let may_be_lost = ledger.overwritten_before() + HASTE * came;
        if index <= may_be_lost {
            return Ok(());
        }
        let what = format!(
            "{}: events are reported as lost, or passed over, and are still there",
            self.name
        );
        Wrong::new(what)
            .fact("came", ledger.numbered(index))
            .fact("due", ledger.numbered(self.next))
            .fact("reported lost", format_args!("{lost} events"))
            .fact(
                "overwritten",
                format_args!("at most those before {}", ledger.overwritten_before()),
            )
            .fact("meanwhile", format_args!("{came} events came during the reading"))
            .err()
    }

    /// Counts events that went with this erase, reported or not.
    fn count_gone(
        &mut self,
        events: Range<usize>,
        erase: Erase,
        ledger: &Ledger,
    ) -> Result<(), String> {
        let all = events.len() as u64;
        let told = match (self.restart_told, self.known) {
            (false, _) => 0,
            // The restart was reported right before an event.
            (true, Known::Event) => all,
            (true, _) => told(events, self.told_up_to),
        };
        self.tally.gone += told;
        self.count_unreported(all - told, erase, ledger)
    }

    /// Counts what went unread with the power, reported or not.
    fn count_cut_off(&mut self, ledger: &Ledger) -> Result<(), String> {
        let cut_off = std::mem::take(&mut self.cut_off);
        if self.restart_told {
            self.tally.gone += cut_off;
            return Ok(());
        }
        self.count_unreported(cut_off, Erase::POWER_UP, ledger)
    }

    fn count_unreported(
        &mut self,
        events: u64,
        erase: Erase,
        ledger: &Ledger,
    ) -> Result<(), String> {
        if events > 0 {
            let silence = self.silence(erase, ledger).ok_or_else(|| {
                format!(
                    "{}: {events} events are gone without a word, and nothing excuses that",
                    self.name
                )
            })?;
            self.tally.unreported.count(events, silence);
        }
        Ok(())
    }

    /// Closes the account of a restart, reported or not.
    fn end_restart(&mut self) {
        self.tally.restarts += u64::from(self.restart_told);
        self.restart_told = false;
    }

    fn deliver(&mut self, index: usize, ledger: &Ledger) -> Result<(), String> {
        let passed = self.erases_ahead(ledger).filter(|erase| erase.to <= index).count();
        self.tally.traceless += passed.saturating_sub(self.restart_told.into()) as u64;
        self.count_cut_off(ledger)?;
        self.end_restart();
        let rest = &ledger.erases()[self.erases_behind..];
        self.erases_behind += rest.iter().take_while(|erase| erase.to <= index).count();
        self.new_life = false;
        self.known = Known::Event;
        self.tally.delivered += 1;
        self.next = index + 1;
        Ok(())
    }

    fn explain_silence(&self, index: usize, erase: Erase, ledger: &Ledger) -> String {
        let began_anew = if self.new_life { "with the power" } else { "with an erase" };
        Wrong::new(format!("{}: the log began anew, and there is no word of a restart", self.name))
            .fact("came", ledger.numbered(index))
            .fact("due", ledger.numbered(self.next))
            .fact("began anew", format_args!("{began_anew}, {erase}"))
            .to_string()
    }

    fn explain(&self, entry: &Entry, lost: usize, ledger: &Ledger) -> String {
        let found = (0..ledger.len())
            .rev()
            .find(|&index| ledger.event(index).is_some_and(|event| event.is(entry)));
        let (what, came) = match found {
            Some(index) if index < self.next => (
                format!("event {index} comes twice or too late"),
                ledger.numbered(index).to_string(),
            ),
            Some(index) => {
                (format!("event {index} comes too early"), ledger.numbered(index).to_string())
            }
            None => ("this event has never been".to_owned(), Told(entry).to_string()),
        };
        let restart = if self.restart_told { ", a restart of the log" } else { "" };
        Wrong::new(format!("{}: {what}", self.name))
            .fact("came", came)
            .fact("due", ledger.numbered(self.next + lost))
            .fact("told before", format_args!("{lost} events lost{restart}"))
            .fact(
                "power went",
                if self.new_life { "since the last event" } else { "not since the last event" },
            )
            .fact("erases ahead", erases(self.erases_ahead(ledger)))
            .to_string()
    }

    /// Checks that a reader that has read to the end has been told everything.
    ///
    /// # Errors
    /// When it has not.
    pub fn finish_reading(&mut self, ledger: &Ledger) -> Result<(), String> {
        let len = ledger.len();
        let place = self.place(ledger).unwrap_or(0);
        // An erase with nothing after it. It need not be the last erase to have arrived.
        let emptied =
            self.erases_ahead(ledger).find(|erase| erase.to >= len).filter(|_| place < len);
        if (self.new_life || emptied.is_some()) && self.known == Known::Event && !self.restart_told
        {
            return Err(format!(
                "{}: nothing has come of a log that began anew, nor a word of a restart",
                self.name
            ));
        }
        if place == len || emptied.is_some() {
            self.life = ledger.life();
            self.count_gone(place..len, emptied.unwrap_or(Erase::POWER_UP), ledger)?;
            self.count_cut_off(ledger)?;
            self.next = len;
            return Ok(());
        }
        Wrong::new(format!("{}: events {place} to {} have not been delivered", self.name, len - 1))
            .fact("first", ledger.numbered(place))
            .fact("last", ledger.numbered(len - 1))
            .fact("erases ahead", erases(self.erases_ahead(ledger)))
            .err()
    }
}

/// How many of these events are before the one up to which a restart was reported.
fn told(events: Range<usize>, up_to: usize) -> u64 {
    events.end.min(up_to).saturating_sub(events.start) as u64
}

/// The event after an erase, with exactly `lost` events reported as lost before it, or with a
/// multiple of 65536 more.
fn after_exactly(
    erase: Erase,
    lost: usize,
    ledger: &Ledger,
    is: impl Fn(usize) -> bool,
) -> Option<usize> {
    let last = erase.to.min(ledger.len());
    let wraps = (ledger.len() - erase.from) / TOTAL_WRAPS_AT;
    (0..=wraps).find_map(|wraps| {
        let lost = lost + wraps * TOTAL_WRAPS_AT;
        (erase.from + lost..=last + lost).find(|&index| is(index))
    })
}
