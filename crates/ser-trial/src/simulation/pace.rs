//! How fast a run was: virtual time against real time, with a bus and without one.

use std::fmt;
use std::ops::{Add, AddAssign};
use std::time::Duration;

/// Virtual time, and how long it took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pace {
    /// Virtual time, in milliseconds.
    pub virtual_ms: u64,
    /// The computer's time.
    pub real: Duration,
}

impl Pace {
    #[expect(clippy::cast_precision_loss, reason = "for people")]
    fn hours(self) -> f64 {
        self.virtual_ms as f64 / 3_600_000.0
    }

    fn minutes(self) -> f64 {
        self.real.as_secs_f64() / 60.0
    }

    /// Virtual hours a minute; `None` without virtual time or without a measurable real time.
    fn per_minute(self) -> Option<f64> {
        (self.virtual_ms > 0 && !self.real.is_zero()).then(|| self.hours() / self.minutes())
    }
}

impl Add for Pace {
    type Output = Pace;

    fn add(self, other: Pace) -> Pace {
        Pace { virtual_ms: self.virtual_ms + other.virtual_ms, real: self.real + other.real }
    }
}

/// Both paces of a run, which differ by a factor of hundreds: a bus is simulated scan by scan,
/// everything else from one event to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Paces {
    /// Of lives without a bus.
    pub without_bus: Pace,
    /// Of lives on one.
    pub on_bus: Pace,
}

impl AddAssign for Paces {
    fn add_assign(&mut self, other: Paces) {
        self.without_bus = self.without_bus + other.without_bus;
        self.on_bus = self.on_bus + other.on_bus;
    }
}

/// As `20.02 h in 1.9 s: 1672 virtual hours a minute without a bus, 4.4 with one`, with a dash for
/// a pace that does not exist.
impl fmt::Display for Paces {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all = self.without_bus + self.on_bus;
        write!(f, "{:.2} h in {:.1} s: ", all.hours(), all.real.as_secs_f64())?;
        let [without, on] = [self.without_bus, self.on_bus].map(|pace| match pace.per_minute() {
            Some(hours) if hours < 100.0 => format!("{hours:.1}"),
            Some(hours) => format!("{hours:.0}"),
            None => "—".to_owned(),
        });
        write!(f, "{without} virtual hours a minute without a bus, {on} with one")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WITHOUT: Pace = Pace { virtual_ms: 36_000_000, real: Duration::from_millis(600) };
    const ON: Pace = Pace { virtual_ms: 360_000, real: Duration::from_millis(1_200) };

    #[test]
    fn each_pace_is_that_of_its_own_hours() {
        let paces = Paces { without_bus: WITHOUT, on_bus: ON };
        let text = "10.10 h in 1.8 s: 1000 virtual hours a minute without a bus, 5.0 with one";
        assert_eq!(paces.to_string(), text);
    }

    #[test]
    fn what_there_was_none_of_has_no_pace() {
        let texts = [
            (WITHOUT, Pace::default(), " 1000 virtual hours a minute without a bus, — with one"),
            (Pace::default(), ON, " — virtual hours a minute without a bus, 5.0 with one"),
            (
                Pace::default(),
                Pace { real: Duration::ZERO, ..ON },
                " — virtual hours a minute without a bus, — with one",
            ),
        ];
        for (without_bus, on_bus, end) in texts {
            let text = Paces { without_bus, on_bus }.to_string();
            assert!(text.ends_with(end), "{text}");
        }
    }

    #[test]
    fn the_sum_of_runs_has_the_pace_of_all() {
        let mut paces = Paces { without_bus: WITHOUT, on_bus: ON };
        paces += Paces {
            without_bus: Pace { real: Duration::from_millis(5_400), ..WITHOUT },
            on_bus: ON,
        };
        let text = "20.20 h in 8.4 s: 200 virtual hours a minute without a bus, 5.0 with one";
        assert_eq!(paces.to_string(), text);
    }
}
