//! The text of a new site file. Every key is explained in it; examples are comments.

use std::fmt::Write as _;

use ser_proto::Model;

/// What is known of a recorder.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Known {
    pub(super) port: String,
    pub(super) model: Option<Model>,
    /// How many entries its log holds; original recorders do not say.
    pub(super) size: Option<u16>,
    pub(super) has_answered: bool,
}

/// A site file with these recorders; without any, one recorder as an example.
pub(super) fn text(zone: &str, recorders: &[Known]) -> String {
    let mut text = HEAD.replace("ZONE", zone);
    if recorders.is_empty() {
        text += EXAMPLE_RECORDER;
    }
    for (index, known) in recorders.iter().enumerate() {
        recorder(&mut text, index + 1, known);
    }
    text += RECORDER_KEYS;
    text += REST;
    text
}

fn recorder(text: &mut String, number: usize, known: &Known) {
    let Known { port, model, size, has_answered } = known;
    // A string takes everything.
    let _ = writeln!(text, "\n[[recorder]]\nname = \"SER{number}\"");
    let _ = writeln!(text, "port = {}", quoted(port));
    let _ = match (model, has_answered) {
        (Some(Model::Ser160), _) => writeln!(text, "model = \"ser160\""),
        (Some(Model::Ser320), _) => writeln!(text, "model = \"ser320\""),
        (None, true) => {
            writeln!(
                text,
                "# model =  # \"ser160\" or \"ser320\": its log was empty, which does not show it"
            )
        }
        (None, false) => writeln!(text, "# model =  # \"ser160\" or \"ser320\": it did not answer"),
    };
    let _ = match (size, has_answered) {
        (Some(size), _) => writeln!(text, "log_size = {size}"),
        (None, true) => writeln!(
            text,
            "original = true\nlog_size = 2048  # as delivered; original recorders do not say"
        ),
        (None, false) => Ok(()),
    };
}

/// A text as TOML has it.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for letter in text.chars() {
        match letter {
            '"' | '\\' => quoted.extend(['\\', letter]),
            letter if letter.is_control() => {
                let _ = write!(quoted, "\\u{:04X}", u32::from(letter));
            }
            letter => quoted.push(letter),
        }
    }
    quoted.push('"');
    quoted
}

const HEAD: &str = "\
# What people know of a plant and its recorders. Lines that begin with # are comments: remove
# the # to make a line count. `ser-cli site check FILE` tells what is wrong.

site = \"My site\"

# The zone in which people read times. Everything stored is UTC.
time_zone = \"ZONE\"

# How far this computer's clock may be from UTC, where the operating system does not know.
# [host]
# utc_doubt_ms = 20

# ---- Recorders: one [[recorder]] for each. Names are unique and have no slash.
";

const EXAMPLE_RECORDER: &str = "
[[recorder]]
name = \"SER1\"
# port = \"/dev/ttyUSB0\"  # or \"tcp://10.0.0.7:4000\", \"geni:/dev/shm/host?node=5\"
# baud = 9600            # of its serial port, also behind a terminal server
# model = \"ser320\"       # or \"ser160\"
# original = true         # by the original manufacturer; it does not say its log's size:
# log_size = 2048
";

const RECORDER_KEYS: &str = "
# More keys of a recorder:
# clock = \"local\"      # what `clock set` sets: \"local\" (the zone above), \"utc\" or \"+05:30\"
# drift_ppm = 50       # the most that its clock drifts
# wander_ppm = 5       # the most that its drift changes
# delay_ms = { closing = [0.01, 0.05], opening = [0.02, 0.32] }  # of its input circuits
";

const REST: &str = "
# ---- Points: one [[point]] for each input that has a name. `recorder` may be left out if there
# is only one.

# [[point]]
# recorder = \"SER1\"
# input = 5
# name = \"Relay trip output\"
# role = \"trip\"  # 52a, 52b, trip, close, pickup, 86 or alarm

# [[point]]
# recorder = \"SER1\"
# input = 7
# name = \"52-1 closed\"
# role = \"52a\"
# equipment = \"52-1\"
# group = \"Feeder 1\"
# on = \"CLOSED\"    # what it means when it is on
# off = \"OPEN\"
# normal = \"on\"    # how it is most of the time
# same_as = \"SER2/52-1 closed\"  # the same contact on another recorder
# inverted = true   # only if one of the two is on when the other is off

# ---- Groups: points that are looked at together; in which the first change is wanted.

# [[group]]
# name = \"Feeder 1\"
# first_out = true

# ---- What is expected: a change that is to follow another. The last word is on or off.

# [[expect]]
# name = \"52-1 clears the fault\"
# after = \"Relay trip output on\"
# then = \"52-1 closed off\"
# within_ms = [15, 50]

# ---- What somebody saw a recorder's clock show.

# [[observation]]
# recorder = \"SER1\"
# host_time = \"2026-11-22T09:00:00Z\"
# unit_time = \"2026-11-22T09:00:00.120\"
# doubt_ms = 100

# ---- Corrections by hand. They are named in every report.

# [[shift]]
# recorder = \"SER1\"
# ms = -250
# from = \"2026-11-22T08:00:00Z\"
# to = \"2026-11-22T12:00:00Z\"
# why = \"clock found 250 ms fast, work order 4711\"

# ---- How incidents are found and shown.

# [incident]
# quiet_s = 5  # the longest time without a change inside an incident
# chatter = { changes = 4, within_ms = 300 }  # shown as one row
";

#[cfg(test)]
mod tests {
    use ser_evidence::site::{self, Site};

    use super::*;

    fn read(text: &str) -> Site {
        site::read(text).unwrap_or_else(|wrong| panic!("{wrong:#?}\n{text}"))
    }

    #[test]
    fn a_new_file_is_a_good_one() {
        let site = read(&text("Europe/Berlin", &[]));
        assert_eq!((site.recorders.len(), site.points.len()), (1, 0));
        assert_eq!(site.recorders[0].name, "SER1");
    }

    #[test]
    fn what_a_recorder_says_is_in_the_file() {
        let known = |port: &str| Known { port: port.to_owned(), ..Known::default() };
        let model = Some(Model::Ser160);
        let site = read(&text(
            "UTC",
            &[
                Known { model, size: Some(512), has_answered: true, ..known("/dev/ttyUSB0") },
                Known { has_answered: true, ..known(r#"\\.\COM10 "x""#) },
                known("tcp://a:1"),
            ],
        ));
        let [first, original, silent] = site.recorders.as_slice() else { panic!("three") };
        assert_eq!((first.model, first.log_size, first.is_original), (model, Some(512), false));
        assert_eq!(original.port.as_deref(), Some(r#"\\.\COM10 "x""#));
        assert_eq!((original.log_size, original.is_original), (Some(2048), true));
        assert_eq!((silent.model, silent.log_size, silent.is_original), (None, None, false));
    }

    /// Somebody removes the # of everything that is no sentence.
    #[test]
    fn the_examples_are_good_as_well() {
        let is_example = |line: &str| {
            let line = line.trim_start_matches("# ");
            line.starts_with('[') || line.split(' ').nth(1) == Some("=")
        };
        let lines = text("UTC", &[]);
        let examples = lines.lines().filter(|line| is_example(line));
        let text: String =
            examples.map(|line| format!("{}\n", line.trim_start_matches("# "))).collect();
        // The keys of recorders stand below the recorder; the pair needs the other recorder.
        let other = "[[recorder]]\nname = \"SER2\"\n[[point]]\nrecorder = \"SER2\"\ninput = 1\n\
                     name = \"52-1 closed\"\n";
        let text = text.replace("then = \"52-1", "then = \"SER1/52-1") + other;
        let site = read(&text);
        assert_eq!((site.points.len(), site.shifts.len()), (3, 1));
    }
}
