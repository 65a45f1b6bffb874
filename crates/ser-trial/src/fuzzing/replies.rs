//! Replies: bodies that come from a recorder.

use ser_proto::genius::MAX_SER_DATA;
use ser_proto::{LONGEST_READ_REPLY, MAX_ENTRIES, ParseError, Reply};

use super::body_rules::{Fault, Rules, above, assert_emitted, settings_fault, word};
use super::extension_rules::{canonical_reply, is_ours, known_part};

const RULES: Rules = Rules { has_length, fault };

/// `data` is the body.
///
/// - It is understood, or refused with the right cause, as the tables of `docs/protocol.md` say.
/// - A body that was understood is sent in its canonical form, with the same meaning.
/// - A reply of our extension has room in a datagram, also one that has grown.
/// - A read reply has as many entries as it says, and its model has entries of this size.
///
/// # Panics
/// When one of these does not hold.
pub fn replies(data: &[u8]) {
    let parsed = Reply::parse(data);
    if is_ours(data) {
        ours(data, &parsed);
        return;
    }
    RULES.assert_agree(data, &parsed);
    let Ok(reply) = parsed else { return };
    assert_eq!(reply.code().byte(), data[0]);
    assert_emitted(reply.to_body(), &canonical(data));
    if let Reply::Read(read) = &reply {
        assert_eq!(read.entries.len(), usize::from(data[3]));
        assert!(read.entries.len() <= MAX_ENTRIES && data.len() <= LONGEST_READ_REPLY);
        assert_eq!(
            read.model.map(|model| model.read_reply_len(read.entries.len())).unwrap_or(8),
            data.len()
        );
    }
    assert_eq!(Reply::parse(&reply.to_body()), Ok(reply));
}

fn ours(data: &[u8], parsed: &Result<Reply, ParseError>) {
    let known = match (known_part(data), parsed) {
        (Ok(known), Ok(_)) => known,
        (Err(expected), Err(error)) => {
            assert_eq!(*error, expected);
            assert!(!error.to_string().is_empty());
            return;
        }
        (expected, parsed) => panic!("{parsed:?}, not {expected:?}"),
    };
    let Ok(reply) = parsed else { return };
    assert_eq!(reply.code().byte(), data[0]);
    assert!(known.len() <= MAX_SER_DATA);
    assert_emitted(reply.to_body(), &canonical_reply(known));
    assert_eq!(Reply::parse(&reply.to_body()).as_ref(), Ok(reply));
}

fn has_length(code: u8, length: usize) -> bool {
    match code {
        b'C' | b'L' => length == 7,
        b'E' | b'S' => length == 1,
        b'M' => length == 3,
        b'P' => [1, 3, 5].contains(&length),
        // The entries are checked once the header is in order.
        b'R' => length >= 8,
        _ => false,
    }
}

fn fault(body: &[u8]) -> Fault {
    match body {
        [b'C', ..] => settings_fault(body)
            .or((word(body, 1) == 0).then_some((1, 0)))
            .or((body[3] == 0).then_some((3, 0))),
        [b'L', ..] => {
            let millisecond = word(body, 5);
            above(body, 2, &[23, 59, 59]).or((millisecond > 999).then_some((5, millisecond)))
        }
        [b'M', ..] => above(body, 1, &[1]),
        [b'R', ..] => {
            let next_slot = word(body, 6);
            above(body, 3, &[10]).or((next_slot > 2047).then_some((6, next_slot)))
        }
        _ => None,
    }
}

/// The form that we use, where the same can be said in several ways.
fn canonical(body: &[u8]) -> Vec<u8> {
    match *body {
        [b'C', a, b, baud, 1, address, print] => vec![b'C', a, b, baud, 0, address, print],
        [b'P', ..] => vec![b'P'],
        _ => body.to_vec(),
    }
}
