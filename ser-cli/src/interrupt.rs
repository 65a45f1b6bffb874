//! Ctrl-C, and a polite kill, as something to ask for in a loop.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::{EXIT_FAILURE, Failure, Result, advise};

/// What to tell when the program ends before it has tidied up.
static LEFT_BEHIND: Mutex<Option<&str>> = Mutex::new(None);

/// From now on an interrupt sets the flag instead of ending the program. The flag is looked at between two questions
/// to the unit; whoever does not want to wait for that presses Ctrl-C once more, which ends the program at once.
pub(crate) fn catch() -> Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    let set = Arc::clone(&flag);
    let caught = move || {
        if set.swap(true, Ordering::Relaxed) {
            if let Some(hint) = *LEFT_BEHIND.lock().unwrap_or_else(PoisonError::into_inner) {
                advise(hint);
            }
            std::process::exit(EXIT_FAILURE.into());
        }
    };
    ctrlc::set_handler(caught).map_err(|error| {
        Failure::new(format!("cannot catch Ctrl-C: {error}")).hint("report this as a bug")
    })?;
    Ok(flag)
}

/// Sets what is told if a second interrupt comes: what there is to put back by hand.
pub(crate) fn leaves_behind(hint: Option<&'static str>) {
    *LEFT_BEHIND.lock().unwrap_or_else(PoisonError::into_inner) = hint;
}
