//! The resolved site: plain structs, in which names have become indices.

use jiff::tz::TimeZone;
use ser_proto::{Baud, Model};

use super::digest::SiteDigest;
use crate::time::{Moment, Shown, Utc};

/// A site. Everything in it is consistent: indices lead somewhere, ranges are the right way round.
#[derive(Clone, Debug)]
pub struct Site {
    /// Its name.
    pub name: String,
    /// The digest of the file that it was read from.
    pub digest: Option<SiteDigest>,
    /// The zone in which people read times.
    pub time_zone: TimeZone,
    /// How far this host's clock may be from UTC, where the operating system does not know:
    /// microseconds.
    pub utc_doubt_us: Option<u64>,
    /// All recorders, in the order of the file.
    pub recorders: Vec<Recorder>,
    /// All points, in the order of the file.
    pub points: Vec<Point>,
    /// All groups, in the order of the file.
    pub groups: Vec<Group>,
    /// What is expected to follow what.
    pub expectations: Vec<Expectation>,
    /// What people saw clocks show.
    pub observations: Vec<HandObservation>,
    /// Times that are shifted by hand.
    pub shifts: Vec<Shift>,
    /// How incidents are found and shown.
    pub incident: IncidentRules,
}

/// Index into [`Site::recorders`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RecorderId(pub usize);

/// Index into [`Site::points`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PointId(pub usize);

/// Index into [`Site::groups`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct GroupId(pub usize);

/// One recorder.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorder {
    /// Its name, unique in the site.
    pub name: String,
    /// How it is reached, as for `--port`.
    pub port: Option<String>,
    /// The rate of its serial port, if it is not the one that recorders are delivered with; also
    /// that behind a terminal server.
    pub baud: Option<Baud>,
    /// Its model.
    pub model: Option<Model>,
    /// How many entries its log holds, for original recorders, which do not say.
    pub log_size: Option<u16>,
    /// Whether it is by the original manufacturer: then the place of a sample in its millisecond is
    /// not known.
    pub is_original: bool,
    /// What its clock is set to.
    pub clock: ClockRule,
    /// The most that its clock drifts, in parts per billion.
    pub drift_ppb: u32,
    /// The band in which its drift stays, from its lowest to its highest, in parts per billion.
    pub wander_ppb: u32,
    /// How long a change takes through its input circuits.
    pub delays: Delays,
}

/// What a recorder's clock is set to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ClockRule {
    /// UTC.
    Utc,
    /// The site's local time, as it was when the clock was set.
    #[default]
    Local,
    /// A fixed number of seconds east of UTC.
    Offset(i32),
}

/// How long a change takes from the contact to the sample: shortest and longest, in microseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Delays {
    /// For a contact that closes (the input goes on).
    pub closing_us: (u32, u32),
    /// For a contact that opens.
    pub opening_us: (u32, u32),
}

/// One input of one recorder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Point {
    /// Its recorder.
    pub recorder: RecorderId,
    /// Its input, from 1.
    pub input: u8,
    /// Its name, unique in its recorder.
    pub name: String,
    /// What it says about its equipment.
    pub role: Option<Role>,
    /// The equipment that it belongs to.
    pub equipment: Option<String>,
    /// The group that it belongs to.
    pub group: Option<GroupId>,
    /// What it means when it is on, such as `CLOSED`.
    pub on: String,
    /// What it means when it is off.
    pub off: String,
    /// The state in which it is most of the time.
    pub normal: Option<bool>,
    /// The same contact on another recorder.
    pub same_as: Option<PointId>,
    /// Whether `same_as` is on when this point is off.
    pub inverted: bool,
}

/// What a point says about its equipment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Role {
    /// On while the breaker is closed (`52a`).
    BreakerClosed,
    /// On while the breaker is open (`52b`).
    BreakerOpen,
    /// On when a relay trips the breaker (`trip`).
    Trip,
    /// On when the breaker is told to close (`close`).
    Close,
    /// On when a relay sees a fault and has not tripped yet (`pickup`).
    Pickup,
    /// On when the lockout relay has operated (`86`).
    Lockout,
    /// On when something wants attention (`alarm`).
    Alarm,
}

/// Points that are looked at together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Its name.
    pub name: String,
    /// Whether the first change in it is wanted.
    pub first_out: bool,
}

/// A change of a point in one direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Edge {
    /// The point.
    pub point: PointId,
    /// Whether it goes on.
    pub on: bool,
}

/// One change that is to follow another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Expectation {
    /// Its name.
    pub name: String,
    /// What starts it.
    pub after: Edge,
    /// What is to follow.
    pub then: Edge,
    /// The earliest and the latest, in microseconds after.
    pub within_us: (i64, i64),
}

/// What a person saw a clock show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HandObservation {
    /// The recorder.
    pub recorder: RecorderId,
    /// When it was seen.
    pub host_time: Moment<Utc>,
    /// What the clock showed.
    pub unit_time: Moment<Shown>,
    /// How far the time of the look may be off, either way, in microseconds.
    pub doubt_us: u64,
}

/// A correction by hand.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shift {
    /// The recorder.
    pub recorder: RecorderId,
    /// What is added to its times, in microseconds.
    pub us: i64,
    /// From when, by the recorder's time without the shift.
    pub from: Moment<Utc>,
    /// Until when.
    pub to: Moment<Utc>,
    /// Why.
    pub why: String,
}

/// How incidents are found and shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IncidentRules {
    /// The longest time without a change inside an incident, in microseconds.
    pub quiet_us: i64,
    /// What counts as chatter.
    pub chatter: Chatter,
}

/// This many changes of one point within this time are chatter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chatter {
    /// How many changes, at least 3.
    pub changes: u32,
    /// Within how long, in microseconds.
    pub within_us: i64,
}

impl Default for IncidentRules {
    /// Five seconds; four changes within 300 ms.
    fn default() -> IncidentRules {
        let chatter = Chatter { changes: 4, within_us: 300_000 };
        IncidentRules { quiet_us: 5_000_000, chatter }
    }
}

impl Delays {
    /// Of a device whose stamps are those of the contacts.
    pub const NONE: Delays = Delays { closing_us: (0, 0), opening_us: (0, 0) };
}

impl Default for Delays {
    /// Those of the input circuit in the hardware guide.
    fn default() -> Delays {
        Delays { closing_us: (10, 50), opening_us: (20, 320) }
    }
}

impl Recorder {
    /// A recorder of which only the name is known.
    #[must_use]
    pub fn named(name: impl Into<String>) -> Recorder {
        Recorder {
            name: name.into(),
            port: None,
            baud: None,
            model: None,
            log_size: None,
            is_original: false,
            clock: ClockRule::default(),
            drift_ppb: 50_000,
            wander_ppb: 5_000,
            delays: Delays::default(),
        }
    }
}

impl Site {
    /// A site of which nothing is known; times are read in UTC.
    #[must_use]
    pub fn unknown() -> Site {
        Site {
            name: String::new(),
            digest: None,
            time_zone: TimeZone::UTC,
            utc_doubt_us: None,
            recorders: Vec::new(),
            points: Vec::new(),
            groups: Vec::new(),
            expectations: Vec::new(),
            observations: Vec::new(),
            shifts: Vec::new(),
            incident: IncidentRules::default(),
        }
    }

    /// The recorder of this name.
    #[must_use]
    pub fn recorder(&self, name: &str) -> Option<RecorderId> {
        self.recorders.iter().position(|recorder| recorder.name == name).map(RecorderId)
    }

    /// The point at this input.
    #[must_use]
    pub fn point_at(&self, recorder: RecorderId, input: u8) -> Option<PointId> {
        let is_it = |point: &Point| point.recorder == recorder && point.input == input;
        self.points.iter().position(is_it).map(PointId)
    }
}
