//! The cost of finding a full read reply in a byte stream and parsing it, compared with
//! alternatives.
//!
//! Each of the two steps is a group with its alternatives on the same work:
//! - `to_bytes`: from characters to bytes. `faster-hex` turns the same characters into the same
//!   bytes. It is told where they begin and end, looks for no frame and checks no checksum.
//! - `to_events`: from characters to ten events. For `nmea` each event is a ZDA sentence that is
//!   already cut out. A sentence holds time, date and checksum, but not the inputs.

use std::fmt::Write;
use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ser_proto::{
    Decoded, Entry, FrameDecoder, FrameEncoder, Inputs, MAX_BODY_LEN, MAX_ENTRIES, Model,
    ReadReply, Reply, TimeStamp,
};

const MODELS: [(&str, Model); 2] = [("ser160", Model::Ser160), ("ser320", Model::Ser320)];

/// Events of a trip, a few milliseconds apart.
fn entries() -> impl Iterator<Item = Entry> {
    (0_u16..).take(MAX_ENTRIES).map(|number| {
        let millisecond = 250 + 7 * number;
        let time =
            TimeStamp { year: 26, month: 11, day: 22, hour: 10, minute: 0, second: 0, millisecond };
        Entry { changed: Inputs(1 << number), state: Inputs(0xFFFF >> number), time }
    })
}

fn frame(model: Model) -> Vec<u8> {
    let entries = entries().collect();
    let reply = ReadReply { start: 1, total: 2048, next_slot: 0, model: Some(model), entries };
    FrameEncoder::new(Reply::Read(reply).to_body()).collect()
}

/// The times of the same events.
fn sentences() -> Vec<String> {
    entries().map(|entry| sentence(entry.time)).collect()
}

fn sentence(time: TimeStamp) -> String {
    let TimeStamp { year, month, day, hour, minute, second, millisecond } = time;
    let fields = format!(
        "GPZDA,{hour:02}{minute:02}{second:02}.{millisecond:03},{day:02},{month:02},20{year:02},00,00"
    );
    let checksum = fields.bytes().fold(0, |sum, byte| sum ^ byte);
    let mut sentence = format!("${fields}");
    write!(sentence, "*{checksum:02X}").expect("a string takes everything");
    sentence
}

/// The one body in the stream.
fn body<'a>(decoder: &'a mut FrameDecoder<MAX_BODY_LEN>, mut stream: &[u8]) -> &'a [u8] {
    match decoder.push_slice(&mut stream) {
        Some(Decoded::Frame(body)) => body,
        other => panic!("a whole frame, and not {other:?}"),
    }
}

fn to_bytes(criterion: &mut Criterion) {
    for (name, model) in MODELS {
        let stream = frame(model);
        let digits = &stream[1..];
        let mut group = criterion.benchmark_group(format!("to_bytes/{name}"));
        group.throughput(Throughput::Bytes(stream.len() as u64));
        group.bench_function("ser_proto", |bencher| {
            let mut decoder = FrameDecoder::<MAX_BODY_LEN>::new();
            bencher.iter(|| {
                black_box(body(&mut decoder, black_box(&stream)));
            });
        });
        group.bench_function("faster_hex", |bencher| {
            let mut bytes = [0; MAX_BODY_LEN + 2];
            let bytes = &mut bytes[..digits.len() / 2];
            bencher.iter(|| {
                faster_hex::hex_decode(black_box(digits), bytes).expect("hex digits");
                black_box(&bytes);
            });
        });
        group.finish();
    }
}

fn to_events(criterion: &mut Criterion) {
    for (name, model) in MODELS {
        let stream = frame(model);
        let mut group = criterion.benchmark_group(format!("to_events/{name}"));
        group.throughput(Throughput::Elements(MAX_ENTRIES as u64));
        group.bench_function("ser_proto", |bencher| {
            let mut decoder = FrameDecoder::<MAX_BODY_LEN>::new();
            bencher.iter(|| {
                let body = body(&mut decoder, black_box(&stream));
                black_box(Reply::parse(body)).expect("the frame holds a reply")
            });
        });
        let sentences = sentences();
        group.bench_function("nmea", |bencher| {
            bencher.iter(|| {
                for sentence in &sentences {
                    black_box(nmea::parse_str(black_box(sentence))).expect("a sentence");
                }
            });
        });
        group.finish();
    }
}

criterion_group!(benches, to_bytes, to_events);
criterion_main!(benches);
