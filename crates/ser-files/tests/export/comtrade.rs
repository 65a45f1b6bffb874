//! COMTRADE, read as the standard says.

use ser_evidence::record::How;
use ser_evidence::timeline::Timeline;
use ser_files::export::Selection;
use ser_files::export::comtrade::{Comtrade, Data, Options};

use crate::common::{Log, history, monotonic_us, site};
use crate::{NOWHERE, recorder};

const PLAIN: Options = Options { data: Data::Ascii, has_rate: false, line_hz: 50 };
const AT_RATE: Options = Options { has_rate: true, ..PLAIN };
const BINARY: Options = Options { data: Data::Binary, ..PLAIN };

/// The parts of a record.
struct Parts {
    cfg: Vec<String>,
    dat: Vec<u8>,
    hdr: String,
    hidden: u64,
}

fn parts(site_text: &str, logs: &[&Log], options: Options) -> Parts {
    let site = site(site_text);
    let history = history(&site, logs);
    let timeline = Timeline::new(&site, &history);
    let selection = Selection::everything();
    let record = Comtrade::new(&timeline, &selection, options).expect("a record");
    let (mut cfg, mut dat, mut hdr) = (Vec::new(), Vec::new(), Vec::new());
    record.write_cfg(&mut cfg).expect("written");
    record.write_dat(&mut dat).expect("written");
    record.write_hdr(&mut hdr, &NOWHERE).expect("written");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    let cfg = text(cfg);
    assert_eq!(cfg.matches('\n').count(), cfg.matches("\r\n").count(), "{cfg}");
    let cfg = cfg.split_terminator("\r\n").map(str::to_owned).collect();
    Parts { cfg, dat, hdr: text(hdr), hidden: record.counted().hidden }
}

fn rows(parts: &Parts) -> Vec<&str> {
    let text = std::str::from_utf8(&parts.dat).expect("text");
    text.split_terminator("\r\n").collect()
}

fn trip() -> Log {
    let mut log = Log::of("U1", 1);
    log.changes("2026-11-22T10:00:00.250", &[1]).changes("2026-11-22T10:00:00.307", &[2, 1]);
    log
}

#[test]
fn a_record_says_what_was_before_and_each_instant() {
    let text = recorder("U1", &[(1, "a, b"), (2, "52-1")]);
    let parts = parts(&text, &[&trip()], PLAIN);
    let expected = [
        "Northfield,U1,2013",
        "2,0A,2D",
        "1,a; b,,,0",
        "2,52-1,,,0",
        "50",
        "0",
        "0,3",
        "22/11/2026,10:00:00.249000",
        "22/11/2026,10:00:00.250000",
        "ASCII",
        "1",
        "0,+1",
        "F,3",
    ];
    assert_eq!(parts.cfg, expected);
    assert_eq!(rows(&parts), ["1,0,0,0", "2,1000,1,0", "3,58000,0,1"]);
    assert!(parts.hdr.contains("U1: 2 entries, nothing is known to be missing"), "{}", parts.hdr);
}

#[test]
fn the_quality_of_time_is_the_worst_of_the_record() {
    let mut log = Log::of("U1", 1);
    let set = monotonic_us("2026-11-22T10:00:00.000");
    let how = How::Set { broadcast: None };
    log.observed(how, "2026-11-22T10:00:00.000", (set, set + 100), Some(2000));
    log.changes("2026-11-22T10:00:00.250", &[1]);
    let with_time = parts(&recorder("U1", &[]), &[&log], PLAIN);
    // Up to 3.5 ms: not class 7 (1 ms) but class 8 (10 ms).
    assert_eq!(with_time.cfg.last().map(String::as_str), Some("8,3"));
}

/// The states of a binary row, by number.
fn binary_rows(dat: &[u8], channels: usize) -> Vec<(u32, u32, Vec<bool>)> {
    let words = channels.div_ceil(16);
    let rows = dat.chunks(8 + 2 * words);
    let number = |bytes: &[u8]| u32::from_le_bytes(bytes.try_into().expect("four"));
    let states = |row: &[u8]| {
        let bit = |channel: usize| row[8 + channel / 8] >> (channel % 8) & 1 == 1;
        assert!((channels..words * 16).all(|spare| !bit(spare)), "{row:?}");
        (0..channels).map(bit).collect()
    };
    rows.map(|row| (number(&row[..4]), number(&row[4..8]), states(row))).collect()
}

#[test]
fn text_and_binary_say_the_same_with_16_17_and_32_channels() {
    for channels in [16_u8, 17, 32] {
        let names: Vec<String> = (1..=channels).map(|input| format!("p{input}")).collect();
        let points: Vec<(u8, &str)> =
            (1..=channels).zip(names.iter().map(String::as_str)).collect();
        let text = recorder("U1", &points);
        let mut log = Log::of("U1", 1);
        for step in 0..u32::from(channels) * 3 {
            let input = u8::try_from(step % u32::from(channels)).expect("small") + 1;
            let (second, ms) = (step / 20, step * 47 % 1000);
            log.changes(&format!("2026-11-22T10:00:{second:02}.{ms:03}"), &[input, 1]);
        }
        let ascii = parts(&text, &[&log], PLAIN);
        let binary = parts(&text, &[&log], BINARY);
        let from_text = rows(&ascii).into_iter().map(|row| {
            let mut fields = row.split(',').map(|field| field.parse::<u32>().expect("a number"));
            let (number, stamp) = (fields.next().expect("n"), fields.next().expect("stamp"));
            (number, stamp, fields.map(|state| state == 1).collect::<Vec<bool>>())
        });
        let from_text: Vec<_> = from_text.collect();
        assert_eq!(from_text, binary_rows(&binary.dat, channels.into()));
        assert!(from_text.iter().any(|(_, _, states)| states[usize::from(channels) - 1]));
    }
}

#[test]
fn thirty_hours_are_exact_to_the_millisecond() {
    let mut log = trip();
    log.changes("2026-11-23T16:00:00.251", &[1]);
    for options in [PLAIN, BINARY] {
        let parts = parts(&recorder("U1", &[]), &[&log], options);
        assert_eq!(parts.cfg[10], "1000", "stamps in milliseconds");
        let stamps: Vec<u32> = match options.data {
            Data::Ascii => rows(&parts)
                .iter()
                .map(|row| row.split(',').nth(1).expect("a stamp").parse().expect("a number"))
                .collect(),
            Data::Binary => {
                binary_rows(&parts.dat, 2).into_iter().map(|(_, stamp, _)| stamp).collect()
            }
        };
        assert_eq!(stamps, [0, 1, 58, 108_000_002]);
    }
}

#[test]
fn with_a_rate_there_is_a_row_for_every_millisecond() {
    let parts = parts(&recorder("U1", &[]), &[&trip()], AT_RATE);
    assert_eq!(parts.cfg[5..7], ["1", "1000,59"]);
    let rows = rows(&parts);
    let expected = |index: usize| match index {
        0 => "0,0",
        1..58 => "1,0",
        _ => "0,1",
    };
    assert_eq!(rows.len(), 59);
    for (index, row) in rows.iter().enumerate() {
        assert_eq!(*row, format!("{},{},{}", index + 1, index * 1000, expected(index)));
    }
    let binary = Options { data: Data::Binary, ..AT_RATE };
    let binary = self::parts(&recorder("U1", &[]), &[&trip()], binary);
    assert_eq!((binary.cfg[1].as_str(), binary.cfg[17].as_str()), ("16,0A,16D", "16,spare 16,,,0"));
    assert_eq!(binary_rows(&binary.dat, 16).len(), 59);
}

#[test]
fn what_is_too_long_is_refused_with_what_is_possible() {
    let site = site(&recorder("U1", &[]));
    let mut log = Log::of("U1", 1);
    log.changes("2026-01-01T10:00:00.000", &[1]).changes("2026-11-22T10:00:00.000", &[1]);
    let history = history(&site, &[&log]);
    let timeline = Timeline::new(&site, &history);
    let selection = Selection::everything();
    for (options, may_be) in
        [(PLAIN, "115 days 17 h"), (BINARY, "49 days 17 h"), (AT_RATE, "1 h 0 min")]
    {
        let Err(refused) = Comtrade::new(&timeline, &selection, options) else {
            panic!("too long")
        };
        let told = refused.to_string();
        assert!(told.contains("325 days 0 h apart") && told.ends_with(may_be), "{told}");
    }
}

#[test]
fn what_is_not_known_repeats_what_was_and_is_told() {
    let text = recorder("U1", &[(1, "a"), (2, "b")]) + &recorder("U2", &[(1, "a")]);
    let (mut one, mut other) = (Log::of("U1", 1), Log::of("U2", 2));
    one.changes("2026-11-22T10:00:00.000", &[1])
        .changes("2026-11-22T10:00:00.010", &[2])
        .loses(3)
        .forgets(&[1])
        .changes("2026-11-22T10:00:05.000", &[2]);
    // On before, and off from its only entry on.
    other.forgets(&[1]).changes("2026-11-22T10:00:01.000", &[1]);
    let parts = parts(&text, &[&one, &other], PLAIN);
    let names: Vec<&str> = parts.cfg[2..5].iter().map(String::as_str).collect();
    assert_eq!(names, ["1,U1/a,,,0", "2,U1/b,,,0", "3,U2/a,,,0"]);
    let states: Vec<&str> = rows(&parts).iter().map(|row| &row[row.len() - 5..]).collect();
    assert_eq!(states, ["0,0,1", "1,0,1", "1,1,1", "1,1,0", "0,1,0", "0,0,0"]);
    let missing = "MISSING: U1: 3 entries missing (in none of the sources), after sequence 2, from \
                   2026-11-22T10:00:00.010000Z, until 2026-11-22T10:00:05.000000Z";
    assert!(parts.hdr.contains(missing), "{}", parts.hdr);
    assert!(parts.hdr.contains("U1: 3 entries, INCOMPLETE"), "{}", parts.hdr);
}

#[test]
fn changes_that_share_a_row_are_counted() {
    let mut log = Log::of("U1", 1);
    log.changes("2026-11-22T10:00:05.000", &[1])
        .changes("2026-11-22T10:00:00.300", &[1])
        .changes("2026-11-22T10:00:00.301", &[2]);
    let text = recorder("U1", &[]);
    let (each, at_rate) = (parts(&text, &[&log], PLAIN), parts(&text, &[&log], AT_RATE));
    assert_eq!((each.hidden, rows(&each).len()), (0, 4));
    assert_eq!(at_rate.hidden, 1);
    assert!(at_rate.hdr.contains("LEFT OUT: 1 changes"), "{}", at_rate.hdr);
}

#[test]
fn one_file_has_all_parts() {
    let site = site(&recorder("U1", &[]));
    let history = history(&site, &[&trip()]);
    let timeline = Timeline::new(&site, &history);
    let selection = Selection::everything();
    for options in [PLAIN, BINARY] {
        let record = Comtrade::new(&timeline, &selection, options).expect("a record");
        let (mut cff, mut cfg, mut dat) = (Vec::new(), Vec::new(), Vec::new());
        record.write_cff(&mut cff, &NOWHERE).expect("written");
        record.write_cfg(&mut cfg).expect("written");
        record.write_dat(&mut dat).expect("written");
        let begin = [b"--- file type: CFG ---\r\n", &*cfg].concat();
        assert!(cff.starts_with(&begin) && cff.ends_with(&dat));
        let data = match options.data {
            Data::Ascii => "--- file type: DAT ASCII ---\r\n".to_owned(),
            Data::Binary => format!("--- file type: DAT BINARY: {} ---\r\n", dat.len()),
        };
        let before = &cff[..cff.len() - dat.len()];
        assert!(before.ends_with(data.as_bytes()));
    }
}
