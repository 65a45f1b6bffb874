//! `watch --site` without a port: all recorders of the site in one list.
//!
//! Each recorder has a thread, which reads its log and hands over what is new. A batch is remembered
//! as delivered only when the list has written it, so that a crash repeats events and loses none.
//! A recorder that fails is told and asked again later; the others go on.

mod follower;
mod order;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use super::Args;
use crate::buses::Buses;
use crate::connection::ConnectionArgs;
use crate::error::{Failure, Result, inform};
use crate::interrupt;
use crate::output::{Format, Palette, Record, RecorderColumn, Rows, SiteTable, site_header};
use crate::site_file::Chosen;
use follower::Follower;
use order::{Evidence, Row};

/// What arrives this close together is put in order.
const GATHERED: Duration = Duration::from_millis(300);

/// New records of one recorder.
struct Batch {
    /// Its place in the list of recorders.
    recorder: usize,
    records: Vec<Record>,
    /// Where to say that they are written.
    written: SyncSender<()>,
}

pub(super) fn run(args: &Args, connection: &ConnectionArgs, chosen: &Chosen) -> Result<()> {
    check(args, chosen)?;
    let stop = interrupt::catch()?;
    let buses = Buses::default();
    let followers = followers(args, connection, chosen, &stop, &buses);
    let columns = followers.iter().map(|follower| follower.column.clone()).collect();
    let remembered = followers.iter().map(Follower::remembered);
    let evidence = Evidence::new(chosen.site.clone(), remembered.collect::<Vec<_>>());
    let mut list = List::new(columns, evidence);
    let (sender, batches) = sync_channel(followers.len());
    inform(format_args!("watching {} until Ctrl-C", list.names()));
    thread::scope(|scope| {
        for (place, follower) in followers.into_iter().enumerate() {
            let sender = sender.clone();
            scope.spawn(move || follower.run(place, &sender));
        }
        drop(sender);
        let result = list.write_all(&batches);
        // The threads see that nobody listens any more.
        stop.store(true, Ordering::Relaxed);
        drop(batches);
        result
    })?;
    match (args.fail_on_loss, list.losses) {
        (false, _) | (_, 0) => Ok(()),
        (true, losses) => Err(Failure::incomplete(format_args!("the list has gaps: {losses}"))),
    }
}

/// What makes no sense for several recorders.
fn check(args: &Args, chosen: &Chosen) -> Result<()> {
    if args.format != Format::Table {
        return Err(Failure::usage("files are of one recorder each; this is a list of several")
            .hint("name the recorder with --recorder, or leave --format out"));
    }
    if args.log_size.is_some() {
        return Err(Failure::usage("--log-size is of one recorder; these are several")
            .hint("write log_size into the site file, for each original recorder"));
    }
    if chosen.with_ports().next().is_none() {
        return Err(chosen.which());
    }
    Ok(())
}

fn followers<'a>(
    args: &'a Args,
    connection: &ConnectionArgs,
    chosen: &Chosen,
    stop: &'a Arc<AtomicBool>,
    buses: &'a Buses,
) -> Vec<Follower<'a>> {
    let of_recorder = |id| {
        let connection = chosen.reached(connection, id)?;
        let name = chosen.site.recorders.get(id.0)?.name.clone();
        let column = RecorderColumn { name, points: connection.points() };
        Some(Follower { column, connection, args, stop, buses })
    };
    chosen.with_ports().filter_map(|(id, _)| of_recorder(id)).collect()
}

/// The list on standard output.
struct List {
    columns: Vec<RecorderColumn>,
    evidence: Evidence,
    table: SiteTable<Rows>,
    losses: usize,
}

impl List {
    fn new(columns: Vec<RecorderColumn>, evidence: Evidence) -> List {
        let header = site_header(&columns);
        let (rows, has_header) = Rows::to_stdout(&|line| line == header);
        let table = SiteTable::new(rows, Palette::of_stdout(), columns.clone(), has_header);
        List { columns, evidence, table, losses: 0 }
    }

    fn names(&self) -> String {
        let names: Vec<&str> = self.columns.iter().map(|column| column.name.as_str()).collect();
        names.join(", ")
    }

    /// Writes batches as they come, until there are no more senders.
    fn write_all(&mut self, batches: &Receiver<Batch>) -> Result<()> {
        while let Ok(first) = batches.recv() {
            let gathered = gather(first, batches);
            let mut by_recorder: Vec<Vec<Record>> = Vec::new();
            by_recorder.resize_with(self.columns.len(), Vec::new);
            let mut waiting = Vec::new();
            for Batch { recorder, records, written } in gathered {
                if let Some(of_recorder) = by_recorder.get_mut(recorder) {
                    of_recorder.extend(records);
                }
                waiting.push(written);
            }
            for Row { recorder, record, order } in self.evidence.ordered(by_recorder) {
                self.losses += usize::from(matches!(record, Record::Loss(_)));
                self.table.record(recorder, &record, order)?;
            }
            self.table.flush()?;
            // A thread that has ended does not wait any more.
            for written in waiting {
                let _ = written.try_send(());
            }
        }
        Ok(())
    }
}

/// What arrives soon after a first batch, with it. A recorder waits until its batch is written, so
/// there is at most one of each.
fn gather(first: Batch, batches: &Receiver<Batch>) -> Vec<Batch> {
    let until = Instant::now() + GATHERED;
    let mut gathered = vec![first];
    loop {
        match batches.recv_timeout(until.saturating_duration_since(Instant::now())) {
            Ok(batch) => gathered.push(batch),
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => return gathered,
        }
    }
}
