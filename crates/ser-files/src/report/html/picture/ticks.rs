//! Which times an axis names.

/// Marks of an axis, at multiples of a step.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Ticks {
    /// Between neighbours, in microseconds.
    pub(super) step_us: i64,
    /// All that are in the window, in microseconds after the origin.
    pub(super) at_us: Vec<i64>,
}

/// Steps that people count in, in microseconds: no finer than the recorder's millisecond.
const STEPS_US: [i64; 28] = [
    1_000,
    2_000,
    5_000,
    10_000,
    20_000,
    50_000,
    100_000,
    200_000,
    500_000,
    1_000_000,
    2_000_000,
    5_000_000,
    10_000_000,
    15_000_000,
    30_000_000,
    60_000_000,
    120_000_000,
    300_000_000,
    600_000_000,
    900_000_000,
    1_800_000_000,
    3_600_000_000,
    7_200_000_000,
    10_800_000_000,
    21_600_000_000,
    43_200_000_000,
    86_400_000_000,
    604_800_000_000,
];

/// All steps as a list for the script, which draws the axis anew when the reader zooms.
pub(super) fn steps_us() -> String {
    STEPS_US.map(|step| step.to_string()).join(" ")
}

/// The finest marks of which no more than `at_most` are in a window of times after the origin.
pub(super) fn ticks((from_us, to_us): (i64, i64), at_most: usize) -> Ticks {
    let at_most = i64::try_from(at_most.max(1)).unwrap_or(i64::MAX);
    let first = |step: i64| from_us.div_euclid(step) + i64::from(from_us.rem_euclid(step) != 0);
    let count = |step: i64| to_us.div_euclid(step) - first(step) + 1;
    let weeks = STEPS_US.last().copied().unwrap_or(1);
    let mut steps = STEPS_US.into_iter();
    let step_us = steps.find(|&step| count(step) <= at_most).unwrap_or_else(|| {
        let weeks_each = (count(weeks) / at_most).saturating_add(1);
        weeks.saturating_mul(weeks_each)
    });
    let multiples = first(step_us)..=to_us.div_euclid(step_us);
    Ticks { step_us, at_us: multiples.map(|multiple| multiple * step_us).collect() }
}

/// A time after the origin, as exact as the step: `20 ms`, `1.25 s`, `2:05`, `3:02:05`.
pub(super) fn label(at_us: i64, step_us: i64) -> String {
    let sign = if at_us < 0 { "−" } else { "" };
    let us = at_us.unsigned_abs();
    let (seconds, ms) = (us / 1_000_000, us / 1_000 % 1_000);
    let text = match us {
        0 => "0".to_owned(),
        1..1_000_000 => format!("{ms} ms"),
        1_000_000..60_000_000 => match step_us {
            ..10_000 => format!("{seconds}.{ms:03} s"),
            10_000..100_000 => format!("{seconds}.{:02} s", ms / 10),
            100_000..1_000_000 => format!("{seconds}.{} s", ms / 100),
            _ => format!("{seconds} s"),
        },
        _ => {
            let fraction = match step_us {
                ..1_000_000 => format!(".{ms:03}"),
                _ => String::new(),
            };
            let (hours, minutes) = (seconds / 3_600, seconds / 60 % 60);
            match hours {
                0 => format!("{minutes}:{:02}{fraction}", seconds % 60),
                _ => format!("{hours}:{minutes:02}:{:02}{fraction}", seconds % 60),
            }
        }
    };
    format!("{sign}{text}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(window: (i64, i64), at_most: usize) -> Vec<String> {
        let Ticks { step_us, at_us } = ticks(window, at_most);
        at_us.iter().map(|&at| label(at, step_us)).collect()
    }

    #[test]
    fn marks_are_round_and_few() {
        assert_eq!(labels((-2_000, 43_000), 6), ["0", "10 ms", "20 ms", "30 ms", "40 ms"]);
        assert_eq!(labels((-400_000, 960_000), 8).len(), 7);
        assert_eq!(labels((900_000, 1_300_000), 5), ["900 ms", "1.0 s", "1.1 s", "1.2 s", "1.3 s"]);
        assert_eq!(labels((1_020_000, 1_050_000), 4), ["1.02 s", "1.03 s", "1.04 s", "1.05 s"]);
        assert_eq!(labels((59_000_000, 63_000_000), 5)[..2], ["59 s", "1:00"]);
        assert_eq!(labels((0, 10_800_000_000), 4), ["0", "1:00:00", "2:00:00", "3:00:00"]);
        assert_eq!(labels((-5_000, 0), 6)[0], "−5 ms");
    }

    #[test]
    fn there_are_never_more_than_asked_for_in_any_window() {
        for span in [0, 1, 999, 1_000, 7_777, 1 << 20, 1 << 35, 1 << 50, i64::MAX / 4] {
            for from in [-span, -1, 0, 12_345, span / 3] {
                for at_most in [1, 2, 5, 12] {
                    let found = ticks((from, from + span), at_most);
                    assert!(found.at_us.len() <= at_most, "{from} {span} {at_most}");
                    assert!(found.at_us.iter().all(|at| (from..=from + span).contains(at)));
                    assert!(found.at_us.iter().all(|at| at % found.step_us == 0));
                }
            }
        }
    }
}
