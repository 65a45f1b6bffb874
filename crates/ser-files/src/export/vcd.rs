//! VCD, the format of waveform viewers: a scope per recorder, a signal per input.
//!
//! What viewers bear was tried with two of them. No `$timezero`, which one refuses. Names without
//! blanks, brackets and dots, which cut or split them. Each time once, and rising. `x` is a state that
//! nobody knows. A loss is an event of its recorder, because a signal cannot say it. The axis has no
//! calendar, so the signal `utc` tells the time under the cursor, and `err_us` of each recorder how
//! far that may be off.

use std::collections::{HashMap, HashSet};
use std::io::Write;

use ser_evidence::timeline::Timeline;

use super::axis::doubt_us;
use super::channels::{Channel, Channels, recorder_name, recorder_of, split_lowest};
use super::counted::Counted;
use super::refused::Refused;
use super::selection::Selection;
use super::statement::{self, Origin};
use super::steps::{self, Happened, States, Step};
use super::survey::{Span, Survey};
use crate::digits::rfc3339;
use crate::digits::{UtcTexts, push_number};
use crate::names;

/// How many signs an identifier is made of, and the first of them: those of ASCII that can be seen,
/// without the first few, which begin something else in this format.
const SIGNS: usize = 90;
const FIRST_SIGN: u8 = b'%';

/// Signals of every recorder besides its inputs.
const OF_RECORDER: [&str; 3] = ["loss", "clock_set", "err_us"];

/// Writes a selection.
///
/// # Errors
/// If nothing has a time, or `out` does not take it.
pub fn write(
    out: &mut dyn Write,
    timeline: &Timeline<'_>,
    selection: &Selection,
    origin: &Origin<'_>,
) -> Result<Counted, Refused> {
    let survey = Survey::of(timeline, selection);
    let span = survey.span.ok_or(Refused::Empty)?;
    let signals = Signals::new(timeline, &survey.channels);
    head(out, timeline, selection, &survey, span, origin)?;
    declarations(out, timeline, &signals)?;
    let mut rows = Rows::new(timeline, &signals, span);
    rows.begin(out)?;
    let take = |step: &Step<'_>| {
        rows.step(step);
        out.write_all(&rows.text)
    };
    steps::for_each(timeline, selection, (survey.axis, span.begins_us()), take)?;
    // So that the last state can be seen.
    let last = rows.last;
    let length_us = span.last_us.saturating_sub(span.begins_us());
    let ends = length_us.saturating_add(steps::SAMPLE_US).unsigned_abs().max(last + 1);
    writeln!(out, "#{ends}")?;
    Ok(survey.counted)
}

/// Everything in the file that has a name.
struct Signals {
    /// The name of the site as a scope.
    site: String,
    /// By recorder: its scope, and its own signals. `None` if it has no inputs.
    recorders: Vec<Option<OfRecorder>>,
    /// By place among the channels.
    inputs: Vec<(Channel, Signal)>,
    utc: Vec<u8>,
    channels: Channels,
}

/// A name and an identifier.
struct Signal {
    name: String,
    id: Vec<u8>,
}

struct OfRecorder {
    scope: String,
    loss: Vec<u8>,
    clock_set: Vec<u8>,
    err_us: Vec<u8>,
}

impl Signals {
    fn new(timeline: &Timeline<'_>, channels: &Channels) -> Signals {
        let mut next = 0;
        let mut id = || {
            next += 1;
            identifier(next - 1)
        };
        let utc = id();
        let mut scopes = Names::default();
        let (mut recorders, mut inputs) = (Vec::new(), Vec::new());
        for recorder in 0..timeline.history().recorders.len() {
            let own: Vec<Channel> = channels.of(recorder).to_vec();
            if own.is_empty() {
                recorders.push(None);
                continue;
            }
            let scope = scopes.unique(&recorder_name(timeline, recorder));
            recorders.push(Some(OfRecorder { scope, loss: id(), clock_set: id(), err_us: id() }));
            let mut taken = Names::default();
            OF_RECORDER.iter().for_each(|name| _ = taken.unique(name));
            for channel in own {
                let name = taken.unique(&channel.name(timeline));
                inputs.push((channel, Signal { name, id: id() }));
            }
        }
        let site = Names::default().unique(&timeline.site().name);
        Signals { site, recorders, inputs, utc, channels: channels.clone() }
    }

    fn of(&self, recorder: usize) -> Option<&OfRecorder> {
        self.recorders.get(recorder)?.as_ref()
    }
}

/// Names that are taken in a scope.
#[derive(Default)]
struct Names {
    taken: HashSet<String>,
    /// By name: the number that was given last.
    counts: HashMap<String, u32>,
}

impl Names {
    /// The name with nothing in it that a viewer takes for something else, and unlike those before.
    fn unique(&mut self, name: &str) -> String {
        let clean = |letter: char| match letter {
            '_' | '-' => letter,
            _ if letter.is_alphanumeric() => letter,
            _ => '_',
        };
        let cleaned: String = name.chars().map(clean).collect();
        let cleaned = if cleaned.is_empty() { "_".to_owned() } else { cleaned };
        if self.taken.insert(cleaned.clone()) {
            return cleaned;
        }
        let count = self.counts.entry(cleaned.clone()).or_insert(1);
        loop {
            *count += 1;
            let unique = format!("{cleaned}_{count}");
            if self.taken.insert(unique.clone()) {
                return unique;
            }
        }
    }
}

/// The identifier of this number.
fn identifier(mut number: usize) -> Vec<u8> {
    let mut id = Vec::new();
    loop {
        let sign = u8::try_from(number % SIGNS).unwrap_or(0);
        id.push(FIRST_SIGN + sign);
        number /= SIGNS;
        if number == 0 {
            return id;
        }
        number -= 1;
    }
}

/// The text in a comment, which it must not end.
fn in_comment(text: &str) -> String {
    text.replace('$', "_")
}

fn head(
    out: &mut dyn Write,
    timeline: &Timeline<'_>,
    selection: &Selection,
    survey: &Survey,
    span: Span,
    origin: &Origin<'_>,
) -> Result<(), Refused> {
    let begins = rfc3339(span.begins_us()).unwrap_or_default();
    writeln!(out, "$date {begins} $end")?;
    writeln!(out, "$version {} $end", in_comment(&names::harmless(origin.program)))?;
    writeln!(out, "$comment")?;
    writeln!(out, "  #0 is {begins}, a unit is a microsecond.")?;
    let mut comment = Comment { out, is_new: true };
    statement::write(&mut comment, timeline, selection, survey, origin, "\n")?;
    writeln!(out, "$end")?;
    writeln!(out, "$timescale 1 us $end")?;
    Ok(())
}

/// Passes lines on as those of a comment.
struct Comment<'o> {
    out: &'o mut dyn Write,
    is_new: bool,
}

impl Write for Comment<'_> {
    fn write(&mut self, text: &[u8]) -> std::io::Result<usize> {
        for &byte in text {
            if std::mem::replace(&mut self.is_new, byte == b'\n') {
                self.out.write_all(b"  ")?;
            }
            self.out.write_all(&[if byte == b'$' { b'_' } else { byte }])?;
        }
        Ok(text.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.out.flush()
    }
}

fn declarations(
    out: &mut dyn Write,
    timeline: &Timeline<'_>,
    signals: &Signals,
) -> Result<(), Refused> {
    let id = |id: &[u8]| String::from_utf8_lossy(id).into_owned();
    writeln!(out, "$scope module {} $end", signals.site)?;
    writeln!(out, "$var string 1 {} utc $end", id(&signals.utc))?;
    let mut inputs = signals.inputs.iter().peekable();
    for (index, recorder) in signals.recorders.iter().enumerate() {
        let Some(OfRecorder { scope, loss, clock_set, err_us }) = recorder else { continue };
        writeln!(out, "$scope module {scope} $end")?;
        while let Some((channel, signal)) = inputs.next_if(|(input, _)| input.recorder == index) {
            let Signal { name, id: of } = signal;
            writeln!(out, "$var wire 1 {} {name} $end", id(of))?;
            if let Some(point) = channel.named(timeline) {
                let [name, on, off] =
                    [&point.name, &point.on, &point.off].map(|text| names::harmless(text));
                let input = channel.input;
                let text = format!("{name}: input {input}, 1 is {on}, 0 is {off}");
                writeln!(out, "$comment {} $end", in_comment(&text))?;
            }
        }
        writeln!(out, "$var event 1 {} loss $end", id(loss))?;
        writeln!(out, "$var event 1 {} clock_set $end", id(clock_set))?;
        writeln!(out, "$var string 1 {} err_us $end", id(err_us))?;
        writeln!(out, "$upscope $end")?;
    }
    writeln!(out, "$upscope $end")?;
    writeln!(out, "$enddefinitions $end")?;
    Ok(())
}

/// Where the changes of a step are made.
struct Rows<'t> {
    timeline: &'t Timeline<'t>,
    signals: &'t Signals,
    begins_us: i64,
    /// The time that was written last.
    last: u64,
    texts: UtcTexts,
    /// By recorder: the doubt that was written last.
    doubts: Vec<Option<Option<u64>>>,
    text: Vec<u8>,
}

impl<'t> Rows<'t> {
    fn new(timeline: &'t Timeline<'t>, signals: &'t Signals, span: Span) -> Rows<'t> {
        Rows {
            timeline,
            signals,
            begins_us: span.begins_us(),
            last: 0,
            texts: UtcTexts::default(),
            doubts: vec![None; signals.recorders.len()],
            text: Vec::new(),
        }
    }

    /// Nothing is known yet.
    fn begin(&mut self, out: &mut dyn Write) -> Result<(), Refused> {
        let text = &mut self.text;
        text.extend_from_slice(b"#0\n$dumpvars\n");
        for (_, signal) in &self.signals.inputs {
            text.push(b'x');
            text.extend_from_slice(&signal.id);
            text.push(b'\n');
        }
        text.push(b's');
        self.texts.push(text, self.begins_us);
        push_id(text, &self.signals.utc);
        for recorder in self.signals.recorders.iter().flatten() {
            text.extend_from_slice(b"s?");
            push_id(text, &recorder.err_us);
        }
        text.extend_from_slice(b"$end\n");
        Ok(out.write_all(text)?)
    }

    fn step(&mut self, step: &Step<'_>) {
        self.text.clear();
        let at = u64::try_from(step.at_us.saturating_sub(self.begins_us)).unwrap_or_default();
        self.last = at;
        // The beginning has its line.
        if at > 0 {
            self.text.push(b'#');
            push_number(&mut self.text, at);
            self.text.push(b'\n');
        }
        if step.happened.iter().any(|happened| matches!(happened, Happened::Entry(_))) {
            self.text.push(b's');
            self.texts.push(&mut self.text, step.at_us);
            push_id(&mut self.text, &self.signals.utc);
        }
        for &recorder in step.changed {
            self.states(recorder, step);
        }
        for &happened in step.happened {
            self.happened(happened, step.at_us);
        }
    }

    fn states(&mut self, recorder: usize, step: &Step<'_>) {
        let (Some(&before), Some(&now)) = (step.before.get(recorder), step.now.get(recorder))
        else {
            return;
        };
        let Signals { channels, inputs, .. } = self.signals;
        let mut differing = States::differing(now, before) & channels.inputs_of(recorder);
        while differing != 0 {
            let (bit, rest) = split_lowest(differing);
            differing = rest;
            let Some((_, signal)) = inputs.get(channels.place_of(recorder, bit)) else { continue };
            self.text.push(match () {
                () if now.known & bit == 0 => b'x',
                () if now.on & bit == 0 => b'0',
                () => b'1',
            });
            self.text.extend_from_slice(&signal.id);
            self.text.push(b'\n');
        }
    }

    fn happened(&mut self, happened: Happened, at_us: i64) {
        let (Happened::Entry(event) | Happened::Loss(event, _) | Happened::ClockSet(event)) =
            happened;
        let recorder = recorder_of(event);
        let Some(signals) = self.signals.of(recorder) else { return };
        let id = match happened {
            Happened::Loss(..) => &signals.loss,
            Happened::ClockSet(_) => &signals.clock_set,
            Happened::Entry(_) => {
                let doubt = doubt_us(self.timeline, event, at_us);
                if self.doubts.get(recorder) == Some(&Some(doubt)) {
                    return;
                }
                if let Some(known) = self.doubts.get_mut(recorder) {
                    *known = Some(doubt);
                }
                self.text.push(b's');
                match doubt {
                    Some(us) => push_number(&mut self.text, us),
                    None => self.text.push(b'?'),
                }
                return push_id(&mut self.text, &signals.err_us);
            }
        };
        self.text.push(b'1');
        self.text.extend_from_slice(id);
        self.text.push(b'\n');
    }
}

/// What follows a value of text.
fn push_id(text: &mut Vec<u8>, id: &[u8]) {
    text.push(b' ');
    text.extend_from_slice(id);
    text.push(b'\n');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_are_never_the_same() {
        let ids: HashSet<Vec<u8>> = (0..100_000).map(identifier).collect();
        assert_eq!(ids.len(), 100_000);
        assert_eq!([0, 89, 90].map(identifier), [&b"%"[..], b"~", b"%%"]);
        assert!(ids.iter().flatten().all(u8::is_ascii_graphic));
    }

    #[test]
    fn names_hold_nothing_that_viewers_take_for_something_else_and_come_once() {
        let mut names = Names::default();
        let given = ["52-1 closed", "52-1.closed", "a [1]", "a_[1]", "$end", "Ü§", "", "א", "loss"];
        let unique = given.map(|name| names.unique(name));
        let expected =
            ["52-1_closed", "52-1_closed_2", "a__1_", "a__1__2", "_end", "Ü_", "_", "א", "loss"];
        assert_eq!(unique, expected);
    }
}
