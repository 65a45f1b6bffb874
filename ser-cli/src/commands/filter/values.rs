//! The values of `filter set`, checked before anything is sent.

use std::collections::BTreeSet;
use std::num::NonZeroU8;

use ser_proto::{ChatterFilter, InputFilter, MAX_CHATTER_CHANGES, MAX_CHATTER_WINDOW_MS, Model};

use crate::error::{Failure, Result};
use crate::values;

/// The inputs that are meant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Inputs {
    /// All that the recorder has.
    All,
    /// These.
    These(BTreeSet<u8>),
}

/// When chatter is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Chatter {
    /// Never.
    Off,
    /// From so many changes in a window on.
    From { changes: NonZeroU8, window_ms: u16 },
}

/// What is to be set. What is not given stays as it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Wish {
    pub(super) debounce_ms: Option<u8>,
    pub(super) chatter: Option<Chatter>,
    pub(super) rearm_ms: Option<u16>,
}

/// Inputs as `3`, `1-4,7` or `all`.
pub(super) fn inputs(text: &str) -> std::result::Result<Inputs, String> {
    let last = Model::Ser320.inputs();
    let not_inputs = || format!("not inputs: numbers from 1 to {last}, as in 3 or 1-4,7; or all");
    if text == "all" {
        return Ok(Inputs::All);
    }
    let number = |text: &str| {
        let number = text.trim().parse().ok().filter(|number| (1..=last).contains(number));
        number.ok_or_else(not_inputs)
    };
    let mut inputs = BTreeSet::new();
    for part in text.split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let (first, last) = (number(first)?, number(last)?);
        if first > last {
            return Err(format!("{first}-{last} goes backwards: {last}-{first}"));
        }
        inputs.extend(first..=last);
    }
    Ok(Inputs::These(inputs))
}

/// A debounce time, in milliseconds.
pub(super) fn debounce(text: &str) -> std::result::Result<u8, String> {
    if text == "off" {
        return Ok(0);
    }
    let out_of_range = || "a debounce time is 0ms to 255ms, in whole milliseconds; or off".into();
    u8::try_from(milliseconds(text)?).map_err(|_| out_of_range())
}

/// Chatter as `10/1s` or `off`.
pub(super) fn chatter(text: &str) -> std::result::Result<Chatter, String> {
    if text == "off" {
        return Ok(Chatter::Off);
    }
    let (changes, window) =
        text.split_once('/').ok_or("not a number of changes and a window, as in 10/1s; or off")?;
    let changes = changes.trim().parse().ok().and_then(NonZeroU8::new);
    let changes = changes
        .filter(|changes| changes.get() <= MAX_CHATTER_CHANGES)
        .ok_or_else(|| format!("chatter begins with 5 to {MAX_CHATTER_CHANGES} changes"))?;
    let window_ms = u16::try_from(milliseconds(window.trim())?).unwrap_or(u16::MAX);
    // The re-arm time, which may not be shorter, is looked at when it is known.
    let filter = ChatterFilter { changes, window_ms, rearm_ms: u16::MAX };
    let checked = InputFilter { debounce_ms: 0, chatter: Some(filter) }.check();
    checked.map(|()| Chatter::From { changes, window_ms }).map_err(|invalid| invalid.to_string())
}

/// A re-arm time, in milliseconds.
pub(super) fn rearm(text: &str) -> std::result::Result<u16, String> {
    let ms = u16::try_from(milliseconds(text)?).ok().filter(|&ms| ms > 0);
    ms.ok_or_else(|| "a re-arm time is as long as the window or longer, up to 65.535s".to_owned())
}

/// A time in whole milliseconds, 0 included.
fn milliseconds(text: &str) -> std::result::Result<u64, String> {
    if ["0", "0s", "0ms"].contains(&text) {
        return Ok(0);
    }
    let time = values::duration(text)?;
    if !time.as_micros().is_multiple_of(1000) {
        return Err("a recorder has whole milliseconds, not parts of one".to_owned());
    }
    Ok(u64::try_from(time.as_millis()).unwrap_or(u64::MAX))
}

impl Inputs {
    /// The inputs that are meant, of a recorder of this model.
    pub(super) fn of(&self, model: Model) -> Result<BTreeSet<u8>> {
        let last = model.inputs();
        match self {
            Inputs::All => Ok((1..=last).collect()),
            Inputs::These(inputs) => match inputs.last() {
                Some(&input) if input > last => Err(Failure::usage(format!(
                    "there is no input {input}: this recorder has inputs 1 to {last}"
                ))
                .hint("ser-cli filter shows all inputs of the recorder")),
                _ => Ok(inputs.clone()),
            },
        }
    }
}

impl Wish {
    /// The filter of an input that has the filter `now`.
    pub(super) fn on_top_of(&self, input: u8, now: InputFilter) -> Result<InputFilter> {
        let debounce_ms = self.debounce_ms.unwrap_or(now.debounce_ms);
        let chatter = match (self.chatter, now.chatter) {
            (Some(Chatter::From { changes, window_ms }), now) => {
                let twice = window_ms.saturating_mul(2);
                let rearm_ms = now.map_or(twice, |now| now.rearm_ms);
                Some(ChatterFilter { changes, window_ms, rearm_ms })
            }
            (Some(Chatter::Off), _) => None,
            (None, now) => now,
        };
        let chatter = match (chatter, self.rearm_ms) {
            (Some(filter), Some(rearm_ms)) => Some(ChatterFilter { rearm_ms, ..filter }),
            (None, Some(_)) => {
                return Err(Failure::usage(format!(
                    "--rearm belongs to a chatter filter, and input {input} has none"
                ))
                .hint("say when chatter begins, as in --chatter 10/1s"));
            }
            (chatter, None) => chatter,
        };
        let filter = InputFilter { debounce_ms, chatter };
        filter.check().map_err(|invalid| {
            Failure::usage(format!("input {input}: {invalid}"))
                .hint(format!(
                    "--chatter takes 5 to {MAX_CHATTER_CHANGES} changes, more than 4 for each \
                     second of a window of 1ms to {MAX_CHATTER_WINDOW_MS}ms"
                ))
                .hint("--rearm takes the window or longer, up to 65.535s")
        })?;
        Ok(filter)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn changes(changes: u8) -> NonZeroU8 {
        NonZeroU8::new(changes).unwrap()
    }

    #[test]
    fn inputs_are_numbers_and_runs_of_them() {
        let these = |numbers: &[u8]| Ok(Inputs::These(numbers.iter().copied().collect()));
        assert_eq!(inputs("3"), these(&[3]));
        assert_eq!(inputs("1-4,7, 3"), these(&[1, 2, 3, 4, 7]));
        assert_eq!(inputs("all"), Ok(Inputs::All));
        for text in ["", "0", "33", "1-33", "x", "1,", "-3", "1-2-3"] {
            assert!(inputs(text).unwrap_err().contains("1 to 32"), "{text}");
        }
        assert_eq!(inputs("7-4").unwrap_err(), "7-4 goes backwards: 4-7");
        assert_eq!(Inputs::All.of(Model::Ser160).unwrap().len(), 16);
        let beyond = inputs("3,20").unwrap().of(Model::Ser160).unwrap_err();
        assert!(beyond.is_usage() && beyond.text().contains("no input 20"), "{}", beyond.text());
    }

    #[test]
    fn each_range_is_told_before_anything_is_sent() {
        assert_eq!((debounce("off"), debounce("0"), debounce("255ms")), (Ok(0), Ok(0), Ok(255)));
        for text in ["256ms", "5", "1s"] {
            assert!(debounce(text).unwrap_err().contains("0ms to 255ms"), "{text}");
        }
        assert!(debounce("1.5ms").unwrap_err().contains("whole milliseconds"));
        assert_eq!(chatter("off"), Ok(Chatter::Off));
        let from = Chatter::From { changes: changes(10), window_ms: 1000 };
        assert_eq!(chatter("10/1s"), Ok(from));
        for (text, told) in [
            ("10", "as in 10/1s"),
            ("33/1s", "5 to 32 changes"),
            ("0/1s", "5 to 32 changes"),
            ("x/1s", "5 to 32 changes"),
            ("4/1s", "from 5 changes on"),
            ("32/7001ms", "1 to 7000 ms"),
            ("10/99s", "1 to 7000 ms"),
            ("10/0", "1 to 7000 ms"),
            ("10/never", "not a time span"),
        ] {
            let why = chatter(text).unwrap_err();
            assert!(why.contains(told), "{text}: {why}");
        }
        assert_eq!((rearm("2s"), rearm("65.535s")), (Ok(2000), Ok(65_535)));
        for text in ["0", "65.536s", "100s"] {
            assert!(rearm(text).unwrap_err().contains("65.535s"), "{text}");
        }
    }

    #[test]
    fn what_is_not_given_stays() {
        let now = InputFilter {
            debounce_ms: 5,
            chatter: Some(ChatterFilter { changes: changes(6), window_ms: 900, rearm_ms: 3000 }),
        };
        let nothing = Wish { debounce_ms: None, chatter: None, rearm_ms: None };
        let from = Chatter::From { changes: changes(10), window_ms: 1000 };
        let set = |wish: Wish, now| wish.on_top_of(3, now).map_err(|failure| failure.text());
        assert_eq!(
            set(Wish { debounce_ms: Some(7), ..nothing }, now),
            Ok(InputFilter { debounce_ms: 7, ..now })
        );
        let chatter =
            |window_ms, rearm_ms| Some(ChatterFilter { changes: changes(10), window_ms, rearm_ms });
        assert_eq!(
            set(Wish { chatter: Some(from), ..nothing }, now),
            Ok(InputFilter { debounce_ms: 5, chatter: chatter(1000, 3000) })
        );
        assert_eq!(
            set(Wish { chatter: Some(from), ..nothing }, InputFilter::OFF),
            Ok(InputFilter { debounce_ms: 0, chatter: chatter(1000, 2000) })
        );
        assert_eq!(
            set(Wish { chatter: Some(Chatter::Off), ..nothing }, now),
            Ok(InputFilter { debounce_ms: 5, chatter: None })
        );
        let rearm = Wish { rearm_ms: Some(800), ..nothing };
        let why = set(rearm, now).unwrap_err();
        assert!(why.contains("input 3: a re-arm time of 800 ms: it cannot be shorter"), "{why}");
        let why = set(rearm, InputFilter::OFF).unwrap_err();
        assert!(why.contains("input 3 has none\nhint: say when chatter begins"), "{why}");
    }
}
