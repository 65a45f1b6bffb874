//! What a recorder keeps while its power is off: its number, stored configuration and
//! battery-backed clock.
//!
//! Both are handles. Clones share the same memory, so it outlives the recorder that uses it.

use std::collections::hash_map::RandomState;
use std::convert::Infallible;
use std::hash::BuildHasher;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use chrono::{Local, NaiveDateTime, TimeDelta};
use ser_node::{CopyNumber, RECORD_LEN, Rtc, Storage};
use ser_proto::RecorderId;

/// Memory and clock of one recorder.
#[derive(Clone, Debug)]
pub struct NonVolatile {
    /// Where the configuration is kept.
    pub storage: MemoryStorage,
    /// The battery-backed clock.
    pub rtc: SimRtc,
    /// The number that tells the recorder from all others.
    pub id: Option<RecorderId>,
}

impl NonVolatile {
    /// The memory of a recorder fresh from the factory, whose clock shows this computer's local
    /// time.
    #[must_use]
    pub fn new() -> NonVolatile {
        NonVolatile {
            storage: MemoryStorage::default(),
            rtc: SimRtc::host(),
            id: RecorderId::new(random_id()),
        }
    }
}

/// A number that no other recorder has, as a factory would give it.
pub(crate) fn random_id() -> [u8; RecorderId::LEN] {
    let mut id = *b"sim-........";
    // Every `RandomState` is another one.
    let random = RandomState::new().hash_one(()).to_le_bytes();
    id.iter_mut().skip(4).zip(random).for_each(|(place, byte)| *place = byte);
    id
}

impl Default for NonVolatile {
    fn default() -> Self {
        NonVolatile::new()
    }
}

/// Configuration memory. When new, it is as erased flash.
#[derive(Clone, Debug)]
pub struct MemoryStorage(Arc<Mutex<[[u8; RECORD_LEN]; 2]>>);

impl Default for MemoryStorage {
    fn default() -> Self {
        MemoryStorage(Arc::new(Mutex::new([[0xFF; RECORD_LEN]; 2])))
    }
}

impl Storage for MemoryStorage {
    type Error = Infallible;

    fn read(&mut self, copy: CopyNumber, record: &mut [u8; RECORD_LEN]) -> Result<(), Infallible> {
        *record = lock(&self.0)[copy as usize];
        Ok(())
    }

    fn write(&mut self, copy: CopyNumber, record: &[u8; RECORD_LEN]) -> Result<(), Infallible> {
        lock(&self.0)[copy as usize] = *record;
        Ok(())
    }
}

/// A battery-backed clock.
#[derive(Clone, Debug)]
pub struct SimRtc(Arc<Mutex<Time>>);

#[derive(Clone, Copy, Debug)]
enum Time {
    /// Runs with this computer's local time, this much ahead of it.
    Host {
        ahead: TimeDelta,
    },
    /// Stands still.
    Held(NaiveDateTime),
    Unknown,
}

impl SimRtc {
    /// A clock that shows the local time of this computer until it is set, and runs on from there.
    #[must_use]
    pub fn host() -> SimRtc {
        SimRtc::new(Time::Host { ahead: TimeDelta::zero() })
    }

    /// A clock that shows `time` at every power-up, or the time to which it was last set. Tests
    /// that use it give the same result every time.
    #[must_use]
    pub fn held_at(time: NaiveDateTime) -> SimRtc {
        SimRtc::new(Time::Held(time))
    }

    /// No clock. A recorder without one powers up in 2000.
    #[must_use]
    pub fn absent() -> SimRtc {
        SimRtc::new(Time::Unknown)
    }

    fn new(time: Time) -> SimRtc {
        SimRtc(Arc::new(Mutex::new(time)))
    }
}

impl Rtc for SimRtc {
    fn read(&mut self) -> Option<NaiveDateTime> {
        match *lock(&self.0) {
            Time::Host { ahead } => Local::now().naive_local().checked_add_signed(ahead),
            Time::Held(time) => Some(time),
            Time::Unknown => None,
        }
    }

    fn write(&mut self, now: NaiveDateTime) {
        let mut time = lock(&self.0);
        match *time {
            Time::Host { .. } => *time = Time::Host { ahead: now - Local::now().naive_local() },
            Time::Held(_) => *time = Time::Held(now),
            Time::Unknown => {}
        }
    }
}

/// Locks even a poisoned mutex: a thread that panicked cannot have left anything half changed here.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
