//! The command line on a Genius bus. `ser-cli sim --genius` provides board, bus and recorders, and
//! every command reaches them through the file that is the host's window.
#![cfg(unix)]

mod common;

use std::fs;
use std::io::{BufReader, Write};
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::sync::mpsc::Receiver;

use common::{Running, events, is_kept, ser_cli, wait_until};
use ser_evidence::record::{ClockObservation, How, Record, Reference, Told};
use ser_files::Source;
use ser_sim::testing::{PATIENCE, image};
use tempfile::TempDir;

/// For recorders that are there, on a busy machine. A board may also stand still for this long.
const PATIENT_TIMEOUT: &str = "60s";

/// On a noisy bus a question gets lost now and then, and is asked again after this time.
const NOISY_TIMEOUT: &str = "10s";

const RETRIES: &str = "10";

/// How far apart two clocks may be after one broadcast has set both.
const CLOCKS_AGREE_WITHIN_MS: u32 = 1;

/// A bus made with `ser-cli sim`, whose contacts are moved through its standard input.
struct Bench {
    folder: TempDir,
    sim: Running,
    announced: Vec<String>,
    timeout: &'static str,
}

impl Bench {
    fn start(options: &str) -> Bench {
        let folder = tempfile::tempdir().expect("a folder");
        let mut command = ser_cli();
        command
            .arg("sim")
            .arg("--genius")
            .arg(folder.path().join("host"))
            .args(["--contacts", "-"]);
        command.args(options.split_whitespace()).current_dir(folder.path());
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut sim = Running::start(&mut command);
        let lines = sim.lines();
        let ports =
            options.split_whitespace().filter(|word| ["--node", "--pty"].contains(word)).count();
        let announced = (0..ports)
            .map(|_| lines.recv_timeout(PATIENCE).expect("the simulator answers"))
            .collect();
        let timeout = if options.contains("--bus-noise") { NOISY_TIMEOUT } else { PATIENT_TIMEOUT };
        Bench { folder, sim, announced, timeout }
    }

    fn window(&self) -> PathBuf {
        self.folder.path().join("host")
    }

    fn port(&self, node: u8) -> String {
        format!("geni:{}?node={node}", self.window().display())
    }

    fn command(&self, port: &str, arguments: &str) -> Command {
        let mut command = ser_cli();
        command
            .env("SER_PORT", port)
            .env("SER_STATE_DIR", self.folder.path().join("state"))
            .args(["--timeout", self.timeout, "--retries", RETRIES])
            .args(arguments.split_whitespace());
        command
    }

    fn run(&self, node: u8, arguments: &str) -> Output {
        self.command(&self.port(node), arguments).output().expect("ser-cli runs")
    }

    /// Standard output of a command to a working recorder.
    fn ok(&self, node: u8, arguments: &str) -> String {
        succeeded(arguments, &self.run(node, arguments))
    }

    /// The same for a command to the bus.
    fn on_bus(&self, arguments: &str) -> String {
        succeeded(arguments, &self.command(&self.bus(), arguments).output().expect("ser-cli runs"))
    }

    /// The bus as a whole.
    fn bus(&self) -> String {
        format!("geni:{}", self.window().display())
    }

    /// Moves contacts, and waits until a recorder has that many entries in all.
    fn play(&mut self, csv: &str, node: u8, entries: usize) {
        let input = self.sim.0.stdin.as_mut().expect("piped");
        writeln!(input, "{csv}\n").expect("the simulator listens");
        wait_until("the recorder has seen it", || {
            events(&self.ok(node, "read --all --format jsonl")).len() == entries
        });
    }
}

fn succeeded(arguments: &str, output: &Output) -> String {
    assert!(output.status.success(), "{arguments}: {}", stderr(output));
    String::from_utf8(output.stdout.clone()).expect("text")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Entry, input and state of the rows of a CSV.
fn without_times(csv: &str) -> Vec<String> {
    csv.lines()
        .map(|line| {
            let fields: Vec<_> = line.split(',').collect();
            [0, 2, 3].map(|column: usize| fields.get(column).copied().unwrap_or_default()).join(",")
        })
        .collect()
}

#[test]
fn every_command_works_over_the_bus() {
    let mut bench = Bench::start("--node 5 --node 9:ser160");
    assert_eq!(bench.announced, [bench.port(5), bench.port(9)]);
    let taps = (0..25)
        .map(|tap| format!("{},1,{},5\n{},16,{},9", tap * 2, 1 - tap % 2, tap * 2, 1 - tap % 2));
    let csv = std::iter::once("ms,input,state,node".to_string())
        .chain(taps)
        .collect::<Vec<_>>()
        .join("\n");
    bench.play(&csv, 5, 25);

    // Seven entries fit a datagram of the larger model and ten of the smaller. None is lost or
    // doubled.
    for (node, input) in [(5, 1), (9, 16)] {
        let rows = without_times(&bench.ok(node, "read --all --format csv"));
        let expected = (1..=25).map(|entry| format!("{entry},{input},{}", entry % 2));
        assert_eq!(rows[1..], expected.collect::<Vec<_>>(), "node {node}");
        let range = without_times(&bench.ok(node, "read --from 3 --count 20 --format csv"));
        assert_eq!(range[1..], rows[3..23], "node {node}");
    }
    assert!(bench.ok(5, "status").contains("inputs          32"));
    assert!(bench.ok(9, "status").contains("inputs          16"));
    assert!(bench.ok(5, "config --size 100").contains("size            100 entries"));
    assert!(bench.ok(5, "config").contains("size            100 entries"));
    assert_eq!(bench.ok(5, "clock set --at 2026-11-22T10:00:00.250"), "2026-11-22T10:00:00.250\n");
    bench.ok(5, "stop");
    assert!(bench.ok(5, "status").contains("stopped"));
    bench.ok(5, "start");
    assert!(bench.ok(5, "status").contains("recording"));
    assert_eq!(bench.ok(5, "last-broadcast"), "none since power-up\n");
    let printed = bench.run(5, "print --from 1 --count 1");
    assert!(
        printed.status.success() && stderr(&printed).contains("RS-232"),
        "{}",
        stderr(&printed)
    );
    // New events are delivered once, to each reader of its own recorder.
    assert_eq!(events(&bench.ok(9, "read --new --format jsonl")).len(), 25);
    assert!(events(&bench.ok(9, "read --new --format jsonl")).is_empty());
    bench.ok(5, "erase --yes");
    assert!(events(&bench.ok(5, "read --all --format jsonl")).is_empty());
    assert_eq!(events(&bench.ok(9, "read --all --format jsonl")).len(), 25);

    assert_eq!(bench.sim.interrupt(), Some(0));
    assert!(!bench.window().exists(), "the window goes with the simulator");
}

#[test]
fn the_bus_is_seen_and_spoken_to_as_a_whole() {
    let mut bench = Bench::start("--node 5 --node 9:ser160");
    bench.play("ms,input,state,node\n0,3,1,5\n0,17,1,5\n0,16,1,9", 5, 1);
    assert_eq!(
        bench.on_bus("genius devices"),
        "node  model  in  out  reference  kind\n\
         \u{20}  5      4   4    0       none  recorder, 32 inputs\n\
         \u{20}  9      4   2    0       none  recorder, 16 inputs\n"
    );
    let globals = "node  inputs  on\n   5      32  3 17\n   9      16  16\n";
    assert_eq!(bench.on_bus("genius globals"), globals);
    assert_eq!(bench.on_bus("genius globals --model-number 4"), globals);
    for command in ["genius globals --model-number 3", "genius broadcast --model-number 3 stop"] {
        let (code, told) = told(bench.command(&bench.bus(), command));
        assert_eq!(code, Some(1), "{told}");
        assert!(
            told.contains("no recorder is logged in") && told.contains("--model-number"),
            "{told}"
        );
    }
    assert_eq!(
        bench.on_bus("genius forces --node 9 --table input-enable"),
        "input enable: 00 00 (no point is on)\n"
    );
    assert_eq!(
        bench.on_bus("genius forces --node 9 --table output-values"),
        "output values: the device has no such points\n"
    );

    let clock = bench.on_bus("genius broadcast clock --at 2026-11-22T10:00:00");
    let confirmed = "set clock at 10:00:00.000";
    assert_eq!(
        clock,
        format!(
            "node  received   last broadcast\n   5  yes        {confirmed}\n   9  yes        {confirmed}\n"
        )
    );
    let again = bench.command(&bench.bus(), "genius broadcast clock --at 2026-11-22T10:00:00");
    let (code, told) = told(again);
    assert_eq!(code, Some(1), "{told}");
    assert!(told.contains("0 of 2 recorders received it") && told.contains("not known"), "{told}");
    // The same edge of two recorders gets the same stamp, or the next one.
    bench.play("ms,input,state,node\n0,1,1,5\n0,1,1,9", 5, 2);
    let stamp = |node| {
        let event = bench.ok(node, "read --from 2 --count 1 --format csv");
        event.lines().nth(1).and_then(|row| row.split(',').nth(1)).map(str::to_string)
    };
    let [first, second] = [5, 9].map(|node| hour_ms(&stamp(node).expect("an event")));
    assert!(first.abs_diff(second) <= CLOCKS_AGREE_WITHIN_MS, "{:?} {:?}", stamp(5), stamp(9));

    let refused =
        bench.command(&bench.bus(), "genius broadcast erase").output().expect("ser-cli runs");
    assert_eq!((refused.status.code(), stderr(&refused).contains("--yes")), (Some(2), true));
    assert!(bench.on_bus("genius broadcast stop").matches("yes").count() == 2);
    assert!(bench.ok(9, "status").contains("stopped"));
    assert!(bench.on_bus("genius broadcast start").matches("yes").count() == 2);
    assert!(bench.on_bus("genius broadcast erase --yes").matches("yes").count() == 2);
    assert!(events(&bench.ok(9, "read --all --format jsonl")).is_empty());
}

/// What is kept of the recorders' clocks, each observation with its recorder's name.
fn kept_clocks(bench: &Bench) -> Vec<(String, ClockObservation)> {
    // The folder is made for the first thing that is kept.
    let files = fs::read_dir(bench.folder.path().join("state")).into_iter().flatten();
    let mut files: Vec<_> = files.map(|file| file.expect("a file").path()).collect();
    files.retain(|path| is_kept(path));
    files.sort();
    files.iter().flat_map(|path| clocks_of(&fs::read(path).expect("a file"))).collect()
}

fn clocks_of(jsonl: &[u8]) -> Vec<(String, ClockObservation)> {
    let told = Source::new(BufReader::new(jsonl), "").expect("JSON lines");
    let clocks = told.filter_map(|told| match told.expect("a record") {
        Told { recorder, record: Record::Clock(clock) } => Some((recorder, clock)),
        _ => None,
    });
    clocks.collect()
}

/// Forgets what is kept of the clocks.
fn forget(bench: &Bench) {
    for file in fs::read_dir(bench.folder.path().join("state")).expect("a folder") {
        let path = file.expect("a file").path();
        if is_kept(&path) {
            fs::remove_file(path).expect("forgotten");
        }
    }
}

#[test]
fn clocks_of_a_bus_are_compared_without_being_set() {
    let bench = Bench::start("--node 5 --node 9:ser160");
    // Both tell what they showed, with its day, although nobody has set them.
    let told = bench.on_bus("genius broadcast mark --format jsonl");
    let marks: Vec<_> = clocks_of(told.as_bytes());
    assert_eq!(marks, kept_clocks(&bench));
    let [(five, one), (nine, other)] = &marks[..] else { panic!("{told}") };
    assert_eq!((five, nine), (&bench.port(5), &bench.port(9)));
    assert!(matches!(one.how, How::Mark { .. }) && one.how == other.how, "{told}");
    forget(&bench);

    // As soon as one may be an original one, none gets a mark with a token, and the day is not known
    // of that one.
    let folder = fs::read_dir(bench.folder.path().join("state")).expect("a folder");
    let mut files = folder.map(|file| file.expect("a file").path());
    let of_nine = files.find(|path| path.to_string_lossy().ends_with("%3D9.jsonl.lock"));
    let original = of_nine.expect("device 9").with_extension("").with_extension("original");
    let believed = "{\"version\":1,\"unit\":\"9\",\"answers\":false,\"asked_utc_s\":";
    let now = std::time::UNIX_EPOCH.elapsed().expect("after 1970").as_secs();
    fs::write(&original, format!("{believed}{now}}}\n")).expect("written");
    let mark = bench.command(&bench.bus(), "genius broadcast mark").output().expect("it runs");
    let (table, error) = (succeeded("mark", &mark), stderr(&mark));
    assert_eq!(table.lines().count(), 3, "{table}");
    assert!(table.lines().nth(2).is_some_and(|row| row.ends_with(" s ± 1 ms")), "{table}");
    assert!(error.contains("device 9: the day is not known: the log is empty"), "{error}");
    assert!(!error.contains("device 5"), "{error}");
    assert!(bench.ok(9, "last-broadcast").contains("read"), "nothing beyond the manual");
    fs::remove_file(&original).expect("forgotten");
    forget(&bench);

    let set = bench.on_bus("genius broadcast clock --at 2026-11-22T09:00:00 --format jsonl");
    assert_eq!(clocks_of(set.as_bytes()), kept_clocks(&bench));
    assert_eq!(kept_clocks(&bench).len(), 2);
    forget(&bench);
    bench.on_bus("genius broadcast clock --at 2026-11-22T10:00:00");
    let table = bench.on_bus("genius broadcast mark");
    let row = |row: usize| table.lines().nth(row).expect("a row");
    assert!(row(1).starts_with("   5  2026-11-22T10:00:"), "{table}");
    let apart = row(2).strip_prefix("   9  2026-11-22T10:00:").expect("the same minute");
    assert!(["+0.000", "+0.001", "-0.001"].iter().any(|ms| apart.contains(ms)), "{table}");

    // A setting and a mark of each, and both of one broadcast.
    let clocks = kept_clocks(&bench);
    let names: Vec<_> = clocks.iter().map(|(name, _)| name.as_str()).collect();
    let (five, nine) = (bench.port(5), bench.port(9));
    assert_eq!(names, [&*five, &*five, &*nine, &*nine]);
    let hows: Vec<_> = clocks.iter().map(|(_, clock)| clock.how).collect();
    assert!(matches!(hows[..2], [How::Set { broadcast: Some(_) }, How::Mark { .. }]), "{hows:?}");
    assert_eq!(hows[..2], hows[2..]);
    for (_, clock) in &clocks {
        let Reference::Host { bound, .. } = clock.at else { panic!("{clock:?}") };
        assert!(bound.width_us().is_some_and(|width_us| width_us >= 2_000), "{bound:?}");
        assert_eq!((clock.place.after, clock.place.before), (Some(0), Some(0)));
    }
}

/// Milliseconds of the hour in which a clock was set to ten o'clock.
fn hour_ms(stamp: &str) -> u32 {
    let time = stamp.strip_prefix("2026-11-22T10:").expect("within the hour");
    let (minute, rest) = time.split_once(':').expect("minutes");
    let (second, millisecond) = rest.split_once('.').expect("seconds");
    let number = |text: &str| text.parse::<u32>().expect("a number");
    (number(minute) * 60 + number(second)) * 1000 + number(millisecond)
}

/// The exit code of a command, and all its output.
fn told(mut command: Command) -> (Option<i32>, String) {
    let output = command.output().expect("ser-cli runs");
    (output.status.code(), stderr(&output))
}

#[test]
fn live_views_survive_a_board_that_stands_still() {
    let mut bench = Bench::start("--node 5:ser160");
    // Short, so that a standstill is noticed soon. Commands wait for the failure to pass anyway.
    bench.timeout = "1s";
    let mut follow = bench.command(&bench.bus(), "genius globals --follow");
    survives(&mut bench, &mut follow, ["     5      16  none", "     5      16  7"], 1);
    let mut watch = bench.command(&bench.port(5), "watch --poll --format csv");
    survives(&mut bench, &mut watch, ["1,7,1", "2,7,0"], 0);
}

/// A live view shows one thing; then the simulator stands still until that is reported; then the
/// view shows another.
fn survives(bench: &mut Bench, view: &mut Command, [before, after]: [&str; 2], contact: u8) {
    let mut view = Running::start(view.stdout(Stdio::piped()).stderr(Stdio::piped()));
    let (rows, told) = (view.lines(), view.told());
    let shows = |expected: &str| {
        let fits = |row: &String| row.ends_with(expected) || without_times(row) == [expected];
        let seen = wait_for(&rows, fits);
        assert!(seen, "{expected} is not shown");
    };
    shows(before);
    bench.sim.signal("-STOP");
    assert!(wait_for(&told, |line| line.starts_with("warning: ")), "nothing is said");
    bench.sim.signal("-CONT");
    assert!(wait_for(&told, |line| line == "all is well again"), "it does not pass");
    let input = bench.sim.0.stdin.as_mut().expect("piped");
    writeln!(input, "ms,input,state\n0,7,{contact}\n").expect("the simulator listens");
    shows(after);
    assert_eq!(view.interrupt(), Some(0));
}

/// Whether such a line arrives.
fn wait_for(lines: &Receiver<String>, fits: impl Fn(&String) -> bool) -> bool {
    std::iter::from_fn(|| lines.recv_timeout(PATIENCE).ok()).any(|line| fits(&line))
}

#[test]
fn events_are_watched_over_the_bus_and_rs_232_works_beside_it() {
    let mut bench = Bench::start("--node 5:ser160 --pty line");
    let line = bench.folder.path().join("line");
    assert_eq!(bench.announced, [line.file_name().unwrap().to_str().unwrap(), &bench.port(5)]);
    let mut command = bench.command(&bench.port(5), "watch --format csv");
    let mut watch = Running(
        command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("ser-cli runs"),
    );
    let rows = watch.lines();
    assert_eq!(
        rows.recv_timeout(PATIENCE).as_deref(),
        Ok("entry,time,input,state,sequence,life,note")
    );

    // The window belongs to one program at a time, but the serial line is a separate way.
    let second = bench.run(5, "status");
    assert_eq!(second.status.code(), Some(1));
    assert!(stderr(&second).contains("is in use"), "{}", stderr(&second));
    let on_line = |arguments: &str| {
        let output =
            bench.command(line.to_str().unwrap(), arguments).output().expect("ser-cli runs");
        succeeded(arguments, &output)
    };
    wait_until("reports go to the host", || {
        let settings = on_line("config");
        settings.contains("auto report     genius") && settings.contains("report to       31")
    });
    let input = bench.sim.0.stdin.as_mut().expect("piped");
    writeln!(input, "ms,input,state\n0,7,1\n3,7,0\n").expect("the simulator listens");
    for expected in ["1,7,1", "2,7,0"] {
        let row = rows.recv_timeout(PATIENCE).expect("an event");
        assert_eq!(without_times(&row), [expected]);
    }
    assert_eq!(watch.interrupt(), Some(0));
    let line_port = line.to_str().unwrap().to_string();
    let settings = bench.command(&line_port, "config").output().expect("ser-cli runs");
    assert!(
        succeeded("config", &settings).contains("auto report     off"),
        "the recorder's setting is back"
    );
}

#[test]
fn each_mistake_has_a_message_of_its_own() {
    let mut bench = Bench::start("--node 5");
    // A short timeout for a board that is not there.
    bench.timeout = NOISY_TIMEOUT;
    let folder = bench.folder.path().display().to_string();
    fs::write(bench.folder.path().join("short"), b"no window").expect("written");
    fs::write(bench.folder.path().join("silent"), [0; 0x4000]).expect("written");
    let host = bench.window().display().to_string();
    for (port, code, message) in [
        (format!("geni:{folder}/none?node=5"), 1, "there is no GENI window"),
        (format!("geni:{folder}?node=5"), 1, "cannot be a GENI window"),
        ("geni:/dev/null?node=5".to_string(), 1, "cannot be a GENI window"),
        (format!("geni:{folder}/short?node=5"), 1, "has 9 bytes and cannot be a GENI window"),
        (format!("geni:{folder}/silent?node=5"), 1, "the GENI board is silent (no heartbeat)"),
        (format!("geni:{host}?node=7"), 1, "device 7 is not on the bus"),
        (format!("geni:{host}?node=31"), 1, "31 is the number of this host's own board"),
        (format!("geni:{host}?node=32"), 2, "a recorder's bus address is 0 to 31"),
        (format!("geni:{host}?node=5&offset=1"), 1, "has 16384 bytes and cannot be a GENI window"),
        (format!("geni:{host}?node=5&offset=x"), 2, "an offset is a number of bytes"),
        (format!("geni:{host}?node=5&node=6"), 2, "each once"),
        (format!("geni:{host}?nod=5"), 2, "each once"),
        (format!("geni:{host}"), 2, "the window to a whole bus"),
        ("geni:".to_string(), 2, "geni: needs the window of a GENI board"),
    ] {
        let output = bench.command(&port, "status").output().expect("ser-cli runs");
        let told = stderr(&output);
        assert_eq!(output.status.code(), Some(code), "{port}: {told}");
        assert!(told.contains(message) && told.contains("hint: "), "{port}: {told}");
    }
    fs::write(bench.folder.path().join("big"), [0; 40_000]).expect("written");
    let (_, big) = told(bench.command(&format!("geni:{folder}/big?node=5"), "status"));
    assert!(big.contains("is this the right file?") && !big.contains("offset"), "{big}");
    let output = bench.command("/dev/ttyS0", "genius devices").output().expect("ser-cli runs");
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("is not a Genius bus"), "{}", stderr(&output));

    // No existing file is overwritten, and no bus address is given twice.
    for (arguments, code, message) in [
        ("--genius short --node 5", 1, "exists already"),
        ("--genius new --node 5 --node 5", 2, "--node 5 is given twice"),
        (
            "--genius new --node 5 --node 9 --host-number 9",
            2,
            "9 is the bus address of a --node, and the host's too",
        ),
        ("--genius new --node 5 --image none", 1, "cannot open the image none"),
    ] {
        let mut sim = ser_cli();
        sim.arg("sim").args(arguments.split_whitespace()).current_dir(bench.folder.path());
        let output = sim.output().expect("ser-cli runs");
        let told = stderr(&output);
        assert_eq!(output.status.code(), Some(code), "{arguments}: {told}");
        assert!(told.contains(message) && told.contains("hint: "), "{arguments}: {told}");
        assert!(!bench.folder.path().join("new").exists(), "{arguments}");
    }
}

#[test]
fn a_bus_may_be_slow_and_noisy_and_its_host_have_any_number() {
    let mut bench = Bench::start(
        "--node 5 --node 9:ser160 --bus-rate 38.4k --host-number 0 --bus-noise 0.5 --seed 3",
    );
    let taps = (0..30).map(|tap| format!("\n{},1,{},5", tap * 2, 1 - tap % 2));
    let csv = std::iter::once("ms,input,state,node".to_string()).chain(taps).collect::<String>();
    bench.play(&csv, 5, 30);
    let rows = without_times(&bench.ok(5, "read --all --format csv"));
    let expected = (1..=30).map(|entry| format!("{entry},1,{}", entry % 2));
    assert_eq!(rows[1..], expected.collect::<Vec<_>>(), "neither lost nor doubled");
    // Which message is disturbed depends on when the commands above were given, so it may take a
    // while.
    wait_until("the board has counted a bus error", || {
        let devices = bench.command(&bench.bus(), "genius devices").output().expect("ser-cli runs");
        let told = stderr(&devices);
        // At the usual rate it takes 3 ms; with a datagram in it a little longer.
        assert!(told.contains("this host is 0; a bus scan takes 1"), "{told}");
        !told.contains("since its board started: 0")
    });
}

#[test]
fn inputs_are_followed_live_until_ctrl_c() {
    let mut bench = Bench::start("--node 5 --node 9:ser160");
    let mut command = bench.command(&bench.bus(), "genius globals --follow");
    let mut follow = Running(
        command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("ser-cli runs"),
    );
    let rows = follow.lines();
    let shown = |expected: &str| {
        let row = rows.recv_timeout(PATIENCE).expect("a row");
        assert_eq!(row.get(23..), Some(expected));
    };
    shown("  node  inputs  on");
    shown("     5      32  none");
    shown("     9      16  none");
    let input = bench.sim.0.stdin.as_mut().expect("piped");
    writeln!(input, "ms,input,state,node\n0,3,1,5\n\n").expect("the simulator listens");
    shown("     5      32  3");
    let input = bench.sim.0.stdin.as_mut().expect("piped");
    writeln!(input, "ms,input,state,node\n0,16,1,9\n\n").expect("the simulator listens");
    shown("     9      16  16");
    assert_eq!(follow.interrupt(), Some(0));
}

#[test]
fn a_window_may_be_mapped_into_memory() {
    let bench = Bench::start("--node 5");
    let mapped = format!("{}&offset=0", bench.port(5));
    let status = bench.command(&mapped, "status").output().expect("ser-cli runs");
    assert!(succeeded("status", &status).contains("recording"));
}

#[test]
fn ctrl_c_ends_the_wait_for_a_board_and_puts_back_what_was_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let photo = folder.path().join("photo");
    let mut bytes = vec![0xA5; 0x4000];
    // Makes the board look healthy.
    bytes[0x0893] = 1;
    for command in ["status", "erase --yes", "watch", "genius devices", "genius globals --follow"] {
        fs::write(&photo, &bytes).expect("written");
        let node = if command.starts_with("genius") { "" } else { "?node=5" };
        let port = format!("geni:{}{node}", photo.display());
        let mut waiting = ser_cli();
        waiting.env("SER_PORT", port).env("SER_STATE_DIR", folder.path().join("state"));
        waiting.args(["--timeout", PATIENT_TIMEOUT]).args(command.split_whitespace());
        let mut waiting = Running::start(waiting.stderr(Stdio::piped()));
        let told = waiting.told();
        wait_until("it waits for the board", || fs::read(&photo).expect("a file")[0x0893] == 0);
        assert_eq!(waiting.interrupt(), Some(1), "{command}");
        let told: Vec<_> = told.iter().collect();
        assert!(told.iter().any(|line| line.contains("interrupted")), "{told:?}");
        assert!(fs::read(&photo).expect("a file") == bytes, "{command}");
    }
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn the_image_is_spoken_to_over_the_bus() {
    let image = image();
    let bench =
        Bench::start(&format!("--node 5 --node 9 --image {}", image.to_str().expect("UTF-8")));
    assert!(bench.ok(5, "status").contains("recording"));
    let clock = bench.on_bus("genius broadcast clock --at 2026-11-22T10:00:00");
    assert_eq!(clock.matches("yes        set clock at 10:00:00.000").count(), 2, "{clock}");
    assert!(events(&bench.ok(5, "read --all --format jsonl")).is_empty());
    bench.ok(5, "stop");
    assert!(
        bench.ok(5, "status").contains("stopped") && bench.ok(9, "status").contains("recording")
    );
}
