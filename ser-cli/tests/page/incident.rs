//! Incidents for pages to show.

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use tempfile::TempDir;

use crate::common::ser_cli;

/// Names that would be markup, script or a formula if anybody believed them.
pub(super) const HOSTILE: [&str; 5] = [
    "<script>document.title='owned'</script>",
    "\"quoted\" & 'quoted' &amp; <b>bold</b>",
    "=1+1",
    "קלט שמאל",
    "]]><img src=x onerror=alert(1)>",
];

/// How often each of the contacts of the crowded incident moves that chatter.
pub(super) const CHATTER: u32 = 20;

/// A folder with a site file and the evidence of an incident.
pub(super) struct Incident {
    folder: TempDir,
    lines: String,
}

impl Incident {
    /// At a site of two recorders: U1 with hostile names at its inputs 1 to 5 and a breaker, and U2.
    pub(super) fn new() -> Incident {
        Incident::at(&["U1", "U2 & co"])
    }

    /// The same with other recorders beside U1.
    fn at(recorders: &[&str]) -> Incident {
        let folder = tempfile::tempdir().expect("a folder");
        let mut site = String::from(
            "site = \"Northfield <1>\"\ntime_zone = \"UTC\"\n[host]\nutc_doubt_ms = 1\n",
        );
        for name in recorders {
            write!(site, "[[recorder]]\nname = \"{name}\"\nclock = \"utc\"\n").expect("text");
        }
        site.push_str(
            "[[point]]\nrecorder = \"U1\"\ninput = 6\nname = \"Trip\"\nrole = \"trip\"\n\
             equipment = \"52-1\"\n\
             [[point]]\nrecorder = \"U1\"\ninput = 7\nname = \"52-1 closed\"\nrole = \"52a\"\n\
             equipment = \"52-1\"\non = \"CLOSED\"\noff = \"OPEN\"\nnormal = \"on\"\n\
             [[expect]]\nname = \"52-1 opens\"\nafter = \"U1/Trip on\"\n\
             then = \"U1/52-1 closed off\"\nwithin_ms = [15, 50]\n",
        );
        for (place, name) in HOSTILE.iter().enumerate() {
            let name = toml_text(name);
            let input = place + 1;
            write!(site, "[[point]]\nrecorder = \"U1\"\ninput = {input}\nname = {name}\n")
                .expect("text");
        }
        fs::write(folder.path().join("north.toml"), site).expect("a file");
        let mut incident = Incident { folder, lines: String::new() };
        incident.line("{\"record\":\"file\",\"schema\":1,\"program\":\"a test\"}");
        for recorder in recorders {
            incident.set(recorder);
        }
        incident
    }

    /// A trip: a pickup, the relay, the breaker that is late, a contact that chatters, a gap.
    pub(super) fn trip() -> Incident {
        let mut incident = Incident::new();
        // What was on before.
        let closed = 1 << 6;
        incident.entry("U1", 1, 100, 1, closed | 1);
        incident.entry("U1", 2, 103, 0b10, closed | 0b11);
        incident.entry("U1", 3, 117, 1 << 5, closed | 0b11 | 1 << 5);
        incident.entry("U2 & co", 1, 119, 0b100, 0b100);
        incident.entry("U1", 4, 188, 1 << 6, 0b11 | 1 << 5);
        let mut chattering = 0b100;
        for change in 0..15 {
            chattering ^= 0b1000;
            incident.entry("U2 & co", 2 + change, 300 + 10 * change, 0b1000, chattering);
        }
        // Entry 5 is missing.
        incident.entry("U1", 6, 900, 0b1_1100, 0b1_1111 | 1 << 5);
        incident
    }

    /// Five recorders, one of a long name, on which more points move than a page of paper has room
    /// for; two contacts that chatter, and entries that are missing.
    pub(super) fn crowded() -> Incident {
        const POINTS: u32 = 18;
        let long = "n".repeat(200);
        let recorders = ["U1", "U2 & co", "U3", "U4", &long];
        let mut incident = Incident::at(&recorders);
        for (late, recorder) in (0..).zip(recorders) {
            let mut state = 1 << 6;
            let mut sequence = 0;
            let mut change = |ms: u32, input: u32, missing: u32| {
                state ^= 1 << input;
                sequence += 1 + missing;
                incident.entry(recorder, sequence, ms, 1 << input, state);
            };
            for input in 0..POINTS {
                let missing = if (recorder, input) == ("U3", 9) { 3 } else { 0 };
                change(100 + late + 13 * input, input, missing);
            }
            if late % 2 == 1 {
                (0..CHATTER).for_each(|again| change(500 + 10 * again, 20, 0));
            }
            (0..POINTS).step_by(2).for_each(|input| change(900 + 20 * input, input, 0));
        }
        incident
    }

    /// So many changes, 40 ms apart, none of them chatter.
    pub(super) fn of(changes: u32) -> Incident {
        let mut incident = Incident::new();
        for change in 0..changes {
            let input = 1 << (change % 20);
            let on = change / 20 % 2 == 0;
            let below = (1 << (change % 20)) - 1;
            let all = (1 << 20) - 1;
            let state = if on { below | input } else { all & !(below | input) };
            incident.entry("U1", change + 1, 40 * change, input, state);
        }
        incident
    }

    /// The page, and what was told when it was written.
    pub(super) fn page(&self) -> PathBuf {
        let page = self.folder.path().join("trip.html");
        let output = self.report("-o trip.html --force");
        assert_eq!(output.status.code(), Some(0), "{output:?}");
        page
    }

    pub(super) fn report(&self, options: &str) -> std::process::Output {
        fs::write(self.folder.path().join("all.jsonl"), &self.lines).expect("a file");
        let mut report = ser_cli();
        report.current_dir(self.folder.path());
        report.args("report --last --site north.toml --input all.jsonl".split(' '));
        report.args(options.split_whitespace()).output().expect("ser-cli runs")
    }

    fn line(&mut self, line: &str) {
        self.lines += line;
        self.lines.push('\n');
    }

    /// The clock was set to within two milliseconds, before the first entry.
    fn set(&mut self, recorder: &str) {
        self.line(&format!(
            "{{\"record\":\"clock\",\"recorder\":\"{recorder}\",\"how\":\"set\",\
             \"shown\":\"2026-11-22T09:59:00.000\",\"scale\":\"host\",\"lo_us\":1000000,\
             \"hi_us\":1002000,\"host\":{{\"boot\":\"0123456789abcdef0123456789abcdef\",\
             \"monotonic_us\":1002000,\"utc_us\":1795341540002000,\"utc_doubt_us\":1000}},\
             \"place\":{{\"life\":\"{:016x}\",\"after\":0,\"before\":0,\"newest\":null}}}}",
            life(recorder)
        ));
    }

    /// Inputs change so many milliseconds after ten o'clock.
    fn entry(&mut self, recorder: &str, sequence: u32, ms: u32, changed: u32, state: u32) {
        let set = |bits: u32| {
            let numbers = (0..32).filter(|bit| bits >> bit & 1 == 1).map(|bit| bit + 1);
            numbers.map(|number: u32| number.to_string()).collect::<Vec<_>>().join(",")
        };
        let (minute, second, ms) = (ms / 60_000, ms / 1000 % 60, ms % 1000);
        self.line(&format!(
            "{{\"record\":\"entry\",\"recorder\":\"{recorder}\",\"entry\":{sequence},\
             \"time\":\"2026-11-22T10:{minute:02}:{second:02}.{ms:03}\",\"changed\":[{}],\
             \"state\":[{}],\"sequence\":{sequence},\"life\":\"{:016x}\"}}",
            set(changed),
            set(state),
            life(recorder)
        ));
    }
}

fn life(recorder: &str) -> u64 {
    recorder.bytes().fold(1, |bits: u64, byte| bits.wrapping_mul(31).wrapping_add(byte.into()))
}

fn toml_text(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}
