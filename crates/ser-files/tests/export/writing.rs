//! What a writer does when its output takes no more.

use std::io::{self, Write};

use ser_evidence::timeline::Timeline;
use ser_files::export::comtrade::{Comtrade, Data, Options};
use ser_files::export::{
    Counted, Refused, Selection, write_csv, write_jsonl, write_prc002, write_vcd,
};
use ser_files::merged::CsvStyle;

use crate::common::{Log, history, site};
use crate::{NOWHERE, recorder};

/// A disk with room for so many bytes.
struct Disk {
    room: usize,
    written: Vec<u8>,
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = bytes.len().min(self.room - self.written.len());
        if taken == 0 && !bytes.is_empty() {
            return Err(io::ErrorKind::StorageFull.into());
        }
        self.written.extend_from_slice(&bytes[..taken]);
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

type Writer = fn(&mut Disk, &Timeline<'_>, &Selection) -> Result<Counted, Refused>;

fn cff(disk: &mut Disk, timeline: &Timeline<'_>, data: Data) -> Result<Counted, Refused> {
    let selection = Selection::everything();
    let record =
        Comtrade::new(timeline, &selection, Options { data, has_rate: true, line_hz: 60 })?;
    record.write_cff(disk, &NOWHERE)?;
    Ok(record.counted())
}

const WRITERS: [(&str, Writer); 6] = [
    ("csv", |disk, timeline, selection| write_csv(disk, timeline, selection, CsvStyle::default())),
    ("jsonl", |disk, timeline, selection| write_jsonl(disk, timeline, selection, "test")),
    ("vcd", |disk, timeline, selection| write_vcd(disk, timeline, selection, &NOWHERE)),
    ("prc002", |disk, timeline, selection| write_prc002(disk, timeline, selection, true)),
    ("cff", |disk, timeline, _| cff(disk, timeline, Data::Ascii)),
    ("binary cff", |disk, timeline, _| cff(disk, timeline, Data::Binary)),
];

#[test]
fn wherever_a_disk_is_full_a_writer_says_so() {
    let site = site(&recorder("U1", &[(1, "a")]));
    let mut log = Log::of("U1", 1);
    log.changes("2026-11-22T10:00:00.250", &[1])
        .loses(2)
        .changes("2026-11-22T10:00:00.270", &[1, 3])
        .changes("2026-11-22T10:00:00.280", &[3]);
    let history = history(&site, &[&log]);
    let timeline = Timeline::new(&site, &history);
    let selection = Selection::everything();
    for (name, write) in WRITERS {
        let with_room = |room| {
            let mut disk = Disk { room, written: Vec::new() };
            let result = write(&mut disk, &timeline, &selection);
            (result, disk.written)
        };
        let (whole, all) = with_room(1 << 20);
        assert_eq!(whole.expect(name), Counted { entries: 3, losses: 1, ..Counted::default() });
        for room in 0..all.len() {
            let (result, written) = with_room(room);
            let is_full = matches!(&result, Err(Refused::Io(error))
                if error.kind() == io::ErrorKind::StorageFull);
            assert!(is_full, "{name} with {room} bytes: {result:?}");
            assert_eq!(written, all[..room], "{name}");
        }
    }
}
