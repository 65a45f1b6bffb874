//! The cost of the event log, compared with the rings of `heapless`, the usual alternative.
//!
//! The work is the recorder's. `append` adds an event to a full log, and the oldest one goes.
//! `read_ten` finds the ten entries of a read reply in the middle of the ring. `read_all` takes all
//! 2048 from the oldest to the newest. Both rivals do less: they have no entry numbers that outlive
//! a wrap, no total, and no size that can be changed.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use heapless::{Deque, HistoryBuf};
use ser_node::{Event, EventLog};

const LEN: usize = 2048;

/// Entries of a read reply, in the middle of the ring.
const ENTRIES: std::ops::Range<u16> = 1000..1010;

fn event(number: i64) -> Event {
    Event { time_ms: number, changed: 1, state: u32::MAX }
}

/// Events that fill the ring once and then continue to its middle.
fn past() -> impl Iterator<Item = Event> {
    (0..).map(event).take(LEN + LEN / 2)
}

fn push(deque: &mut Deque<Event, LEN>, event: Event) {
    if deque.is_full() {
        deque.pop_front();
    }
    deque.push_back(event).expect("there is room now");
}

/// A full ring of each kind.
fn full_rings(
    storage: &mut [Event],
) -> (EventLog<'_>, Box<HistoryBuf<Event, LEN>>, Box<Deque<Event, LEN>>) {
    let mut log = EventLog::new(storage);
    let mut history = Box::new(HistoryBuf::new());
    let mut deque = Box::new(Deque::new());
    for event in past() {
        log.append(event);
        history.write(event);
        push(&mut deque, event);
    }
    (log, history, deque)
}

fn append(criterion: &mut Criterion) {
    let mut storage = [Event::EMPTY; LEN];
    let (mut log, mut history, mut deque) = full_rings(&mut storage);
    let mut group = criterion.benchmark_group("event_log/append");
    let added = event(1);
    group.bench_function("ser_node", |bencher| bencher.iter(|| log.append(black_box(added))));
    group.bench_function("heapless_history_buf", |bencher| {
        bencher.iter(|| history.write(black_box(added)));
    });
    group.bench_function("heapless_deque", |bencher| {
        bencher.iter(|| push(&mut deque, black_box(added)));
    });
    group.finish();
    black_box((log, history, deque));
}

fn read_ten(criterion: &mut Criterion) {
    let mut storage = [Event::EMPTY; LEN];
    let (log, history, deque) = full_rings(&mut storage);
    let mut group = criterion.benchmark_group("event_log/read_ten");
    group.bench_function("ser_node", |bencher| {
        bencher.iter(|| add_up(|number| log.entry(number).copied()));
    });
    group.bench_function("heapless_history_buf", |bencher| {
        bencher.iter(|| add_up(|number| history.as_slice().get(usize::from(number - 1)).copied()));
    });
    group.bench_function("heapless_deque", |bencher| {
        bencher.iter(|| add_up(|number| deque.get(usize::from(number - 1)).copied()));
    });
    group.finish();
}

/// Copies entries, as into a reply, and looks at each.
fn add_up(entry: impl Fn(u16) -> Option<Event>) -> i64 {
    black_box(ENTRIES)
        .filter_map(|number| black_box(entry(number)))
        .map(|event| event.time_ms)
        .sum()
}

fn read_all(criterion: &mut Criterion) {
    let mut storage = [Event::EMPTY; LEN];
    let (log, history, deque) = full_rings(&mut storage);
    let mut group = criterion.benchmark_group("event_log/read_all");
    group.throughput(Throughput::Elements(LEN as u64));
    let sum = |sum: i64, event: &Event| sum.wrapping_add(event.time_ms);
    group.bench_function("ser_node", |bencher| {
        bencher.iter(|| {
            let sequences = log.oldest_sequence()..log.next_sequence();
            sequences.filter_map(|sequence| log.entry(log.entry_number(sequence)?)).fold(0, sum)
        });
    });
    group.bench_function("heapless_history_buf", |bencher| {
        bencher.iter(|| history.oldest_ordered().fold(0, sum));
    });
    group.bench_function("heapless_deque", |bencher| bencher.iter(|| deque.iter().fold(0, sum)));
    group.finish();
}

criterion_group!(benches, append, read_ten, read_all);
criterion_main!(benches);
