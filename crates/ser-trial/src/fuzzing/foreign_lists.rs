//! Lists of relays and other recorders, as somebody hands them in, and maps of their names.

use std::io::Read;

use ser_evidence::record::{Record, Told};
use ser_files::import::{DateOrder, Epoch, Format, Importer, Map, Options, Output, zone_named};
use ser_files::jsonl::Reader;

use super::dribble::Dribble;

/// Where a file ends and the next begins: the data of a COMTRADE configuration, or a map.
const NEXT_FILE: &[u8] = b"\n=== next file ===\n";

/// Each reader by its own name, and the choice among them by content.
const FORMATS: [Option<Format>; 6] = [
    None,
    Some(Format::SelSer),
    Some(Format::SelCser),
    Some(Format::Cytime),
    Some(Format::Comtrade),
    Some(Format::Prc002),
];

/// `data` is a file, and the data beside it or a map of its names, divided by a line. Whatever is in
/// it, every reader reads or refuses it; however slowly it comes, with the same result. What is read is
/// the same if the file is read twice, and what is written of it can be read.
///
/// # Panics
/// When this does not hold.
pub fn foreign_lists(data: &[u8]) {
    let at = data.windows(NEXT_FILE.len()).position(|part| part == NEXT_FILE);
    let (file, beside) = match at {
        Some(at) => (&data[..at], &data[at + NEXT_FILE.len()..]),
        None => (data, &b""[..]),
    };
    let map = std::str::from_utf8(beside).ok().and_then(|text| Map::parse(text, None).ok());
    for format in FORMATS {
        for (dates, doubt_ms) in [(None, Some(5)), (Some(DateOrder::Ymd), None)] {
            let options = Options {
                format,
                dates,
                doubt_ms,
                zone: zone_named("Europe/Berlin"),
                epoch: Some(Epoch::Local1984),
                map: map.clone().unwrap_or_default(),
            };
            check(&options, file, beside);
        }
    }
}

fn check(options: &Options, file: &[u8], beside: &[u8]) {
    let once = written(options, [Box::new(file)], beside);
    assert_eq!(written(options, [Box::new(Dribble { data: file })], beside), once);
    let Ok((lines, told)) = once else { return };
    let read: Vec<Told> =
        Reader::new(lines.as_bytes(), "F3").map(|told| told.expect("ours")).collect();
    assert_eq!(read, told);
    // Our own files hold what they hold, and are not joined here.
    if !matches!(Format::of(file), Some(Format::Csv | Format::Jsonl)) || options.format.is_some() {
        let twice = written(options, [Box::new(file), Box::new(file)], beside);
        assert_eq!(twice.map(|(lines, _)| lines), Ok(lines));
    }
}

/// What is made of files of one recorder, as text and as records.
fn written<'d, const N: usize>(
    options: &Options,
    files: [Box<dyn Read + 'd>; N],
    beside: &[u8],
) -> Result<(String, Vec<Told>), String> {
    let mut importer = Importer::new(options.clone());
    let (mut told, mut lines) = (Vec::new(), Vec::new());
    let mut output = Output::new(&mut lines, "fuzzing");
    for file in files {
        let data = std::io::Cursor::new(beside.to_vec());
        let data = || Ok(Box::new(data) as Box<dyn Read>);
        let mut own = |recorder: &str, record: &Record, note: Option<&str>| {
            told.push(Told { recorder: recorder.to_owned(), record: record.clone() });
            output.record(recorder, record, note)
        };
        let opened = importer.open(file).map_err(|refusal| refusal.to_string())?;
        importer.read("F3", opened, data, &mut own).map_err(|refusal| refusal.to_string())?;
    }
    let imported = importer.finish();
    output.finish(&imported).expect("memory has room");
    told.extend(
        imported.records().map(|(recorder, record)| Told {
            recorder: recorder.to_owned(),
            record: record.clone(),
        }),
    );
    Ok((String::from_utf8(lines).expect("JSON is UTF-8"), told))
}
