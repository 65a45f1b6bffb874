//! The clock of a recorder in truth: ticks of about a millisecond, counted from power-up, and what
//! was shown at them.

use ser_proto::TimeStamp;

use crate::chance::Chance;
use crate::true_time::{MS, Ps};

/// The most that a clock is off, in parts per billion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rates {
    pub(crate) drift_ppb: u32,
    pub(crate) wander_ppb: u32,
}

impl Rates {
    /// The most that a tick differs from a millisecond, so that neither a tick in true time nor
    /// true time in ticks is off by more than the drift.
    fn most_ppb(self) -> i64 {
        let drift = i64::from(self.drift_ppb);
        (drift - drift * drift / 1_000_000_000 - 1).max(0)
    }

    /// A rate that the clock keeps to, more or less, all its days.
    pub(crate) fn draw(self, chance: &mut Chance) -> i64 {
        let most = self.most_ppb();
        match chance.below(3) {
            0 => chance.of(&[-most, most]),
            _ => chance.between(-most, most),
        }
    }
}

/// From one tick on, ticks have this length.
#[derive(Clone, Copy, Debug)]
struct Segment {
    tick: i64,
    at: Ps,
    length: Ps,
}

/// The ticks of one power-up.
#[derive(Debug)]
pub(crate) struct Ticks(Vec<Segment>);

impl Ticks {
    /// Ticks from power-up until long enough. The rate wanders around `rate_ppb`.
    pub(crate) fn draw(
        on: Ps,
        until: Ps,
        rate_ppb: i64,
        rates: Rates,
        chance: &mut Chance,
    ) -> Ticks {
        let most = rates.most_ppb();
        // The band is as wide as the wander, and the rate in its middle.
        let wander = i64::from(rates.wander_ppb) / 2;
        let mut segments: Vec<Segment> = Vec::new();
        let (mut tick, mut at) = (0, on);
        while at <= until {
            let off = if chance.one_in(3) {
                chance.of(&[-wander, wander])
            } else {
                chance.between(-wander, wander)
            };
            let length = MS + (rate_ppb + off).clamp(-most, most);
            segments.push(Segment { tick, at, length });
            let span = (until - on) / 8 * chance.between(1, 4);
            let count = span / MS + 1000;
            tick += count;
            at += count * length;
        }
        Ticks(segments)
    }

    /// When this tick is.
    pub(crate) fn instant(&self, tick: i64) -> Ps {
        let after = self.0.partition_point(|segment| segment.tick <= tick);
        let segment = self.0[after.saturating_sub(1)];
        segment.at + (tick - segment.tick) * segment.length
    }

    /// The last tick at or before this instant.
    pub(crate) fn at(&self, time: Ps) -> i64 {
        let after = self.0.partition_point(|segment| segment.at <= time);
        let segment = self.0[after.saturating_sub(1)];
        segment.tick + (time - segment.at).div_euclid(segment.length)
    }

    /// How much a tick differs from a millisecond there, in parts per billion.
    pub(crate) fn rate_ppb(&self, tick: i64) -> i64 {
        self.instant(tick + 1) - self.instant(tick) - MS
    }
}

/// The clock shows `shown_ms` at `tick` and counts on from there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Setting {
    /// From when the setting is in force.
    pub(crate) from: Ps,
    pub(crate) tick: i64,
    pub(crate) shown_ms: i64,
}

/// A time with whatever the clock showed, and when it began to show that.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TrueShown {
    pub(crate) shown_ms: i64,
    pub(crate) began: Ps,
    /// Which setting was in force, counted from power-up.
    pub(crate) setting: usize,
}

/// What the clock shows in one power-up.
#[derive(Debug)]
pub(crate) struct TrueClock {
    pub(crate) ticks: Ticks,
    /// In the order of `from`; the first is that of the power-up.
    pub(crate) settings: Vec<Setting>,
}

impl TrueClock {
    /// What it shows at an instant.
    pub(crate) fn at(&self, time: Ps) -> TrueShown {
        let tick = self.ticks.at(time);
        let in_force = self.settings.partition_point(|setting| setting.from <= time);
        let setting = in_force.saturating_sub(1);
        let Setting { tick: set_at, shown_ms, .. } = self.settings[setting];
        let began = self.ticks.instant(tick);
        TrueShown { shown_ms: shown_ms + tick - set_at, began, setting }
    }
}

/// As the eight bytes of a stamp.
pub(crate) fn stamp(shown_ms: i64) -> TimeStamp {
    let time = jiff::Timestamp::from_millisecond(shown_ms).expect("a time of two-digit years");
    let time = jiff::tz::Offset::UTC.to_datetime(time);
    let small = |value: i8| u8::try_from(value).expect("not negative");
    TimeStamp {
        year: u8::try_from(time.year() % 100).expect("two digits"),
        month: small(time.month()),
        day: small(time.day()),
        hour: small(time.hour()),
        minute: small(time.minute()),
        second: small(time.second()),
        millisecond: u16::try_from(time.millisecond()).expect("not negative"),
    }
}
