//! Gives everything in an archive to another one.

use ser_archive::{Access, Archive, Place};
use ser_collector::{Forwarded, forward};

use crate::archive::{ArchiveArgs, available};
use crate::error::{Failure, Result, inform};
use crate::interrupt;
use crate::output::PROGRAM;
use std::sync::atomic::Ordering;

pub(super) fn run(args: &ArchiveArgs, to: &Place) -> Result<()> {
    let mut from = args.read()?;
    available(to)?;
    if to == args.place()? {
        return Err(Failure::usage("an archive cannot be given to itself")
            .hint("name another one, as in postgres://ser@db/plant"));
    }
    let stop = interrupt::catch()?;
    let mut other = Archive::open(to, Access::Write { program: PROGRAM })?;
    let (mut position, mut all) = (0, Forwarded::default());
    loop {
        let given = forward(&mut from, &mut other, &mut position)?;
        all.rows += given.rows;
        all.entries += given.entries;
        all.conflicts += given.conflicts;
        if given.rows == 0 {
            break;
        }
        if stop.load(Ordering::Relaxed) {
            return Err(Failure::Interrupted);
        }
    }
    inform(format_args!("given to {to}: {} rows, {} entries new there", all.rows, all.entries));
    match all.conflicts {
        0 => Ok(()),
        conflicts => Err(Failure::incomplete(format_args!(
            "entries that contradict others there, and are kept beside them: {conflicts}"
        ))
        .hint("ser-cli archive check lists them")),
    }
}
