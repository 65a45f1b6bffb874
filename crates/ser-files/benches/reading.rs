//! How fast files of records are read, per entry.

use std::fmt::Write;
use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ser_files::Source;

const ENTRIES: u32 = 100_000;

/// Entries of one change each, a few milliseconds apart.
fn times() -> impl Iterator<Item = (u32, String, u32, u32)> {
    (0..ENTRIES).map(|number| {
        let ms = number * 7;
        let (second, minute) = (ms / 1000 % 60, ms / 60_000 % 60);
        let time = format!("2026-11-22T10:{minute:02}:{second:02}.{:03}", ms % 1000);
        (number + 1, time, number % 32 + 1, number / 32 % 2)
    })
}

fn csv() -> String {
    let mut text = "entry,time,input,state,sequence,life,note\n".to_owned();
    for (number, time, input, state) in times() {
        let entry = number % 2048 + 1;
        let _ = writeln!(text, "{entry},{time},{input},{state},{number},9f3c5a7e21b04d68,");
    }
    text
}

fn jsonl() -> String {
    let mut text = "{\"record\":\"file\",\"schema\":1,\"program\":\"bench\"}\n".to_owned();
    for (number, time, input, _) in times() {
        let entry = number % 2048 + 1;
        let _ = writeln!(
            text,
            "{{\"record\":\"entry\",\"recorder\":\"U1-SER1\",\"entry\":{entry},\"time\":\"{time}\",\
             \"changed\":[{input}],\"state\":[1,2,5,9,17,23,31],\"sequence\":{number},\
             \"life\":\"9f3c5a7e21b04d68\"}}"
        );
    }
    text
}

fn reading(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("reading");
    group.throughput(Throughput::Elements(ENTRIES.into()));
    for (name, text) in [("csv", csv()), ("jsonl", jsonl())] {
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let source = Source::new(black_box(text.as_bytes()), "U1").expect("a file of ours");
                assert_eq!(source.filter(Result::is_ok).count(), ENTRIES as usize);
            });
        });
    }
    group.finish();
}

criterion_group!(benches, reading);
criterion_main!(benches);
