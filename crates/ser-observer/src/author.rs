//! Who changes recorders from here, for whoever asks later.

use ser_evidence::record::{CommandRecord, Outcome};

use crate::host_reading;

/// Who sends commands: a person, on a host, by a program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Author {
    user: String,
    host: String,
    program: String,
}

impl Author {
    /// The user by whose rights this program runs, on this computer. The operating system is asked,
    /// and no variable that the user could set. `program` is its name with its version.
    #[must_use]
    pub fn of_this_program(program: &str) -> Author {
        // What the system does not say is not known.
        let name = |name: Option<String>| CommandRecord::name(&name.unwrap_or_default());
        let (user, host) = (name(whoami::username().ok()), name(whoami::hostname().ok()));
        Author { user, host, program: program.to_owned() }
    }

    /// The user, as one line of up to [`CommandRecord::LONGEST_NAME`] characters.
    #[must_use]
    pub fn user(&self) -> &str {
        &self.user
    }

    /// The name of this computer, likewise.
    #[must_use]
    pub fn host(&self) -> &str {
        &self.host
    }

    /// The record of a command that was sent to `peer` just now, and what came of it.
    #[must_use]
    pub fn record(
        &self,
        peer: &str,
        command: String,
        outcome: &ser_client::Outcome,
    ) -> CommandRecord {
        let record = CommandRecord {
            at: host_reading::now(),
            user: self.user.clone(),
            host: self.host.clone(),
            program: self.program.clone(),
            peer: peer.to_owned(),
            command,
            outcome: outcome_of(outcome),
        };
        record.fitted()
    }
}

fn outcome_of(outcome: &ser_client::Outcome) -> Outcome {
    use ser_client::Outcome as Told;
    match outcome {
        Told::Done => Outcome::Done,
        Told::Sent => Outcome::Sent,
        Told::Refused(why) => Outcome::Refused(why.clone()),
        Told::NotAnswered(why) => Outcome::NotAnswered(why.clone()),
        Told::NotSent(why) => Outcome::NotSent(why.clone()),
    }
}
