//! One list that was imported twice, under two time zones: each of its entries is there twice, at two
//! times, and nothing in the timeline says so.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};

use ser_evidence::history::{History, LifeHistory};
use ser_evidence::time::shown;

use crate::error::{advise, warn};

/// Offsets from UTC are multiples of this, in microseconds.
const QUARTER_US: i64 = 900_000_000;

/// A single change may come at such a distance by chance.
const FEWEST: usize = 2;

/// Tells of lists of one recorder that say the same in another zone.
pub(super) fn tell(history: &History) {
    // Only imported lists are in lives that are named by what is in them.
    for recorder in history.recorders.iter().filter(|recorder| recorder.stamps.is_some()) {
        let mut lists: HashMap<u64, &LifeHistory> = HashMap::new();
        let long = recorder.lives.iter().filter(|life| life.entries.len() >= FEWEST);
        for life in long {
            let Some(twin) = lists.insert(print(life), life) else { continue };
            let (Some(one), Some(other)) = (begins_us(twin), begins_us(life)) else { continue };
            let hours = one.abs_diff(other) / 60_000_000;
            warn(format_args!(
                "{}: two lists of {} events say the same, {} h {:02} min apart",
                recorder.recorder.name,
                life.entries.len(),
                hours / 60,
                hours % 60
            ));
            advise("was one list imported under two zones? Leave out the file with the wrong one");
        }
    }
}

/// What a list says, whatever its zone is.
fn print(life: &LifeHistory) -> u64 {
    let mut print = DefaultHasher::new();
    for held in &life.entries {
        let at_us = shown(&held.entry.time).map(|at| at.us().rem_euclid(QUARTER_US));
        (at_us, held.entry.changed.0, held.entry.state.0).hash(&mut print);
    }
    print.finish()
}

fn begins_us(life: &LifeHistory) -> Option<i64> {
    Some(shown(&life.entries.first()?.entry.time)?.us())
}
