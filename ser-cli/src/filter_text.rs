//! Filters and inputs as people read them.

use ser_console::Harmless;
use ser_proto::{ChatterFilter, InputFilter};

use crate::output::Points;

/// A time as `5 ms`, `1 s` or `1.5 s`.
pub(crate) fn time(ms: u16) -> String {
    match (ms / 1000, ms % 1000) {
        (0, _) => format!("{ms} ms"),
        (seconds, 0) => format!("{seconds} s"),
        (seconds, rest) => {
            format!("{seconds}.{}", format!("{rest:03}").trim_end_matches('0')) + " s"
        }
    }
}

/// As `off` or `5 ms`.
pub(crate) fn debounce(filter: &InputFilter) -> String {
    match filter.debounce_ms {
        0 => "off".to_owned(),
        ms => time(ms.into()),
    }
}

/// As `10 changes in 1 s`.
pub(crate) fn chatter(filter: &ChatterFilter) -> String {
    format!("{} changes in {}", filter.changes, time(filter.window_ms))
}

/// As `off`, `debounce 5 ms` or `debounce 5 ms, chatter from 10 changes in 1 s, re-arm 2 s`.
pub(crate) fn whole(filter: &InputFilter) -> String {
    let debounce = (filter.debounce_ms != 0).then(|| format!("debounce {}", debounce(filter)));
    let chatter = filter.chatter.map(|filter| {
        format!("chatter from {}, re-arm {}", chatter(&filter), time(filter.rearm_ms))
    });
    match (debounce, chatter) {
        (None, None) => "off".to_owned(),
        (Some(one), None) | (None, Some(one)) => one,
        (Some(debounce), Some(chatter)) => format!("{debounce}, {chatter}"),
    }
}

/// Input numbers in ascending order as `1-4, 7`.
pub(crate) fn numbers(inputs: &[u8]) -> String {
    let mut runs: Vec<(u8, u8)> = Vec::new();
    for &input in inputs {
        match runs.last_mut() {
            Some((_, last)) if last.checked_add(1) == Some(input) => *last = input,
            _ => runs.push((input, input)),
        }
    }
    let runs = runs.into_iter().map(|(first, last)| match last - first {
        0 => first.to_string(),
        1 => format!("{first}, {last}"),
        _ => format!("{first}-{last}"),
    });
    runs.collect::<Vec<_>>().join(", ")
}

/// Some inputs as `input 3 (52-1 closed)` or `inputs 1-4, 7`: a name is there for a single one.
pub(crate) fn inputs(inputs: &[u8], points: &Points) -> String {
    match inputs {
        [input] => match points.name(*input) {
            Some(name) => format!("input {input} ({})", Harmless(name).line()),
            None => format!("input {input}"),
        },
        inputs => format!("inputs {}", numbers(inputs)),
    }
}

/// A count as `1,234`.
pub(crate) fn count(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (position, digit) in digits.chars().enumerate() {
        if position > 0 && (digits.len() - position).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroU8;

    use super::*;
    use crate::output::testing::points;

    #[test]
    fn filters_read_shortly() {
        let times = [(5, "5 ms"), (1000, "1 s"), (1500, "1.5 s"), (65_535, "65.535 s")];
        for (ms, text) in times {
            assert_eq!(time(ms), text);
        }
        let changes = NonZeroU8::new(10).unwrap();
        let chatter = Some(ChatterFilter { changes, window_ms: 1000, rearm_ms: 2000 });
        let text = |debounce_ms, chatter| whole(&InputFilter { debounce_ms, chatter });
        assert_eq!(text(0, None), "off");
        assert_eq!(text(5, None), "debounce 5 ms");
        assert_eq!(text(0, chatter), "chatter from 10 changes in 1 s, re-arm 2 s");
        assert_eq!(text(5, chatter), "debounce 5 ms, chatter from 10 changes in 1 s, re-arm 2 s");
    }

    #[test]
    fn inputs_are_runs_and_a_single_one_has_its_name() {
        assert_eq!(numbers(&[1, 2, 3, 4, 7, 9, 10]), "1-4, 7, 9, 10");
        assert_eq!(inputs(&[3], &points()), "input 3 (52-1 closed)");
        assert_eq!(inputs(&[4], &points()), "input 4");
        assert_eq!(inputs(&[3, 4], &points()), "inputs 3, 4");
    }

    #[test]
    fn counts_have_their_thousands() {
        for (number, text) in [(0, "0"), (999, "999"), (1234, "1,234"), (1_234_567, "1,234,567")] {
            assert_eq!(count(number), text);
        }
    }
}
