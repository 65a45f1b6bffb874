//! Adds a note to an archive.

use ser_archive::{Archive, Batch};
use ser_console::is_obeyed;
use ser_evidence::record::{NoteRecord, Record};
use ser_observer::Author;

use super::OnArgs;
use super::known::Notes;

use crate::archive::NamedEntry;
use crate::audit;
use crate::error::{Failure, Result, inform};
use crate::output::PROGRAM;
use ser_observer::host_reading;

/// Adds a note on an incident, unless the same person has just said the same.
pub(super) fn add(on: &OnArgs, text: &str, closes: bool) -> Result<()> {
    let text = text.trim();
    fits(text, closes)?;
    let mut archive = on.archive.write()?;
    let entry = on.incident.entry(&mut archive)?;
    check(&mut archive, &entry)?;
    let lives = archive.lives(&entry.recorder)?;
    let name = entry.name(&lives);
    let notes = Notes::of(&mut archive)?;
    let author = Author::of_this_program(PROGRAM);
    let (user, host) = (author.user().to_owned(), author.host().to_owned());
    let is_same =
        |last: &&&NoteRecord| (&*last.text, last.closes, &*last.user) == (text, closes, &*user);
    if notes.on([entry.clone()].into_iter()).last().filter(is_same).is_some() {
        inform(format_args!("{name} has this note already"));
        return Ok(());
    }
    let at = host_reading::now();
    let collector = audit::collector();
    let NamedEntry { recorder, life, sequence } = entry;
    let note = NoteRecord { at, user, host, life, sequence, text: text.to_owned(), closes };
    let records = vec![Record::Note(note)];
    archive.append(&[Batch::of(collector, recorder, records, at.utc)])?;
    inform(match closes {
        true => format!("{name} is closed"),
        false => format!("the note on {name} is kept"),
    });
    Ok(())
}

/// A note on nothing would never be shown again.
fn check(archive: &mut Archive, entry: &NamedEntry) -> Result<()> {
    let wanted = ser_archive::Wanted {
        places: vec![(entry.life, entry.sequence)],
        ..ser_archive::Wanted::default()
    };
    let mut is_there = false;
    archive.excerpt(&entry.recorder, &wanted, &mut |record| {
        if let Record::Entry(found) = record {
            is_there |= (found.life, found.sequence) == (entry.life, Some(entry.sequence));
        }
        Ok(())
    })?;
    match is_there {
        true => Ok(()),
        false => Err(Failure::usage("the archive has no such entry")
            .hint("ser-cli incident list shows the names of incidents")),
    }
}

fn fits(text: &str, closes: bool) -> Result<()> {
    if text.is_empty() && !closes {
        return Err(
            Failure::usage("the note is empty").hint("say something, or close the incident")
        );
    }
    if text.chars().any(is_obeyed) {
        return Err(Failure::usage("a note is one line, without control characters")
            .hint("write several notes for several lines"));
    }
    if text.chars().count() > NoteRecord::LONGEST {
        let longest = NoteRecord::LONGEST;
        return Err(Failure::usage(format!("a note has at most {longest} characters"))
            .hint("write several notes"));
    }
    Ok(())
}
