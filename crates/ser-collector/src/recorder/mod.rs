//! What the thread of a recorder does: it visits it, again and again.

mod audit;
mod duties;
mod filing;
mod follow;
mod meet;
mod plan;

use std::sync::Arc;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use ser_archive::Writer;
use ser_evidence::record::Told;
use ser_evidence::site::Recorder;
use tracing::{debug, info, warn};

use crate::options::Options;
use crate::pause::{self, Pause};
use crate::ports::Ports;
use crate::states::{Reached, States};
use crate::trouble::Trouble;
use meet::{Known, Memory};

/// What all threads share.
pub(crate) struct Shared {
    pub(crate) options: Options,
    pub(crate) writer: Writer,
    pub(crate) states: States,
    pub(crate) ports: Ports,
    pub(crate) known: Known,
    pub(crate) stop: Arc<AtomicBool>,
    /// Commands that could not be archived to the end, and their recorders.
    pub(crate) left: Mutex<Vec<Told>>,
    /// Why the collector cannot go on at all.
    pub(crate) failed: Mutex<Option<Trouble>>,
}

impl Shared {
    pub(crate) fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

/// A recorder that is to be read.
pub(crate) struct Task {
    /// Its place in the list of states.
    pub(crate) place: usize,
    pub(crate) recorder: Recorder,
    pub(crate) shared: Arc<Shared>,
}

impl Task {
    /// Reads the recorder until the end, or once.
    pub(crate) fn run(&self) {
        let mut memory = Memory::default();
        self.read(&mut memory);
        let told = |record| Told { recorder: self.recorder.name.clone(), record };
        let left = memory.unfiled.take().into_iter().map(told);
        self.shared.left.lock().unwrap_or_else(std::sync::PoisonError::into_inner).extend(left);
    }

    fn read(&self, memory: &mut Memory) {
        let times = self.shared.options.times;
        let (mut pause, mut is_known) = (Pause::new(&times), self.shared.options.once);
        let mut told: Option<(Instant, String)> = None;
        while !self.shared.is_stopped() {
            let visit = self.visit(memory, &mut || {
                pause.is_over();
                let name = &self.recorder.name;
                match (told.take(), std::mem::replace(&mut is_known, true)) {
                    (Some(_), _) => info!("{name} is being read again"),
                    (None, false) => info!("{name} is being read"),
                    (None, true) => {}
                }
                self.reached(Reached::Yes, None);
            });
            let trouble = match visit {
                Ok(()) => {
                    self.reached(Reached::Done, None);
                    return;
                }
                Err(Trouble::Stopped) => return,
                Err(trouble @ (Trouble::NewLog | Trouble::Unproven)) => {
                    debug!(recorder = self.recorder.name, "{trouble}");
                    continue;
                }
                Err(trouble) => trouble,
            };
            self.shared.ports.after(&trouble, &self.recorder);
            let text = trouble.to_string();
            let is_news = told
                .as_ref()
                .is_none_or(|(at, before)| *before != text || at.elapsed() >= times.tell_again);
            if is_news {
                self.tell(&trouble);
                told = Some((Instant::now(), text));
            }
            self.reached(Reached::No, Some(&trouble));
            if trouble.is_of_archive_for_good() {
                self.give_up(trouble);
                return;
            }
            if self.shared.options.once {
                return;
            }
            pause::wait(pause.next(), &self.shared.stop);
        }
    }

    fn tell(&self, trouble: &Trouble) {
        let recorder = &self.recorder.name;
        match trouble.hint() {
            Some(hint) => warn!(hint, "{recorder}: {trouble}"),
            None => warn!("{recorder}: {trouble}"),
        }
    }

    fn reached(&self, reached: Reached, trouble: Option<&Trouble>) {
        let trouble = trouble.map(|trouble| (trouble.to_string(), trouble.hint()));
        self.shared.states.change(self.place, |state| {
            (state.reached, state.trouble) = (reached, trouble);
        });
    }

    /// Ends the whole collector: nothing can be archived.
    fn give_up(&self, trouble: Trouble) {
        let failed = self.shared.failed.lock();
        failed.unwrap_or_else(std::sync::PoisonError::into_inner).get_or_insert(trouble);
        self.shared.stop.store(true, Ordering::Relaxed);
    }
}
