//! One writer for many threads.
//!
//! A database has one writer at a time. So one thread owns the archive, and others hand it batches
//! over a queue of bounded length. It writes everything that waits in one transaction and answers
//! when that is on the disk. Where the connection to a server is lost, it makes another one.

use std::sync::mpsc::{Receiver, RecvError, SyncSender, TrySendError, channel, sync_channel};
use std::thread::JoinHandle;

use crate::archive::Archive;
use crate::batch::{Appended, Batch};
use crate::error::{Error, Result};

/// The most records that are written in one transaction with others.
const AT_ONCE: usize = 20_000;

/// Makes the archive ready, the first time and whenever it was lost.
type Open = dyn FnMut() -> Result<Archive> + Send;

/// What the thread is to do.
enum Order {
    /// To write a batch.
    Append(Written),
    /// To do something else with the archive, if it is ready.
    Use(Box<Act>),
}

/// Something else than writing a batch. Returns whether the archive is lost.
type Act = dyn FnOnce(Result<&mut Archive>) -> bool + Send;

/// A batch, and whom to answer.
struct Written {
    batch: Batch,
    answer: std::sync::mpsc::Sender<Result<Appended>>,
}

/// The thread that owns the archive. Dropping it writes what still waits.
pub struct Writer {
    queue: Option<SyncSender<Order>>,
    thread: Option<JoinHandle<Option<Archive>>>,
}

/// What will come of a batch.
#[must_use = "only the answer says whether it was written"]
pub struct Ticket(Receiver<Result<Appended>>);

impl Ticket {
    /// Waits until the batch is on the disk, or cannot be written. What was written of others at
    /// the same time does not count.
    ///
    /// # Errors
    /// Those of [`Archive::append`], and [`Error::WriterGone`].
    pub fn wait(self) -> Result<Appended> {
        self.0.recv().unwrap_or(Err(Error::WriterGone))
    }
}

impl Writer {
    /// Starts the thread, for an archive that `open` makes ready: when it is first needed, and
    /// again after it was lost. At most `waiting` orders wait for it.
    ///
    /// # Errors
    /// If the system has no thread to give.
    pub fn start(
        open: impl FnMut() -> Result<Archive> + Send + 'static,
        waiting: usize,
    ) -> std::io::Result<Writer> {
        let (queue, orders) = sync_channel(waiting);
        let open: Box<Open> = Box::new(open);
        let thread = std::thread::Builder::new()
            .name("archive".to_owned())
            .spawn(move || Desk { open, archive: None }.serve(&orders))?;
        Ok(Writer { queue: Some(queue), thread: Some(thread) })
    }

    /// Hands over a batch; waits while the queue is full.
    ///
    /// # Errors
    /// [`Error::WriterGone`].
    pub fn append(&self, batch: Batch) -> Result<Ticket> {
        let (answer, ticket) = channel();
        let queue = self.queue.as_ref().ok_or(Error::WriterGone)?;
        let order = Order::Append(Written { batch, answer });
        queue.send(order).map_err(|_| Error::WriterGone)?;
        Ok(Ticket(ticket))
    }

    /// Hands over a batch, or gives it back if the queue is full.
    ///
    /// # Errors
    /// [`Error::WriterGone`].
    pub fn try_append(&self, batch: Batch) -> Result<std::result::Result<Ticket, Batch>> {
        let (answer, ticket) = channel();
        let queue = self.queue.as_ref().ok_or(Error::WriterGone)?;
        match queue.try_send(Order::Append(Written { batch, answer })) {
            Ok(()) => Ok(Ok(Ticket(ticket))),
            Err(TrySendError::Full(Order::Append(Written { batch, .. }))) => Ok(Err(batch)),
            Err(_) => Err(Error::WriterGone),
        }
    }

    /// Does something else with the archive, in turn with what others want, and waits for it.
    ///
    /// # Errors
    /// Those of `act`, those of opening the archive, and [`Error::WriterGone`].
    pub fn with<T: Send + 'static>(
        &self,
        act: impl FnOnce(&mut Archive) -> Result<T> + Send + 'static,
    ) -> Result<T> {
        let (answer, done) = channel();
        let act = move |archive: Result<&mut Archive>| {
            let result = archive.and_then(act);
            let is_lost = matches!(result, Err(Error::Lost { .. }));
            // Who asked may have gone away meanwhile.
            _ = answer.send(result);
            is_lost
        };
        let queue = self.queue.as_ref().ok_or(Error::WriterGone)?;
        queue.send(Order::Use(Box::new(act))).map_err(|_| Error::WriterGone)?;
        done.recv().unwrap_or(Err(Error::WriterGone))
    }

    /// Writes what waits, ends the thread, and gives the archive back, if it was ever ready and is
    /// not lost.
    ///
    /// # Errors
    /// [`Error::WriterGone`] if it had ended already.
    pub fn end(mut self) -> Result<Option<Archive>> {
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

/// Where orders are carried out.
struct Desk {
    open: Box<Open>,
    archive: Option<Archive>,
}

impl Desk {
    fn serve(mut self, orders: &Receiver<Order>) -> Option<Archive> {
        let mut next = None;
        loop {
            let order = match next.take().map_or_else(|| orders.recv(), Ok) {
                Ok(order) => order,
                Err(RecvError) => return self.archive,
            };
            match order {
                Order::Append(first) => next = self.append_waiting(first, orders),
                Order::Use(act) => {
                    if act(self.ready()) {
                        self.archive = None;
                    }
                }
            }
        }
    }

    /// The archive, which is opened if need be.
    fn ready(&mut self) -> Result<&mut Archive> {
        match &mut self.archive {
            Some(archive) => Ok(archive),
            archive => Ok(archive.insert((self.open)()?)),
        }
    }

    /// Writes a batch, and with it what waits. Returns an order that came behind these.
    fn append_waiting(&mut self, first: Written, orders: &Receiver<Order>) -> Option<Order> {
        let mut records = first.batch.records.len();
        let (mut batches, mut answers) = (vec![first.batch], vec![first.answer]);
        let mut next = None;
        while records < AT_ONCE
            && let Ok(order) = orders.try_recv()
        {
            match order {
                Order::Append(Written { batch, answer }) => {
                    // A batch that only moves a bookmark counts as well, or this might never end.
                    records += batch.records.len().max(1);
                    batches.push(batch);
                    answers.push(answer);
                }
                order @ Order::Use(_) => {
                    next = Some(order);
                    break;
                }
            }
        }
        let mut together = self.append_together(&batches).map(Vec::into_iter);
        for (batch, answer) in batches.iter().zip(answers) {
            // Alone, a batch that cannot be written keeps nobody else from being written.
            let appended = match together.as_mut().and_then(Iterator::next) {
                Some(appended) => appended,
                None => self.ready().and_then(|archive| archive.append_alone(batch)),
            };
            if matches!(appended, Err(Error::Lost { .. })) {
                self.archive = None;
            }
            // Who asked may have gone away meanwhile. It is written all the same.
            _ = answer.send(appended);
        }
        next
    }

    /// What has come of each of several batches; `None` if each must be tried alone.
    fn append_together(&mut self, batches: &[Batch]) -> Option<Vec<Result<Appended>>> {
        if batches.len() == 1 {
            return None;
        }
        match self.ready().and_then(|archive| archive.append(batches)) {
            Ok(appended) => Some(appended.into_iter().map(Ok).collect()),
            // Each alone would wait as long again.
            Err(Error::Busy { archive }) => {
                let busy = |_| Err(Error::Busy { archive: archive.clone() });
                Some(batches.iter().map(busy).collect())
            }
            Err(Error::Lost { archive }) => {
                let lost = |_| Err(Error::Lost { archive: archive.clone() });
                Some(batches.iter().map(lost).collect())
            }
            Err(_) => None,
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
                joins: false,
                at: Moment::from_us(0),
            };
            queue.send(Order::Append(Written { batch, answer })).unwrap();
            Ticket(ticket)
        });
        let tickets = tickets.collect();
        (orders, tickets)
    }

    fn nowhere() -> Result<Archive> {
        Err(Error::Missing { archive: "plant.db".to_owned() })
    }

    #[test]
    fn an_archive_that_was_lost_is_opened_anew_when_it_is_needed() {
        let folder = tempfile::tempdir().unwrap();
        let place = Place::File(folder.path().join("plant.db"));
        let mut tries = 0;
        let open = move || {
            tries += 1;
            match tries {
                2 => Err(Error::Busy { archive: "plant.db".to_owned() }),
                _ => Archive::open(&place, Access::Write { program: "a test" }),
            }
        };
        let writer = Writer::start(open, 2).unwrap();
        assert_eq!(writer.with(Archive::position).unwrap(), 0);
        let lost = |_: &mut Archive| Err::<(), _>(Error::Lost { archive: "plant.db".to_owned() });
        assert!(matches!(writer.with(lost), Err(Error::Lost { .. })));
        assert!(matches!(writer.with(Archive::position), Err(Error::Busy { .. })));
        assert_eq!(writer.with(Archive::position).unwrap(), 0);
        assert!(writer.end().unwrap().is_some());
    }

    #[test]
    fn each_is_told_what_was_written_of_its_own_batch() {
        let folder = tempfile::tempdir().unwrap();
        let place = Place::File(folder.path().join("plant.db"));
        let archive = Archive::open(&place, Access::Write { program: "a test" }).unwrap();
        let (orders, tickets) = waiting();
        Desk { open: Box::new(nowhere), archive: Some(archive) }.serve(&orders);
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
        Desk { open: Box::new(nowhere), archive: Some(archive) }.serve(&orders);
        for ticket in tickets {
            assert!(matches!(ticket.wait(), Err(Error::Busy { .. })));
        }
        assert_eq!(waited.load(Ordering::Relaxed), 1);
    }
}
