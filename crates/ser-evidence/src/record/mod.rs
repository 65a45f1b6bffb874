//! What is known of recorders, as it was read: each piece of evidence is a record.
//!
//! Records say what was read and when; they say nothing about what it means. The same records in
//! any order, from any number of files, give the same timeline.

mod clock;
mod command;
mod entry;
mod gap;
mod life;
mod names;
mod note;
mod site;
mod suppressed;
mod watched;

pub use clock::{Boot, ClockObservation, ClockStep, Fellow, HostReading, How, Place, Reference};
pub use command::{CommandRecord, Outcome};
pub use entry::EntryRecord;
pub use gap::{Gap, Lost, Why};
pub use life::{Life, LifeRecord};
pub use names::{PointRecord, RecorderRecord};
pub use note::NoteRecord;
pub use site::SiteRecord;
pub use suppressed::Suppressed;
pub use watched::Watched;

/// One piece of evidence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Record {
    /// One sample in which inputs changed.
    Entry(EntryRecord),
    /// What is known to be missing.
    Gap(Gap),
    /// What a recorder's clock showed at a known time.
    Clock(ClockObservation),
    /// A recorder's clock may have been set here, and nothing more is known about that.
    Step(ClockStep),
    /// What is known of a life of a recorder's log.
    Life(LifeRecord),
    /// From when to when nothing was missed.
    Watched(Watched),
    /// How many changes the recorder had left out.
    Suppressed(Suppressed),
    /// What an input is called.
    Point(PointRecord),
    /// In what time the stamps are.
    Recorder(RecorderRecord),
    /// A command that changed the recorder, or may have. It takes no part in a timeline.
    Command(CommandRecord),
    /// What a person says about an incident.
    Note(NoteRecord),
    /// A version of the site file.
    Site(SiteRecord),
}

/// A record and the recorder that it is about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Told {
    /// The recorder's name.
    pub recorder: String,
    /// The piece of evidence.
    pub record: Record,
}
