//! `config`: the recorder's settings.

use std::io::{self, Write};

use ser_client::{RequestError, Unit};
use ser_proto::{AutoReport, Baud, Configuration, Configure, MAX_REPORT_ADDRESS};

use crate::audit::AuditArgs;
use crate::connection::{self, ConnectionArgs};
use crate::error::{Failure, Result};
use crate::output::field;
use crate::values::{self, ReportVia, Switch, on_off};

const EXAMPLES: &str = "\
Examples:
  ser-cli config                               show the settings
  ser-cli config --size 1024 --auto-print off  change two of them
  ser-cli config --line-baud 19200             from then on: --baud 19200";

/// Show or change the recorder's settings. Settings that are not given stay as they are; the
/// recorder keeps them without power.
///
/// To keep the settings that are not given, the command asks the recorder first. An original
/// recorder does not answer that: give it at least --auto-report, --report-to and --auto-print,
/// which its protocol cannot leave out.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    #[command(flatten)]
    settings: Settings,

    #[command(flatten)]
    _audit: AuditArgs,
}

/// The settings that are given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::Args)]
pub(crate) struct Settings {
    /// Entries that the log holds, 1–2048; a smaller log keeps the newest events.
    #[arg(long, value_name = "N", value_parser = values::entries())]
    size: Option<u16>,

    /// Rate of the recorder's RS-232 port, used after its reply.
    #[arg(long, value_name = "RATE", value_parser = values::baud)]
    line_baud: Option<Baud>,

    /// Where the recorder reports events automatically.
    #[arg(long, value_name = "WHERE")]
    auto_report: Option<ReportVia>,

    /// Bus address that gets the reports, 0–31.
    #[arg(
        long,
        value_name = "N",
        value_parser = clap::value_parser!(u8).range(0..=i64::from(MAX_REPORT_ADDRESS))
    )]
    report_to: Option<u8>,

    /// Whether the recorder prints every event as a line of text on RS-232.
    #[arg(long, value_name = "SWITCH")]
    auto_print: Option<Switch>,
}

impl Settings {
    /// These settings, completed from `base`.
    pub(crate) fn on_top_of(&self, base: Configure) -> Configure {
        Configure {
            size: self.size.or(base.size),
            baud: self.line_baud.or(base.baud),
            auto_report: self.auto_report.map_or(base.auto_report, AutoReport::from),
            report_address: self.report_to.unwrap_or(base.report_address),
            auto_print: self.auto_print.map_or(base.auto_print, bool::from),
        }
    }

    fn is_empty(&self) -> bool {
        let Settings { size, line_baud, auto_report, report_to, auto_print } = self;
        size.is_none()
            && line_baud.is_none()
            && auto_report.is_none()
            && report_to.is_none()
            && auto_print.is_none()
    }

    /// Whether the command is complete without the settings in force: it can express that size and
    /// rate stay.
    fn is_sufficient(&self) -> bool {
        self.auto_report.is_some() && self.report_to.is_some() && self.auto_print.is_some()
    }
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let mut unit = connection::open(connection)?;
    let now = match args.settings.is_empty() {
        true => connection::settings(&mut unit)?.ok_or_else(settings_unknown)?,
        false => change(&mut unit, &args.settings)?,
    };
    let mut out = io::stdout().lock();
    field(&mut out, "size", format_args!("{} entries", now.size))?;
    write_line_settings(&mut out, &now)?;
    out.flush()?;
    if args.settings.line_baud.is_some() {
        connection::tell_new_baud(connection, &now)?;
    }
    Ok(())
}

fn change(unit: &mut Unit, settings: &Settings) -> Result<Configuration> {
    let keep = Configure {
        size: None,
        baud: None,
        auto_report: AutoReport::Off,
        report_address: 0,
        auto_print: false,
    };
    let base = match settings.is_sufficient() {
        true => keep,
        false => {
            let now = connection::settings(unit)?.ok_or_else(settings_unknown)?;
            // Leaves size and rate out, which keeps them. A rate is thus set only when one is
            // given.
            Configure { size: None, baud: None, ..now.into() }
        }
    };
    unit.configure(settings.on_top_of(base)).map_err(|error| match error {
        RequestError::Refused { in_force } => Failure::new(format!(
            "the recorder did not accept the settings; it now has: size {}, {} baud, auto report \
             {}, report to {}, auto print {}",
            in_force.size,
            in_force.baud.bits_per_second(),
            auto_report_name(in_force.auto_report),
            in_force.report_address,
            on_off(in_force.auto_print)
        ))
        .hint("change one setting at a time to find out which one it refuses"),
        other => other.into(),
    })
}

fn settings_unknown() -> Failure {
    connection::settings_unknown().hint(
        "to set everything without asking the recorder, give --auto-report, --report-to and \
         --auto-print together",
    )
}

/// The settings other than the size, one per line.
pub(crate) fn write_line_settings(
    out: &mut dyn Write,
    configuration: &Configuration,
) -> io::Result<()> {
    field(out, "line baud", configuration.baud.bits_per_second())?;
    field(out, "auto report", auto_report_name(configuration.auto_report))?;
    field(out, "report to", configuration.report_address)?;
    field(out, "auto print", on_off(configuration.auto_print))
}

pub(super) fn auto_report_name(auto_report: AutoReport) -> &'static str {
    match auto_report {
        AutoReport::Off => "off",
        AutoReport::Genius => "genius",
        AutoReport::Rs232 => "rs232",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_given_is_taken_from_the_base() {
        let base = Configure {
            size: None,
            baud: None,
            auto_report: AutoReport::Genius,
            report_address: 7,
            auto_print: true,
        };
        let none = Settings {
            size: None,
            line_baud: None,
            auto_report: None,
            report_to: None,
            auto_print: None,
        };
        assert!(none.is_empty() && !none.is_sufficient());
        assert_eq!(none.on_top_of(base), base);
        let some = Settings { size: Some(9), auto_print: Some(Switch::Off), ..none };
        assert!(!some.is_empty());
        assert_eq!(some.on_top_of(base), Configure { size: Some(9), auto_print: false, ..base });
    }
}
