//! Commands that changed a recorder, or may have.
//!
//! A contact's change is the recorder's to tell; who set its clock, erased its log or changed its
//! filters is a host's. Such a record says who did it, by what, and what came of it. It is kept for
//! whoever asks later and takes no part in a timeline: what a set clock means there is said by
//! [`ClockObservation`](super::ClockObservation)s and [`ClockStep`](super::ClockStep)s.

use ser_console::Harmless;

use super::HostReading;

/// One command that changes a recorder, however often it was sent, and what came of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CommandRecord {
    /// When the outcome was known.
    pub at: HostReading,
    /// Who did it: the user of the operating system.
    pub user: String,
    /// The name of the host where it was done.
    pub host: String,
    /// The program that sent it, with its version.
    pub program: String,
    /// Where it was sent: the port or address of the recorder, or the bus.
    pub peer: String,
    /// What was sent, in words and with units.
    pub command: String,
    /// What came of it.
    pub outcome: Outcome,
}

/// What came of a command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The recorder has confirmed it.
    Done,
    /// It was sent to all recorders on a bus, which carry it out and do not answer.
    Sent,
    /// The recorder has answered and did not take it, for this reason.
    Refused(String),
    /// No answer came that tells, for this reason: it may have been carried out.
    NotAnswered(String),
    /// Nothing was sent, for this reason.
    NotSent(String),
}

impl CommandRecord {
    /// The longest name of a user, host, program or peer, in characters.
    pub const LONGEST_NAME: usize = 200;

    /// The longest command, and the longest reason, in characters.
    pub const LONGEST_TEXT: usize = 1000;

    /// What stands where a name is not known: none may be empty.
    pub const NOT_KNOWN: &str = "not known";

    /// A name as a record takes it: one line that can be seen, not empty, cut off where it is too
    /// long.
    #[must_use]
    pub fn name(text: &str) -> String {
        fitted(text, CommandRecord::LONGEST_NAME)
    }

    /// The same with texts that a file takes: each on one line, with nothing that a terminal would
    /// obey, not empty, and cut off where it is too long.
    #[must_use]
    pub fn fitted(self) -> CommandRecord {
        CommandRecord {
            at: self.at,
            user: Self::name(&self.user),
            host: Self::name(&self.host),
            program: Self::name(&self.program),
            peer: Self::name(&self.peer),
            command: fitted(&self.command, Self::LONGEST_TEXT),
            outcome: self.outcome.fitted(),
        }
    }
}

impl Outcome {
    /// Why it is not done, where there is a reason.
    #[must_use]
    pub fn why(&self) -> Option<&str> {
        match self {
            Outcome::Done | Outcome::Sent => None,
            Outcome::Refused(why) | Outcome::NotAnswered(why) | Outcome::NotSent(why) => Some(why),
        }
    }

    fn fitted(self) -> Outcome {
        let text = |why: &str| fitted(why, CommandRecord::LONGEST_TEXT);
        match self {
            Outcome::Done | Outcome::Sent => self,
            Outcome::Refused(why) => Outcome::Refused(text(&why)),
            Outcome::NotAnswered(why) => Outcome::NotAnswered(text(&why)),
            Outcome::NotSent(why) => Outcome::NotSent(text(&why)),
        }
    }
}

/// One line of at most so many characters that can be seen.
fn fitted(text: &str, longest: usize) -> String {
    let line = Harmless(text.trim()).line();
    let line = match line.chars().nth(longest) {
        None => line,
        Some(_) => line.chars().take(longest.saturating_sub(1)).chain(['…']).collect(),
    };
    // What was escaped may have been at the beginning or the end.
    match line.trim() {
        "" => CommandRecord::NOT_KNOWN.to_owned(),
        line => line.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_text_becomes_a_line_that_can_be_seen() {
        for (text, line) in [
            ("anna", "anna"),
            (" anna \n", "anna"),
            ("an\nna", r"an\nna"),
            ("\u{1b}[2Janna", r"\u{1b}[2Janna"),
            ("", CommandRecord::NOT_KNOWN),
            (" \t\r\n ", CommandRecord::NOT_KNOWN),
            ("exactly te", "exactly te"),
            ("more than ten", "more than…"),
        ] {
            let longest = if line.len() > 12 { 20 } else { 10 };
            assert_eq!(fitted(text, longest), line, "{text:?}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn whatever_a_text_is_it_fits(text in any::<String>(), longest in 10_usize..60) {
            let line = fitted(&text, longest);
            prop_assert!((1..=longest).contains(&line.chars().count()), "{line:?}");
            prop_assert_eq!(line.trim(), &line);
            prop_assert!(!line.chars().any(ser_console::is_obeyed));
            prop_assert_eq!(fitted(&line, longest), line, "once is enough");
        }
    }
}
