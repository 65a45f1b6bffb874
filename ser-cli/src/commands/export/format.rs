//! The words of the command line.

use clap::ValueEnum;
use ser_files::export::comtrade;
use ser_files::merged::Dialect;

/// The format of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// A row per change, with recorder, times in UTC and names.
    Csv,
    /// Everything, for report, merge and scripts.
    Jsonl,
    /// Signals for waveform viewers (`GTKWave`, Surfer).
    Vcd,
    /// COMTRADE, IEEE C37.111-2013: .cfg, .dat and .hdr.
    Comtrade,
    /// COMTRADE as one file.
    Cff,
    /// The table of events for NERC PRC-002.
    Prc002,
    /// Parquet for databases, in builds that have it.
    Parquet,
}

impl Format {
    /// How its files' names end.
    pub(super) const fn extension(self) -> &'static str {
        match self {
            Format::Csv | Format::Prc002 => "csv",
            Format::Jsonl => "jsonl",
            Format::Vcd => "vcd",
            Format::Comtrade => "cfg",
            Format::Cff => "cff",
            Format::Parquet => "parquet",
        }
    }
}

impl Format {
    /// Whether the file itself says how many lines of its sources were damaged.
    pub(super) const fn tells_damage(self) -> bool {
        matches!(self, Format::Vcd | Format::Comtrade | Format::Cff | Format::Parquet)
    }
}

/// For which program CSV is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum CsvDialect {
    /// Commas, CR LF, UTF-8.
    #[default]
    Rfc4180,
    /// Semicolons, byte order mark, and times as a German Excel reads them.
    ExcelDe,
}

impl From<CsvDialect> for Dialect {
    fn from(dialect: CsvDialect) -> Dialect {
        match dialect {
            CsvDialect::Rfc4180 => Dialect::Rfc4180,
            CsvDialect::ExcelDe => Dialect::ExcelDe,
        }
    }
}

/// How the rows of COMTRADE are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Data {
    /// As text.
    #[default]
    Ascii,
    /// As binary numbers: much smaller, and fewer programs read it.
    Binary,
}

impl From<Data> for comtrade::Data {
    fn from(data: Data) -> comtrade::Data {
        match data {
            Data::Ascii => comtrade::Data::Ascii,
            Data::Binary => comtrade::Data::Binary,
        }
    }
}
