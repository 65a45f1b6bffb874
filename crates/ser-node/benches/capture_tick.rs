//! Cost of one capture tick: the work of the 1 kHz interrupt without the main loop's share. Times
//! are per tick.

use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::{Criterion, criterion_group, criterion_main};
use ser_node::{CaptureChannel, Debounce};

/// Ticks per channel: fewer than the queue holds, so that every change finds room.
const BATCH: u64 = 200;

/// How long `ticks` ticks take when the inputs in `toggling` change in every one of them.
fn time_ticks(ticks: u64, debounce: Debounce, toggling: u32) -> Duration {
    let mut elapsed = Duration::ZERO;
    let mut left = ticks;
    while left > 0 {
        let batch = left.min(BATCH);
        left -= batch;
        let mut channel = CaptureChannel::new();
        let (mut capture, _reader) = channel.split(debounce);
        let mut inputs = 0;
        capture.sample(0, inputs);
        let start = Instant::now();
        for tick_ms in (1..).take(usize::try_from(batch).unwrap_or(usize::MAX)) {
            inputs ^= toggling;
            capture.sample(tick_ms, black_box(inputs));
        }
        elapsed += start.elapsed();
    }
    elapsed
}

fn capture_tick(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("capture_tick");
    let filters = [("no_debounce", Debounce::OFF), ("debounce_255_ms", Debounce::uniform(255))];
    let contacts: [(&str, u32); 3] =
        [("idle", 0), ("one_input_toggles", 1), ("all_inputs_toggle", u32::MAX)];
    for (filter, debounce) in filters {
        for (name, toggling) in contacts {
            group.bench_function(format!("{filter}/{name}"), |bencher| {
                bencher.iter_custom(|ticks| time_ticks(ticks, debounce, toggling));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, capture_tick);
criterion_main!(benches);
