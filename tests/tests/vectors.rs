//! The manual's examples, decoded by the frame decoder and the message types: whole, in pieces and
//! after noise.

use proptest::prelude::*;
use ser_proto::{Command, FrameEncoder, Reply};
use ser_tests::vectors::{Sender, Vector, all, decode};

fn assert_means(vector: &Vector, seen: &ser_tests::vectors::Seen, how: &str) {
    assert_eq!(
        seen.messages,
        [vector.meaning.as_str()],
        "{}, line {}, {how}",
        vector.file,
        vector.line
    );
}

#[test]
fn every_example_means_what_the_file_says() {
    let vectors = all();
    assert!(vectors.len() >= 80);
    for vector in &vectors {
        assert_means(vector, &decode([&vector.wire[..]], vector.sender), "whole");
    }
}

#[test]
fn every_example_means_the_same_byte_by_byte() {
    for vector in all() {
        assert_means(&vector, &decode(vector.wire.chunks(1), vector.sender), "byte by byte");
    }
}

#[test]
fn every_example_is_found_after_noise() {
    let noises: [&[u8]; 4] =
        [b"0001 2026-11-22 10:00:00.250  1 ON\r\n", b"1B0145", b"\x00\xFF\x80~", b"45\r4"];
    for vector in all() {
        for noise in noises {
            let seen = decode([noise, &vector.wire], vector.sender);
            assert_means(&vector, &seen, "after noise");
            assert_eq!(seen.text, noise, "line {}: text is handed on as it is", vector.line);
        }
        let seen = decode([b"\x1B0743", &vector.wire[..]], vector.sender);
        assert_eq!(
            seen.messages,
            ["Interrupted", vector.meaning.as_str()],
            "{}, line {}",
            vector.file,
            vector.line
        );
    }
}

#[test]
fn lower_case_digits_mean_the_same() {
    for vector in all() {
        let lower = vector.wire.to_ascii_lowercase();
        assert_means(&vector, &decode([&lower[..]], vector.sender), "in lower case");
    }
}

#[test]
fn what_is_understood_is_sent_the_same_way() {
    let mut sent = 0;
    for vector in all().into_iter().filter(|vector| vector.canonical) {
        let mut decoder = ser_proto::FrameDecoder::<{ ser_proto::MAX_BODY_LEN }>::new();
        let body = vector.wire.iter().find_map(|&byte| match decoder.push(byte)? {
            ser_proto::Decoded::Frame(body) => Some(body.to_vec()),
            _ => None,
        });
        let body = body.expect("a frame that is not refused decodes");
        let again = match vector.sender {
            Sender::Host => Command::parse(&body).expect("a command").to_body(),
            Sender::Unit => Reply::parse(&body).expect("a reply").to_body(),
        };
        assert_eq!(
            FrameEncoder::new(again).collect::<Vec<_>>(),
            vector.wire,
            "{}, line {}",
            vector.file,
            vector.line
        );
        sent += 1;
    }
    assert!(sent >= 35);
}

/// The bodies that a chapter of `docs/protocol.md` shows: a line without an indent begins one, and
/// what follows two blanks is said about it.
fn bodies_of_chapter(title: &str) -> Vec<Vec<u8>> {
    let page = ser_tests::pages::file("docs/protocol.md").expect("docs/protocol.md");
    let chapter =
        page.split("\n## ").find(|chapter| chapter.starts_with(title)).expect("a chapter");
    let blocks = chapter.split("```text\n").skip(1).filter_map(|block| block.split("```").next());
    let mut bodies: Vec<Vec<u8>> = Vec::new();
    for line in blocks.flat_map(str::lines) {
        let bytes = line.trim_start().split("  ").next().unwrap_or_default();
        let bytes = bytes.split(' ').map_while(|byte| u8::from_str_radix(byte, 16).ok());
        if !line.starts_with(' ') {
            bodies.push(Vec::new());
        }
        bodies.last_mut().expect("no block begins with an indent").extend(bytes);
    }
    bodies
}

#[test]
fn the_examples_of_the_chapter_on_our_extension_are_among_these() {
    let bodies = bodies_of_chapter("Our extension");
    assert_eq!(bodies.iter().map(|body| body[0]).collect::<Vec<_>>(), *b"IITTFFFDD");
    for body in bodies {
        let length = u8::try_from(body.len()).expect("a body is short");
        let sum = body.iter().fold(0, |sum: u8, &byte| sum.wrapping_add(byte));
        let digits: String = [&[length], &body[..], &[sum]]
            .concat()
            .iter()
            .map(|byte| format!("{byte:02X}"))
            .collect();
        let wire = format!("\u{1B}{digits}").into_bytes();
        let is_it = |vector: &Vector| !vector.refused && vector.wire == wire;
        assert!(all().iter().any(is_it), "no vector for {body:02X?}");
    }
}

proptest! {
    #[test]
    fn every_cut_of_a_stream_gives_the_same_messages(
        order in prop::collection::vec((0..all().len(), prop::collection::vec(any::<u8>(), 0..4)), 1..30),
        cuts in prop::collection::vec(any::<prop::sample::Index>(), 0..40),
        from_host: bool,
    ) {
        let sender = if from_host { Sender::Host } else { Sender::Unit };
        let vectors = all();
        let stream: Vec<u8> = order
            .iter()
            .flat_map(|(index, noise)| vectors[*index].wire.iter().chain(noise))
            .copied()
            .collect();
        let mut cuts: Vec<_> = cuts.iter().map(|cut| cut.index(stream.len() + 1)).collect();
        cuts.extend([0, stream.len()]);
        cuts.sort_unstable();
        let pieces = cuts.windows(2).map(|cut| &stream[cut[0]..cut[1]]);
        prop_assert_eq!(decode(pieces, sender), decode([&stream[..]], sender));
    }

    #[test]
    fn decoding_anything_never_panics_and_a_good_frame_after_it_is_found(
        mut stream in prop::collection::vec(prop_oneof![
            2 => any::<u8>(),
            1 => Just(ser_proto::ESC),
            6 => prop::sample::select(b"0123456789ABCDEF".to_vec()),
        ], 0..600),
        host: bool,
    ) {
        let sender = if host { Sender::Host } else { Sender::Unit };
        stream.extend(b"\x1B014545");
        let seen = decode([&stream[..]], sender);
        let erase = if host { "Erase" } else { "Erased" };
        prop_assert_eq!(seen.messages.last().map(String::as_str), Some(erase));
    }
}
