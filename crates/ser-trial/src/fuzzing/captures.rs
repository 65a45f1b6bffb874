//! Captures of a line, as `ser-cli decode` reads them.

use std::io::Read;

use ser_cli::{CaptureFormat, CaptureOptions, Listing, Side, Tally};
use ser_proto::{Command, FrameEncoder};

use super::dribble::Dribble;

const FORMATS: [Option<CaptureFormat>; 3] =
    [None, Some(CaptureFormat::Raw), Some(CaptureFormat::Hex)];
const SIDES: [Option<Side>; 3] = [None, Some(Side::Host), Some(Side::Recorder)];

/// `data` is a capture. It is taken in each format, from each side, with frames and without:
///
/// - it is decoded to its end, and the list is the same however slowly it comes;
/// - each line of the list is counted once, and entries belong to the line above them;
/// - nothing in the list can steer a terminal;
/// - a good frame at the end is found and understood, whatever came before.
///
/// # Panics
/// When one of these does not hold.
pub fn captures(data: &[u8]) {
    for format in FORMATS {
        for from in SIDES {
            for bodies in [false, true] {
                let options = CaptureOptions { from, format, bodies };
                let (list, tally) = decoded(options, data);
                assert_eq!(
                    decoded(options, Dribble { data }),
                    (list.clone(), tally),
                    "{options:?}"
                );
                check_list(&list, tally);
            }
        }
    }
    finds_a_frame_at_the_end(data);
}

fn decoded(options: CaptureOptions, input: impl Read) -> (String, Tally) {
    let mut out = Vec::new();
    let mut list = Listing::plain(&mut out);
    let read_error = options.decode(input, &mut list).expect("a vector takes everything");
    assert!(read_error.is_none(), "these bytes can be read");
    let tally = list.tally();
    (String::from_utf8(out).expect("the list is text"), tally)
}

fn check_list(list: &str, tally: Tally) {
    assert!(list.chars().all(|character| character == '\n' || !character.is_control()), "{list:?}");
    // Entries are indented further than any place is wide.
    let found = list.lines().filter(|line| !line.starts_with("         ")).count() as u64;
    let Tally { messages, lines, damages } = tally;
    assert_eq!(found, messages + lines + damages, "{list}");
}

fn finds_a_frame_at_the_end(data: &[u8]) {
    let frame = FrameEncoder::new(Command::Erase.to_body());
    let capture: Vec<u8> = data.iter().copied().chain(frame).collect();
    let options =
        CaptureOptions { from: Some(Side::Host), format: Some(CaptureFormat::Raw), bodies: false };
    let (list, tally) = decoded(options, &capture[..]);
    let last = list.lines().last().unwrap_or_default();
    let words: Vec<&str> = last.split_whitespace().skip(1).collect();
    assert_eq!(words.join(" "), "host erase the event buffer", "{last}");
    assert!(tally.messages > 0);
}
