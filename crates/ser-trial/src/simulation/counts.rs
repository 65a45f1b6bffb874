//! What a recorder must have counted since power-up: each counter exactly where that follows from
//! what the recorder was given, and within bounds where it does not.

use std::num::NonZeroU8;

use ser_node::{Diagnostics, GeniusDiagnostics};
use ser_proto::genius::{MAX_SER_DATA, max_entries};
use ser_proto::{
    Command, Configure, Counter, Counters, FrameError, MAX_ENTRIES, MAX_SIZE, Model, ParseError,
};

use super::port::Port;

/// The most counters that one page has room for.
const ROOM: usize = (MAX_SER_DATA - 4) / 4;

/// The driver's counters of what nobody does to a board here: no configuration or command is wrong,
/// no recorder broadcasts, nobody asks for its memory, and nobody else locks its tables.
const NEVER: [Counter; 10] = [
    Counter::BOARD_CONFIGURATIONS_REFUSED,
    Counter::BOARD_COMMANDS_BLOCKED,
    Counter::BOARD_COMMANDS_REFUSED,
    Counter::BOARD_DATAGRAMS_REFUSED,
    Counter::BOARD_OWN_BROADCASTS,
    Counter::BOARD_REQUESTS_REFUSED,
    Counter::BOARD_REQUESTS_UNANSWERED,
    Counter::BOARD_REQUESTS_MALFORMED,
    Counter::BOARD_REQUEST_QUEUE_FULL,
    Counter::BOARD_REQUEST_POINTERS_REFUSED,
];

/// How many commands wait on a port at most.
const WAITING: u32 = 16;

/// The fewest entries that a reply on the bus has room for.
const FEWEST_ENTRIES: usize = max_entries(Model::Ser320);

/// What came by the Genius port.
#[derive(Clone, Copy, Debug, Default)]
pub struct GeniusCounts {
    /// Datagrams that are not for a recorder.
    pub ignored: u32,
    /// Commands to all.
    pub broadcasts: u32,
    /// Times and marks whose arrival nobody saw.
    pub clocks_refused: u32,
    /// Whatever gets a reply, or none.
    pub requests: u32,
    /// How often the board's reset line was pulled, at power-up too.
    pub resets: u32,
}

/// What a recorder was given that it counts.
#[derive(Clone, Copy, Debug, Default)]
pub struct Expected {
    /// What is known exactly. Of refused parameters and overruns these are the least.
    pub exact: Diagnostics,
    /// Reads from the line that no log can answer, and filters for inputs that there are not. They
    /// count when they are carried out.
    pub unreadable: u32,
    /// Reads and prints that it depends on the log's size whether they are refused.
    pub doubtful: u32,
    /// Prints, which find no room while others wait.
    pub prints: u32,
    /// Events of which the recorder has printed that they will not be printed.
    pub unprinted: u32,
    /// Events that can have been overwritten.
    pub overwritten: u32,
    /// How often reports can have begun anew or gone on: once for each event, erase and
    /// configuration.
    pub reportable: u32,
    /// What came by the Genius port, if there is one.
    pub genius: Option<GeniusCounts>,
}

impl Expected {
    /// Counts a frame that was given up.
    pub fn frame_error(&mut self, cause: FrameError) {
        let counts = &mut self.exact;
        *match cause {
            FrameError::Interrupted | FrameError::Incomplete => &mut counts.frames_interrupted,
            FrameError::NotHex { .. } => &mut counts.frames_not_hex,
            FrameError::Checksum { .. } => &mut counts.frames_checksum,
            FrameError::TooLong { .. } => &mut counts.frames_too_long,
            FrameError::Empty => &mut counts.frames_empty,
        } += 1;
    }

    /// Counts a body that is not a command.
    pub fn parse_error(&mut self, error: ParseError) {
        let counts = &mut self.exact;
        *match error {
            ParseError::Empty => &mut counts.frames_empty,
            ParseError::UnknownCode { .. } => &mut counts.commands_unknown,
            ParseError::WrongLength { .. }
            | ParseError::TooShort { .. }
            | ParseError::EntrySize { .. } => &mut counts.commands_wrong_length,
            ParseError::BadValue { .. } => &mut counts.parameters_refused,
        } += 1;
    }

    /// Counts a command that is carried out later and may be refused then.
    pub fn command(&mut self, port: Port, command: &Command, inputs: u8, smallest_size: u16) {
        match *command {
            Command::SetFilter { input: Some(input), .. } if input.get() > inputs => {
                *(if port == Port::Line { &mut self.unreadable } else { &mut self.doubtful }) += 1;
            }
            Command::Read { start, count } => {
                let beyond = start == 0 || start > MAX_SIZE || usize::from(count) > MAX_ENTRIES;
                let most = if port == Port::Line { MAX_ENTRIES } else { FEWEST_ENTRIES };
                if port == Port::Line && beyond {
                    self.unreadable += 1;
                } else if start == 0 || start > smallest_size || usize::from(count) > most {
                    self.doubtful += 1;
                }
            }
            // It may come before reads that wait.
            Command::Configure(Configure { size: Some(_), .. }) => self.doubtful += 2 * WAITING,
            Command::Print { .. } => {
                self.doubtful += 1;
                self.prints += 1;
            }
            _ => {}
        }
    }

    /// The least and the most that the counter can be, as far as that is known; `None` if there is
    /// no such counter. `asked_by` is the port by which it is asked for: what came by it before has
    /// been carried out.
    fn bounds(&self, counter: Counter, asked_by: Port) -> Option<(u32, u32)> {
        let exact = &self.exact;
        let is = |count| Some((count, count));
        if NEVER.contains(&counter) {
            return self.genius.map(|_| (0, 0));
        }
        match counter {
            Counter::FRAMES_INTERRUPTED => is(exact.frames_interrupted),
            Counter::FRAMES_NOT_HEX => is(exact.frames_not_hex),
            Counter::FRAMES_CHECKSUM => is(exact.frames_checksum),
            Counter::FRAMES_TOO_LONG => is(exact.frames_too_long),
            Counter::FRAMES_EMPTY => is(exact.frames_empty),
            Counter::LINE_ERRORS => is(exact.line_errors),
            Counter::COMMANDS_UNKNOWN => is(exact.commands_unknown),
            Counter::COMMANDS_WRONG_LENGTH => is(exact.commands_wrong_length),
            Counter::PARAMETERS_REFUSED => {
                let done = if asked_by == Port::Line { self.unreadable } else { 0 };
                let least = exact.parameters_refused;
                Some((least + done, least + self.unreadable + self.doubtful))
            }
            Counter::COMMANDS_OVERRUN => {
                Some((exact.commands_overrun, exact.commands_overrun + self.prints))
            }
            Counter::EDGES_LOST => is(exact.edges_lost),
            Counter::SAMPLES_MISSED => is(exact.samples_missed),
            Counter::SETTINGS_LATE => is(exact.settings_late),
            Counter::EVENTS_UNREPORTED => Some((0, self.overwritten)),
            // What is not printed is counted when the line begins that says so, and nothing else is
            // on the line then.
            Counter::EVENTS_UNPRINTED if asked_by == Port::Line => is(self.unprinted),
            Counter::EVENTS_UNPRINTED => Some((self.unprinted, self.overwritten)),
            Counter::STORAGE_ERRORS => is(0),
            Counter::DATAGRAMS_IGNORED => {
                self.genius.map(|genius| (genius.ignored, genius.ignored))
            }
            Counter::BROADCASTS => self.genius.map(|genius| (genius.broadcasts, genius.broadcasts)),
            Counter::REPLIES_LOST => self.genius.map(|genius| (0, genius.requests)),
            Counter::CLOCKS_REFUSED => {
                self.genius.map(|genius| (genius.clocks_refused, genius.clocks_refused))
            }
            Counter::REPORTS_SENT => self.genius.map(|_| (0, self.reportable)),
            // At power-up the board is reset without having failed. Afterwards each reset follows a
            // failure.
            Counter::BOARD_FAILURES => {
                self.genius.map(|genius| (genius.resets.saturating_sub(1), genius.resets))
            }
            Counter::BOARD_RESETS => self.genius.map(|genius| {
                let resets = genius.resets.saturating_sub(1);
                (resets, resets)
            }),
            _ => self.genius.filter(|_| is_of_port_or_driver(counter)).map(|_| (0, u32::MAX)),
        }
    }

    /// The bounds of all counters that there are, by their ids. `left_out` has the changes of each
    /// input that the recorder has.
    #[must_use]
    pub fn all_bounds(&self, asked_by: Port, left_out: &[u32]) -> Bounds {
        let value = |id: u8| {
            let counter = NonZeroU8::new(id).map(Counter::from_id)?;
            let bounds = match counter.suppressed_input() {
                Some(input) => left_out.get(usize::from(input) - 1).map(|&count| (count, count)),
                None => self.bounds(counter, asked_by),
            };
            bounds.map(|(least, most)| (counter, least, most))
        };
        Bounds((0..=u8::MAX).filter_map(value).collect())
    }

    /// Checks what a recorder has counted, all of it done that it was told to do.
    ///
    /// # Errors
    /// The first counter that is not what it must be.
    pub fn check(
        &self,
        counted: &Diagnostics,
        genius: Option<&GeniusDiagnostics>,
    ) -> Result<(), String> {
        let counts = [
            (Counter::FRAMES_INTERRUPTED, counted.frames_interrupted),
            (Counter::FRAMES_NOT_HEX, counted.frames_not_hex),
            (Counter::FRAMES_CHECKSUM, counted.frames_checksum),
            (Counter::FRAMES_TOO_LONG, counted.frames_too_long),
            (Counter::FRAMES_EMPTY, counted.frames_empty),
            (Counter::LINE_ERRORS, counted.line_errors),
            (Counter::COMMANDS_UNKNOWN, counted.commands_unknown),
            (Counter::COMMANDS_WRONG_LENGTH, counted.commands_wrong_length),
            (Counter::PARAMETERS_REFUSED, counted.parameters_refused),
            (Counter::COMMANDS_OVERRUN, counted.commands_overrun),
            (Counter::EDGES_LOST, counted.edges_lost),
            (Counter::SETTINGS_LATE, counted.settings_late),
            (Counter::EVENTS_UNREPORTED, counted.events_unreported),
            (Counter::EVENTS_UNPRINTED, counted.events_unprinted),
            (Counter::STORAGE_ERRORS, counted.storage_errors),
        ];
        let of_genius = genius.map(|counted| {
            [
                (Counter::DATAGRAMS_IGNORED, counted.datagrams_ignored),
                (Counter::BROADCASTS, counted.broadcasts),
                (Counter::REPLIES_LOST, counted.replies_lost),
                (Counter::CLOCKS_REFUSED, counted.clocks_refused),
                (Counter::REPORTS_SENT, counted.reports_sent),
                (Counter::BOARD_FAILURES, counted.board.failures),
                (Counter::BOARD_RESETS, counted.board.resets),
            ]
        });
        // By the bus nothing counts as carried out that waits on the line.
        for (counter, told) in counts.into_iter().chain(of_genius.into_iter().flatten()) {
            if let Some((least, most)) = self.bounds(counter, Port::Bus) {
                check_one(counter, told, least, most)?;
            }
        }
        if counted.samples_missed != 0 {
            return Err(format!("the recorder has missed {} samples", counted.samples_missed));
        }
        Ok(())
    }
}

/// Whether a counter without bounds is one that a recorder with a Genius port has.
fn is_of_port_or_driver(counter: Counter) -> bool {
    counter == Counter::REPORTS_FAILED
        || (Counter::BOARD_FAILURES..=Counter::BOARD_LOCKOUTS_LOST).contains(&counter)
}

fn check_one(counter: Counter, told: u32, least: u32, most: u32) -> Result<(), String> {
    if (least..=most).contains(&told) {
        return Ok(());
    }
    Err(format!("the recorder says that {counter} is {told}, and it is {least} to {most}"))
}

/// All counters of a recorder in a moment, with the least and the most that they can be.
#[derive(Clone, Debug, Default)]
pub struct Bounds(Vec<(Counter, u32, u32)>);

impl Bounds {
    /// Checks the answer to a question for counters from `first` on, which came when they were at
    /// least so many. Now they are at most `now`.
    ///
    /// # Errors
    /// When a counter is not within its bounds, or another one than it must be.
    pub fn check(&self, first: Counter, page: &Counters, now: &Bounds) -> Result<(), String> {
        let Bounds(least) = self;
        let mut due = least.iter().skip_while(|(counter, ..)| *counter < first);
        let mut most = now.0.iter().skip_while(|(counter, ..)| *counter < first);
        let wrong_page = || Err(format!("asked from {first} on, the recorder tells {page:?}"));
        for (counter, told) in page.counters() {
            match (due.next(), most.next()) {
                (Some(&(id, least, _)), Some(&(_, _, most))) if id == counter => {
                    check_one(counter, told, least, most)?;
                }
                _ => return wrong_page(),
            }
        }
        let next = due.next().map(|(counter, ..)| *counter);
        let begins = page.values.is_empty() || page.first >= first;
        // A page ends where there is no room, or where ids are left out.
        let last = page.counters().last().map(|(counter, _)| counter);
        let goes_on = last.zip(next).is_some_and(|(last, next)| {
            last.id().get().checked_add(1) == Some(next.id().get()) && page.values.len() < ROOM
        });
        if next != page.next || !begins || goes_on {
            return wrong_page();
        }
        Ok(())
    }
}
