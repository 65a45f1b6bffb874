//! Commands that have begun and whose outcome is not known yet.
//!
//! If an interrupt ends the program meanwhile, they are written down as not answered.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use ser_client::Outcome;

use super::Place;
use crate::interrupt;

/// Writes a command and its outcome down.
type Write = fn(&Place, String, &Outcome);

/// A command that was begun.
struct Begun {
    number: u64,
    place: Place,
    command: String,
    write: Write,
}

/// All of them. Whoever writes one down holds the lock until it is written, so an interrupt waits.
static ALL: Mutex<Vec<Begun>> = Mutex::new(Vec::new());

static LAST_NUMBER: AtomicU64 = AtomicU64::new(0);

/// One of them.
pub(super) struct UnderWay {
    number: u64,
    place: Place,
    write: Write,
}

impl UnderWay {
    /// A command is about to be sent.
    pub(super) fn begin(place: Place, command: String, write: Write) -> UnderWay {
        // Where signals cannot be caught, an interrupt leaves no record, and the rest is as always.
        if let Err(failure) = interrupt::write_down_with(write_down_all) {
            failure.warn();
        }
        let number = LAST_NUMBER.fetch_add(1, Ordering::Relaxed);
        all().push(Begun { number, place: place.clone(), command, write });
        UnderWay { number, place, write }
    }

    /// What came of it is known. It is written down, unless an interrupt has done that.
    pub(super) fn end(self, command: String, outcome: &Outcome) {
        let mut all = all();
        let count = all.len();
        all.retain(|begun| begun.number != self.number);
        if all.len() < count {
            (self.write)(&self.place, command, outcome);
        }
    }
}

fn all() -> MutexGuard<'static, Vec<Begun>> {
    ALL.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Before an interrupt ends the program.
fn write_down_all() {
    let mut all = all();
    for Begun { place, command, write, .. } in all.drain(..) {
        write(
            &place,
            command,
            &Outcome::NotAnswered("interrupted before an answer came".to_owned()),
        );
    }
    // Until the program has ended, nothing else is written down, and nothing more is sent.
    std::mem::forget(all);
}
