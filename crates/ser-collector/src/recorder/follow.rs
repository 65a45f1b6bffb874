//! A visit to a recorder: it is met, and its log is followed until something fails.

use ser_archive::Bookmark;
use ser_client::{Cursor, LogFollower, LogWatcher, Unit};
use ser_evidence::record::{ClockObservation, ClockStep, Record, Reference};

use super::Task;
use super::duties::Duties;
use super::filing::Filing;
use super::meet::Memory;
use super::plan::Plan;
use crate::pause::HEARTBEAT;
use crate::trouble::Trouble;

impl Task {
    /// Visits the recorder until something fails, or reads it once. `all_is_well` is called when it
    /// was read.
    pub(super) fn visit(
        &self,
        memory: &mut Memory,
        all_is_well: &mut dyn FnMut(),
    ) -> Result<(), Trouble> {
        let shared = &self.shared;
        let (collector, recorder) = (shared.options.name.clone(), self.recorder.name.clone());
        let bookmark =
            shared.writer.with(move |archive| archive.bookmark(&collector, &recorder))?;
        let mut unit = shared.ports.open(&self.recorder, shared.options.line, &shared.stop)?;
        self.audit(&mut unit, &memory.unfiled);
        let known = bookmark.and_then(|bookmark| bookmark.log_size);
        let plan = self.plan(&mut unit, known, &mut memory.found)?;
        let met = self.meet(&mut unit, bookmark.as_ref(), memory)?;
        let follower = LogFollower::new(bookmark.as_ref().map(cursor), plan.size);
        if memory.unproven_of != met.log {
            memory.unproven.clear();
        }
        memory.unproven_of = met.log;
        let follower = if met.is_another { follower.of_another_log() } else { follower };
        let mut visit = Visit {
            task: self,
            watcher: plan.watcher(follower, self),
            filing: Filing::new(self, &met, bookmark.as_ref(), memory.life.take()),
            duties: Duties::new(
                self,
                &unit,
                met.log,
                (memory.left_out.take(), memory.set_due.take()),
            ),
        };
        let ended = visit.follow(&mut unit, memory, all_is_well);
        visit.end(&mut unit, &plan, memory, ended)
    }
}

struct Visit<'t> {
    task: &'t Task,
    watcher: LogWatcher,
    filing: Filing<'t>,
    duties: Duties<'t>,
}

impl Visit<'_> {
    fn follow(
        &mut self,
        unit: &mut Unit,
        memory: &mut Memory,
        all_is_well: &mut dyn FnMut(),
    ) -> Result<(), Trouble> {
        let shared = &self.task.shared;
        loop {
            if shared.is_stopped() {
                return Err(Trouble::Stopped);
            }
            let Visit { watcher, filing, duties, .. } = self;
            let mut is_idle = true;
            let step = watcher.step(unit, HEARTBEAT, &mut |step| {
                is_idle &= step.deliveries.is_empty();
                filing.take(step)
            });
            if matches!(step, Err(Trouble::NewLog)) {
                // It may also be that for a while there was another recorder here.
                memory.is_of_another_log = filing.is_still_there(unit).is_ok();
            }
            if matches!(step, Err(Trouble::Held)) {
                // A reading in a storm never ends, so what is held is confirmed in the middle of it.
                filing.confirm(unit)?;
                watcher.read_next();
                continue;
            }
            step?;
            // A reading of the log, and not just a look for reports.
            let has_read = watcher.complete_at().is_some();
            if has_read && filing.is_holding() {
                filing.confirm(unit)?;
            }
            if has_read {
                memory.is_of_another_log = false;
                duties.read(filing, watcher.complete_at());
                duties.due(unit, filing, is_idle, &mut memory.unproven)?;
                if !memory.unproven.is_empty() {
                    // What a clock showed must not be said of another recorder.
                    filing.is_still_there(unit)?;
                    filing.is_said();
                    memory.unsaid.append(&mut memory.unproven);
                }
                note(filing, memory)?;
                all_is_well();
                if shared.options.once {
                    return Ok(());
                }
            }
        }
    }

    /// Says what is known by now, and leaves the recorder as it was.
    fn end(
        &mut self,
        unit: &mut Unit,
        plan: &Plan,
        memory: &mut Memory,
        ended: Result<(), Trouble>,
    ) -> Result<(), Trouble> {
        memory.has_switched |= self.watcher.has_switched();
        if matches!(ended, Ok(()) | Err(Trouble::Stopped)) {
            let is_there = self.filing.is_still_there(unit);
            // The setting of another recorder is left alone.
            if !matches!(is_there, Err(Trouble::Unproven)) {
                plan.put_back(memory.has_switched, unit, &self.task.recorder.name);
            }
            if is_there.is_ok() {
                let last = self.duties.last(unit, &self.filing);
                if self.filing.is_still_there(unit).is_ok() {
                    memory.unsaid.append(&mut memory.unproven);
                    memory.unsaid.extend(last);
                }
            }
        } else if self.filing.has_anchor() {
            memory.unsaid.extend(self.duties.vouch());
        }
        // That a clock may have been set is told in any case: it costs doubt, and nothing else.
        memory.unsaid.extend(memory.unproven.iter().filter_map(possible_step));
        let is_archive_there = !matches!(ended, Err(Trouble::Archive(_)));
        // What fails now was not promised to anybody.
        let noted = match is_archive_there && !self.filing.is_holding() {
            true => note(&mut self.filing, memory),
            false => Ok(()),
        };
        (memory.life, memory.set_due) = (self.filing.told(), self.duties.set_due());
        // What is not archived yet is news when it is seen again.
        let is_said = memory.unsaid.is_empty() && memory.unproven.is_empty();
        memory.left_out = self.duties.left_out().filter(|_| is_said);
        ended.and(noted)
    }
}

/// Archives what is known besides entries, and commands that still wait for that. What fails waits.
fn note(filing: &mut Filing<'_>, memory: &mut Memory) -> Result<(), Trouble> {
    let waiting = memory.unfiled.take();
    let records = memory.unsaid.iter().chain(&waiting).cloned().collect();
    filing.note(records).inspect_err(|_| memory.unfiled.add(waiting))?;
    memory.unsaid.clear();
    Ok(())
}

/// What is left of a record that may be of another recorder: its clock may have been set there.
fn possible_step(record: &Record) -> Option<Record> {
    match record {
        Record::Step(_) => Some(record.clone()),
        Record::Clock(ClockObservation {
            how, place, at: Reference::Host { reading, .. }, ..
        }) if how.is_set() => Some(Record::Step(ClockStep { place: *place, reading: *reading })),
        _ => None,
    }
}

fn cursor(bookmark: &Bookmark) -> Cursor {
    let Bookmark { sequence, is_exact, anchor, .. } = *bookmark;
    Cursor { sequence, is_exact, anchor }
}
