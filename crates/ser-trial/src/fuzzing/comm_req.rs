//! `COMM_REQ` blocks: the words that a PLC program hands to its bus controller.

use ser_proto::genius::{CommReq, CommReqError, MAX_WORDS, bytes_of_words, words_of_bytes};

/// `data` holds the words, two bytes each, low byte first.
///
/// - Words are understood if, and only if, the table in `docs/genius.md` has such a block. They are
///   written again as the canonical words, with the same meaning.
/// - A refusal names a word that is wrong, is missing, or is too much.
/// - Bytes come out of words as they went in.
///
/// # Panics
/// When one of these does not hold.
pub fn comm_req(data: &[u8]) {
    let words: Vec<u16> = words_of_bytes(data).collect();
    assert_eq!(words.len(), data.len().div_ceil(2));
    assert!(bytes_of_words(&words, data.len()).eq(data.iter().copied()));

    let parsed = CommReq::parse(&words);
    assert_eq!(parsed.is_ok(), is_block(&words), "{parsed:?}");
    match parsed {
        Ok(block) => {
            assert!(!block.to_string().is_empty());
            let sent = block.to_words();
            assert_eq!(*sent, *canonical(&block, &words));
            assert!(sent.len() <= MAX_WORDS);
            assert_eq!(CommReq::parse(&sent), Ok(block));
        }
        Err(CommReqError::Missing { index }) => assert!(index >= words.len()),
        Err(CommReqError::BadWord { index, value }) => assert_eq!(words.get(index), Some(&value)),
        Err(CommReqError::TooManyWords { words: count }) => assert_eq!(count, words.len()),
    }
}

/// Whether the words are a block by the table, with the latitude that the table gives.
fn is_block(words: &[u16]) -> bool {
    let [length, 0, _, status, 0, 0, command, rest @ ..] = words else { return false };
    let is_address = |word: u16| word <= 31 || word == 255;
    let is_byte = |word: u16| word <= 255;
    let fits = match (command, rest) {
        (14, &[target, function, subfunction, priority, bytes, ref data @ ..]) => {
            let count = bytes.div_ceil(2);
            is_address(target)
                && is_byte(function)
                && is_byte(subfunction)
                && priority <= 1
                && bytes <= 134
                && [count + 6, count + 7].contains(length)
                && (usize::from(count)..=usize::from(count) + 1).contains(&data.len())
        }
        (13, &[max_words, _, into, function, subfunction, sender]) => {
            *length == 7
                && max_words > 0
                && into < u16::MAX
                && is_byte(function)
                && is_byte(subfunction)
                && is_address(sender)
        }
        _ => false,
    };
    fits && *status < u16::MAX
}

/// The same block as we write it.
fn canonical(block: &CommReq, words: &[u16]) -> Vec<u16> {
    let CommReq::Send(send) = block else { return words.to_vec() };
    let bytes = usize::from(words[11]);
    assert_eq!(send.data.len(), bytes);
    // The word that the manual's rule counts in excess may be present, and word 0 may leave it out.
    let mut canonical = words[..12 + bytes.div_ceil(2)].to_vec();
    canonical[0] = u16::try_from(bytes.div_ceil(2) + 7).expect("a short block");
    if bytes % 2 == 1
        && let Some(last) = canonical.last_mut()
    {
        *last &= 0x00FF;
    }
    canonical
}
