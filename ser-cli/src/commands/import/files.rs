//! The files that are read: lists, the data beside COMTRADE configurations, maps.

use std::borrow::Cow;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use ser_evidence::site::Site;
use ser_files::import::{Format, Importer, Map, Own, Read, Refusal};

use crate::error::{Failure, Result};
use crate::outlet::NotWritten;
use crate::site_file;

/// Without the data of COMTRADE configurations that are named, too: it is read with them.
pub(super) fn without_data(files: &[PathBuf]) -> Vec<PathBuf> {
    let is_kind = |path: &Path, kind: &str| {
        path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(kind))
    };
    let belongs = |data: &PathBuf| {
        let is_its = |path: &&PathBuf| {
            is_kind(path, "cfg") && path.with_extension("") == data.with_extension("")
        };
        is_kind(data, "dat") && files.iter().any(|path| is_its(&path))
    };
    files.iter().filter(|path| !belongs(path)).cloned().collect()
}

/// Everything that may be read for these files: also the data beside configurations.
pub(super) fn with_data(files: &[PathBuf]) -> Vec<PathBuf> {
    let beside = files.iter().flat_map(|path| DATA.map(|kind| path.with_extension(kind)));
    files.iter().cloned().chain(beside).collect()
}

/// How the data of a configuration ends.
const DATA: [&str; 3] = ["dat", "DAT", "Dat"];

/// Reads a file if `fits` likes its format. Its recorder is named, or has the name of the file up to
/// the last dot. Records of our own files go to `own` at once.
pub(super) fn read(
    importer: &mut Importer,
    path: &Path,
    recorder: Option<&str>,
    fits: impl FnOnce(Format) -> Result<()>,
    own: &mut Own<'_>,
) -> std::result::Result<Read, NotWritten> {
    let file = File::open(path).map_err(|error| Failure::reading(path.display(), &error))?;
    if file.metadata().is_ok_and(|about| about.is_dir()) {
        let failure = Failure::new(format!("{} is a folder", path.display()))
            .hint(format!("name the files in it, as in {}", path.join("*.txt").display()));
        return Err(failure.into());
    }
    let stem = stem(path);
    let recorder = recorder.unwrap_or(&stem);
    let data = || Ok(Box::new(data_beside(path)?) as Box<dyn io::Read>);
    let opened = importer.open(file).map_err(|refusal| refused(path, &refusal))?;
    fits(opened.format())?;
    importer.read(recorder, opened, data, own).map_err(|refusal| match refusal {
        Refusal::NotTaken(error) => NotWritten::Io(error),
        refusal => NotWritten::Failed(refused(path, &refusal)),
    })
}

/// The name of a file up to its last dot.
pub(super) fn stem(path: &Path) -> Cow<'_, str> {
    path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy()
}

/// The data of a configuration: the same name, ending with dat.
fn data_beside(path: &Path) -> io::Result<File> {
    let mut first = None;
    for extension in DATA {
        match File::open(path.with_extension(extension)) {
            Ok(file) => return Ok(file),
            Err(error) => first = first.or(Some(error)),
        }
    }
    Err(first.unwrap_or_else(|| io::Error::from(io::ErrorKind::NotFound)))
}

/// Why a file is not read, and what to do.
fn refused(path: &Path, refusal: &Refusal) -> Failure {
    let failure = Failure::new(format!("{}: {refusal}", path.display()));
    match refusal {
        Refusal::Empty => failure.hint("get the list from the device anew"),
        Refusal::Io(_) | Refusal::NotTaken(_) => {
            failure.hint("check its name and your rights to it")
        }
        Refusal::Utf16 => {
            failure.hint("save it as UTF-8; the encoding is often in the dialogue Save As")
        }
        Refusal::NoText => {
            failure.hint("of COMTRADE name the .cfg; its binary .dat is found beside it")
        }
        Refusal::Unknown => failure
            .hint("SEL reports (SER, CSER), CyTime JSON, COMTRADE and CSV for PRC-002 are known")
            .hint("if it is one of them, say so with --format"),
        Refusal::NoConfiguration => failure.hint("name the .cfg; the .dat is found beside it"),
        Refusal::NoData(_) => failure.hint(format!(
            "it has to be beside the configuration, as {}",
            path.with_extension("dat").display()
        )),
        Refusal::Damaged { .. } => {
            failure.hint("the line is one without which the rest means nothing; get the file anew")
        }
        Refusal::NoZone => failure
            .hint("say the zone in which the device's clock is set, as in --zone Europe/Berlin")
            .hint("a clock that does not follow summer time has an offset: --zone +01:00"),
        Refusal::NoDates { possible, .. } => {
            let options: Vec<String> =
                possible.iter().map(|order| format!("--dates {order}")).collect();
            failure.hint(format!("say it with {}", options.join(" or ")))
        }
        Refusal::NoEpoch => failure
            .hint("with /posix/ in the address that it is from, say --epoch posix")
            .hint("without, --epoch 1984, and the recorder's time zone with --zone"),
        Refusal::TooMuch { .. } => failure
            .hint("a list is held in memory as a whole, to put its rows in order")
            .hint("divide it, or export a shorter time"),
    }
}

/// Reads a map of names; its mistakes are drawn on standard error.
pub(super) fn map(path: &Path, site: Option<&Site>) -> Result<Map> {
    let text = site_file::text_of(path, "ser-cli import --help shows what a map looks like")?;
    Map::parse(&text, site).map_err(|mistakes| {
        site_file::draw(path, &text, &mistakes);
        let counted = site_file::counted(mistakes.len(), "error").unwrap_or_default();
        Failure::new(format!("{} has {counted}", path.display()))
            .hint("ser-cli import --help shows what a map looks like")
    })
}
