//! One recorder with everything that outlives a power cut: its contacts, its ledger, what it keeps.

use chrono::{DateTime, NaiveDateTime};
use ser_node::{Debounce, GeniusDiagnostics, HELD_BACK_MS, Rtc};
use ser_proto::{ClockSource, InputFilter, MAX_SIZE, Model};
use ser_sim::{LineRate, MemoryStorage, NonVolatile, SimNode, SimNodeOptions, SimRtc};

use super::activity::{Activity, Tempo};
use super::chance::Chance;
use super::filter_orders::{FilterTable, stored};
use super::ledger::Ledger;
use super::trail::Trail;

/// 2000-01-01 00:00, where a recorder without a battery-backed clock begins.
const NEVER_SET_MS: i64 = 946_684_800_000;

/// 2026-11-22 10:00.
const FIRST_DAY_MS: i64 = 1_795_341_600_000;

/// How long a recorder takes at most until a change is recorded. It holds the change back twice:
/// until it is accepted, and until it is recorded.
pub const SETTLING_MS: u64 = 2 * (HELD_BACK_MS + 1);

/// A recorder.
pub struct Unit {
    /// Which one.
    pub model: Model,
    /// The debounce times that the board decides, until a host sets a filter.
    pub debounce: Debounce,
    /// Its ledger.
    pub ledger: Ledger,
    /// Its contacts.
    pub activity: Activity,
    non_volatile: NonVolatile,
    has_clock: bool,
}

impl Unit {
    /// A recorder fresh from the factory.
    #[must_use]
    pub fn new(mut chance: Chance, model: Model) -> Unit {
        let debounce = match chance.below(3) {
            0 => Debounce::uniform(u8::try_from(chance.spread(1..=255)).unwrap_or(1)),
            1 => (1..=32).fold(Debounce::OFF, |times, input| {
                let time_ms = if chance.one_in(2) { 0 } else { chance.spread(1..=255) };
                times.with(input, u8::try_from(time_ms).unwrap_or(0))
            }),
            _ => Debounce::OFF,
        };
        let has_clock = !chance.one_in(4);
        let rtc =
            if has_clock { SimRtc::held_at(date_time(FIRST_DAY_MS)) } else { SimRtc::absent() };
        Unit {
            model,
            debounce,
            ledger: Ledger::new(model),
            activity: Activity::new(chance.branch(), model.inputs()),
            non_volatile: NonVolatile { storage: MemoryStorage::default(), rtc, id: None },
            has_clock,
        }
    }

    /// How its node is built.
    #[must_use]
    pub fn options(&self) -> SimNodeOptions {
        SimNodeOptions {
            model: self.model,
            debounce: self.debounce,
            line_rate: LineRate::Real,
            non_volatile: self.non_volatile.clone(),
        }
    }

    /// The filters that a host has set, or that the board has. The board has debounce times also for
    /// inputs that there are not, and changes wait for the longest of all.
    fn filters_at_power_up(&self) -> FilterTable {
        let of_board =
            |input| InputFilter { debounce_ms: self.debounce.time_ms(input), chatter: None };
        stored(&self.non_volatile.storage).unwrap_or_else(|| {
            std::array::from_fn(|bit| of_board(u8::try_from(bit + 1).unwrap_or(0)))
        })
    }

    /// Looks whether the recorder has set filters in this step.
    ///
    /// # Errors
    /// When nobody has ordered them.
    pub fn look_at_filters(&mut self, trail: &Trail) -> Result<(), String> {
        if !self.ledger.may_set_filters() {
            return Ok(());
        }
        let Some(filters) = stored(&self.non_volatile.storage) else { return Ok(()) };
        let before = self.ledger.filters_set();
        self.ledger.filters_stored(&filters)?;
        if self.ledger.filters_set() != before {
            trail.note("filters set");
        }
        Ok(())
    }

    /// The power will come on after `off_ms`. The battery-backed clock has gone on meanwhile.
    pub fn power_comes_on(&mut self, now_ms: u64, off_ms: u64) {
        let first = self.ledger.life() == 0;
        let shows_ms = if first { FIRST_DAY_MS } else { self.ledger.time_ms(now_ms) };
        let shows_ms = shows_ms.saturating_add_unsigned(off_ms);
        let (time_ms, size) = match (self.has_clock, first) {
            (true, true) => (shows_ms, MAX_SIZE),
            (true, false) => (shows_ms, self.ledger.smallest_size()),
            (false, true) => (NEVER_SET_MS, MAX_SIZE),
            (false, false) => (NEVER_SET_MS, self.ledger.smallest_size()),
        };
        if self.has_clock {
            self.non_volatile.rtc.write(date_time(time_ms));
        }
        let source = if self.has_clock { ClockSource::Battery } else { ClockSource::NeverSet };
        self.ledger.power_up(now_ms, (source, time_ms), size, &self.filters_at_power_up());
    }

    /// The node has come to the present. Notes what its contacts have done on the way.
    pub fn follow(&mut self, node: &mut SimNode<'_>, now_ms: u64, held_up: bool) {
        let moves = node.take_played();
        let moves = moves.iter().map(|played| (played.start_ms + played.at_ms, played.changed.0));
        if !held_up {
            self.ledger.take_debounce_times();
        }
        if held_up && self.ledger.is_undebounced() {
            self.ledger.contacts_moved_unseen(moves);
        } else {
            moves.for_each(|(at_ms, changed)| self.ledger.contacts_moved(at_ms, changed));
        }
        self.ledger.settle(now_ms);
        self.ledger.expire(now_ms);
        self.ledger.expected.exact.samples_missed = node.passed_over();
    }

    /// Lets contacts begin what they do next if it is time, or all at once if nothing else is under
    /// way.
    pub fn play(&mut self, node: &mut SimNode<'_>, now_ms: u64, tempo: Tempo) {
        let may_begin = tempo == Tempo::Flat && node.next_move_ms().is_none();
        if may_begin || now_ms >= self.activity.next_ms() {
            node.play(&self.activity.next_scene(now_ms, tempo));
        }
    }

    /// Checks what the recorder has counted since power-up, and every entry of its log, whether or
    /// not somebody reads it.
    ///
    /// # Errors
    /// When it is not what it must be.
    pub fn check(
        &self,
        node: &SimNode<'_>,
        genius: Option<GeniusDiagnostics>,
    ) -> Result<(), String> {
        let expected = self.ledger.expected_by_now();
        expected.check(&node.diagnostics(), genius.as_ref())?;
        for (input, left_out) in (1..=self.model.inputs()).zip(self.ledger.left_out()) {
            let counted = node.suppressed(input);
            if counted != left_out {
                return Err(format!(
                    "{left_out} changes of input {input} were chatter, and the recorder has counted \
                     {counted}"
                ));
            }
        }
        let (total, entries) = node.log();
        self.ledger.check_log(total, &entries)
    }
}

fn date_time(ms: i64) -> NaiveDateTime {
    DateTime::from_timestamp_millis(ms).unwrap_or_default().naive_utc()
}
