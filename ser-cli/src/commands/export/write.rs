//! From the timeline to files.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use ser_evidence::timeline::Timeline;
use ser_files::export::comtrade::{Comtrade, Options};
use ser_files::export::{self, Counted, FileName, Origin, Refused, Selection};
use ser_files::merged::CsvStyle;

use super::Args;
use super::format::Format;
use super::out::{BUFFER, Out};
use crate::error::{Failure, Result, advise, inform, warn};
use crate::gather::Gathered;
use crate::interrupt::Caught;
use crate::new_files::NewFiles;
use crate::output::PROGRAM;

/// Everything that is exported, and how.
struct Export<'e> {
    args: &'e Args,
    timeline: &'e Timeline<'e>,
    selection: &'e Selection,
    origin: Origin<'e>,
}

/// Writes the file or the files.
pub(super) fn write(
    args: &Args,
    inputs: Vec<PathBuf>,
    gathered: &Gathered,
    timeline: &Timeline<'_>,
    selection: &Selection,
) -> Result<Counted> {
    let origin = Origin {
        program: PROGRAM,
        site_digest: gathered.site_digest.as_deref(),
        not_reached: &gathered.not_reached,
        damaged_lines: gathered.damaged_lines,
    };
    let export = Export { args, timeline, selection, origin };
    // Standard output is left as it is when the user presses Ctrl-C; files are taken back.
    let Some(output) = &args.output else { return export.to_stdout() };
    let caught = Caught::for_now()?;
    let result = export.to_files(output, inputs, caught.flag());
    if caught.ends_interrupted() {
        return Err(Failure::Interrupted);
    }
    result
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

impl Export<'_> {
    fn to_stdout(&self) -> Result<Counted> {
        let mut out = io::BufWriter::with_capacity(BUFFER, io::stdout());
        let written = self.write_one(&mut out);
        let counted = written.map_err(|refused| told(refused, &"standard output"))?;
        out.flush()?;
        Ok(counted)
    }

    fn to_files(&self, output: &Path, inputs: Vec<PathBuf>, stop: &AtomicBool) -> Result<Counted> {
        let path = self.path(output)?;
        let mut files = NewFiles::new(self.args.force).sparing(inputs);
        let counted = match self.args.format {
            Format::Comtrade => self.comtrade(&path, &mut files, stop)?,
            _ => {
                let mut out = Out::new(files.create(&path)?, stop);
                in_file(&path, &mut out, |out| self.write_one(out))?
            }
        };
        // Between here and the end nothing waits for anybody.
        if stop.load(Ordering::Relaxed) {
            return Err(Failure::Interrupted);
        }
        files.finish()?;
        inform(format_args!("{} is written", path.display()));
        Ok(counted)
    }

    /// The parts of a record that are files of their own. The configuration gets its name last: a
    /// program that looks for it finds the others.
    fn comtrade(&self, cfg: &Path, files: &mut NewFiles, stop: &AtomicBool) -> Result<Counted> {
        let extension = cfg.extension().and_then(|extension| extension.to_str());
        let Some(extension @ ("cfg" | "CFG")) = extension else {
            let proposal = cfg.with_extension("cfg");
            return Err(Failure::usage(format!("{} is no name of a COMTRADE file", cfg.display()))
                .hint(format!("let it end with .cfg, as in -o {}", proposal.display())));
        };
        let beside = |lower: &str, upper: &str| {
            cfg.with_extension(if extension == "cfg" { lower } else { upper })
        };
        let (dat, hdr) = (beside("dat", "DAT"), beside("hdr", "HDR"));
        let record = self.record().map_err(|refused| told(refused, &cfg.display()))?;
        // Before anything is written, which may take a while.
        let mut created = |path: &Path| Ok::<_, Failure>(Out::new(files.create(path)?, stop));
        let mut outs = [created(&dat)?, created(&hdr)?, created(cfg)?];
        let [to_dat, to_hdr, to_cfg] = &mut outs;
        in_file(&dat, to_dat, |out| record.write_dat(out))?;
        in_file(&hdr, to_hdr, |out| record.write_hdr(out, &self.origin))?;
        in_file(cfg, to_cfg, |out| record.write_cfg(out))?;
        Ok(record.counted())
    }

    fn record(&self) -> std::result::Result<Comtrade<'_>, Refused> {
        let options = Options {
            data: self.args.data.into(),
            has_rate: self.args.rate.is_some(),
            line_hz: self.args.line_frequency,
        };
        Comtrade::new(self.timeline, self.selection, options)
    }

    /// Writes what is one file.
    fn write_one(&self, out: &mut (dyn Write + Send)) -> std::result::Result<Counted, Refused> {
        let Export { args, timeline, selection, origin } = self;
        let is_spreadsheet_safe = args.spreadsheet_safe;
        match args.format {
            Format::Csv => {
                let dialect = args.csv_dialect.into();
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

    /// The name of the file.
    fn path(&self, output: &Path) -> Result<PathBuf> {
        let Some(company) = &self.args.comname else { return Ok(output.to_owned()) };
        if !output.is_dir() {
            return Err(Failure::usage(format!("{} is no folder", output.display()))
                .hint("with --comname, -o is the folder, and the file is named by what is in it"));
        }
        let Some(begins_us) = export::begins_us(self.timeline, self.selection) else {
            return Err(told(Refused::Empty, &output.display()));
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
            company,
            extension: self.args.format.extension(),
        };
        Ok(output.join(export::file_name(&name)))
    }
}

/// Writes to a file to its end.
fn in_file<T>(
    path: &Path,
    out: &mut Out<'_>,
    write: impl FnOnce(&mut Out<'_>) -> std::result::Result<T, Refused>,
) -> Result<T> {
    let written = write(out).map_err(|refused| told(refused, &path.display()))?;
    out.flush().map_err(|error| Failure::writing(path.display(), &error))?;
    Ok(written)
}

/// Why nothing is written, and what to do about it.
fn told(refused: Refused, to: &dyn std::fmt::Display) -> Failure {
    match refused {
        Refused::Io(error) => Failure::writing(to, &error),
        Refused::Empty => {
            Failure::new(refused).hint("--format csv and jsonl hold entries without a time, too")
        }
        Refused::TooLong { .. } => Failure::new(refused)
            .hint("choose a part of it with --last-trip, --around, or --since and --until")
            .hint("or another format: csv, jsonl and vcd may be as long as you like"),
    }
}
