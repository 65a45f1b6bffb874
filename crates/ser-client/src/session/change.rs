//! Commands that change a recorder, for whoever writes down what was done to it.
//!
//! [`Change::of`] is the one place that says which commands these are. What came of one is an
//! [`Outcome`]: of a command that was not answered nobody knows.

use std::fmt;
use std::num::NonZeroU8;

use ser_proto::{AutoReport, Command, Configure, Filters, InputFilter, Reply, TimeStamp};

/// Is told of each change twice: before anything is sent, and when its outcome is known, before
/// whoever asked for it. Who is told of a beginning alone knows that it may have been carried out.
pub type ChangeHook = Box<dyn FnMut(&Change, Stage<'_>) + Send>;

/// How far a change is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage<'a> {
    /// It is about to be sent. A clock that is set gets its time only then, so none is known yet.
    Begins,
    /// It has ended.
    Ended(&'a Outcome),
}

/// A command that changes a recorder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Change the settings.
    Configure(Configure),
    /// Erase the log.
    Erase,
    /// Start or stop recording.
    SetRecording(bool),
    /// Set the clock. Of several attempts, this is the time in the last one.
    SetClock(TimeStamp),
    /// Set the filter of an input.
    SetFilter {
        /// The input; `None` for all.
        input: Option<NonZeroU8>,
        /// Its filter.
        filter: InputFilter,
    },
}

/// What came of a change.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The recorder has confirmed it.
    Done,
    /// It was sent to all recorders on a bus, which do not answer.
    Sent,
    /// The recorder has answered and did not take it, for this reason.
    Refused(String),
    /// No answer came that tells, for this reason: it may have been carried out.
    NotAnswered(String),
    /// Nothing was sent, for this reason.
    NotSent(String),
}

impl Change {
    /// The change that a command makes; `None` if it only asks, or has something printed. Every
    /// command has to be named here, so that none is forgotten.
    #[must_use]
    pub const fn of(command: &Command) -> Option<Change> {
        match *command {
            Command::Configure(configure) => Some(Change::Configure(configure)),
            Command::Erase => Some(Change::Erase),
            Command::SetMode { recording } => Some(Change::SetRecording(recording)),
            Command::SetClock(time) => Some(Change::SetClock(time)),
            Command::SetFilter { input, filter } => Some(Change::SetFilter { input, filter }),
            Command::QueryConfiguration
            | Command::LastBroadcast
            | Command::QueryMode
            | Command::Print { .. }
            | Command::Read { .. }
            | Command::Identify
            | Command::Time { .. }
            | Command::QueryFilters { .. }
            | Command::Diagnostics { .. } => None,
        }
    }

    /// What an answer says of it.
    pub(crate) fn answered(&self, reply: &Reply) -> Outcome {
        let refused_unless = |is_done, why: &dyn Fn() -> String| match is_done {
            true => Outcome::Done,
            false => Outcome::Refused(why()),
        };
        match (self, reply) {
            (Change::Configure(configure), Reply::Configuration(in_force)) => {
                refused_unless(configure.apply_to(in_force) == *in_force, &|| {
                    format!("in force are {}", Settings(&(*in_force).into()))
                })
            }
            (Change::SetRecording(recording), Reply::Mode(mode)) => {
                refused_unless(mode.recording == *recording, &|| mode.to_string())
            }
            (Change::SetFilter { input, filter }, Reply::Filters(page)) => {
                match filter_refused(*input, filter, page) {
                    _ if page.filters.is_empty() => tells_nothing(),
                    None => Outcome::Done,
                    Some((input, in_force)) => {
                        Outcome::Refused(format!("input {input} has: {in_force}"))
                    }
                }
            }
            (Change::Erase, Reply::Erased) | (Change::SetClock(_), Reply::ClockSet) => {
                Outcome::Done
            }
            _ => tells_nothing(),
        }
    }
}

fn tells_nothing() -> Outcome {
    Outcome::NotAnswered("the answer does not say what was asked for".to_owned())
}

/// The first input that has another filter in force than the one that was set, for one input or for
/// all.
pub(crate) fn filter_refused(
    input: Option<NonZeroU8>,
    filter: &InputFilter,
    in_force: &Filters,
) -> Option<(u8, InputFilter)> {
    let meant = if input.is_some() { 1 } else { usize::MAX };
    let mut meant = in_force.inputs().take(meant);
    meant.find(|(_, in_force)| *in_force != filter).map(|(input, in_force)| (input, *in_force))
}

/// As `set clock to 2026-11-22T10:00:00.000`.
impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Change::Configure(configure) => write!(f, "configure: {}", Settings(configure)),
            Change::Erase => f.write_str("erase the log"),
            Change::SetRecording(true) => f.write_str("start recording"),
            Change::SetRecording(false) => f.write_str("stop recording"),
            // Each attempt gets its time when it is sent, and none was.
            Change::SetClock(time) if time.check().is_err() => f.write_str("set clock"),
            Change::SetClock(time) => write!(f, "set clock to {time}"),
            Change::SetFilter { input: Some(input), filter } => {
                write!(f, "set filter of input {input}: {filter}")
            }
            Change::SetFilter { input: None, filter } => {
                write!(f, "set filter of all inputs: {filter}")
            }
        }
    }
}

/// Settings in words. Those that a command leaves as they are have none.
struct Settings<'a>(&'a Configure);

impl fmt::Display for Settings<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Configure { size, baud, auto_report, report_address, auto_print } = *self.0;
        if let Some(size) = size {
            write!(f, "size {size} entries, ")?;
        }
        if let Some(baud) = baud {
            write!(f, "line {} baud, ", baud.bits_per_second())?;
        }
        let auto_report = match auto_report {
            AutoReport::Off => "off",
            AutoReport::Genius => "genius",
            AutoReport::Rs232 => "rs232",
        };
        let auto_print = if auto_print { "on" } else { "off" };
        write!(f, "auto report {auto_report}, report to {report_address}, auto print {auto_print}")
    }
}

#[cfg(test)]
mod tests {
    use ser_proto::Baud;

    use super::*;

    #[test]
    fn a_change_is_said_in_words_with_units() {
        let time = TimeStamp {
            year: 26,
            month: 11,
            day: 22,
            hour: 10,
            minute: 0,
            second: 0,
            millisecond: 0,
        };
        let configure = Configure {
            size: Some(1024),
            baud: Some(Baud::B9600),
            auto_report: AutoReport::Rs232,
            report_address: 1,
            auto_print: true,
        };
        let filter = InputFilter { debounce_ms: 5, chatter: None };
        for (command, text) in [
            (Command::SetClock(time), "set clock to 2026-11-22T10:00:00.000"),
            (Command::Erase, "erase the log"),
            (Command::SetMode { recording: true }, "start recording"),
            (Command::SetMode { recording: false }, "stop recording"),
            (
                Command::Configure(configure),
                "configure: size 1024 entries, line 9600 baud, auto report rs232, report to 1, \
                 auto print on",
            ),
            (
                Command::Configure(Configure {
                    size: None,
                    baud: None,
                    auto_report: AutoReport::Off,
                    report_address: 0,
                    auto_print: false,
                }),
                "configure: auto report off, report to 0, auto print off",
            ),
            (
                Command::SetFilter { input: NonZeroU8::new(3), filter },
                "set filter of input 3: debounce 5 ms, chatter filter off",
            ),
            (
                Command::SetFilter { input: None, filter },
                "set filter of all inputs: debounce 5 ms, chatter filter off",
            ),
        ] {
            assert_eq!(Change::of(&command).expect("a change").to_string(), text);
        }
    }
}
