//! What a service says to its manager: that it is ready, alive, or about to end.

use std::time::{Duration, Instant};

use ser_collector::{Collector, Reached};

/// How often a service says that it is alive, if its manager does not say.
const ALIVE_EVERY: Duration = Duration::from_secs(10);

/// A thread that was not seen at work for this long hangs. Each waits for the archive or for a
/// recorder, and both have limits.
const HANGS_AFTER: Duration = Duration::from_secs(600);

/// This program as a service of systemd; without one, nobody listens.
pub(super) struct Service {
    every: Duration,
    due: Instant,
}

impl Service {
    /// The collector is at work.
    pub(super) fn begin() -> Service {
        say(&Word::Ready);
        let every = watched_every().map_or(ALIVE_EVERY, |limit| limit / 3);
        Service { every, due: Instant::now() }
    }

    /// Says now and then that all threads are at work, if they are.
    pub(super) fn is_alive(&mut self, collector: &Collector) {
        if Instant::now() < self.due {
            return;
        }
        self.due = Instant::now() + self.every;
        let states = collector.states();
        let is_at_work = |seen_at: Instant| seen_at.elapsed() < HANGS_AFTER;
        let reached = states.iter().filter(|state| state.reached == Reached::Yes).count();
        say(&Word::Status(format!("{reached} of {} recorders are being read", states.len())));
        if states.iter().all(|state| is_at_work(state.seen_at)) {
            say(&Word::Alive);
        }
    }

    /// The collector is about to end.
    pub(super) fn ends(&self) {
        say(&Word::Ends);
    }
}

/// What is said.
enum Word {
    Ready,
    Status(String),
    Alive,
    Ends,
}

#[cfg(unix)]
fn say(word: &Word) {
    use sd_notify::NotifyState;
    let word = match word {
        Word::Ready => NotifyState::Ready,
        Word::Status(text) => NotifyState::Status(text),
        Word::Alive => NotifyState::Watchdog,
        Word::Ends => NotifyState::Stopping,
    };
    // Without a manager there is nobody to tell, and one that does not listen ends this program.
    let _ = sd_notify::notify(&[word]);
}

#[cfg(not(unix))]
fn say(_: &Word) {}

/// Within which time the manager wants to hear from a service.
#[cfg(unix)]
fn watched_every() -> Option<Duration> {
    sd_notify::watchdog_enabled()
}

#[cfg(not(unix))]
fn watched_every() -> Option<Duration> {
    None
}
