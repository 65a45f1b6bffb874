//! The notes of an archive, by the entries that they are attached to.

use std::collections::BTreeMap;

use ser_archive::Archive;
use ser_evidence::record::{Life, NoteRecord, Record};

use crate::archive::NamedEntry;
use crate::error::Result;

/// All notes.
pub(super) struct Notes {
    by_entry: BTreeMap<(String, Life, u64), Vec<NoteRecord>>,
}

impl Notes {
    /// Those of an archive.
    pub(super) fn of(archive: &mut Archive) -> Result<Notes> {
        let mut by_entry: BTreeMap<_, Vec<NoteRecord>> = BTreeMap::new();
        archive.of_kind("note", &mut |recorder, record| {
            if let Record::Note(note) = record {
                let place = (recorder.to_owned(), note.life, note.sequence);
                by_entry.entry(place).or_default().push(note);
            }
            Ok(())
        })?;
        Ok(Notes { by_entry })
    }

    /// Those on an incident with these entries, in the order in which they were written.
    pub(super) fn on(&self, entries: impl Iterator<Item = NamedEntry>) -> Vec<&NoteRecord> {
        let mut notes: Vec<&NoteRecord> = entries
            .filter_map(|NamedEntry { recorder, life, sequence }| {
                self.by_entry.get(&(recorder, life, sequence))
            })
            .flatten()
            .collect();
        // The archive has them in this order; clocks of several computers may disagree.
        notes.sort_by_key(|note| note.at.utc);
        notes
    }
}
