//! Starting the threads of a collector, and ending them.

use std::collections::BTreeMap;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{Builder, JoinHandle};

use ser_archive::{Archive, Batch, Error, Writer};
use ser_evidence::record::{Record, SiteRecord, Told};
use ser_observer::{LogIdentity, host_reading};

use crate::forward::{give_all, keep_forwarding};
use crate::options::{Open, Options};
use crate::ports::Ports;
use crate::recorder::{Shared, Task};
use crate::states::{Reached, State, States};
use crate::trouble::Trouble;
use crate::upkeep;

/// How many batches may wait for the archive: one of each recorder would, at most.
const WAITING: usize = 64;

/// A collector at work. Dropping it ends it.
pub struct Collector {
    shared: Arc<Shared>,
    open: Open,
    recorders: Vec<JoinHandle<()>>,
    others: Vec<JoinHandle<()>>,
    /// Whether nothing more will be read.
    is_read: Arc<AtomicBool>,
}

/// What a collector leaves.
#[derive(Debug)]
pub struct Ended {
    /// How each recorder was in the end.
    pub states: Vec<State>,
    /// Commands that were sent to recorders and could not be archived.
    pub commands: Vec<Told>,
    /// Why not everything was given to the other archive, if each recorder was to be read once.
    pub not_forwarded: Option<Error>,
    /// Why it could not go on, if nobody wanted it to end.
    pub failed: Option<Trouble>,
}

impl Collector {
    /// Starts a thread for each recorder of the site that has a port, and those that look after the
    /// archive. `open` opens it, at once and again whenever a server was lost. The collector ends
    /// when `stop` is set.
    ///
    /// # Errors
    /// If the archive cannot be opened or read, or the system has no threads to give.
    pub fn start(options: Options, open: Open, stop: Arc<AtomicBool>) -> Result<Collector, Error> {
        let for_writer = Arc::clone(&open);
        let writer = Writer::start(move || for_writer(), WAITING).map_err(no_thread)?;
        let recorders: Vec<_> = options
            .site
            .recorders
            .iter()
            .filter(|recorder| recorder.port.is_some())
            .cloned()
            .collect();
        let states = States::of(recorders.iter().map(|recorder| recorder.name.clone()));
        let shared = Arc::new(Shared {
            options,
            writer,
            states,
            ports: Ports::default(),
            known: Default::default(),
            stop,
            left: Mutex::default(),
            failed: Mutex::new(None),
        });
        let mut collector = Collector {
            shared: Arc::clone(&shared),
            open,
            recorders: Vec::new(),
            others: Vec::new(),
            is_read: Arc::default(),
        };
        collector.remember_numbers(recorders.iter().map(|recorder| recorder.name.clone()))?;
        if let Some(forward) = &shared.options.forward {
            // From now on retention waits for it, also if it was never reached yet.
            let outlet = forward.outlet.clone();
            shared.writer.with(move |archive| archive.set_outlet(&outlet, 0))?;
        }
        collector.archive_site(recorders.iter().map(|recorder| recorder.name.clone()))?;
        for (place, recorder) in recorders.into_iter().enumerate() {
            let task = Task { place, recorder, shared: Arc::clone(&shared) };
            let thread = Builder::new().name(task.recorder.name.clone());
            collector.recorders.push(thread.spawn(move || task.run()).map_err(no_thread)?);
        }
        if !shared.options.once {
            collector.start_others()?;
        }
        Ok(collector)
    }

    /// Starts what is done besides reading recorders.
    fn start_others(&mut self) -> Result<(), Error> {
        let (shared, open) = (Arc::clone(&self.shared), Arc::clone(&self.open));
        let upkeep = move || upkeep::look_after(&shared.options, &open, &shared.stop);
        let named = |name: &str| Builder::new().name(name.to_owned());
        self.others.push(named("upkeep").spawn(upkeep).map_err(no_thread)?);
        if let Some(forward) = self.shared.options.forward.clone() {
            let (shared, open) = (Arc::clone(&self.shared), Arc::clone(&self.open));
            let is_over = Arc::clone(&self.is_read);
            let times = shared.options.times;
            let work = move || keep_forwarding(&forward, &open, &times, &is_over);
            self.others.push(named("forward").spawn(work).map_err(no_thread)?);
        }
        Ok(())
    }

    /// Which recorder had which number, as far as the archive knows.
    fn remember_numbers(&self, recorders: impl Iterator<Item = String>) -> Result<(), Error> {
        for recorder in recorders {
            let (collector, name) = (self.shared.options.name.clone(), recorder.clone());
            let bookmark =
                self.shared.writer.with(move |archive| archive.bookmark(&collector, &name))?;
            if let Some(log) = bookmark.and_then(|bookmark| bookmark.log) {
                self.shared.known.note(&LogIdentity::from_bytes(log), &recorder);
            }
        }
        Ok(())
    }

    /// Archives the site file for each recorder of which the archive has another version, or none.
    fn archive_site(&self, recorders: impl Iterator<Item = String>) -> Result<(), Error> {
        let text = self.shared.options.site_text.clone();
        let Some(text) = text.filter(|text| SiteRecord::holds(text)) else { return Ok(()) };
        let (collector, recorders) = (self.shared.options.name.clone(), recorders.collect());
        self.shared.writer.with(move |archive| site_to(archive, &collector, recorders, &text))
    }

    /// How each recorder is.
    #[must_use]
    pub fn states(&self) -> Vec<State> {
        self.shared.states.all()
    }

    /// Whether no recorder is read any more.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.recorders.iter().all(JoinHandle::is_finished)
    }

    /// Whether a thread has ended that nobody wanted to end: what it did is not done any more.
    #[must_use]
    pub fn has_lost_a_thread(&self) -> bool {
        let mut threads = self.recorders.iter().chain(&self.others);
        let has_ended = threads.any(JoinHandle::is_finished);
        // Asked afterwards, so that threads which end because of it are none of these.
        let is_wanted = self.shared.options.once || self.shared.is_stopped();
        has_ended && !is_wanted
    }

    /// Ends the threads: each says what it knows by now, and leaves its recorder as it was.
    #[must_use]
    pub fn end(mut self) -> Ended {
        self.join();
        if let Err(error) = (self.open)().and_then(|mut archive| upkeep::tell_heads(&mut archive)) {
            tracing::warn!("the heads of the chains are not known: {error}");
        }
        let forward = self.shared.options.forward.as_ref().filter(|_| self.shared.options.once);
        let not_forwarded = forward.and_then(|forward| give_all(forward, &self.open).err());
        let failed = self.shared.failed.lock().unwrap_or_else(PoisonError::into_inner).take();
        let left = &mut *self.shared.left.lock().unwrap_or_else(PoisonError::into_inner);
        Ended { states: self.states(), commands: std::mem::take(left), not_forwarded, failed }
    }

    fn join(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        // What a thread panics with has been told by then, and the recorder stays unread.
        for thread in self.recorders.drain(..) {
            _ = thread.join();
        }
        // What was read last is still given away, if that goes at once.
        self.is_read.store(true, Ordering::Relaxed);
        for thread in self.others.drain(..) {
            _ = thread.join();
        }
    }
}

/// Adds a version of the site file for each recorder whose last one is another.
fn site_to(
    archive: &mut Archive,
    collector: &str,
    mut recorders: Vec<String>,
    text: &str,
) -> Result<(), Error> {
    let mut last = BTreeMap::new();
    archive.of_kind("site", &mut |recorder, record| {
        if let Record::Site(site) = record {
            last.insert(recorder.to_owned(), site.text);
        }
        Ok(())
    })?;
    recorders.retain(|recorder| last.get(recorder).is_none_or(|last| last != text));
    let at = host_reading::now();
    let version = || vec![Record::Site(SiteRecord { at, text: text.to_owned() })];
    let batch = |recorder: String| Batch::of(collector, recorder, version(), at.utc);
    archive.append(&recorders.into_iter().map(batch).collect::<Vec<_>>()).map(|_| ())
}

impl Ended {
    /// The recorders that were not read in the end.
    pub fn not_reached(&self) -> impl Iterator<Item = &State> {
        let is_missed = |state: &&State| matches!(state.reached, Reached::No | Reached::NotYet);
        self.states.iter().filter(is_missed)
    }
}

impl Drop for Collector {
    fn drop(&mut self) {
        self.join();
    }
}

fn no_thread(error: io::Error) -> Error {
    Error::Database { archive: "a thread".to_owned(), source: error.into() }
}
