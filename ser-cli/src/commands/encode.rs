//! `encode`: turns a command into the bytes that go over the line.

use std::io::{self, Write};

use ser_proto::{Command, Configure, FrameEncoder, TimeStamp};

use super::config::Settings;
use crate::decoding::hex_text;
use crate::error::Result;
use crate::time::parse_time;
use crate::values;

const EXAMPLES: &str = "\
Examples:
  ser-cli encode read --from 1 --count 10
  ser-cli encode set-clock 2026-11-22T10:00:00.250
  ser-cli encode config --size 1024 --auto-report rs232 --body
  ser-cli encode query-mode --raw > /dev/ttyUSB0
  ser-cli encode erase | ser-cli decode --from host";

/// Show the bytes of a command without sending it.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    #[command(subcommand)]
    what: Message,

    /// The body alone, as it goes into a Genius datagram: without ESC, length and checksum.
    #[arg(long, global = true)]
    body: bool,

    /// Write the bytes themselves instead of hex text.
    #[arg(long, global = true)]
    raw: bool,
}

/// A command to a recorder, as the words of a command line.
#[derive(Debug, clap::Subcommand)]
pub(crate) enum Message {
    /// `C` alone: ask for the configuration (original recorders stay silent).
    QueryConfig,
    /// `C`: change the configuration; size and rate are kept if not given, the other settings
    /// become 0 or off.
    Config(Settings),
    /// `E`: erase the event buffer.
    Erase,
    /// `L`: ask for the last broadcast.
    LastBroadcast,
    /// `M` alone: ask for mode and version (original recorders stay silent).
    QueryMode,
    /// `M`: start recording.
    Start,
    /// `M`: stop recording.
    Stop,
    /// `P`: print entries on RS-232.
    Print {
        /// Number of the first entry.
        #[arg(long, value_name = "N", value_parser = values::entries())]
        from: u16,
        /// How many entries.
        #[arg(long, value_name = "N", value_parser = values::entries())]
        count: u16,
    },
    /// `R`: read entries.
    Read {
        /// Number of the first entry.
        #[arg(long, value_name = "N", value_parser = values::entries())]
        from: u16,
        /// How many entries, up to 10; 0 asks for total and next slot only.
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=10))]
        count: u8,
    },
    /// `S`: set the clock.
    SetClock {
        /// The time at which the last byte arrives, like 2026-11-22T10:00:00.250.
        #[arg(value_parser = parse_time)]
        time: TimeStamp,
    },
}

pub(crate) fn run(args: &Args) -> Result<()> {
    let mut out = io::stdout().lock();
    let body = args.what.command().to_body();
    let bytes: Vec<u8> = if args.body { body.to_vec() } else { FrameEncoder::new(body).collect() };
    match args.raw {
        true => out.write_all(&bytes)?,
        false => writeln!(out, "{}", hex_text(&bytes))?,
    }
    out.flush()?;
    Ok(())
}

impl Message {
    /// The command as the recorder gets it.
    pub(crate) fn command(&self) -> Command {
        match *self {
            Message::QueryConfig => Command::QueryConfiguration,
            Message::Config(ref settings) => Command::Configure(settings.on_top_of(Configure {
                size: None,
                baud: None,
                auto_report: ser_proto::AutoReport::Off,
                report_address: 0,
                auto_print: false,
            })),
            Message::Erase => Command::Erase,
            Message::LastBroadcast => Command::LastBroadcast,
            Message::QueryMode => Command::QueryMode,
            Message::Start => Command::SetMode { recording: true },
            Message::Stop => Command::SetMode { recording: false },
            Message::Print { from, count } => Command::Print { start: from, count },
            Message::Read { from, count } => Command::Read { start: from, count },
            Message::SetClock { time } => Command::SetClock(time),
        }
    }
}
