//! The tables of a site file and their keys.

/// A kind of table.
#[derive(Debug)]
pub(super) struct Kind {
    /// What a table of this kind is called in a sentence.
    pub(super) what: &'static str,
    /// How it begins in a file.
    pub(super) head: &'static str,
    /// Its keys.
    pub(super) keys: &'static [&'static str],
}

pub(super) const SITE: Kind = Kind {
    what: "the site",
    head: "",
    keys: &[
        "site",
        "time_zone",
        "host",
        "recorder",
        "point",
        "group",
        "expect",
        "observation",
        "shift",
        "incident",
    ],
};

pub(super) const HOST: Kind = Kind { what: "the host", head: "[host]", keys: &["utc_doubt_ms"] };

pub(super) const RECORDER: Kind = Kind {
    what: "a recorder",
    head: "[[recorder]]",
    keys: &[
        "name",
        "port",
        "baud",
        "model",
        "original",
        "log_size",
        "clock",
        "drift_ppm",
        "wander_ppm",
        "delay_ms",
    ],
};

pub(super) const DELAYS: Kind =
    Kind { what: "`delay_ms`", head: "", keys: &["closing", "opening"] };

pub(super) const POINT: Kind = Kind {
    what: "a point",
    head: "[[point]]",
    keys: &[
        "recorder",
        "input",
        "name",
        "role",
        "equipment",
        "group",
        "on",
        "off",
        "normal",
        "same_as",
        "inverted",
    ],
};

pub(super) const GROUP: Kind =
    Kind { what: "a group", head: "[[group]]", keys: &["name", "first_out"] };

pub(super) const EXPECT: Kind = Kind {
    what: "an expectation",
    head: "[[expect]]",
    keys: &["name", "after", "then", "within_ms"],
};

pub(super) const OBSERVATION: Kind = Kind {
    what: "an observation",
    head: "[[observation]]",
    keys: &["recorder", "host_time", "unit_time", "doubt_ms"],
};

pub(super) const SHIFT: Kind =
    Kind { what: "a shift", head: "[[shift]]", keys: &["recorder", "ms", "from", "to", "why"] };

pub(super) const INCIDENT: Kind =
    Kind { what: "the incident", head: "[incident]", keys: &["quiet_s", "chatter"] };

pub(super) const CHATTER: Kind =
    Kind { what: "`chatter`", head: "", keys: &["changes", "within_ms"] };

/// All kinds of tables that have a name of their own.
const ALL: [&Kind; 9] =
    [&SITE, &HOST, &RECORDER, &POINT, &GROUP, &EXPECT, &OBSERVATION, &SHIFT, &INCIDENT];

/// The tables that have this key, as in "a recorder (`[[recorder]]`)".
pub(super) fn with_key(key: &str) -> Vec<String> {
    let have_it = ALL.iter().filter(|kind| kind.keys.contains(&key));
    let name = |kind: &&Kind| match kind.head {
        "" => format!("{}, above all tables", kind.what),
        head => format!("{} (`{head}`)", kind.what),
    };
    have_it.map(name).collect()
}
