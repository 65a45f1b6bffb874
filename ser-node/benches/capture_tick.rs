//! Cost of one capture tick: the work of the 1 kHz interrupt, without the main loop's share.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use ser_node::{CaptureChannel, Debounce};

/// Ticks per measurement: fewer than the queue holds, so that every change finds room.
const TICKS: u32 = 200;

fn capture_tick(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("capture_tick");
    group.throughput(Throughput::Elements(TICKS.into()));
    let filters = [("no_debounce", Debounce::OFF), ("debounce_255_ms", Debounce::uniform(255))];
    let contacts: [(&str, u32); 3] = [("idle", 0), ("one_input_toggles", 1), ("all_inputs_toggle", u32::MAX)];
    for (filter, debounce) in filters {
        for (name, toggling) in contacts {
            group.bench_function(format!("{filter}/{name}"), |bencher| {
                bencher.iter_batched_ref(
                    CaptureChannel::new,
                    |channel| {
                        let (mut capture, _reader) = channel.split(debounce);
                        let mut inputs = 0;
                        for tick_ms in 0..TICKS {
                            capture.sample(tick_ms, black_box(inputs));
                            inputs ^= toggling;
                        }
                    },
                    BatchSize::SmallInput,
                );
            });
        }
    }
    group.finish();
}

criterion_group!(benches, capture_tick);
criterion_main!(benches);
