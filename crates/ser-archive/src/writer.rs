//! One writer for many threads.
//!
//! A database has one writer at a time. So one thread owns the archive, and others hand it batches
//! over a queue of bounded length. It writes everything that waits in one transaction and answers
//! when that is on the disk.

use std::sync::mpsc::{Receiver, RecvError, SyncSender, TrySendError, channel, sync_channel};
use std::thread::JoinHandle;

use crate::archive::Archive;
use crate::batch::{Appended, Batch};
use crate::error::{Error, Result};

/// The most records that are written in one transaction with others.
const AT_ONCE: usize = 20_000;

/// A batch, and whom to answer.
struct Order {
    batch: Batch,
    answer: std::sync::mpsc::Sender<Result<Appended>>,
}

/// The thread that owns the archive. Dropping it writes what still waits.
pub struct Writer {
    queue: Option<SyncSender<Order>>,
    thread: Option<JoinHandle<Archive>>,
}

/// What will come of a batch.
#[must_use = "only the answer says whether it was written"]
pub struct Ticket(Receiver<Result<Appended>>);

impl Ticket {
    /// Waits until the batch is on the disk, or cannot be written. What was written of others at the
    /// same time does not count.
    ///
    /// # Errors
    /// Those of [`Archive::append`], and [`Error::WriterGone`].
    pub fn wait(self) -> Result<Appended> {
        self.0.recv().unwrap_or(Err(Error::WriterGone))
    }
}

impl Writer {
    /// Starts the thread. At most `waiting` batches wait for it.
    ///
    /// # Errors
    /// If the system has no thread to give.
    pub fn start(archive: Archive, waiting: usize) -> std::io::Result<Writer> {
        let (queue, orders) = sync_channel(waiting);
        let thread = std::thread::Builder::new()
            .name("archive".to_owned())
            .spawn(move || write_all(archive, &orders))?;
        Ok(Writer { queue: Some(queue), thread: Some(thread) })
    }

    /// Hands over a batch; waits while the queue is full.
    ///
    /// # Errors
    /// [`Error::WriterGone`].
    pub fn append(&self, batch: Batch) -> Result<Ticket> {
        let (answer, ticket) = channel();
        let queue = self.queue.as_ref().ok_or(Error::WriterGone)?;
        queue.send(Order { batch, answer }).map_err(|_| Error::WriterGone)?;
        Ok(Ticket(ticket))
    }

    /// Hands over a batch, or gives it back if the queue is full.
    ///
    /// # Errors
    /// [`Error::WriterGone`].
    pub fn try_append(&self, batch: Batch) -> Result<std::result::Result<Ticket, Batch>> {
        let (answer, ticket) = channel();
        let queue = self.queue.as_ref().ok_or(Error::WriterGone)?;
        match queue.try_send(Order { batch, answer }) {
            Ok(()) => Ok(Ok(Ticket(ticket))),
            Err(TrySendError::Full(order)) => Ok(Err(order.batch)),
            Err(TrySendError::Disconnected(_)) => Err(Error::WriterGone),
        }
    }

    /// Writes what waits, ends the thread, and gives the archive back.
    ///
    /// # Errors
    /// [`Error::WriterGone`] if it had ended already.
    pub fn end(mut self) -> Result<Archive> {
        self.queue = None;
        let thread = self.thread.take().ok_or(Error::WriterGone)?;
        thread.join().map_err(|_| Error::WriterGone)
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        self.queue = None;
        if let Some(thread) = self.thread.take() {
            _ = thread.join();
        }
    }
}

fn write_all(mut archive: Archive, orders: &Receiver<Order>) -> Archive {
    loop {
        let first = match orders.recv() {
            Ok(order) => order,
            Err(RecvError) => return archive,
        };
        let mut records = first.batch.records.len();
        let (mut batches, mut answers) = (vec![first.batch], vec![first.answer]);
        while records < AT_ONCE
            && let Ok(order) = orders.try_recv()
        {
            // A batch that only moves a bookmark counts as well, or this might never end.
            records += order.batch.records.len().max(1);
            batches.push(order.batch);
            answers.push(order.answer);
        }
        let together = match batches.len() {
            1 => None,
            _ => match archive.append(&batches) {
                Ok(appended) => Some(appended.into_iter().map(Ok).collect::<Vec<_>>()),
                // Each alone would wait as long again.
                Err(Error::Busy { archive }) => {
                    let busy = |_| Err(Error::Busy { archive: archive.clone() });
                    Some(batches.iter().map(busy).collect())
                }
                Err(_) => None,
            },
        };
        let mut together = together.map(Vec::into_iter);
        for (batch, answer) in batches.iter().zip(answers) {
            // Alone, a batch that cannot be written keeps nobody else from being written.
            let appended = match together.as_mut().and_then(Iterator::next) {
                Some(appended) => appended,
                None => archive.append_alone(batch),
            };
            // Who asked may have gone away meanwhile. It is written all the same.
            _ = answer.send(appended);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::Duration;

    use ser_evidence::record::{PointRecord, Record};
    use ser_evidence::time::Moment;

    use super::*;
    use crate::archive::Access;
    use crate::place::Place;
    use crate::sql::{OnRow, Sql, Value};

    /// A database to which another program writes for ever. It counts how often somebody waited.
    struct Taken(Arc<AtomicUsize>);

    impl Sql for Taken {
        fn name(&self) -> &str {
            "plant.db"
        }

        fn begin(&mut self) -> Result<()> {
            self.0.fetch_add(1, Ordering::Relaxed);
            Err(Error::Busy { archive: "plant.db".to_owned() })
        }

        fn roll_back(&mut self) {}

        fn set_patience(&mut self, _: Duration) -> Result<()> {
            unreachable!()
        }

        fn has_tables(&mut self) -> Result<bool> {
            unreachable!()
        }

        fn migrate(&mut self, _: i64) -> Result<()> {
            unreachable!()
        }

        fn copy_to(&mut self, _: &Path) -> Result<()> {
            unreachable!()
        }

        fn begin_reading(&mut self) -> Result<()> {
            unreachable!()
        }

        fn commit(&mut self) -> Result<()> {
            unreachable!()
        }

        fn run(&mut self, _: &'static str, _: &[Value]) -> Result<u64> {
            unreachable!()
        }

        fn query(&mut self, _: &'static str, _: &[Value], _: OnRow<'_>) -> Result<()> {
            unreachable!()
        }

        fn size(&mut self) -> Result<u64> {
            unreachable!()
        }

        fn evidence_size(&mut self) -> Result<u64> {
            unreachable!()
        }

        fn give_back(&mut self) -> Result<()> {
            unreachable!()
        }
    }

    /// The batches of six recorders, which wait all together. The first has no record, the next has
    /// one, and so on.
    fn waiting() -> (Receiver<Order>, Vec<Ticket>) {
        let (queue, orders) = sync_channel(6);
        let tickets = (0..6).map(|number| {
            let (answer, ticket) = channel();
            let point = |input| {
                Record::Point(PointRecord {
                    input,
                    name: "pump".into(),
                    on: "on".into(),
                    off: "off".into(),
                })
            };
            let batch = Batch {
                collector: "cellar".to_owned(),
                recorder: format!("SER{number}"),
                records: (1..=number).map(point).collect(),
                bookmark: None,
                at: Moment::from_us(0),
            };
            queue.send(Order { batch, answer }).unwrap();
            Ticket(ticket)
        });
        let tickets = tickets.collect();
        (orders, tickets)
    }

    #[test]
    fn each_is_told_what_was_written_of_its_own_batch() {
        let folder = tempfile::tempdir().unwrap();
        let place = Place::File(folder.path().join("plant.db"));
        let archive = Archive::open(&place, Access::Write { program: "a test" }).unwrap();
        let (orders, tickets) = waiting();
        write_all(archive, &orders);
        let answers: Vec<_> = tickets
            .into_iter()
            .map(|ticket| {
                let appended = ticket.wait().unwrap();
                (appended.evidence, appended.position)
            })
            .collect();
        assert_eq!(answers, [(0, 0), (1, 1), (2, 3), (3, 6), (4, 10), (5, 15)]);
    }

    #[test]
    fn who_waits_for_another_program_waits_once_for_all() {
        let waited = Arc::new(AtomicUsize::new(0));
        let archive = Archive { sql: Box::new(Taken(Arc::clone(&waited))) };
        let (orders, tickets) = waiting();
        write_all(archive, &orders);
        for ticket in tickets {
            assert!(matches!(ticket.wait(), Err(Error::Busy { .. })));
        }
        assert_eq!(waited.load(Ordering::Relaxed), 1);
    }
}
