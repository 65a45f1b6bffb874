//! How fast entries are written in each format, and how much memory that takes.
//!
//! `cargo bench -p ser-files --bench exporting` makes a timeline of ten million entries of thirty-two
//! recorders with a seed, and writes it to an output that only counts. `--features parquet` adds
//! Parquet. Run as a test, it writes a few thousand entries.

use std::fs;
use std::hint::black_box;
use std::io::{self, Write};
use std::time::Instant;

use clap::Parser;
use oorandom::Rand64;
use ser_evidence::history::{Collector, History};
use ser_evidence::record::{EntryRecord, Life, Record};
use ser_evidence::site::{self, Site};
use ser_evidence::time::{Moment, stamp};
use ser_evidence::timeline::Timeline;
use ser_files::export::comtrade::{Comtrade, Data, Options};
use ser_files::export::{
    Counted, Origin, Refused, Selection, write_csv, write_jsonl, write_prc002, write_vcd,
};
use ser_files::merged::{CsvStyle, Dialect};
use ser_proto::{Entry, Inputs};

#[derive(Debug, Parser)]
struct Arguments {
    /// Entries of all recorders together.
    #[arg(long, default_value_t = 10_000_000)]
    entries: u64,

    /// How often each format is written.
    #[arg(long, default_value_t = 3)]
    repetitions: usize,

    /// Where chance begins.
    #[arg(long, default_value_t = 1)]
    seed: u64,

    /// Only the format whose name holds this.
    filter: Option<String>,

    /// Passed by `cargo bench`.
    #[arg(long, hide = true)]
    bench: bool,
}

const RECORDERS: u64 = 32;

/// 2026-10-01T00:00:00.
const BEGIN_US: i64 = 1_790_812_800_000_000;

const ORIGIN: Origin<'static> =
    Origin { program: "bench", site_digest: None, not_reached: &[], damaged_lines: 0 };

type Writer = fn(&mut Sink, &Timeline<'_>, &Selection) -> Result<Counted, Refused>;

const WRITERS: [(&str, Writer); 7] = [
    ("CSV", |out, timeline, part| write_csv(out, timeline, part, style(Dialect::Rfc4180))),
    ("CSV for Excel", |out, timeline, part| {
        write_csv(out, timeline, part, style(Dialect::ExcelDe))
    }),
    ("JSON lines", |out, timeline, part| write_jsonl(out, timeline, part, "bench")),
    ("VCD", |out, timeline, part| write_vcd(out, timeline, part, &ORIGIN)),
    ("PRC-002", |out, timeline, part| write_prc002(out, timeline, part, true)),
    ("COMTRADE, text", |out, timeline, part| cff(out, timeline, part, Data::Ascii)),
    ("COMTRADE, binary", |out, timeline, part| cff(out, timeline, part, Data::Binary)),
];

#[cfg(feature = "parquet")]
const PARQUET: [(&str, Writer); 1] = [("Parquet", |out, timeline, part| {
    ser_files::export::write_parquet(out, timeline, part, &ORIGIN)
})];

#[cfg(not(feature = "parquet"))]
const PARQUET: [(&str, Writer); 0] = [];

const fn style(dialect: Dialect) -> CsvStyle {
    CsvStyle { dialect, is_spreadsheet_safe: true, has_names: true }
}

fn cff(
    out: &mut Sink,
    timeline: &Timeline<'_>,
    part: &Selection,
    data: Data,
) -> Result<Counted, Refused> {
    let record = Comtrade::new(timeline, part, Options { data, has_rate: false, line_hz: 50 })?;
    record.write_cff(out, &ORIGIN)?;
    Ok(record.counted())
}

/// Counts what it is given, and looks at the memory now and then.
#[derive(Default)]
struct Sink {
    bytes: u64,
    looked_at: u64,
    most_kb: u64,
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        black_box(bytes);
        self.bytes += u64::try_from(bytes.len()).unwrap_or(0);
        if self.bytes - self.looked_at > 1 << 24 {
            self.looked_at = self.bytes;
            self.most_kb = self.most_kb.max(resident_kb());
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// What this process has in memory; 0 where that is not known.
fn resident_kb() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.and_then(|line| line.trim().strip_suffix(" kB")?.parse().ok()).unwrap_or(0)
}

fn main() {
    let arguments = Arguments::parse();
    let entries = if arguments.bench { arguments.entries } else { 5_000 };
    let repetitions = if arguments.bench { arguments.repetitions } else { 1 };
    let site = plant();
    let history = history(&site, entries, arguments.seed);
    let began = Instant::now();
    let timeline = Timeline::new(&site, &history);
    println!("{entries} entries; {:.1} s to make the timeline", began.elapsed().as_secs_f64());
    for (name, write) in WRITERS.into_iter().chain(PARQUET) {
        if arguments.filter.as_ref().is_some_and(|filter| !name.contains(filter.as_str())) {
            continue;
        }
        let mut best_s = f64::INFINITY;
        let mut sink = Sink::default();
        let before_kb = resident_kb();
        for _ in 0..repetitions {
            sink = Sink::default();
            let began = Instant::now();
            let counted = write(&mut sink, &timeline, &Selection::everything());
            assert_eq!(counted.expect("written").entries, entries);
            best_s = best_s.min(began.elapsed().as_secs_f64());
        }
        #[allow(clippy::cast_precision_loss, reason = "a figure for people")]
        let mb = sink.bytes as f64 / 1e6;
        let grown_kb = sink.most_kb.saturating_sub(before_kb);
        let rate = mb / best_s;
        println!("{name:17} {mb:7.0} MB {best_s:6.2} s {rate:6.0} MB/s, {grown_kb} kB more memory");
    }
}

/// Thirty-two recorders, all of whose inputs have names.
fn plant() -> Site {
    let mut text = "site = \"Northfield\"\ntime_zone = \"Europe/Berlin\"\n".to_owned();
    for recorder in 1..=RECORDERS {
        text += &format!("[[recorder]]\nname = \"U{recorder:02}-SER1\"\nclock = \"utc\"\n");
        for input in 1..=32 {
            text += &format!(
                "[[point]]\nrecorder = \"U{recorder:02}-SER1\"\ninput = {input}\n\
                 name = \"52-{input} closed\"\non = \"CLOSED\"\noff = \"OPEN\"\n"
            );
        }
    }
    site::read(&text).unwrap_or_else(|errors| panic!("{errors:?}"))
}

/// The logs of all recorders: mostly one change, over some weeks.
fn history(site: &Site, entries: u64, seed: u64) -> History {
    let mut collector = Collector::new();
    for recorder in 0..RECORDERS {
        let mut chance = Rand64::new(u128::from(seed) << 64 | u128::from(recorder));
        let name = format!("U{:02}-SER1", recorder + 1);
        let count = entries / RECORDERS + u64::from(recorder < entries % RECORDERS);
        let (mut at_us, mut state) = (BEGIN_US, 0_u32);
        collector.begin_source();
        for index in 0..count {
            at_us += 1000 * (1 + i64::try_from(chance.rand_range(0..10_000)).unwrap_or(0));
            let mut changed = 1_u32 << chance.rand_range(0..32);
            if index % 8 == 0 {
                changed |= 1 << chance.rand_range(0..32);
            }
            state ^= changed;
            let entry = EntryRecord {
                life: Life::from_bits(recorder + 1),
                sequence: Some(index + 1),
                number: u16::try_from(index % 2048 + 1).unwrap_or(1),
                entry: Entry {
                    changed: Inputs(changed),
                    state: Inputs(state),
                    time: stamp(Moment::from_us(at_us)).expect("a time of this century"),
                },
                known: EntryRecord::ALL_KNOWN,
            };
            collector.add(&name, &Record::Entry(entry));
        }
    }
    collector.finish(site)
}
