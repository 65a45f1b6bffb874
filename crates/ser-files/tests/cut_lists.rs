//! Lists that were cut off, as by a copy that ended early or a terminal that was closed: nothing of
//! them is guessed, and what is missing stands where it was.

use ser_evidence::history::Collector;
use ser_evidence::record::{Lost, Record, Why};
use ser_evidence::site::Site;
use ser_files::import::{Epoch, Imported, Importer, Options, Read, zone_named};

const HEAD: &str = "#    DATE        TIME            ELEMENT        STATE\n";

/// Rows of a report, the newest first.
const ROWS: [&str; 4] = [
    "1    2027-03-14  09:05:00.004    52A            Deasserted\n",
    "2    2027-03-14  09:05:00.003    50P1           Deasserted\n",
    "3    2027-03-14  09:05:00.002    50P1           Asserted\n",
    "4    2027-03-14  09:05:00.001    52A            Asserted\n",
];

fn import(text: &str) -> (Read, Imported) {
    let epoch = Some(Epoch::Posix);
    let options = Options { zone: zone_named("UTC"), epoch, ..Options::default() };
    let mut importer = Importer::new(options);
    let opened = importer.open(text.as_bytes()).expect("a format that is known");
    let nothing = || Err(std::io::ErrorKind::NotFound.into());
    let read = importer.read("F3", opened, nothing, &mut |_, _, _| Ok(())).expect("it is read");
    (read, importer.finish())
}

/// Inputs that changed in each entry and what their states are then, and gaps, in their order.
fn told(imported: &Imported) -> Vec<String> {
    let points: Vec<_> = imported
        .records()
        .filter_map(|(_, record)| match record {
            Record::Point(point) => Some(point.clone()),
            _ => None,
        })
        .collect();
    let records = imported.records().filter_map(|(_, record)| match record {
        Record::Entry(told) => {
            let input = told.entry.changed.numbers().next()?;
            let point = points.iter().find(|point| point.input == input)?;
            let word = match told.entry.state.contains(input) {
                true => &point.on,
                false => &point.off,
            };
            Some(format!("{} {word}", point.name))
        }
        Record::Gap(gap) => {
            assert_eq!((gap.lost, gap.why), (Lost::AtLeast(1), Why::NotReached));
            Some(format!("gap after {}", gap.after.expect("a sequence")))
        }
        _ => None,
    });
    records.collect()
}

/// After which sequences a timeline takes entries for missing.
fn missing(imported: &Imported) -> Vec<u64> {
    let mut collector = Collector::new();
    imported.records().for_each(|(recorder, record)| collector.add(recorder, record));
    let history = collector.finish(&Site::unknown());
    let lives = history.recorders.iter().flat_map(|recorder| &recorder.lives);
    lives.flat_map(|life| &life.gaps).map(|gap| gap.after).collect()
}

fn left_out(read: &Read, imported: &Imported) -> Vec<String> {
    let notes = read.notes.left_out.iter().chain(&imported.notes.left_out);
    notes.map(ToString::to_string).collect()
}

fn list(rows: &[&str]) -> String {
    HEAD.to_owned() + &rows.concat()
}

#[test]
fn a_row_without_a_line_end_is_left_out_and_a_gap() {
    let (read, whole) = import(&list(&ROWS));
    let all = ["52A Asserted", "50P1 Asserted", "50P1 Deasserted", "52A Deasserted"];
    assert_eq!((told(&whole), left_out(&read, &whole).len()), (all.map(str::to_owned).to_vec(), 0));

    let cut = list(&ROWS);
    // However much of the row is cut off, down to its number alone: it was the oldest.
    for gone in 1..ROWS[3].len() {
        let (read, imported) = import(&cut[..cut.len() - gone]);
        let expected = ["gap after 0", all[1], all[2], all[3]].map(str::to_owned);
        assert_eq!(told(&imported), expected, "{gone}");
        let [note] = &left_out(&read, &imported)[..] else { panic!("{gone}") };
        assert!(note.starts_with("line 5: "), "{note}");
        assert!(note.contains("no line end") || note.contains("not a row"), "{note}");
    }
    assert_eq!(missing(&import(&cut[..cut.len() - 9]).1), [0]);
    // Printed the other way round it was the newest.
    let turned: Vec<&str> = ROWS.iter().rev().copied().collect();
    let cut = list(&turned);
    let (_, imported) = import(&cut[..cut.len() - 4]);
    assert_eq!(told(&imported), [all[0], all[1], all[2], "gap after 3"].map(str::to_owned));
    // The relay ends what it sends with ETX, and then the row is whole.
    let (read, imported) = import(&(cut.trim_end().to_owned() + "\u{3}"));
    assert_eq!(
        (told(&imported), left_out(&read, &imported).len()),
        (all.map(str::to_owned).to_vec(), 0)
    );
}

#[test]
fn a_part_of_a_word_is_no_state() {
    for part in
        ["52A            De", "52A De", "52A            Asser", "50P1", "52A            deassert"]
    {
        let row = format!("1    2027-03-14  09:05:00.004    {part}\n");
        let (read, imported) = import(&list(&[&row, ROWS[1], ROWS[2], ROWS[3]]));
        let expected = ["52A Asserted", "50P1 Asserted", "50P1 Deasserted", "gap after 3"];
        assert_eq!(told(&imported), expected, "{part}");
        assert_eq!(left_out(&read, &imported).len(), 1, "{part}");
    }
    // Words that are whole, and what the relay says of itself.
    for whole in [
        "52A            HI",
        "52A            IN",
        "Relay Settings Changed",
        "52A            BLOCKED",
    ] {
        let row = format!("1    2027-03-14  09:05:00.004    {whole}\n");
        let (read, imported) = import(&list(&[&row, ROWS[1], ROWS[2]]));
        assert_eq!(left_out(&read, &imported), [""; 0], "{whole}");
    }
}

#[test]
fn numbers_that_no_row_has_are_told() {
    // Without the newest row.
    let (read, imported) = import(&list(&ROWS[1..]));
    assert_eq!(
        told(&imported),
        ["52A Asserted", "50P1 Asserted", "50P1 Deasserted", "gap after 3"]
    );
    let lost: Vec<String> = read.notes.lost.iter().map(ToString::to_string).collect();
    assert_eq!(lost, ["line 2: row 1, the newest, is not in the file"]);
    assert_eq!(missing(&imported), [3]);
    // Without one in between: the sequence says where.
    let (read, imported) = import(&list(&[ROWS[0], ROWS[1], ROWS[3]]));
    let sequences: Vec<_> = imported
        .records()
        .filter_map(|(_, record)| match record {
            Record::Entry(entry) => entry.sequence,
            _ => None,
        })
        .collect();
    assert_eq!(sequences, [1, 3, 4]);
    let lost: Vec<String> = read.notes.lost.iter().map(ToString::to_string).collect();
    assert_eq!(lost, ["line 4: row 3 is not in the file"]);
    // Nothing is missing, and a damaged row is not told twice.
    assert_eq!(import(&list(&ROWS)).0.notes.lost_count, 0);
    let damaged = ROWS[1].replace("09:05", "09:xx");
    let (read, _) = import(&list(&[ROWS[0], &damaged, ROWS[2]]));
    assert_eq!((read.notes.left_out_count, read.notes.lost_count), (1, 0));
}

#[test]
fn csv_for_prc_002_that_ends_in_a_row_is_cut() {
    let head = "Date,Time,Local Time Code,Substation,Device,State\n";
    let first = "03/14/2027,09:05:00.001,+00,OAK,52A,OPEN\n";
    let (read, imported) = import(&format!("{head}{first}03/14/2027,09:05:00.002,+00,OAK,52A,CLO"));
    assert_eq!(told(&imported), ["OAK 52A OPEN", "gap after 1"]);
    let [note] = &left_out(&read, &imported)[..] else { panic!() };
    assert!(note.starts_with("line 3: ") && note.contains("no line end"), "{note}");
    // A closing quote says that the row is whole.
    let row = "03/14/2027,09:05:00.002,+00,OAK,52A,\"CLOSED\"";
    let (_, imported) = import(&format!("{head}{first}{row}"));
    assert_eq!(told(&imported), ["OAK 52A OPEN", "OAK 52A CLOSED"]);
}

#[test]
fn a_file_of_ours_that_ends_in_a_row_is_cut() {
    let head = "entry,time,input,state,sequence,life,note\n";
    let first = "1,2027-03-14T09:05:00.001,1,1,1,9f3c5a7e21b04d68,\n";
    // The sequence, too, may have gone on.
    for cut in
        ["2,2027-03-14T09:05:00.002,1,0,2", "2,2027-03-14T09:05:00.002,1,0,2,9f3c5a7e21b04d68,"]
    {
        let text = format!("{head}{first}{cut}");
        let read: Vec<_> = ser_files::Source::new(text.as_bytes(), "F3").expect("ours").collect();
        let [Ok(_), Err(error)] = &read[..] else { panic!("{read:?}") };
        assert_eq!(error.line, 3);
        assert!(error.problem.to_string().contains("no line end"), "{error}");
    }
    let json = "{\"record\":\"recorder\",\"recorder\":\"F3\",\"utc_offset_s\":0}";
    let read: Vec<_> = ser_files::Source::new(json.as_bytes(), "F3").expect("ours").collect();
    assert!(matches!(&read[..], [Ok(_)]), "an object is whole where its last bracket is: {read:?}");
}

#[test]
fn a_list_of_several_recorders_shows_what_is_lost_before_it() {
    let row = |number: usize, end: &str| {
        format!(
            "{number}    2027-03-14  09:05:00.{:03}    P{number}    Asserted{end}",
            100 - number
        )
    };
    let rows: String = (1..=40).map(|number| row(number, "\n")).collect();
    let whole = import(&(HEAD.to_owned() + &rows)).1;
    assert_eq!((whole.recorders.len(), missing(&whole)), (2, vec![]));
    let (_, cut) = import(&(HEAD.to_owned() + &rows + &row(41, "")));
    assert_eq!(missing(&cut), [0, 0]);
}
