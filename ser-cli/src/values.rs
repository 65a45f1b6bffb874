//! Values of arguments, checked before anything is sent.

use std::time::Duration;

use clap::ValueEnum;
use ser_proto::genius::{BusAddress, BusRate};
use ser_proto::{AutoReport, Baud, MAX_SIZE};
use ser_sim::genius::BusTiming;

/// A setting that is on or off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Switch {
    /// On.
    On,
    /// Off.
    Off,
}

impl From<Switch> for bool {
    fn from(switch: Switch) -> bool {
        switch == Switch::On
    }
}

/// `on` or `off`, as a [`Switch`] is written.
pub(crate) fn on_off(on: bool) -> &'static str {
    if on { "on" } else { "off" }
}

/// Where events are reported automatically.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ReportVia {
    /// Nowhere.
    Off,
    /// To a device on the Genius bus.
    Genius,
    /// To the RS-232 port.
    Rs232,
}

impl From<ReportVia> for AutoReport {
    fn from(via: ReportVia) -> AutoReport {
        match via {
            ReportVia::Off => AutoReport::Off,
            ReportVia::Genius => AutoReport::Genius,
            ReportVia::Rs232 => AutoReport::Rs232,
        }
    }
}

/// The rate of a bus, by the names that `docs/genius.md` uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum BusRateName {
    /// The usual rate.
    #[default]
    #[value(name = "153.6K", alias = "153k6", alias = "153.6K-standard")]
    Standard,
    /// The same with longer pauses, for long cables.
    #[value(name = "153.6K-extended", alias = "153k6e")]
    Extended,
    /// For longer cables.
    #[value(name = "76.8K", alias = "76k8")]
    Half,
    /// For the longest cables.
    #[value(name = "38.4K", alias = "38k4")]
    Quarter,
}

impl From<BusRateName> for BusTiming {
    fn from(name: BusRateName) -> BusTiming {
        match name {
            BusRateName::Standard => BusTiming::K153Standard,
            BusRateName::Extended => BusTiming::K153Extended,
            BusRateName::Half => BusTiming::K76,
            BusRateName::Quarter => BusTiming::K38,
        }
    }
}

impl From<BusRateName> for BusRate {
    fn from(name: BusRateName) -> BusRate {
        match name {
            BusRateName::Standard => BusRate::K153_6Standard,
            BusRateName::Extended => BusRate::K153_6Extended,
            BusRateName::Half => BusRate::K76_8,
            BusRateName::Quarter => BusRate::K38_4,
        }
    }
}

/// A bus address, 0-31.
pub(crate) fn bus_address(text: &str) -> Result<BusAddress, String> {
    let number = text.parse().ok().and_then(BusAddress::new);
    number.ok_or_else(|| "not a bus address: 0 to 31".to_string())
}

/// A rate that the recorder supports.
pub(crate) fn baud(text: &str) -> Result<Baud, String> {
    text.parse().ok().and_then(Baud::from_bits_per_second).ok_or_else(|| {
        let rates: Vec<_> =
            Baud::ALL.iter().map(|baud| baud.bits_per_second().to_string()).collect();
        format!("the recorder has the rates {}", rates.join(", "))
    })
}

/// An entry number, or a number of entries, of the largest log.
pub(crate) fn entries() -> clap::builder::RangedI64ValueParser<u16> {
    clap::value_parser!(u16).range(1..=i64::from(MAX_SIZE))
}

/// A time span like `500ms`, `2s` or `1.5` (seconds).
pub(crate) fn duration(text: &str) -> Result<Duration, String> {
    let (number, unit_ms) = match text.strip_suffix("ms") {
        Some(number) => (number, 1.0),
        None => (text.strip_suffix('s').unwrap_or(text), 1000.0),
    };
    let ms = number.trim().parse().map(|number: f64| number * unit_ms);
    match ms {
        Ok(ms) if (1.0..=3_600_000.0).contains(&ms) => Ok(Duration::from_secs_f64(ms / 1000.0)),
        Ok(_) => Err("must be between 1ms and 3600s".to_string()),
        Err(_) => Err("not a time span like 500ms, 2s or 1.5".to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_spans_are_milliseconds_or_seconds() {
        for (text, ms) in [("500ms", 500), ("2s", 2000), ("1.5", 1500), ("1.5s", 1500), ("1ms", 1)]
        {
            assert_eq!(duration(text), Ok(Duration::from_millis(ms)), "{text}");
        }
        for text in ["", "ms", "x", "0", "-1", "nan", "inf", "2h", "3601"] {
            assert!(duration(text).is_err(), "{text}");
        }
    }

    #[test]
    fn only_the_recorders_rates_are_rates() {
        assert_eq!(baud("19200"), Ok(Baud::B19200));
        assert!(baud("115200").unwrap_err().contains("300, 600"));
        assert!(baud("fast").is_err());
    }
}
