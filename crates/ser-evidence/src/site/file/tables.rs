//! One struct for each kind of table.

use jiff::tz::TimeZone;
use ser_proto::{Baud, Model};
use toml::Spanned;

use crate::site::diagnostic::Span;
use crate::site::model::{ClockRule, Delays, IncidentRules, Role};
use crate::time::{Moment, Shown, Utc};

/// The whole file.
#[derive(Debug, Default)]
pub(in crate::site) struct SiteTable {
    pub(in crate::site) name: Option<Spanned<String>>,
    pub(in crate::site) time_zone: Option<TimeZone>,
    pub(in crate::site) utc_doubt_us: Option<u64>,
    pub(in crate::site) recorders: Vec<RecorderTable>,
    pub(in crate::site) points: Vec<PointTable>,
    pub(in crate::site) groups: Vec<GroupTable>,
    pub(in crate::site) expectations: Vec<ExpectTable>,
    pub(in crate::site) observations: Vec<ObservationTable>,
    pub(in crate::site) shifts: Vec<ShiftTable>,
    pub(in crate::site) incident: IncidentRules,
}

/// `[[recorder]]`.
#[derive(Debug)]
pub(in crate::site) struct RecorderTable {
    pub(in crate::site) name: Option<Spanned<String>>,
    pub(in crate::site) port: Option<Spanned<String>>,
    pub(in crate::site) baud: Option<Baud>,
    pub(in crate::site) model: Option<Spanned<Model>>,
    pub(in crate::site) is_original: Option<bool>,
    pub(in crate::site) log_size: Option<u16>,
    pub(in crate::site) clock: Option<ClockRule>,
    pub(in crate::site) drift_ppb: Option<u32>,
    pub(in crate::site) wander_ppb: Option<u32>,
    pub(in crate::site) delays: Delays,
}

/// The recorder that a table names; with a single one in the file, it need not.
#[derive(Debug)]
pub(in crate::site) struct Owner {
    /// Where the table begins.
    pub(in crate::site) head: Span,
    /// What kind of table it is.
    pub(in crate::site) what: &'static str,
    /// Whether the key is there, even if it is not understood.
    pub(in crate::site) is_named: bool,
    pub(in crate::site) name: Option<Spanned<String>>,
}

/// `[[point]]`.
#[derive(Debug)]
pub(in crate::site) struct PointTable {
    pub(in crate::site) recorder: Owner,
    pub(in crate::site) input: Option<Spanned<u8>>,
    pub(in crate::site) name: Option<Spanned<String>>,
    pub(in crate::site) role: Option<Role>,
    pub(in crate::site) equipment: Option<String>,
    pub(in crate::site) group: Option<Spanned<String>>,
    pub(in crate::site) on: Option<String>,
    pub(in crate::site) off: Option<String>,
    pub(in crate::site) normal: Option<bool>,
    pub(in crate::site) same_as: Option<Spanned<String>>,
    pub(in crate::site) inverted: Option<Spanned<bool>>,
}

/// `[[group]]`.
#[derive(Debug)]
pub(in crate::site) struct GroupTable {
    pub(in crate::site) name: Option<Spanned<String>>,
    pub(in crate::site) first_out: bool,
}

/// A change of a point, as in `52-1 closed off`.
#[derive(Debug)]
pub(in crate::site) struct EdgeText {
    /// `after` or `then`.
    pub(in crate::site) key: &'static str,
    pub(in crate::site) text: Spanned<String>,
}

/// `[[expect]]`.
#[derive(Debug)]
pub(in crate::site) struct ExpectTable {
    pub(in crate::site) name: Option<Spanned<String>>,
    pub(in crate::site) after: Option<EdgeText>,
    pub(in crate::site) then: Option<EdgeText>,
    pub(in crate::site) within_us: Option<(i64, i64)>,
}

/// `[[observation]]`.
#[derive(Debug)]
pub(in crate::site) struct ObservationTable {
    pub(in crate::site) recorder: Owner,
    pub(in crate::site) host_time: Option<Moment<Utc>>,
    pub(in crate::site) unit_time: Option<Moment<Shown>>,
    pub(in crate::site) doubt_us: Option<u64>,
}

/// `[[shift]]`.
#[derive(Debug)]
pub(in crate::site) struct ShiftTable {
    pub(in crate::site) recorder: Owner,
    pub(in crate::site) us: Option<i64>,
    pub(in crate::site) from: Option<Spanned<Moment<Utc>>>,
    pub(in crate::site) to: Option<Spanned<Moment<Utc>>>,
    pub(in crate::site) why: Option<String>,
}
