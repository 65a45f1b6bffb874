//! Lists of other recorders: each sample is read as it is written down beside it.
//!
//! The samples are of our own making, in the shapes that devices write. `NAME.reading` is what a
//! correct reader gets out of `NAME`; `SER_WRITE_EXPECTED=1` writes it anew, to be looked at.

use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use ser_evidence::history::Collector;
use ser_evidence::record::{EntryRecord, Lost, Record, Why};
use ser_evidence::site::Site;
use ser_files::import::{
    DateOrder, Epoch, Format, Imported, Importer, Map, Options, Output, Read, Refusal, zone_named,
};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/import")
}

fn in_zone(zone: &str) -> Options {
    Options { zone: zone_named(zone), ..Options::default() }
}

fn read_into(importer: &mut Importer, name: &str, bytes: &[u8]) -> Result<Read, Refusal> {
    let data = Path::new(name).with_extension("dat");
    let data = || Ok(Box::new(File::open(folder().join(data))?) as Box<dyn io::Read>);
    let opened = importer.open(bytes)?;
    importer.read("F3", opened, data, &mut |_, _, _| Ok(()))
}

fn sample(name: &str) -> Vec<u8> {
    fs::read(folder().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// What is read of samples of one recorder.
fn reading(names: &[&str], options: Options) -> String {
    let mut importer = Importer::new(options);
    let mut text = String::new();
    for name in names {
        match read_into(&mut importer, name, &sample(name)) {
            Ok(read) => told(&mut text, name, &read),
            Err(refusal) => writeln!(text, "{name}: refused: {refusal}").unwrap(),
        }
    }
    records(&mut text, &importer.finish());
    text
}

fn told(text: &mut String, name: &str, read: &Read) {
    let channels = read.extent.map(|extent| {
        format!(
            ", {} analog and {} status channels",
            extent.analog_channels, extent.status_channels
        )
    });
    writeln!(text, "{name}: {}{}", read.format, channels.unwrap_or_default()).unwrap();
    read.notes.remarks.iter().for_each(|note| writeln!(text, "  {note}").unwrap());
    read.notes.left_out.iter().for_each(|note| writeln!(text, "  left out: {note}").unwrap());
}

/// Entries in words, and all other records as they are written.
fn records(text: &mut String, imported: &Imported) {
    imported.notes.remarks.iter().for_each(|note| writeln!(text, "  {note}").unwrap());
    imported.notes.left_out.iter().for_each(|note| writeln!(text, "  left out: {note}").unwrap());
    let mut points = Vec::new();
    for (recorder, record) in imported.records() {
        match record {
            Record::Point(point) => points.push((recorder.to_owned(), point.clone())),
            Record::Entry(entry) => {
                let EntryRecord { sequence, entry, known, .. } = *entry;
                let mut changes = String::new();
                for input in entry.changed.numbers() {
                    let is_it = |(of, point): &&(String, ser_evidence::record::PointRecord)| {
                        of == recorder && point.input == input
                    };
                    let (_, point) = points.iter().find(is_it).expect("every input has a name");
                    let state = match (known.contains(input), entry.state.contains(input)) {
                        (false, _) => "?",
                        (true, true) => &point.on,
                        (true, false) => &point.off,
                    };
                    write!(changes, "  {} {state}", point.name).unwrap();
                }
                let sequence = sequence.expect("a sequence");
                writeln!(text, "{recorder} {sequence} {}{changes}  (known {known:?})", entry.time)
                    .unwrap();
            }
            Record::Life(life) => {
                writeln!(text, "{recorder} a life, exact {}", life.is_exact).unwrap();
            }
            Record::Recorder(stamps) => {
                writeln!(text, "{recorder} UTC{:+} s", stamps.utc_offset_s).unwrap();
            }
            other => writeln!(text, "{recorder} {other:?}").unwrap(),
        }
    }
}

fn expect_reading(file: &str, names: &[&str], options: Options) {
    let path = folder().join(file);
    let read = reading(names, options);
    if std::env::var_os("SER_WRITE_EXPECTED").is_some() {
        fs::write(&path, &read).expect("written");
    }
    let expected = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{file}: {error}"));
    assert_eq!(read, expected, "{file}");
}

#[test]
fn sel_reports() {
    expect_reading("sel-report.reading", &["sel-report.txt"], in_zone("America/Chicago"));
    let ymd = Options { dates: Some(DateOrder::Ymd), ..in_zone("UTC") };
    expect_reading("sel-newest-first.reading", &["sel-newest-first.txt"], ymd);
    expect_reading("sel-empty.reading", &["sel-empty.txt"], Options::default());
    expect_reading("sel-551-shape.reading", &["sel-551-shape.txt"], in_zone("UTC"));
}

#[test]
fn sel_compressed_lists() {
    expect_reading("sel-compressed.reading", &["sel-compressed.txt"], in_zone("America/Chicago"));
    expect_reading("sel-compressed-empty.reading", &["sel-compressed-empty.txt"], in_zone("UTC"));
}

#[test]
fn cytime_logs() {
    let local = Options { epoch: Some(Epoch::Local1984), ..in_zone("UTC") };
    let posix = || Options { epoch: Some(Epoch::Posix), ..Options::default() };
    let files = ["cytime-last.json", "cytime-verbose.json"];
    expect_reading("cytime-verbose.reading", &files, local);
    expect_reading("cytime-posix-verbose.reading", &["cytime-posix-verbose.json"], posix());
    expect_reading("cytime-posix-short.reading", &["cytime-posix-short.json"], posix());
}

#[test]
fn csv_for_prc_002() {
    expect_reading("prc-002.reading", &["prc-002.csv"], Options::default());
}

#[test]
fn comtrade_records() {
    for name in ["comtrade-1999", "comtrade-1999-binary"] {
        let (reading, cfg) = (format!("{name}.reading"), format!("{name}.cfg"));
        expect_reading(&reading, &[&cfg], in_zone("America/Chicago"));
    }
    expect_reading("comtrade-1991.reading", &["comtrade-1991.cfg"], in_zone("UTC"));
    for name in ["comtrade-2013-float.cfg", "comtrade-ascii.cff", "comtrade-binary.cff"] {
        let reading = Path::new(name).with_extension("reading");
        expect_reading(reading.to_str().expect("text"), &[name], Options::default());
    }
    expect_reading("comtrade-liberties.reading", &["comtrade-liberties.cfg"], in_zone("UTC"));
}

/// All samples that are read without the user saying more than a zone.
const SAMPLES: [(&str, Format); 13] = [
    ("sel-report.txt", Format::SelSer),
    ("sel-newest-first.txt", Format::SelSer),
    ("sel-empty.txt", Format::SelSer),
    ("sel-compressed.txt", Format::SelCser),
    ("sel-compressed-empty.txt", Format::SelCser),
    ("cytime-verbose.json", Format::Cytime),
    ("cytime-posix-short.json", Format::Cytime),
    ("cytime-last.json", Format::Cytime),
    ("prc-002.csv", Format::Prc002),
    ("comtrade-1999.cfg", Format::Comtrade),
    ("comtrade-liberties.cfg", Format::Comtrade),
    ("comtrade-ascii.cff", Format::Comtrade),
    ("comtrade-binary.cff", Format::Comtrade),
];

fn sure() -> Options {
    let (dates, epoch) = (Some(DateOrder::Ymd), Some(Epoch::Local1984));
    Options { dates, epoch, ..in_zone("UTC") }
}

#[test]
fn the_format_is_known_by_the_content() {
    for (name, format) in SAMPLES {
        let head = sample(name);
        assert_eq!(Format::of(&head), Some(format), "{name}");
    }
    assert_eq!(
        Format::of(b"{\"record\":\"file\",\"schema\":1,\"program\":\"x\"}\n"),
        Some(Format::Jsonl)
    );
    assert_eq!(Format::of(b"entry,time,input,state\n"), Some(Format::Csv));
    for none in [&b""[..], b"\n", b"hello", b"1,2,3,4\n", b"ms,input,state\n1,1,1\n"] {
        assert_eq!(Format::of(none), None, "{none:?}");
    }
}

#[test]
fn what_is_not_known_is_asked_for() {
    let read = |name: &str, options: Options| {
        let mut importer = Importer::new(options);
        read_into(&mut importer, name, &sample(name)).map(|read| read.format)
    };
    assert!(matches!(read("sel-report.txt", Options::default()), Err(Refusal::NoZone)));
    assert!(matches!(read("comtrade-1999.cfg", Options::default()), Err(Refusal::NoZone)));
    let refused = read("sel-newest-first.txt", in_zone("UTC"));
    let Err(Refusal::NoDates { example, possible }) = refused else { panic!("{refused:?}") };
    assert_eq!((example.as_str(), possible), ("27/03/04", vec![DateOrder::Dmy, DateOrder::Ymd]));
    assert!(matches!(read("cytime-verbose.json", in_zone("UTC")), Err(Refusal::NoEpoch)));
    let data = read("comtrade-1999.dat", in_zone("UTC"));
    assert!(matches!(data, Err(Refusal::NoConfiguration)), "{data:?}");
    let mut importer = Importer::new(in_zone("UTC"));
    let alone = read_into(&mut importer, "not-there.cfg", &sample("comtrade-1999.cfg"));
    assert!(matches!(alone, Err(Refusal::NoData(_))), "{alone:?}");
}

fn written(imported: &Imported) -> String {
    let mut out = Vec::new();
    Output::new(&mut out, "ser-cli").finish(imported).expect("memory has room");
    String::from_utf8(out).expect("JSON is UTF-8")
}

fn imported(files: &[&[u8]], options: Options) -> Imported {
    let mut importer = Importer::new(options);
    for bytes in files {
        read_into(&mut importer, "comtrade-1999.cfg", bytes).expect("it can be read");
    }
    importer.finish()
}

#[test]
fn the_encoding_and_the_ends_of_lines_change_nothing() {
    for name in ["sel-report.txt", "sel-newest-first.txt", "prc-002.csv", "comtrade-1999.cfg"] {
        let text = String::from_utf8(sample(name)).expect("UTF-8");
        let expected = written(&imported(&[text.as_bytes()], sure_for(name)));
        assert!(expected.contains("\"entry\""), "{name}");
        let utf16 = |order: fn(u16) -> [u8; 2]| {
            ["\u{FEFF}", &text].concat().encode_utf16().flat_map(order).collect::<Vec<u8>>()
        };
        for other in [
            text.replace("\r\n", "\n").into_bytes(),
            text.replace("\r\n", "\r").into_bytes(),
            ["\u{FEFF}", &text].concat().into_bytes(),
            utf16(u16::to_le_bytes),
            utf16(u16::to_be_bytes),
        ] {
            assert_eq!(written(&imported(&[&other], sure_for(name))), expected, "{name}");
        }
    }
    let bare: Vec<u8> = "=>SER\r\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    assert!(matches!(read_into(&mut Importer::new(sure()), "", &bare), Err(Refusal::Utf16)));
}

fn sure_for(name: &str) -> Options {
    match name {
        "sel-newest-first.txt" => sure(),
        _ => Options { dates: None, ..sure() },
    }
}

#[test]
fn what_is_in_several_files_is_there_once() {
    let text = String::from_utf8(sample("sel-report.txt")).expect("UTF-8");
    let options = || in_zone("UTC");
    let whole = written(&imported(&[text.as_bytes()], options()));
    let twice = imported(&[text.as_bytes(), text.as_bytes()], options());
    assert_eq!(written(&twice), whole);

    // A week later two rows are new, and the numbers of all others are larger by two.
    let rows: Vec<&str> = text.lines().collect();
    let is_row = |line: &&&str| line.starts_with(|letter: char| letter.is_ascii_digit());
    let own = |range: std::ops::Range<usize>, up: u64| -> String {
        let head = rows.iter().filter(|line| line.starts_with('#')).map(|line| (*line).to_owned());
        let kept = rows.iter().filter(is_row).skip(range.start).take(range.len()).map(|line| {
            let (number, rest) = line.split_once(' ').expect("a number");
            format!("{} {rest}", number.parse::<u64>().expect("a number") - up)
        });
        head.chain(kept).collect::<Vec<_>>().join("\n") + "\n"
    };
    let all = own(0..9, 0);
    let (early, late) = (own(0..5, 5), own(3..9, 0));
    let expected = written(&imported(&[all.as_bytes()], options()));
    for order in [[&early, &late], [&late, &early]] {
        let order: Vec<&[u8]> = order.iter().map(|text| text.as_bytes()).collect();
        assert_eq!(written(&imported(&order, options())), expected);
    }
    // Lists that share nothing are two lives: nobody knows what was between them.
    let apart = [own(0..3, 5), own(5..9, 0)];
    let apart = imported(&[apart[0].as_bytes(), apart[1].as_bytes()], options());
    let lives = apart.records().filter(|(_, record)| matches!(record, Record::Life(_))).count();
    assert_eq!(lives, 2);
}

/// The gaps that are written: after which sequence, how many are lost, and why.
fn gaps(imported: &Imported) -> Vec<(Option<u64>, Lost, Why)> {
    let gaps = imported.records().filter_map(|(_, record)| match record {
        Record::Gap(gap) => Some((gap.after, gap.lost, gap.why)),
        _ => None,
    });
    gaps.collect()
}

/// What a timeline takes for missing: after which sequence, how many, and why.
fn missing_in_history(imported: &Imported) -> Vec<(u64, Lost, Why)> {
    let mut collector = Collector::new();
    imported.records().for_each(|(recorder, record)| collector.add(recorder, record));
    let history = collector.finish(&Site::unknown());
    let lives = history.recorders.iter().flat_map(|recorder| &recorder.lives);
    lives.flat_map(|life| &life.gaps).map(|gap| (gap.after, gap.lost, gap.why)).collect()
}

/// A COMTRADE record of four channels with these samples, the last of which is the last announced.
fn sampled(rows: &str) -> (Read, Imported) {
    let last = rows.lines().last().and_then(|row| row.split_once(','));
    let announced = last.and_then(|(number, _)| number.parse().ok()).expect("a number");
    sampled_of(announced, rows)
}

/// The same where so many samples are announced.
fn sampled_of(announced: u64, rows: &str) -> (Read, Imported) {
    let text = format!(
        "--- file type: CFG ---\nOAK,FR,2013\n4,0A,4D\n1,52A,,,0\n2,52B,,,0\n3,51P,,,0\n4,86,,,0\n\
         60\n0\n0,{announced}\n14/03/2027,09:05:00.000000\n14/03/2027,09:05:00.000000\nASCII\n1\n\
         0,0\n0,0\n--- file type: DAT ASCII ---\n{rows}"
    );
    let mut importer = Importer::new(Options::default());
    let read = read_into(&mut importer, "x.cff", text.as_bytes()).expect("it can be read");
    (read, importer.finish())
}

#[test]
fn what_changed_in_samples_that_are_missing_is_a_gap() {
    let lost = |inputs| (Some(1), Lost::Unknown, Why::NotRecorded(inputs));
    // At the end, also of 52A and 52B, which no other sample changes. 51P is the first that moved.
    let (read, imported) = sampled("1,0,1,0,0,0\n2,1000,1,0,1,0\n5,53000,0,1,1,1\n");
    assert_eq!(gaps(&imported), [lost(0b1110)]);
    let [note] = &read.notes.lost[..] else { panic!("{:?}", read.notes.lost) };
    assert_eq!(note.why, "there are no samples 3 to 4, and meanwhile these changed: 52A, 52B, 86");
    // A change follows, and the next one is not lost.
    let (_, imported) =
        sampled("1,0,1,0,0,0\n2,1,1,0,1,0\n5,2,0,0,1,0\n6,3,0,1,1,0\n7,4,0,1,0,0\n");
    assert_eq!(gaps(&imported), [lost(0b010)]);
    // A damaged row is the same, also the last one.
    let (read, imported) = sampled("1,0,1,0,0,0\n2,1000,1,0,1,0\n3,2000,x\n4,3000,0,1,1,0\n");
    assert_eq!((gaps(&imported), read.notes.left_out_count), (vec![lost(0b110)], 1));
    let (_, imported) = sampled("1,0,1,0,0,0\n2,1000,1,0,1,0\n3,2000,x\n");
    assert_eq!(gaps(&imported), [(Some(1), Lost::Unknown, Why::Unreadable)]);
    // Nothing is missing.
    let (read, imported) = sampled("1,0,1,0,0,0\n2,1000,1,0,1,0\n3,2000,0,1,1,0\n");
    assert_eq!((gaps(&imported), read.notes.lost_count), (vec![], 0));
}

#[test]
fn samples_that_are_announced_and_not_there_are_lost_at_the_end() {
    let rows = "1,0,1,0,0,0\n2,1000,1,0,1,0\n";
    let (read, imported) = sampled_of(9, rows);
    assert_eq!(gaps(&imported), [(Some(1), Lost::Unknown, Why::Unreadable)]);
    assert_eq!(missing_in_history(&imported), [(1, Lost::Unknown, Why::Unreadable)]);
    let [note] = &read.notes.lost[..] else { panic!("{:?}", read.notes.lost) };
    assert!(note.why.starts_with("9 samples are announced, and the data ends after 2"), "{note}");
    assert_eq!(read.notes.lost_count, 1);
    // Nothing is told twice: these are missing in between.
    let (read, _) = sampled_of(6, "1,0,1,0,0,0\n6,1000,1,0,1,0\n");
    assert_eq!(read.notes.lost_count, 1, "{:?}", read.notes);
}

#[test]
fn a_row_that_is_left_out_is_a_gap_where_it_stood() {
    let in_list = |after, lines: &[&str]| {
        let text = lines.join("\n") + "\n";
        let imported = imported(&[text.as_bytes()], in_zone("UTC"));
        assert_eq!(gaps(&imported), [(Some(after), Lost::AtLeast(1), Why::NotReached)], "{text}");
    };
    let head = "#     DATE        TIME            ELEMENT      STATE";
    let [three, two, one] = [
        "3     2027-03-14  09:05:00.001    52A    Asserted",
        "2     2027-03-14  09:05:00.002    52B    Asserted",
        "1     2027-03-1x  09:05:00.003    52A    Deasserted",
    ];
    // The newest row, whichever way the list is printed.
    in_list(2, &[head, three, two, one]);
    in_list(2, &[head, one, two, three]);
    let head = "Date,Time,Local Time Code,Substation,Device,State";
    let [first, second, third, damaged] = [
        "03/14/2027,09:05:00.001,+00,OAK,52A,OPEN",
        "03/14/2027,09:05:00.002,+00,OAK,52B,OPEN",
        "03/14/2027,09:05:00.003,+00,OAK,52A,CLOSED",
        "03/14/2027,09:05:xx,+00,OAK,52B,CLOSED",
    ];
    in_list(1, &[head, first, damaged, second, third]);
    in_list(1, &[head, third, second, damaged, first]);
    in_list(3, &[head, first, second, third, damaged]);
    in_list(3, &[head, damaged, third, second, first]);
    let event = |number: u64, status: &str| {
        format!(
            "{{\"event_type\":1,\"channel\":1,\"status\":{status},\"milliseconds\":{number},\
             \"seconds\":1800000000,\"seq_num\":{number}}}"
        )
    };
    let text = format!("{{\"events\":[{},{},{}]}}", event(1, "1"), event(2, "0"), event(3, "x1"));
    let text = text.replace("x1", "\"x\"");
    let options = Options { epoch: Some(Epoch::Posix), ..Options::default() };
    let imported = imported(&[text.as_bytes()], options);
    assert_eq!(gaps(&imported), [(Some(2), Lost::AtLeast(1), Why::NotReached)]);
}

#[test]
fn two_events_of_one_sequence_are_told() {
    let event = |milliseconds: u16| {
        format!(
            "{{\"event_type\":1,\"channel\":1,\"status\":1,\"milliseconds\":{milliseconds},\
             \"seconds\":1800000000,\"seq_num\":7}}"
        )
    };
    let read = |milliseconds: [u16; 2]| {
        let [first, second] = milliseconds.map(event);
        let text = format!("{{\"events\":[{first},\n{second}]}}");
        let options = Options { epoch: Some(Epoch::Posix), ..Options::default() };
        read_into(&mut Importer::new(options), "events.json", text.as_bytes()).expect("it is read")
    };
    let told = read([1, 2]).notes.left_out;
    let [note] = &told[..] else { panic!("{told:?}") };
    assert_eq!(note.to_string(), "line 2: another event, in line 1, has the sequence 7");
    assert!(read([1, 1]).notes.left_out.is_empty());
}

#[test]
fn long_names_stay_apart_and_are_told() {
    let long = "x".repeat(300);
    let text = format!(
        "Date,Time,Local Time Code,Substation,Device,State\n\
         03/14/2027,09:05:00.001,+00,OAK,{long}a,OPEN\n\
         03/14/2027,09:05:00.002,+00,OAK,{long}b,OPEN\n"
    );
    let mut importer = Importer::new(Options::default());
    let read = read_into(&mut importer, "x.csv", text.as_bytes()).expect("it is read");
    assert!(read.notes.remarks.iter().any(|note| note.why.contains("longer than 200")));
    assert_eq!(importer.finish().recorders[0].points, 2);
}

/// A record of so many channels, each of which goes on five milliseconds after the one before.
fn wide(channels: usize) -> String {
    let mut text = format!("--- file type: CFG ---\nOAK,FR,2013\n{channels},0A,{channels}D\n");
    for channel in 1..=channels {
        writeln!(text, "{channel},point {channel},,,0").unwrap();
    }
    let samples = channels + 1;
    writeln!(
        text,
        "60\n0\n0,{samples}\n14/03/2027,00:00:00.000000\n14/03/2027,00:00:00.000000\nASCII\n1\n0,0\n0,0\n\
         --- file type: DAT ASCII ---"
    )
    .unwrap();
    for sample in 1..=samples {
        write!(text, "{sample},{}", sample * 5000).unwrap();
        (1..=channels).for_each(|channel| write!(text, ",{}", u8::from(channel < sample)).unwrap());
        text.push('\n');
    }
    text
}

#[test]
fn more_points_than_inputs_become_several_recorders_of_one_clock() {
    let imported = imported(&[wide(70).as_bytes()], Options::default());
    let names: Vec<&str> = imported.recorders.iter().map(|recorder| &*recorder.name).collect();
    assert_eq!(names, ["F3", "F3 (2)", "F3 (3)"]);
    let points: Vec<u64> = imported.recorders.iter().map(|recorder| recorder.points).collect();
    assert_eq!(points, [32, 32, 6]);
    assert!(imported.notes.remarks.iter().any(|note| note.why.contains("are one clock")));
    // The evidence knows their order although nobody ever observed the clock.
    let mut collector = ser_evidence::history::Collector::new();
    imported.records().for_each(|(recorder, record)| collector.add(recorder, record));
    let mut site = ser_evidence::site::Site::unknown();
    assert_eq!(collector.name_inputs(&mut site), []);
    let history = collector.finish(&site);
    let timeline = ser_evidence::timeline::Timeline::new(&site, &history);
    let mut list = Vec::new();
    ser_files::merged::write_csv(&mut list, &timeline).expect("memory has room");
    let list = String::from_utf8(list).expect("UTF-8");
    assert_eq!(list.lines().count(), 71, "{list}");
    let gaps: usize = history.recorders.iter().flat_map(|r| &r.lives).map(|l| l.gaps.len()).sum();
    assert_eq!(gaps, 0);
    let which = ser_evidence::incident::Which::Last;
    let incident = ser_evidence::incident::Incident::pick(&timeline, which).expect("an incident");
    let report = ser_evidence::incident::Report::new(&timeline, incident);
    let document = ser_files::report::Document {
        timeline: &timeline,
        report: &report,
        program: "test",
        site_digest: None,
        archive_heads: &[],
        not_reached: &[],
        damaged_lines: 0,
        doubtful_hours: 0,
        unfold: true,
    };
    let mut json = Vec::new();
    ser_files::report::write_json(&mut json, &document).expect("memory has room");
    let json: serde_json::Value = serde_json::from_slice(&json).expect("JSON");
    let rows = json["sequence"].as_array().expect("rows");
    assert_eq!(rows.len(), 70);
    for (place, row) in rows.iter().enumerate().skip(1) {
        assert_eq!(row["order_to_previous"], "before", "{place}: {row}");
        assert_eq!(row["point"], format!("point {}", place + 1));
    }
}

#[test]
fn samples_without_stamps_come_at_the_rates_of_the_configuration() {
    let mut text = String::from(
        "--- file type: CFG ---\nOAK,FR,1999\n1,0A,1D\n1,a,,,0\n60\n2\n1000,4\n500,8\n\
         14/03/2027,00:00:00.000000\n14/03/2027,00:00:00.000000\nASCII\n1\n\
         --- file type: DAT ASCII ---\n",
    );
    (1..=8).for_each(|sample| writeln!(text, "{sample},,{}", sample % 2).unwrap());
    let imported = imported(&[text.as_bytes()], in_zone("UTC"));
    let ms = imported.records().filter_map(|(_, record)| match record {
        Record::Entry(entry) => Some(entry.entry.time.millisecond),
        _ => None,
    });
    // As the comtrade package for Python has it, version 0.2.0.
    assert_eq!(ms.collect::<Vec<_>>(), [1, 2, 3, 5, 7, 9, 11]);
}

#[test]
fn a_map_fixes_inputs_and_words() {
    let map = Map::parse(
        "[[point]]\nfrom = \"52A\"\ninput = 1\n[[point]]\nfrom = \"86 T2\"\nrecorder = \"LO\"\n\
         input = 9\noff = \"LOCKED\"\n",
        None,
    )
    .expect("a map");
    let imported = imported(&[&sample("sel-report.txt")], Options { map, ..in_zone("UTC") });
    let points: Vec<String> = imported
        .records()
        .filter_map(|(recorder, record)| match record {
            Record::Point(point) => Some(format!(
                "{recorder} {} {} {}/{}",
                point.input, point.name, point.on, point.off
            )),
            _ => None,
        })
        .collect();
    assert!(points.contains(&"F3 1 52A Asserted/Deasserted".to_owned()), "{points:?}");
    assert!(points.contains(&"LO 9 86 T2 not LOCKED/LOCKED".to_owned()), "{points:?}");
    assert_eq!(points.iter().filter(|point| point.starts_with("F3 1 ")).count(), 1);
}

#[test]
fn whatever_the_length_memory_and_time_are_bounded() {
    const LONG: u64 = 200 << 20;
    let none = || Err(io::ErrorKind::NotFound.into());
    let mut taken = |_: &str, _: &Record, _: Option<&str>| Ok(());
    for (format, head) in [
        (Format::SelSer, &b"#  DATE  TIME\n1  "[..]),
        (Format::SelCser, b"\"FID\",\"0143\"\n\""),
        (Format::Prc002, b"Date,Time,Local Time Code,Substation,Device,State\n"),
        (Format::Comtrade, b"OAK,FR,2013\n1,0A,1D\n1,"),
    ] {
        let long = io::Cursor::new(head).chain(io::repeat(b'x').take(LONG));
        let mut importer = Importer::new(Options { format: Some(format), ..sure() });
        let opened = importer.open(long).expect("the format is given");
        let read = importer.read("F3", opened, none, &mut taken);
        match read {
            Ok(read) => assert!(read.notes.left_out[0].why.contains("longer than"), "{format}"),
            Err(refusal) => assert!(matches!(refusal, Refusal::Damaged { .. }), "{refusal}"),
        }
    }
    let long = io::Cursor::new(b"{\"events\": [").chain(io::repeat(b' ').take(LONG));
    let mut importer = Importer::new(sure());
    let opened = importer.open(long).expect("the format is known");
    let read = importer.read("F3", opened, none, &mut taken);
    assert!(matches!(read, Err(Refusal::TooMuch { .. })));
    let (row, head) = (b"14/03/2027\n".repeat(1000), &b"OAK,FR,2013\n"[..]);
    let long = io::Cursor::new([head, &row].concat()).chain(io::repeat(b'\n').take(LONG));
    let options = Options { format: Some(Format::Comtrade), ..sure() };
    let mut importer = Importer::new(options);
    let opened = importer.open(long).expect("the format is given");
    let read = importer.read("F3", opened, none, &mut taken);
    assert!(matches!(read, Err(Refusal::TooMuch { .. })));
}

mod anything {
    use proptest::prelude::*;

    use super::*;

    /// A sample, and what is done to it.
    fn torn() -> impl Strategy<Value = (usize, Vec<(usize, Vec<u8>, usize)>)> {
        let edit = (any::<usize>(), proptest::collection::vec(any::<u8>(), 0..6), 0_usize..12);
        (0..SAMPLES.len(), proptest::collection::vec(edit, 1..8))
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 1500, ..ProptestConfig::default() })]

        #[test]
        fn a_damaged_sample_is_read_or_refused_and_what_is_written_can_be_read(
            (place, edits) in torn(), doubt_ms: Option<u8>,
        ) {
            let (name, format) = SAMPLES[place];
            let mut bytes = sample(name);
            for (at, new, gone) in edits {
                let at = at % (bytes.len() + 1);
                let end = (at + gone).min(bytes.len());
                bytes.splice(at..end, new);
            }
            let options =
                Options { format: Some(format), doubt_ms: doubt_ms.map(Into::into), dates: None, ..sure() };
            check(name, &bytes, options);
        }

        #[test]
        fn any_bytes_are_read_or_refused(
            bytes in proptest::collection::vec(any::<u8>(), 0..300), place in 0..SAMPLES.len(),
        ) {
            check("comtrade-1999.cfg", &bytes, Options { format: Some(SAMPLES[place].1), ..sure() });
            check("comtrade-1999.cfg", &bytes, sure());
        }
    }

    fn check(name: &str, bytes: &[u8], options: Options) {
        let mut importer = Importer::new(options.clone());
        let read = read_into(&mut importer, name, bytes);
        let imported = importer.finish();
        if read.is_err() {
            return;
        }
        let text = written(&imported);
        let mut twice = Importer::new(options);
        for _ in 0..2 {
            read_into(&mut twice, name, bytes).expect("it was read once");
        }
        assert_eq!(written(&twice.finish()), text);
        let again = ser_files::jsonl::Reader::new(text.as_bytes(), "F3");
        let again = again.map(|told| told.expect("what was written can be read"));
        let again: Vec<_> = again.map(|told| (told.recorder, told.record)).collect();
        let made: Vec<_> = imported
            .records()
            .map(|(recorder, record)| (recorder.to_owned(), record.clone()))
            .collect();
        assert_eq!(again, made);
    }
}

#[test]
fn numbers_that_no_recorder_has_are_told_and_nothing_overflows() {
    let last = u64::MAX;
    let sel = format!(
        "#    DATE        TIME            ELEMENT   STATE\n\
         {last}  03/14/2027  14:21:00.017    51P1T     Asserted\n\
         {}  03/14/2027  14:21:00.018    51P1T     Deasserted\n\
         0  03/14/2027  14:21:00.019    51P1T     Asserted\n",
        last - 1
    );
    let cytime = format!(
        "{{\"events\":[{{\"event_type\":1,\"channel\":1,\"status\":1,\"milliseconds\":1,\
         \"seconds\":1800000000,\"seq_num\":{last}}}]}}"
    );
    for (text, count) in [(sel, 3), (cytime, 1)] {
        let options = Options { epoch: Some(Epoch::Posix), ..sure() };
        let mut importer = Importer::new(options);
        let read = read_into(&mut importer, "", text.as_bytes()).expect("it is read");
        assert_eq!(read.notes.left_out_count, count, "{:?}", read.notes);
        assert_eq!(importer.finish().records().count(), 0);
    }
    // Samples may have any number.
    let (_, imported) = sampled_of(2, &format!("{},0,1,0,0,0\n{last},1000,1,0,1,0\n", last - 1));
    assert_eq!(gaps(&imported), []);
    sampled(&format!("1,0,1,0,0,0\n{last},1000,1,0,1,0\n"));
}

fn points(imported: &Imported) -> Vec<String> {
    let name = |(_, record): (_, &Record)| match record {
        Record::Point(point) => Some(point.name.clone()),
        _ => None,
    };
    imported.records().filter_map(name).collect()
}

#[test]
fn channels_of_one_name_stay_apart_whatever_others_are_called() {
    let text = "--- file type: CFG ---\nOAK,FR,2013\n4,0A,4D\n1,a,,,0\n2,a,,,0\n3,a (1),,,0\n\
                4,a (1) (1),,,0\n60\n0\n0,9\n14/03/2027,09:05:00.000000\n\
                14/03/2027,09:05:00.000000\nASCII\n1\n0,0\n0,0\n--- file type: DAT ASCII ---\n\
                1,0,0,0,0,0\n2,1000,1,1,1,1\n";
    let imported = imported(&[text.as_bytes()], Options::default());
    assert_eq!(points(&imported), ["a (1) (1) (1)", "a (2)", "a (1)", "a (1) (1)"]);
}

#[test]
fn a_row_of_our_own_table_that_says_what_is_missing_is_no_point() {
    let text = "Date, Time, Local Time Code, Substation, Device, State\n\
                03/14/2027, 09:29:58.104, -5, Oakridge, 51P1T, Operate\n\
                03/14/2027, 09:29:58.146, -5, Oakridge, U1, RECORDS MISSING: 37 entries missing\n\
                03/14/2027, 09:29:58.146, -5, Oakridge, 51P1T, Reset\n";
    let mut importer = Importer::new(Options::default());
    let read = read_into(&mut importer, "", text.as_bytes()).expect("it is read");
    let [note] = &read.notes.lost[..] else { panic!("{:?}", read.notes) };
    let told = "line 3: U1 says that records are missing: 37 entries missing";
    assert_eq!(note.to_string(), told);
    let imported = importer.finish();
    assert_eq!(points(&imported), ["Oakridge 51P1T"]);
    assert_eq!(gaps(&imported), [(Some(1), Lost::AtLeast(1), Why::NotReached)]);
}

#[test]
fn only_a_key_says_that_a_file_is_of_a_cytime_recorder() {
    let jsonl = "{\"record\":\"life\",\"recorder\":\"events\",\"life\":\"1\",\"exact\":true}\n";
    assert_eq!(Format::of(jsonl.as_bytes()), Some(Format::Jsonl));
    assert_eq!(Format::of(b"{\"events\" : []}"), Some(Format::Cytime));
}

#[test]
fn two_words_of_one_meaning_are_told() {
    let text = "Date, Time, Local Time Code, Substation, Device, State\n\
                03/14/2027, 09:29:58.104, -5, Oakridge, 51P1T, Operate\n\
                03/14/2027, 09:29:58.146, -5, Oakridge, 51P1T, Reset\n\
                03/14/2027, 09:29:58.147, -5, Oakridge, 51P1T, PICKUP\n\
                03/14/2027, 09:29:58.148, -5, Oakridge, 51P1T, RESET\n";
    let remarks = imported(&[text.as_bytes()], Options::default()).notes.remarks;
    let told: Vec<String> = remarks.iter().map(ToString::to_string).collect();
    let expected =
        "\"Operate\" and \"PICKUP\" of \"Oakridge 51P1T\" both mean on; \"Operate\" is shown";
    assert_eq!(told, [expected]);
}

#[test]
fn our_own_files_in_another_dress_are_refused_by_line_and_reason() {
    let header = "entry,time,input,state,sequence,life,note,recorder\n";
    let row = "1,2026-11-22T10:00:00.250,3,1,1,9f3c5a7e21b04d68,,";
    let read = |bytes: &[u8]| read_into(&mut Importer::new(Options::default()), "", bytes);
    let returns = format!("{header}{row}U1\n").replace('\n', "\r");
    let refused = read(returns.as_bytes()).expect_err("no line ends").to_string();
    assert!(refused.starts_with("line 1: its lines end with CR alone"), "{refused}");
    let latin = [header.as_bytes(), row.as_bytes(), b"Pr\xFCfstand\n"].concat();
    let left_out = read(&latin).expect("it is read").notes.left_out;
    assert!(left_out[0].to_string().contains("line 2: the recorder"), "{left_out:?}");
    assert!(left_out[0].why.contains("is not UTF-8"), "{left_out:?}");
    let json = b"{\"record\":\"entry\",\n{\"recorder\":\"Pr\xFCfstand\"}\n";
    let left_out = read(json).expect("it is read").notes.left_out;
    assert!(left_out[1].to_string().contains("line 2: this is not UTF-8"), "{left_out:?}");
}

#[test]
fn remarks_of_our_own_lines_are_handed_on() {
    let line = "{\"record\":\"entry\",\"recorder\":\"U1\",\"entry\":1,\
                \"time\":\"2026-11-22T10:00:00.250\",\"changed\":[3],\"state\":[3],\
                \"note\":\"looked at twice\"}\n";
    let mut out = Vec::new();
    let mut output = Output::new(&mut out, "ser-cli");
    let mut importer = Importer::new(Options::default());
    let none = || Err(io::ErrorKind::NotFound.into());
    let mut own =
        |recorder: &str, record: &Record, note: Option<&str>| output.record(recorder, record, note);
    let opened = importer.open(line.as_bytes()).expect("the format is known");
    importer.read("", opened, none, &mut own).expect("it is read");
    let imported = importer.finish();
    assert_eq!((imported.recorders[0].name.as_str(), imported.recorders[0].entries), ("U1", 1));
    assert!(output.finish(&imported).expect("memory has room"));
    let text = String::from_utf8(out).expect("UTF-8");
    assert!(text.contains("\"note\":\"looked at twice\""), "{text}");
    assert_eq!(text.lines().count(), 2);
}

#[test]
fn a_part_of_a_cytime_log_says_nothing_of_what_was_before() {
    let exact = |text: &str| {
        let options = Options { epoch: Some(Epoch::Posix), ..Options::default() };
        let imported = imported(&[text.as_bytes()], options);
        let exact: Vec<bool> = imported
            .records()
            .filter_map(|(_, record)| match record {
                Record::Life(life) => Some(life.is_exact),
                _ => None,
            })
            .collect();
        (exact, gaps(&imported))
    };
    let events = "\"events\":[{\"event_type\":1,\"channel\":1,\"status\":1,\"milliseconds\":1,\
                  \"seconds\":1800000000,\"seq_num\":65534}]";
    assert_eq!(exact(&format!("{{{events}}}")), (vec![false], vec![]));
    let last = "\"NumberOfEvents\":1,\"LastSequenceNumber\":65534";
    let gone = (Some(0), Lost::Exactly(65_533), Why::Overwritten);
    assert_eq!(exact(&format!("{{{last},{events}}}")), (vec![true], vec![gone]));
}
