//! What a printer on the RS-232 line prints: ordered jobs, and auto print.

use heapless::Deque;

use crate::diagnostics::count;
use crate::event_log::EventLog;
use crate::owed::Owed;
use crate::print_line::PrintLine;

/// Print jobs that may wait.
const MAX_JOBS: usize = 4;

/// Entries still to be printed.
#[derive(Clone, Copy, Debug)]
struct Job {
    next: u16,
    left: u16,
}

/// The jobs, and the progress of auto print.
pub(crate) struct Printer {
    jobs: Deque<Job, MAX_JOBS>,
    owed: Owed,
    edges_lost_printed: u32,
}

impl Printer {
    pub(crate) const fn new() -> Printer {
        Printer { jobs: Deque::new(), owed: Owed::ALL, edges_lost_printed: 0 }
    }

    /// Queues a job; false when too many are waiting.
    pub(crate) fn order(&mut self, start: u16, count: u16) -> bool {
        self.jobs.push_back(Job { next: start, left: count }).is_ok()
    }

    /// Notes that auto print was switched on or off. It begins with the next event.
    pub(crate) fn auto_print_changed(&mut self, log: &EventLog<'_>) {
        self.owed = Owed::none(log);
    }

    /// Drops everything still to be printed, because the events were erased: jobs and auto print
    /// alike.
    pub(crate) fn erased(&mut self, log: &EventLog<'_>) {
        self.owed = Owed::none(log);
        self.jobs.clear();
    }

    /// The next line of a job.
    pub(crate) fn next_ordered(&mut self, log: &EventLog<'_>) -> Option<PrintLine> {
        while let Some(job) = self.jobs.front_mut() {
            let entry_number = job.next;
            match log.entry(entry_number) {
                Some(event) if job.left > 0 => {
                    job.next += 1;
                    job.left -= 1;
                    return Some(PrintLine::event(entry_number, event));
                }
                _ => {
                    self.jobs.pop_front();
                }
            }
        }
        None
    }

    /// Notes losses while auto print is off, so that they are not printed later.
    pub(crate) fn is_off(&mut self, edges_lost: u32) {
        self.edges_lost_printed = edges_lost;
    }

    /// The next line of auto print: losses come before the events that are there. Counts events
    /// that were overwritten unprinted.
    pub(crate) fn next_auto(
        &mut self,
        log: &EventLog<'_>,
        edges_lost: u32,
        events_unprinted: &mut u32,
    ) -> Option<PrintLine> {
        let newly_lost = edges_lost - self.edges_lost_printed;
        if newly_lost > 0 {
            self.edges_lost_printed = edges_lost;
            return Some(PrintLine::lost(newly_lost, b"INPUT CHANGES NOT RECORDED"));
        }
        let overwritten = self.owed.skip_overwritten(log);
        if overwritten > 0 {
            count(events_unprinted, overwritten);
            let overwritten = u32::try_from(overwritten).unwrap_or(u32::MAX);
            return Some(PrintLine::lost(overwritten, b"EVENTS NOT PRINTED"));
        }
        let first = self.owed.first();
        let entry_number = log.entry_number(first)?;
        let event = log.entry(entry_number)?;
        self.owed.told(first, 1);
        Some(PrintLine::event(entry_number, event))
    }
}
