//! Names of incidents: recorder, life and sequence of an entry, as in `U1-SER1/9f3c/120`.
//!
//! The list gives an incident the name of its first entry. Any other entry of it names it as well,
//! so a name stays good when more is learnt of clocks and another entry comes first.

use std::str::FromStr;

use ser_archive::Archive;
use ser_console::Harmless;
use ser_evidence::record::Life;
use ser_evidence::timeline::{EventId, Timeline};

use crate::error::{Failure, Result};

/// The fewest digits of a life that a name has.
const FEWEST: usize = 4;

/// The name of an incident as a user gives it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct IncidentName {
    recorder: String,
    /// How the name of the life begins.
    life: String,
    sequence: u64,
}

/// An entry by which an incident is named.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct NamedEntry {
    pub(crate) recorder: String,
    pub(crate) life: Life,
    pub(crate) sequence: u64,
}

impl FromStr for IncidentName {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<IncidentName, String> {
        let wrong = "not the name of an incident, like U1-SER1/9f3c/120: recorder, the first digits \
                     of the life, and a sequence; ser-cli incident list shows them";
        // A recorder without a site file is named after its port, with slashes.
        let mut parts = text.trim().rsplitn(3, '/');
        let (sequence, life, recorder) = (parts.next(), parts.next(), parts.next());
        let sequence = sequence.and_then(|sequence| sequence.parse().ok()).ok_or(wrong)?;
        let is_hex = |life: &&str| {
            (1..=16).contains(&life.len())
                && life.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
        };
        let life = life.filter(is_hex).ok_or(wrong)?.to_owned();
        let recorder = recorder.filter(|name| !name.is_empty()).ok_or(wrong)?.to_owned();
        Ok(IncidentName { recorder, life, sequence })
    }
}

impl IncidentName {
    /// The entry that is meant.
    pub(crate) fn entry(&self, archive: &mut Archive) -> Result<NamedEntry> {
        let IncidentName { recorder, life, sequence } = self;
        let lives = archive.lives(recorder)?;
        let is_meant = |found: &&Life| found.to_string().starts_with(life);
        let mut meant = lives.iter().filter(is_meant);
        let hint = "ser-cli incident list shows the names of incidents";
        let shown = Harmless(recorder).line();
        match (meant.next(), meant.next()) {
            (Some(&life), None) => {
                Ok(NamedEntry { recorder: recorder.clone(), life, sequence: *sequence })
            }
            (None, _) if lives.is_empty() => {
                Err(Failure::usage(format!("the archive has no recorder {shown}")).hint(hint))
            }
            (None, _) => {
                Err(Failure::usage(format!("no life of {shown} begins with {life}")).hint(hint))
            }
            (Some(_), Some(_)) => {
                Err(Failure::usage(format!("several lives of {shown} begin with {life}"))
                    .hint("give more digits of the life"))
            }
        }
    }
}

impl NamedEntry {
    /// Of an entry of a timeline.
    pub(crate) fn of(timeline: &Timeline<'_>, event: EventId) -> Option<NamedEntry> {
        Some(NamedEntry {
            recorder: timeline.recorder(event)?.recorder.name.clone(),
            life: timeline.life(event)?.name(),
            sequence: timeline.held(event)?.sequence,
        })
    }

    /// The entry in a timeline, if it is there.
    pub(crate) fn find(&self, timeline: &Timeline<'_>) -> Option<EventId> {
        let mut recorders = (0_u32..).zip(&timeline.history().recorders);
        let (recorder, history) =
            recorders.find(|(_, history)| history.recorder.name == self.recorder)?;
        let mut lives = (0_u32..).zip(&history.lives);
        let (life, entries) = lives.find(|(_, life)| life.name() == self.life)?;
        entries.entry(self.sequence)?;
        let place = u32::try_from(entries.place_of(self.sequence)).ok()?;
        Some(EventId { recorder, life, place })
    }

    /// Its name, with as many digits of the life as tell it from the others of this recorder.
    pub(crate) fn name(&self, lives: &[Life]) -> String {
        let life = self.life.to_string();
        let is_enough = |digits: &usize| {
            let begins = |other: &&Life| {
                life.get(..*digits).is_some_and(|start| other.to_string().starts_with(start))
            };
            lives.iter().filter(begins).count() <= 1
        };
        let digits = (FEWEST..life.len()).find(is_enough).unwrap_or(life.len());
        let life = life.get(..digits).unwrap_or(&life);
        format!("{}/{life}/{}", Harmless(&self.recorder).line(), self.sequence)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_read_as_it_is_written() {
        let life = |bits| Life::from_bits(bits);
        let lives = [life(0x9f3c_5a7e_21b0_4d68), life(0x9f3c_6000_0000_0000), life(7)];
        let entry = |recorder: &str, life, sequence| NamedEntry {
            recorder: recorder.to_owned(),
            life,
            sequence,
        };
        for (entry, name) in [
            (entry("U1", lives[0], 120), "U1/9f3c5/120"),
            (entry("/dev/ttyUSB0", lives[2], 7), "/dev/ttyUSB0/0000/7"),
        ] {
            assert_eq!(entry.name(&lives), name);
            let read: IncidentName = name.parse().unwrap();
            assert_eq!((read.recorder, read.sequence), (entry.recorder, entry.sequence));
            assert!(entry.life.to_string().starts_with(&read.life));
        }
        for wrong in ["", "U1", "U1/120", "/9f3c/120", "U1/9f3g/120", "U1/9f3c/x", "U1//1"] {
            assert!(wrong.parse::<IncidentName>().is_err(), "{wrong}");
        }
    }
}
