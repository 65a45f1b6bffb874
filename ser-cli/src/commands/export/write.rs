//! From the timeline to files.

use std::io::Write;
use std::path::{Path, PathBuf};

use ser_evidence::timeline::Timeline;
use ser_files::export::comtrade::{Comtrade, Options};
use ser_files::export::{self, Counted, FileName, Origin, Refused, Selection};
use ser_files::merged::CsvStyle;

use super::Args;
use super::format::Format;
use crate::error::{Failure, Result, advise, warn};
use crate::gather::{Damaged, Gathered};
use crate::new_files::NewFiles;
use crate::outlet::{NotWritten, Outlet, Part, file_named, finish};
use crate::output::PROGRAM;
use crate::site_file::counted;

/// Everything that is exported, and how.
struct Export<'e> {
    args: &'e Args,
    timeline: &'e Timeline<'e>,
    selection: &'e Selection,
    origin: Origin<'e>,
}

/// Where an export goes.
pub(super) enum Destination {
    /// One file, or standard output.
    One(Outlet),
    /// The parts of a COMTRADE record.
    Record(NewFiles, Parts),
    /// A folder, in which the content names the files.
    Folder(NewFiles, PathBuf),
}

/// The parts of a COMTRADE record that are files of their own.
pub(super) struct Parts {
    cfg: PathBuf,
    /// The data, the header and the configuration. The configuration gets its name last: a program
    /// that looks for it finds the others.
    parts: [Part; 3],
}

impl Destination {
    /// What the user names. A name that cannot be used is refused before anything is read; `inputs`
    /// are never overwritten.
    pub(super) fn of(args: &Args, inputs: Vec<PathBuf>) -> Result<Destination> {
        let files = NewFiles::new(args.force).sparing(inputs);
        match file_named(args.output.as_deref()) {
            None => Ok(Destination::One(Outlet::Stdout)),
            Some(folder) if args.comname.is_some() => match folder.is_dir() {
                true => Ok(Destination::Folder(files, folder.to_owned())),
                false => Err(Failure::usage(format!("{} is not a folder", folder.display())).hint(
                    "with --comname, -o is the folder, and the file is named by what is in it",
                )),
            },
            Some(path) => Destination::named(args.format, files, path),
        }
    }

    /// The file of this name, or the files.
    fn named(format: Format, mut files: NewFiles, path: &Path) -> Result<Destination> {
        match format {
            Format::Comtrade => {
                let parts = Parts::begin(&mut files, path)?;
                Ok(Destination::Record(files, parts))
            }
            _ => Outlet::open(Some(path), files).map(Destination::One),
        }
    }
}

impl Parts {
    fn begin(files: &mut NewFiles, cfg: &Path) -> Result<Parts> {
        let extension = cfg.extension().and_then(|extension| extension.to_str());
        let Some(extension @ ("cfg" | "CFG")) = extension else {
            let proposal = cfg.with_extension("cfg");
            return Err(Failure::usage(format!(
                "{} is not a name of a COMTRADE file",
                cfg.display()
            ))
            .hint(format!("let it end with .cfg, as in -o {}", proposal.display())));
        };
        let beside = |lower: &str, upper: &str| {
            cfg.with_extension(if extension == "cfg" { lower } else { upper })
        };
        let dat = Part::begin(files, &beside("dat", "DAT"))?;
        let hdr = Part::begin(files, &beside("hdr", "HDR"))?;
        let parts = [dat, hdr, Part::begin(files, cfg)?];
        Ok(Parts { cfg: cfg.to_owned(), parts })
    }
}

/// Writes the file or the files.
pub(super) fn write(
    args: &Args,
    destination: Destination,
    gathered: &Gathered,
    timeline: &Timeline<'_>,
    selection: &Selection,
) -> Result<Counted> {
    let origin = Origin {
        program: PROGRAM,
        site_digest: gathered.site_digest.as_deref(),
        not_reached: &gathered.not_reached,
        damaged_lines: gathered.damaged.lines,
    };
    Export { args, timeline, selection, origin }.write(destination)
}

/// Tells what is not in the file.
pub(super) fn tell(counted: Counted) {
    let Counted { timeless, hidden, .. } = counted;
    if timeless > 0 {
        warn(format_args!("{timeless} entries have no time and are not in the file"));
        advise("the clock was never set; --format csv and jsonl hold them nevertheless");
    }
    if hidden > 0 {
        warn(format_args!("{hidden} changes were followed by another in the same millisecond"));
        advise("without --rate each has its row");
    }
}

/// Tells of damaged lines of the sources, where the format has no place to say so.
pub(super) fn tell_damaged(damaged: Damaged) {
    let Damaged { lines, without_place, .. } = damaged;
    if lines == 0 {
        return;
    }
    let counted = counted(usize::try_from(lines).unwrap_or(usize::MAX), "damaged line");
    let counted = counted.unwrap_or_default();
    warn(format_args!(
        "{counted} of the sources are missing in the file, which has no place for that"
    ));
    let of_placed = "a loss after the entry before it, if entries are missing there";
    match (without_place, lines - without_place) {
        (0, _) => advise(format_args!("each is in it as {of_placed}")),
        (_, 0) => advise("the file does not say so, because nobody knows their place in a log"),
        (without, with) => advise(format_args!(
            "{with} are in it as {of_placed}; of {without} nobody knows the place, and the file does \
             not say so"
        )),
    }
    advise("vcd and comtrade say in words how many there were");
}

impl Export<'_> {
    fn write(&self, destination: Destination) -> Result<Counted> {
        match destination {
            Destination::One(outlet) => outlet.write(|out| self.write_one(out).map_err(told)),
            Destination::Record(files, parts) => self.comtrade(files, parts),
            Destination::Folder(files, folder) => {
                let path = folder.join(self.name()?);
                self.write(Destination::named(self.args.format, files, &path)?)
            }
        }
    }

    fn comtrade(&self, files: NewFiles, Parts { cfg, parts }: Parts) -> Result<Counted> {
        let record = self.record().map_err(|refused| match told(refused) {
            NotWritten::Failed(failure) => failure,
            NotWritten::Io(error) => Failure::writing(cfg.display(), &error),
        })?;
        let [to_dat, to_hdr, to_cfg] = parts;
        to_dat.write(|out| record.write_dat(out).map_err(told))?;
        to_hdr.write(|out| record.write_hdr(out, &self.origin).map_err(told))?;
        to_cfg.write(|out| record.write_cfg(out).map_err(told))?;
        finish(files, &cfg)?;
        Ok(record.counted())
    }

    fn record(&self) -> std::result::Result<Comtrade<'_>, Refused> {
        let options = Options {
            data: self.args.data.unwrap_or_default().into(),
            has_rate: self.args.rate.is_some(),
            line_hz: self.args.line_frequency.unwrap_or(50),
        };
        Comtrade::new(self.timeline, self.selection, options)
    }

    /// Writes what is one file.
    fn write_one(&self, out: &mut (dyn Write + Send)) -> std::result::Result<Counted, Refused> {
        let Export { args, timeline, selection, origin } = self;
        let is_spreadsheet_safe = args.spreadsheet_safe;
        match args.format {
            Format::Csv => {
                let dialect = args.csv_dialect.unwrap_or_default().into();
                let style = CsvStyle { dialect, is_spreadsheet_safe, has_names: true };
                export::write_csv(out, timeline, selection, style)
            }
            Format::Jsonl => export::write_jsonl(out, timeline, selection, PROGRAM),
            Format::Vcd => export::write_vcd(out, timeline, selection, origin),
            Format::Prc002 => export::write_prc002(out, timeline, selection, is_spreadsheet_safe),
            Format::Comtrade | Format::Cff => {
                let record = self.record()?;
                record.write_cff(out, origin)?;
                Ok(record.counted())
            }
            #[cfg(feature = "parquet")]
            Format::Parquet => export::write_parquet(out, timeline, selection, origin),
            // Refused before anything was read.
            #[cfg(not(feature = "parquet"))]
            Format::Parquet => Err(Refused::Empty),
        }
    }

    /// The name of the file by its content.
    fn name(&self) -> Result<String> {
        let Some(begins_us) = export::begins_us(self.timeline, self.selection) else {
            return Err(empty());
        };
        // Rows of PRC-002 are in local time, everything else is in UTC.
        let offset_s = match self.args.format {
            Format::Prc002 => {
                let at = jiff::Timestamp::from_microsecond(begins_us).unwrap_or_default();
                self.timeline.site().time_zone.to_offset(at).seconds()
            }
            _ => 0,
        };
        let recorders = &self.timeline.history().recorders;
        let device = match recorders.as_slice() {
            [only] => only.recorder.name.clone(),
            several => format!("{}-RECORDERS", several.len()),
        };
        let name = FileName {
            utc_us: begins_us,
            offset_s,
            station: &self.timeline.site().name,
            device: &device,
            company: self.args.comname.as_deref().unwrap_or_default(),
            extension: self.args.format.extension(),
        };
        Ok(export::file_name(&name))
    }
}

/// Why nothing is written, and what to do about it.
fn told(refused: Refused) -> NotWritten {
    let failure = match refused {
        Refused::Io(error) => return NotWritten::Io(error),
        Refused::Empty => empty(),
        Refused::TooLong { .. } => Failure::new(refused)
            .hint("choose a part of it with --last-trip, --around, or --since and --until")
            .hint("or another format: csv, jsonl and vcd may be as long as you like"),
    };
    NotWritten::Failed(failure)
}

fn empty() -> Failure {
    Failure::new(Refused::Empty).hint("--format csv and jsonl hold entries without a time, too")
}
