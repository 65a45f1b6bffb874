//! Ctrl-C and the termination signal, as a flag to check in a loop.

use std::io;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::error::{EXIT_FAILURE, Failure, Result, advise};

/// How soon an interrupt is noticed.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Signals this close together count as one: `timeout` sends one to the program and one to its
/// group, and a supervisor may send two of different kinds.
const ONE_WISH: Duration = Duration::from_millis(500);

/// What to tell the user if the program ends before it has cleaned up.
static LEFT_BEHIND: Mutex<Option<&str>> = Mutex::new(None);

/// What removes everything that is not whole before the program ends.
static CLEAN_UP: OnceLock<fn()> = OnceLock::new();

/// What writes down what the interrupt has cut short.
static WRITE_DOWN: OnceLock<fn()> = OnceLock::new();

/// Set by an interrupt, once somebody checks for interrupts.
static INTERRUPTED: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// How many check the flag. If nobody does, an interrupt ends the program.
static LOOKING: AtomicUsize = AtomicUsize::new(0);

/// From now on an interrupt sets the flag instead of ending the program. The flag is checked
/// between two questions to the recorder. A second Ctrl-C ends the program at once, for a user who
/// does not want to wait for that.
pub(crate) fn catch() -> Result<Arc<AtomicBool>> {
    // Before the first interrupt can come.
    LOOKING.fetch_add(1, Ordering::SeqCst);
    flag()
}

/// From now on the program calls this before an interrupt ends it. Nobody has to check a flag: it
/// ends at once, whatever it is doing. A file that reaches the size limit of the process becomes a
/// failed write, where the signal for it would end the program without this call.
pub(crate) fn clean_up_with(clean_up: fn()) -> Result<()> {
    CLEAN_UP.get_or_init(|| clean_up);
    flag()?;
    #[cfg(unix)]
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default())
        .map_err(not_caught)?;
    Ok(())
}

/// From now on the program calls this as well, before it cleans up and an interrupt ends it.
pub(crate) fn write_down_with(write_down: fn()) -> Result<()> {
    WRITE_DOWN.get_or_init(|| write_down);
    flag().map(drop)
}

/// Checks the flag for as long as this exists.
pub(crate) struct Caught(Arc<AtomicBool>);

impl Caught {
    /// The same as [`catch`], for an operation that has something to put back.
    pub(crate) fn for_now() -> Result<Caught> {
        catch().map(Caught)
    }

    pub(crate) fn flag(&self) -> &Arc<AtomicBool> {
        &self.0
    }

    /// Checks for the last time. A later interrupt ends the program, unless somebody else checks
    /// for it.
    pub(crate) fn ends_interrupted(self) -> bool {
        let flag = Arc::clone(&self.0);
        drop(self);
        flag.load(Ordering::SeqCst)
    }
}

impl Drop for Caught {
    fn drop(&mut self) {
        LOOKING.fetch_sub(1, Ordering::SeqCst);
    }
}

fn flag() -> Result<Arc<AtomicBool>> {
    if let Some(flag) = INTERRUPTED.get() {
        return Ok(Arc::clone(flag));
    }
    let flag = Arc::clone(INTERRUPTED.get_or_init(Arc::default));
    let set = Arc::clone(&flag);
    let mut first = None;
    let caught = move || {
        let first: Instant = *first.get_or_insert_with(Instant::now);
        let is_second = set.swap(true, Ordering::SeqCst) && first.elapsed() >= ONE_WISH;
        if is_second || LOOKING.load(Ordering::SeqCst) == 0 {
            if let Some(hint) = *LEFT_BEHIND.lock().unwrap_or_else(PoisonError::into_inner) {
                advise(hint);
            }
            for before_the_end in [WRITE_DOWN.get(), CLEAN_UP.get()].into_iter().flatten() {
                before_the_end();
            }
            std::process::exit(EXIT_FAILURE.into());
        }
    };
    on_every_signal(caught).map_err(not_caught)?;
    Ok(flag)
}

#[allow(clippy::needless_pass_by_value, reason = "as map_err has it")]
fn not_caught(error: io::Error) -> Failure {
    Failure::new(format!("cannot catch Ctrl-C: {error}")).hint("report this as a bug")
}

/// Calls a function at every Ctrl-C, termination signal and hang-up. A signal that was ignored when
/// the program started (`nohup`) stays ignored.
#[cfg(unix)]
fn on_every_signal(mut caught: impl FnMut() + Send + 'static) -> io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;

    let ignored = ignored_signals();
    let is_heard = |signal: &i32| ignored >> (signal - 1) & 1 == 0;
    let mut signals = Signals::new([SIGHUP, SIGINT, SIGTERM].into_iter().filter(is_heard))?;
    thread::Builder::new()
        .name("signals".to_owned())
        .spawn(move || signals.forever().for_each(|_| caught()))?;
    Ok(())
}

/// The ignored signals, one bit each; 0 where the system does not say.
#[cfg(unix)]
fn ignored_signals() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}

#[cfg(not(unix))]
fn on_every_signal(caught: impl FnMut() + Send + 'static) -> io::Result<()> {
    ctrlc::set_handler(caught).map_err(io::Error::other)
}

/// Runs work that may wait without end, such as opening a pipe, until there is an interrupt.
pub(crate) fn unless_interrupted<T: Send + 'static>(
    stop: &AtomicBool,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T> {
    let (sender, done) = channel();
    // The work cannot be cut short. Nobody waits for it, and it ends with the program.
    thread::spawn(move || sender.send(work()));
    loop {
        match done.recv_timeout(LOOK_EVERY) {
            Ok(done) => return Ok(done),
            Err(RecvTimeoutError::Timeout) if !stop.load(Ordering::Relaxed) => {}
            Err(_) => return Err(Failure::Interrupted),
        }
    }
}

/// Sets the text for a second interrupt: what the user has to put back by hand.
pub(crate) fn leaves_behind(hint: Option<&'static str>) {
    *LEFT_BEHIND.lock().unwrap_or_else(PoisonError::into_inner) = hint;
}
