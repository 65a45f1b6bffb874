//! `collect --check`: whether everything is as it should be, before a service is left alone with
//! it.

use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use ser_archive::{Archive, Place};
use ser_collector::{Met, Open, Options, meet_all};

use crate::error::{Failure, Result, inform};
use crate::output::{Grid, Palette};

pub(super) fn run(
    options: &Options,
    open: &Open,
    place: &Place,
    stop: &Arc<AtomicBool>,
) -> Result<()> {
    match place {
        Place::File(path) if !path.exists() => check_folder(path)?,
        _ => check_archive(open, place)?,
    }
    if let Some(forward) = &options.forward {
        check_archive(&forward.open, &forward.outlet)?;
    }
    let met = meet_all(options, stop);
    let missed = met.iter().filter(|(_, met)| met.is_err()).count();
    let rows = met.into_iter().map(|(name, met)| row(name, met)).collect();
    let columns = vec!["recorder", "answers", "log"];
    let mut out = io::stdout().lock();
    Grid { title: None, columns, rows }.write(&mut out, Palette::of_stdout())?;
    out.flush()?;
    match missed {
        0 => Ok(()),
        _ => Err(Failure::new(format!("recorders that do not answer: {missed}"))
            .hint("ser-cli status --recorder NAME looks closer")),
    }
}

/// An archive that is not there yet is made by whoever collects, and not here.
fn check_folder(path: &Path) -> Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    if !folder.is_dir() {
        return Err(Failure::new(format!("there is no folder {}", folder.display()))
            .hint("make it, or name another place for the archive"));
    }
    inform(format_args!("{} is not there yet, and will be made", path.display()));
    Ok(())
}

fn check_archive(open: &Open, name: impl std::fmt::Display) -> Result<()> {
    let position = open().and_then(|mut archive| Archive::position(&mut archive));
    let position = position?;
    inform(format_args!("{name} can be written; rows: {position}"));
    Ok(())
}

fn row(name: String, met: std::result::Result<Met, ser_collector::Trouble>) -> Vec<String> {
    match met {
        Ok(Met { is_original: true, size }) => {
            vec![name, "yes, as an original one does".to_owned(), log(size)]
        }
        Ok(Met { is_original: false, size }) => {
            vec![name, "yes, and says which log it has".to_owned(), log(size)]
        }
        Err(trouble) => vec![name, format!("no: {trouble}"), String::new()],
    }
}

fn log(size: u16) -> String {
    format!("{size} entries")
}
