//! Ctrl-C, and a polite kill, as something to ask for in a loop.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Failure, Result};

/// From now on an interrupt sets the flag instead of ending the program.
pub(crate) fn catch() -> Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    let set = Arc::clone(&flag);
    ctrlc::set_handler(move || set.store(true, Ordering::Relaxed)).map_err(|error| {
        Failure::new(format!("cannot catch Ctrl-C: {error}")).hint("report this as a bug")
    })?;
    Ok(flag)
}
