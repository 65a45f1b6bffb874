//! What the readings of all sources say of one another.

use ser_evidence::history::{History, LifeHistory};
use ser_files::NotReached;

use crate::error::{advise, warn};

/// Recorders that could not be reached now, and those of which the files say so.
pub(super) fn not_reached(mut missed: Vec<NotReached>, history: &mut History) -> Vec<NotReached> {
    for history in &mut history.recorders {
        let name = &history.recorder.name;
        let is_missed_now = missed.iter().any(|missed| missed.recorder == *name);
        if history.is_not_reached && !is_missed_now {
            let why = "not reached when the file was made".to_owned();
            missed.push(NotReached { recorder: name.clone(), why });
        }
        history.is_not_reached |= is_missed_now;
    }
    missed
}

/// Says where nobody can know which readings are of the same log.
pub(super) fn tell(history: &History) {
    for history in &history.recorders {
        let name = &history.recorder.name;
        let is_by_number = |life: &&LifeHistory| life.is_by_number;
        let by_number = history.lives.iter().filter(is_by_number).count();
        if by_number > 0 && by_number < history.lives.len() {
            warn(format_args!(
                "{name}: a file without sequence numbers stands beside other files; entries that \
                 are in both come twice"
            ));
            advise("leave out the file whose header is only entry,time,input,state");
        }
        let nameless = |life: &&LifeHistory| life.life.is_none() && !life.is_by_number;
        let nameless: Vec<&LifeHistory> = history.lives.iter().filter(nameless).collect();
        let is_later =
            |life: &&&LifeHistory| life.entries.first().is_some_and(|held| held.sequence > 1);
        if nameless.len() > 1 && nameless.iter().any(|life| is_later(&life)) {
            warn(format_args!(
                "{name}: {} readings have no entry in common, so nobody knows whether they are of \
                 one log; each is taken for a log of its own",
                nameless.len()
            ));
            advise("ser-cli read --new and watch remember which log they read; their files fit");
        }
    }
}
