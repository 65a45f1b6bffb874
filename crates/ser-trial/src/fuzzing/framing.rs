//! The frame around a body, implemented a second time from the description in `docs/protocol.md`.

use ser_proto::{Decoded, DroppedFrame, ESC, FrameDecoder};

/// The frame of a body of up to 255 bytes.
pub(super) fn frame_of(body: &[u8]) -> Vec<u8> {
    let sum = body.iter().fold(0_u8, |sum, &byte| sum.wrapping_add(byte));
    let length = u8::try_from(body.len()).expect("a body fits a frame");
    let mut frame = vec![ESC];
    for byte in [length].iter().chain(body).chain([&sum]) {
        frame.extend(format!("{byte:02X}").bytes());
    }
    frame
}

/// What a decoder has found, in a form that can be stored.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Seen {
    Text(u8),
    Frame(Vec<u8>),
    Dropped(DroppedFrame),
}

impl From<Decoded<'_>> for Seen {
    fn from(decoded: Decoded<'_>) -> Seen {
        match decoded {
            Decoded::Text(byte) => Seen::Text(byte),
            Decoded::Frame(body) => Seen::Frame(body.to_vec()),
            Decoded::Dropped(dropped) => Seen::Dropped(dropped),
        }
    }
}

/// Everything that a decoder finds in a stream.
pub(super) fn decode<const N: usize>(stream: &[u8]) -> Vec<Seen> {
    let mut decoder = FrameDecoder::<N>::new();
    let mut seen: Vec<Seen> =
        stream.iter().filter_map(|&byte| decoder.push(byte).map(Seen::from)).collect();
    seen.extend(decoder.finish().map(Seen::Dropped));
    seen
}
