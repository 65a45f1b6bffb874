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
    /// Waits until the batch is on the disk, or cannot be written.
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
                Ok(appended) => Some(Ok(appended)),
                // Each alone would wait as long again.
                Err(Error::Busy { archive }) => Some(Err(archive)),
                Err(_) => None,
            },
        };
        for (batch, answer) in batches.iter().zip(answers) {
            // Alone, a batch that cannot be written keeps nobody else from being written.
            let appended = match &together {
                Some(Ok(appended)) => Ok(*appended),
                Some(Err(archive)) => Err(Error::Busy { archive: archive.clone() }),
                None => archive.append(std::slice::from_ref(batch)),
            };
            // Who asked may have gone away meanwhile. It is written all the same.
            _ = answer.send(appended);
        }
    }
}
