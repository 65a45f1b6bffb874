//! Cost of finding and understanding one full read reply in a byte stream, per entry.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ser_proto::{
    Decoded, Entry, FrameDecoder, FrameEncoder, Inputs, MAX_BODY_LEN, MAX_ENTRIES, Model, ReadReply, Reply,
    TimeStamp,
};
use std::hint::black_box;

fn frame(model: Model) -> Vec<u8> {
    let time = TimeStamp { year: 26, month: 11, day: 22, hour: 10, minute: 0, second: 0, millisecond: 250 };
    let entry = Entry { changed: Inputs(0x1234), state: Inputs(0x5678), time };
    let entries = core::iter::repeat_n(entry, MAX_ENTRIES).collect();
    let reply = ReadReply { start: 1, total: 2048, next_slot: 0, model: Some(model), entries };
    FrameEncoder::new(Reply::Read(reply).to_body()).collect()
}

fn frame_decoding(criterion: &mut Criterion) {
    for (name, model) in [("ser160", Model::Ser160), ("ser320", Model::Ser320)] {
        let stream = frame(model);
        let mut group = criterion.benchmark_group(format!("frame_decoding/{name}"));
        group.throughput(Throughput::Bytes(stream.len() as u64));
        group.bench_function("deframe", |bencher| {
            let mut decoder = FrameDecoder::<MAX_BODY_LEN>::new();
            bencher.iter(|| {
                for &byte in black_box(&stream) {
                    if let Some(Decoded::Frame(body)) = decoder.push(byte) {
                        black_box(body);
                    }
                }
            });
        });
        group.throughput(Throughput::Elements(MAX_ENTRIES as u64));
        group.bench_function("deframe_and_parse_per_entry", |bencher| {
            let mut decoder = FrameDecoder::<MAX_BODY_LEN>::new();
            bencher.iter(|| {
                for &byte in black_box(&stream) {
                    if let Some(Decoded::Frame(body)) = decoder.push(byte) {
                        black_box(Reply::parse(body)).expect("the frame holds a reply");
                    }
                }
            });
        });
        group.finish();
    }
}

criterion_group!(benches, frame_decoding);
criterion_main!(benches);
