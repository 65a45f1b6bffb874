//! The rows.

use std::io::{self, Write};

use super::options::Data;
use super::record::Record;
use crate::digits::push_number;
use crate::export::channels::split_lowest;
use crate::export::steps::{self, Happened, SAMPLE_US, Step};

/// The channels in a word of a binary row.
const WORD: usize = 16;

/// What rows there are.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Made {
    pub(super) rows: u64,
    /// Changes that are in none, because the same input changed again in the same row.
    pub(super) hidden: u64,
}

/// Counts the rows.
pub(super) fn count(record: &Record<'_>) -> io::Result<Made> {
    make(record, |_| Ok(()))
}

/// Writes the rows.
pub(super) fn write(out: &mut dyn Write, record: &Record<'_>) -> io::Result<()> {
    make(record, |row| out.write_all(row)).map(drop)
}

/// The size of a binary row.
pub(super) fn binary_row_len(channels: usize) -> u64 {
    u64::try_from(8 + 2 * channels.div_ceil(WORD)).unwrap_or(u64::MAX)
}

fn make(record: &Record<'_>, take: impl FnMut(&[u8]) -> io::Result<()>) -> io::Result<Made> {
    let mut rows = Rows {
        row: Row::new(record.options.data, record.channels.len()),
        on: vec![0; record.timeline.history().recorders.len()],
        made: Made::default(),
        pending: None,
        touched: vec![0; record.timeline.history().recorders.len()],
        take,
    };
    // The states before the first change have a row.
    for (recorder, &on) in record.survey.first_on.iter().enumerate() {
        rows.show(record, recorder, on & record.survey.channels.inputs_of(recorder));
    }
    rows.reach(record, record.span.begins_us())?;
    let axis = (record.survey.axis, record.span.begins_us());
    steps::for_each(record.timeline, record.selection, axis, |step| rows.step(record, step))?;
    rows.end_row()?;
    Ok(rows.made)
}

struct Rows<F> {
    row: Row,
    /// By recorder: the inputs that are on in the row.
    on: Vec<u32>,
    made: Made,
    /// The row that is being made: its instant and its stamp.
    pending: Option<(i64, u64)>,
    /// By recorder: the inputs that changed in this row.
    touched: Vec<u32>,
    take: F,
}

impl<F: FnMut(&[u8]) -> io::Result<()>> Rows<F> {
    fn step(&mut self, record: &Record<'_>, step: &Step<'_>) -> io::Result<()> {
        // What is unknown stays as it was.
        let shown = |recorder: usize, on: u32| {
            let now = step.now.get(recorder).copied().unwrap_or_default();
            now.known & (now.on ^ on) & record.survey.channels.inputs_of(recorder)
        };
        let on = |recorder: usize| self.on.get(recorder).copied().unwrap_or(0);
        let changes = step.changed.iter().any(|&recorder| shown(recorder, on(recorder)) != 0);
        let is_entry = |happened: &Happened| matches!(happened, Happened::Entry(_));
        if !changes && !step.happened.iter().any(is_entry) {
            return Ok(());
        }
        self.reach(record, step.at_us)?;
        for &recorder in step.changed {
            let inputs = shown(recorder, self.on.get(recorder).copied().unwrap_or(0));
            if let Some(touched) = self.touched.get_mut(recorder) {
                self.made.hidden += u64::from((*touched & inputs).count_ones());
                *touched |= inputs;
            }
            self.show(record, recorder, inputs);
        }
        Ok(())
    }

    /// Shows these inputs as the opposite of what they were.
    fn show(&mut self, record: &Record<'_>, recorder: usize, mut inputs: u32) {
        if let Some(on) = self.on.get_mut(recorder) {
            *on ^= inputs;
        }
        while inputs != 0 {
            let (bit, rest) = split_lowest(inputs);
            inputs = rest;
            self.row.flip(record.survey.channels.place_of(recorder, bit));
        }
    }

    /// Begins the row of an instant, and ends those before.
    fn reach(&mut self, record: &Record<'_>, at_us: i64) -> io::Result<()> {
        if !record.options.has_rate {
            if self.pending.is_none_or(|(pending_us, _)| pending_us != at_us) {
                self.end_row()?;
                self.pending = Some((at_us, record.stamp(at_us)));
            }
            return Ok(());
        }
        let since = at_us.saturating_sub(record.span.begins_us()).max(0);
        let sample = ((since + SAMPLE_US / 2) / SAMPLE_US).unsigned_abs();
        // The row that is being made is that of the sample after those that are finished.
        while self.pending.is_none() || self.made.rows < sample {
            self.end_row()?;
            self.pending = Some((at_us, self.made.rows * SAMPLE_US.unsigned_abs()));
        }
        Ok(())
    }

    /// Hands out the row that is being made, if there is one.
    fn end_row(&mut self) -> io::Result<()> {
        let Some((_, stamp)) = self.pending.take() else { return Ok(()) };
        self.made.rows += 1;
        self.touched.fill(0);
        (self.take)(self.row.finished(self.made.rows, stamp))
    }
}

/// The states of all channels as they are written.
struct Row {
    data: Data,
    /// Text: a comma and a digit for each. Binary: the words.
    states: Vec<u8>,
    row: Vec<u8>,
}

impl Row {
    fn new(data: Data, channels: usize) -> Row {
        let states = match data {
            Data::Ascii => [b",0".repeat(channels), b"\r\n".to_vec()].concat(),
            Data::Binary => vec![0; 2 * channels.div_ceil(WORD)],
        };
        Row { data, states, row: Vec::new() }
    }

    /// The byte with the state of a channel, and its bit there.
    fn place(&self, channel: usize) -> (usize, u8) {
        match self.data {
            Data::Ascii => (2 * channel + 1, 1),
            Data::Binary => (channel / 8, 1 << (channel % 8)),
        }
    }

    fn flip(&mut self, channel: usize) {
        let (byte, bit) = self.place(channel);
        if let Some(state) = self.states.get_mut(byte) {
            *state ^= bit;
        }
    }

    fn finished(&mut self, number: u64, stamp: u64) -> &[u8] {
        self.row.clear();
        match self.data {
            Data::Ascii => {
                push_number(&mut self.row, number);
                self.row.push(b',');
                push_number(&mut self.row, stamp);
            }
            Data::Binary => {
                for number in [number, stamp] {
                    let number = u32::try_from(number).unwrap_or(u32::MAX);
                    self.row.extend_from_slice(&number.to_le_bytes());
                }
            }
        }
        self.row.extend_from_slice(&self.states);
        &self.row
    }
}
