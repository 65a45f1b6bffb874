//! `filter set` and `filter clear`: one command for each input whose filter changes, or one for all.

use std::collections::BTreeSet;
use std::num::NonZeroU8;

use ser_client::{RequestError, Unit};
use ser_console::Harmless;
use ser_proto::{Code, InputFilter};

use super::values::{self, Inputs, Wish};
use crate::error::{Failure, Result, inform};
use crate::filter_text;
use crate::output::Points;

/// Which inputs are meant.
#[derive(Debug, clap::Args)]
#[group(required = true, multiple = true)]
pub(super) struct Target {
    /// The inputs, by their numbers: 3, 1-4,7, all.
    #[arg(long, value_name = "INPUTS", value_parser = values::inputs)]
    input: Option<Inputs>,

    /// An input by its name in the site file; may be repeated.
    #[arg(long, value_name = "NAME")]
    point: Vec<String>,
}

impl Target {
    /// The inputs by number.
    pub(super) fn inputs(&self, points: &Points, has_site: bool) -> Result<Inputs> {
        let mut inputs = match &self.input {
            Some(Inputs::All) => return Ok(Inputs::All),
            Some(Inputs::These(inputs)) => inputs.clone(),
            None => BTreeSet::new(),
        };
        for name in &self.point {
            let input = points.input(name).ok_or_else(|| unknown(name, points, has_site))?;
            inputs.insert(input);
        }
        Ok(Inputs::These(inputs))
    }
}

fn unknown(name: &str, points: &Points, has_site: bool) -> Failure {
    let names: Vec<&str> = points.inputs().filter_map(|input| points.name(input)).collect();
    let name = Harmless(name).line();
    match has_site {
        false => Failure::usage(format!("--point {name} is a name in a site file"))
            .hint("name the file with --site or SER_SITE, or give the number with --input"),
        true if names.is_empty() => {
            Failure::usage(format!("the site file has no point {name} of this recorder"))
                .hint("give the number with --input, or add a [[point]] to the file")
        }
        true => Failure::usage(format!("the site file has no point {name} of this recorder"))
            .hint(format!("it has {}", names.join(", "))),
    }
}

/// Sets what differs. Returns the filters of all inputs that are in force afterwards.
pub(super) fn set(
    unit: &mut Unit,
    inputs: &BTreeSet<u8>,
    wish: Wish,
    now: &[InputFilter],
    points: &Points,
) -> Result<Vec<InputFilter>> {
    let mut wanted = Vec::new();
    for &input in inputs {
        let now = now.get(usize::from(input) - 1).copied().unwrap_or_default();
        // All are looked at before the first is sent.
        wanted.push((input, now, wish.on_top_of(input, now)?));
    }
    let changed: Vec<(u8, InputFilter)> = wanted
        .iter()
        .filter(|(_, now, wanted)| now != wanted)
        .map(|(input, _, wanted)| (*input, *wanted))
        .collect();
    let names = |of: &[(u8, InputFilter)]| {
        filter_text::inputs(&of.iter().map(|(input, _)| *input).collect::<Vec<_>>(), points)
    };
    if changed.is_empty() {
        inform("nothing to change: the filters are so already");
        return Ok(now.to_vec());
    }
    match one_for_all(&wanted, now.len()) {
        Some(filter) => {
            unit.set_filter(None, filter).map_err(|error| refused(error, filter, &[], points))?;
        }
        None => {
            for (position, (input, filter)) in changed.iter().enumerate() {
                let done = changed.get(..position).unwrap_or_default();
                unit.set_filter(NonZeroU8::new(*input), *filter)
                    .map_err(|error| refused(error, *filter, done, points))?;
            }
        }
    }
    // What was sent for all inputs is not on one page.
    let in_force =
        unit.filters()?.ok_or(RequestError::UnexpectedReply { command: Code::Filters })?;
    let differs = |(input, wanted): &&(u8, InputFilter)| {
        in_force.get(usize::from(*input) - 1) != Some(wanted)
    };
    if let Some((input, wanted)) = changed.iter().find(differs) {
        let in_force = in_force.get(usize::from(*input) - 1).copied().unwrap_or_default();
        let error = RequestError::FilterRefused { input: *input, in_force };
        return Err(refused(error, *wanted, &[], points));
    }
    inform(format_args!("changed: {}", names(&changed)));
    Ok(in_force)
}

/// The filter, if all inputs of the recorder get the same one.
fn one_for_all(wanted: &[(u8, InputFilter, InputFilter)], inputs: usize) -> Option<InputFilter> {
    let &(_, _, first) = wanted.first()?;
    let is_same = wanted.len() == inputs && wanted.iter().all(|(_, _, filter)| *filter == first);
    is_same.then_some(first)
}

/// The failure of a setting, with what has been set before.
fn refused(
    error: RequestError,
    wanted: InputFilter,
    done: &[(u8, InputFilter)],
    points: &Points,
) -> Failure {
    let failure = match error {
        RequestError::FilterRefused { input, in_force } => Failure::new(format!(
            "the recorder did not accept the filter of {} ({}); it has in force: {}",
            filter_text::inputs(&[input], points),
            filter_text::whole(&wanted),
            filter_text::whole(&in_force)
        ))
        .hint("set debounce and chatter one after the other, to find out which one it refuses")
        .hint("a recorder that guards its settings takes none until it is opened at its front"),
        other => other.into(),
    };
    let done: Vec<u8> = done.iter().map(|(input, _)| *input).collect();
    match done.as_slice() {
        [] => failure,
        done => failure.hint(format!(
            "set before that, and in force: {}; ser-cli filter shows all",
            filter_text::inputs(done, points)
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::testing::points;

    const FIVE: InputFilter = InputFilter { debounce_ms: 5, chatter: None };

    #[test]
    fn a_refusal_says_what_is_in_force_and_what_was_set_before() {
        let refusal = RequestError::FilterRefused { input: 3, in_force: InputFilter::OFF };
        let text = refused(refusal, FIVE, &[(1, FIVE), (2, FIVE)], &points()).text();
        assert!(
            text.starts_with(
                "the recorder did not accept the filter of input 3 (52-1 closed) (debounce 5 ms); \
                 it has in force: off\nhint: "
            ),
            "{text}"
        );
        assert!(text.contains("set before that, and in force: inputs 1, 2;"), "{text}");
    }

    #[test]
    fn one_command_is_for_all_only_if_all_become_the_same() {
        let change = |input, wanted| (input, InputFilter::OFF, wanted);
        assert_eq!(one_for_all(&[change(1, FIVE), change(2, FIVE)], 2), Some(FIVE));
        assert_eq!(one_for_all(&[change(1, FIVE), change(2, FIVE)], 3), None);
        assert_eq!(one_for_all(&[change(1, FIVE), change(2, InputFilter::OFF)], 2), None);
        assert_eq!(one_for_all(&[], 0), None);
    }

    #[test]
    fn an_input_has_a_name_in_the_site_file() {
        let target = |input: Option<&str>, names: &[&str]| Target {
            input: input.map(|text| values::inputs(text).unwrap()),
            point: names.iter().map(|&name| name.to_owned()).collect(),
        };
        let inputs = target(Some("7"), &["52-1 closed"]).inputs(&points(), true).unwrap();
        assert_eq!(inputs, Inputs::These([3, 7].into()));
        for (has_site, points, told) in [
            (true, points(), "it has 52-1 closed"),
            (true, Points::default(), "add a [[point]]"),
            (false, Points::default(), "--site or SER_SITE"),
        ] {
            let failure = target(None, &["52-2"]).inputs(&points, has_site).unwrap_err();
            assert!(failure.is_usage() && failure.text().contains(told), "{}", failure.text());
        }
    }
}
