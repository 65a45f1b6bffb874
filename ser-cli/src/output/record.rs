//! The input of the writers of all formats: events and losses, each with its place in the log.

use std::fmt;
use std::io;

use ser_client::{Delivery, Lost};
use ser_evidence::record::Gap;
use ser_files::csv::loss_note;
use ser_observer::new_life;
use ser_proto::{Entry, Model};

use super::{EventWriter, Life};
use crate::time::ClockStep;

/// An event, with its notes.
#[derive(Clone, Debug)]
pub(crate) struct Event {
    /// The recorder's number for it.
    pub(crate) number: u16,
    /// The recorder's total after it, from 1; `None` if that is not known.
    pub(crate) sequence: Option<u64>,
    pub(crate) life: Life,
    /// The entry as it was read.
    pub(crate) entry: Entry,
    /// Remarks for a reader of the entry; usually none.
    pub(crate) notes: Vec<Note>,
}

/// A remark on an event.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Note {
    /// The entry cannot be what the recorder meant, for this reason.
    Odd(String),
    /// Its clock shows an earlier time than at the previous event, which nevertheless came first.
    ClockWentBack,
    /// The two digits of the year have begun again since the previous event: 1970 follows 2069.
    YearsBeganAnew,
}

/// Missing events.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Loss {
    /// The sequence of the last event before the loss; 0 at the beginning of a log.
    pub(crate) after: Option<u64>,
    pub(crate) life: Life,
    pub(crate) lost: Lost,
}

impl Loss {
    /// The loss in a sentence for people.
    pub(crate) fn sentence(&self) -> String {
        let events = |count: u32| match count {
            1 => "1 event was".to_string(),
            _ => format!("{count} events were"),
        };
        match self.lost {
            Lost::Overwritten { count } => {
                format!("{} overwritten before they were read", events(count))
            }
            Lost::OverwrittenAtLeast { count: 1 } => {
                "at least 1 event had been overwritten before the first reading".to_string()
            }
            Lost::OverwrittenAtLeast { count } => {
                format!("at least {count} events had been overwritten before the first reading")
            }
            Lost::LogRestarted => "the log began anew (it was erased, or the power failed); \
                 unread events of the old log are lost, how many is not known"
                .to_string(),
            Lost::Unrecorded { inputs } => {
                let many = if inputs.numbers().count() == 1 { "input" } else { "inputs" };
                format!(
                    "{many} {inputs} changed while nothing was recorded; how often is not known"
                )
            }
        }
    }
}

/// As `lost 37 (exactly) after 120: overwritten`, for a column of notes.
impl fmt::Display for Loss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&loss_note(&Gap::from(self)))
    }
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Note::Odd(why) => f.write_str(why),
            Note::ClockWentBack => ClockStep::Back.fmt(f),
            Note::YearsBeganAnew => ClockStep::YearsBeganAnew.fmt(f),
        }
    }
}

impl Event {
    /// All notes in one text, if there are any.
    pub(crate) fn note(&self) -> Option<String> {
        let notes: Vec<String> = self.notes.iter().map(Note::to_string).collect();
        (!notes.is_empty()).then(|| notes.join("; "))
    }

    /// Whether the entry cannot be what the recorder meant.
    pub(crate) fn is_odd(&self) -> bool {
        self.notes.iter().any(|note| matches!(note, Note::Odd(_)))
    }
}

/// Turns deliveries into records, one after the other.
pub(crate) struct Annotator {
    life: Life,
    before: Before,
}

/// What an earlier run knew about the log that is read.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Before {
    /// The last event that was delivered.
    pub(crate) previous: Option<Entry>,
    /// The last event before the log was erased, if it was erased right after that. The first event
    /// of the new log continues from its state.
    pub(crate) erased: Option<Entry>,
    /// The name of the next life, if one has been drawn already.
    pub(crate) next_life: Option<Life>,
}

impl Annotator {
    /// For a log of this life.
    pub(crate) fn new(life: Life, before: Before) -> Annotator {
        Annotator { life, before }
    }

    /// The life of the log that is being read.
    pub(crate) fn life(&self) -> Life {
        self.life
    }

    /// Says how the next life of the log is called, unless a name was drawn before.
    pub(crate) fn name_next_life(&mut self, name: Option<Life>) {
        self.before.next_life = self.before.next_life.or(name);
    }

    /// Says that the following entries are unrelated to those before.
    pub(crate) fn begin_anew(&mut self) {
        self.before.previous = None;
    }

    /// Turns a delivery into records, hands these to a writer, and returns them.
    pub(crate) fn write(
        &mut self,
        delivery: &Delivery,
        writer: &mut dyn EventWriter,
    ) -> io::Result<Vec<Record>> {
        let records = self.records(delivery)?;
        for record in &records {
            match record {
                Record::Event(event) => writer.event(event)?,
                Record::Loss(loss) => writer.lost(loss)?,
            }
        }
        Ok(records)
    }

    fn records(&mut self, delivery: &Delivery) -> io::Result<Vec<Record>> {
        let life = self.life;
        Ok(match *delivery {
            Delivery::Event { entry_number, sequence, entry, model } => {
                let notes = notes(&entry, model, self.before.previous.as_ref());
                if entry.time.check().is_ok() {
                    self.before.previous = Some(entry);
                }
                let erased = self.before.erased.take().filter(|_| sequence == Some(1));
                let lost = erased.and_then(|erased| Lost::between(&erased, &entry));
                let loss = lost.map(|lost| Record::Loss(Loss { after: Some(0), life, lost }));
                let event =
                    Record::Event(Event { number: entry_number, sequence, life, entry, notes });
                loss.into_iter().chain([event]).collect()
            }
            Delivery::Lost { after, lost } => {
                if lost == Lost::LogRestarted {
                    self.before.previous = None;
                    if life != Life::UNKNOWN {
                        self.life = self.before.next_life.take().map_or_else(new_life, Ok)?;
                    }
                }
                vec![Record::Loss(Loss { after, life, lost })]
            }
        })
    }
}

/// One item of a reading.
pub(crate) enum Record {
    Event(Event),
    Loss(Loss),
}

fn notes(entry: &Entry, model: Model, previous: Option<&Entry>) -> Vec<Note> {
    let mut notes = Vec::new();
    if let Err(invalid) = entry.time.check() {
        notes.push(Note::Odd(format!("{} {} is out of range", invalid.field(), invalid.value)));
    }
    if entry.changed.is_empty() {
        notes.push(Note::Odd(match entry.state.is_empty() {
            true => "no input changed, none is on".to_string(),
            false => format!("no input changed, on: {}", entry.state),
        }));
    }
    if (entry.changed.0 | entry.state.0) & !model.mask() != 0 {
        let inputs = ser_proto::Inputs((entry.changed.0 | entry.state.0) & !model.mask());
        notes.push(Note::Odd(format!(
            "a recorder of {} inputs has no input {inputs}",
            model.inputs()
        )));
    }
    notes.extend(previous.and_then(|previous| {
        match ClockStep::between(previous.time, entry.time)? {
            ClockStep::Back => Some(Note::ClockWentBack),
            ClockStep::YearsBeganAnew => Some(Note::YearsBeganAnew),
            ClockStep::Forward => None,
        }
    }));
    notes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::testing::entry;
    use ser_proto::{Inputs, TimeStamp};

    fn loss(lost: Lost) -> Loss {
        Loss { after: Some(120), life: Life::UNKNOWN, lost }
    }

    #[test]
    fn a_loss_is_exact_where_it_can_be() {
        for (lost, note, sentence) in [
            (
                Lost::Overwritten { count: 37 },
                "lost 37 (exactly) after 120: overwritten",
                "37 events were overwritten before they were read",
            ),
            (
                Lost::OverwrittenAtLeast { count: 1 },
                "lost 1 (at least) after 120: overwritten",
                "at least 1 event had been overwritten before the first reading",
            ),
            (
                Lost::LogRestarted,
                "lost an unknown number after 120: log began anew",
                "the log began anew (it was erased, or the power failed); unread events of the \
                 old log are \
                 lost, how many is not known",
            ),
            (
                Lost::Unrecorded { inputs: Inputs(0b101) },
                "lost an unknown number after 120: not recorded, inputs 1 3",
                "inputs 1 3 changed while nothing was recorded; how often is not known",
            ),
        ] {
            assert_eq!(loss(lost).to_string(), note);
            assert_eq!(loss(lost).sentence(), sentence);
        }
        let nowhere = Loss { after: None, ..loss(Lost::Overwritten { count: 2 }) };
        assert_eq!(nowhere.to_string(), "lost 2 (exactly): overwritten");
    }

    #[test]
    fn what_cannot_be_is_named_field_by_field() {
        let good = entry("00.250", &[3], &[3]);
        let texts = |entry: &Entry| -> Vec<String> {
            notes(entry, Model::Ser160, None).iter().map(Note::to_string).collect()
        };
        assert_eq!(texts(&good), [""; 0]);
        let time = TimeStamp { month: 13, ..good.time };
        assert_eq!(texts(&Entry { time, ..good }), ["month 13 is out of range"]);
        let time = TimeStamp { millisecond: 1000, ..good.time };
        assert_eq!(texts(&Entry { time, ..good }), ["millisecond 1000 is out of range"]);
        assert_eq!(texts(&Entry { changed: Inputs(0), ..good }), ["no input changed, on: 3"]);
        assert_eq!(
            texts(&Entry { state: Inputs(1 << 16), ..good }),
            ["a recorder of 16 inputs has no input 17"]
        );
    }

    #[test]
    fn a_step_of_the_clock_is_noted_at_the_event_after_it() {
        let later = entry("00.251", &[3], &[3]);
        let earlier = entry("00.250", &[3], &[]);
        let at = |entry: Entry, previous: Entry| notes(&entry, Model::Ser160, Some(&previous));
        assert_eq!(at(later, earlier), []);
        assert_eq!(at(earlier, later), [Note::ClockWentBack]);
        let year = |year| Entry { time: TimeStamp { year, ..later.time }, ..later };
        assert_eq!(at(year(70), year(69)), [Note::YearsBeganAnew]);
        assert_eq!(at(year(69), year(70)), [Note::ClockWentBack]);
        let never = Entry { time: TimeStamp { month: 0, ..later.time }, ..later };
        assert_eq!(at(later, never), []);
    }

    #[test]
    fn a_log_that_begins_anew_gets_a_name_of_its_own_if_it_has_one() {
        let restart = Delivery::Lost { after: Some(7), lost: Lost::LogRestarted };
        let life = new_life().unwrap();
        let mut annotator = Annotator::new(life, Before::default());
        let records = annotator.records(&restart).unwrap();
        let [Record::Loss(loss)] = &records[..] else { panic!() };
        assert_eq!(loss.life, life, "the loss belongs to the log of before");
        assert!(![life, Life::UNKNOWN].contains(&annotator.life()));
        // A name that was drawn before a crash may already be in a file.
        let next = new_life().unwrap();
        let mut annotator =
            Annotator::new(life, Before { next_life: Some(next), ..Before::default() });
        annotator.records(&restart).unwrap();
        assert_eq!(annotator.life(), next);
        let mut annotator = Annotator::new(Life::UNKNOWN, Before::default());
        annotator.records(&restart).unwrap();
        assert_eq!(annotator.life(), Life::UNKNOWN);
    }

    #[test]
    fn a_step_shows_across_an_entry_without_a_date_and_from_run_to_run() {
        let never = TimeStamp { month: 13, ..entry("00.250", &[3], &[3]).time };
        let event = |entry| Delivery::Event {
            entry_number: 1,
            sequence: Some(9),
            entry,
            model: Model::Ser160,
        };
        let before = Before { previous: Some(entry("05.000", &[3], &[3])), ..Before::default() };
        let mut annotator = Annotator::new(Life::UNKNOWN, before);
        let mut noted = |entry| {
            let records = annotator.records(&event(entry)).unwrap();
            let [Record::Event(event)] = &records[..] else { panic!() };
            event.note()
        };
        let odd = noted(Entry { time: never, ..entry("00.250", &[3], &[3]) });
        assert_eq!(odd.as_deref(), Some("month 13 is out of range"));
        assert_eq!(noted(entry("04.000", &[3], &[])).as_deref(), Some("the clock went back"));
        assert_eq!(noted(entry("04.001", &[3], &[3])), None);
    }

    #[test]
    fn what_changed_around_an_erase_without_an_entry_is_told() {
        let before = Before { erased: Some(entry("00.250", &[3], &[3])), ..Before::default() };
        let first = |state: &[u8]| {
            let event = Delivery::Event {
                entry_number: 1,
                sequence: Some(1),
                entry: entry("00.300", &[4], state),
                model: Model::Ser160,
            };
            Annotator::new(Life::UNKNOWN, before).records(&event).unwrap()
        };
        assert!(matches!(&first(&[3, 4])[..], [Record::Event(_)]), "it goes on from there");
        let records = first(&[4]);
        let [Record::Loss(loss), Record::Event(_)] = &records[..] else { panic!() };
        assert_eq!((loss.after, loss.lost), (Some(0), Lost::Unrecorded { inputs: Inputs(0b100) }));
    }
}
