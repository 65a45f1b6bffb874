//! The frame decoder, against a second one that sees the whole stream at once.

use ser_proto::{DroppedFrame, ESC, FrameDecoder, FrameError, LONGEST_READ_REPLY, MAX_BODY_LEN};

use super::framing::{Seen, decode, frame_of};

/// `data` is the stream. For decoders of every size that is in use:
///
/// - the decoder finds what `docs/protocol.md` says, with every dropped frame at its true place;
/// - the result does not depend on how the stream is cut;
/// - a good frame after the stream is found, whatever the stream was;
/// - a body that was found is found again when it is put into a frame.
///
/// # Panics
/// When one of these does not hold.
pub fn frames(data: &[u8]) {
    for_bodies_of_up_to::<16>(data);
    for_bodies_of_up_to::<LONGEST_READ_REPLY>(data);
    for_bodies_of_up_to::<MAX_BODY_LEN>(data);
}

fn for_bodies_of_up_to<const N: usize>(stream: &[u8]) {
    let seen = decode::<N>(stream);
    assert_eq!(seen, by_the_book(stream, N));
    // The first byte of a slice says how long the slice is.
    assert_eq!(
        decode_slices::<N>(stream, |slice| 1 + usize::from(slice[0]) % 9),
        seen,
        "in slices"
    );
    assert_eq!(decode_slices::<N>(stream, <[u8]>::len), seen, "in one piece");

    let followed = [stream, &frame_of(b"L")].concat();
    assert_eq!(
        decode::<N>(&followed).last(),
        Some(&Seen::Frame(b"L".to_vec())),
        "the frame after it"
    );

    for body in
        seen.iter().filter_map(|seen| if let Seen::Frame(body) = seen { Some(body) } else { None })
    {
        assert_eq!(decode::<N>(&frame_of(body)), [Seen::Frame(body.clone())]);
    }
}

fn decode_slices<const N: usize>(stream: &[u8], slice_len: impl Fn(&[u8]) -> usize) -> Vec<Seen> {
    let mut decoder = FrameDecoder::<N>::new();
    let (mut seen, mut rest) = (Vec::new(), stream);
    while !rest.is_empty() {
        let (mut slice, behind) = rest.split_at(slice_len(rest).min(rest.len()));
        while let Some(decoded) = decoder.push_slice(&mut slice) {
            seen.push(Seen::from(decoded));
        }
        assert!(slice.is_empty(), "bytes were left");
        rest = behind;
    }
    assert_eq!(decoder.position(), stream.len() as u64);
    seen.extend(decoder.finish().map(Seen::Dropped));
    seen
}

/// The contents of a stream, found by looking at it as a whole. An ESC ends what was before it, so
/// each stretch from one ESC to the next can be understood alone.
fn by_the_book(stream: &[u8], longest: usize) -> Vec<Seen> {
    let mut stretches = stream.split(|&byte| byte == ESC);
    let before = stretches.next().unwrap_or_default();
    let mut seen: Vec<Seen> = before.iter().copied().map(Seen::Text).collect();
    let mut esc = before.len();
    for stretch in stretches {
        let next_esc = esc + 1 + stretch.len();
        let (frame, text) = understand(stretch, esc as u64, next_esc == stream.len(), longest);
        seen.extend(frame);
        seen.extend(text.iter().copied().map(Seen::Text));
        esc = next_esc;
    }
    seen
}

/// Understands what follows an ESC up to the next one, or to the end of the stream: the result of
/// the frame, and the text after it.
fn understand(stretch: &[u8], start: u64, is_last: bool, longest: usize) -> (Option<Seen>, &[u8]) {
    let digits = stretch.iter().take_while(|byte| byte.is_ascii_hexdigit()).count();
    let drop_at = |index: usize, cause| {
        Some(Seen::Dropped(DroppedFrame { start, at: start + 1 + index as u64, cause }))
    };
    let cut_short = || match stretch.get(digits) {
        Some(&byte) => (drop_at(digits, FrameError::NotHex { byte }), &stretch[digits + 1..]),
        None if is_last => (drop_at(digits, FrameError::Incomplete), &[][..]),
        None => (drop_at(digits, FrameError::Interrupted), &[][..]),
    };
    if digits < 2 {
        return cut_short();
    }
    let bytes: Vec<u8> = stretch[..digits - digits % 2].chunks(2).map(byte_of).collect();
    let length = bytes[0];
    let wanted = 2 * (1 + usize::from(length) + 1);
    if length == 0 || usize::from(length) > longest {
        let cause = if length == 0 { FrameError::Empty } else { FrameError::TooLong { length } };
        return (drop_at(1, cause), &stretch[digits.min(wanted)..]);
    }
    if digits < wanted {
        return cut_short();
    }
    let (body, received) = (&bytes[1..=usize::from(length)], bytes[usize::from(length) + 1]);
    let computed = body.iter().fold(0_u8, |sum, &byte| sum.wrapping_add(byte));
    let frame = if computed == received {
        Some(Seen::Frame(body.to_vec()))
    } else {
        drop_at(wanted - 1, FrameError::Checksum { computed, received })
    };
    (frame, &stretch[wanted..])
}

fn byte_of(digits: &[u8]) -> u8 {
    let digits = str::from_utf8(digits).expect("digits are ASCII");
    u8::from_str_radix(digits, 16).expect("digits are hexadecimal")
}
