//! What the chatter filter leaves out, and what it must not: the whole recorder against a plain
//! account of what its contacts did.

mod bench;

use std::num::NonZeroU8;

use bench::{Bench, TEN_O_CLOCK};
use proptest::prelude::*;
use ser_node::Debounce;
use ser_proto::{
    ChatterFilter, Command, Counter, Entry, InputFilter, MAX_CHATTER_CHANGES,
    MAX_CHATTER_WINDOW_MS, Model, Reply, TimeStamp,
};

const HOUR_MS: u32 = 3_600_000;

fn set(bench: &mut Bench, input: u8, filter: InputFilter) {
    let input = NonZeroU8::new(input);
    let replies = bench.ask(&Command::SetFilter { input, filter });
    let [Reply::Filters(page)] = &replies[..] else { panic!("{replies:?}") };
    assert_eq!(page.filters[0], filter, "it is in force");
}

fn left_out(bench: &mut Bench, input: u8) -> u32 {
    let first = Counter::suppressed(input).unwrap();
    let replies = bench.ask(&Command::Diagnostics { first });
    let [Reply::Diagnostics(page)] = &replies[..] else { panic!("{replies:?}") };
    page.counters().next().unwrap().1
}

/// Milliseconds since ten o'clock.
fn since_ten_ms(time: TimeStamp) -> u32 {
    ((u32::from(time.hour) - 10) * 60 + u32::from(time.minute)) * 60_000
        + u32::from(time.second) * 1000
        + u32::from(time.millisecond)
}

/// A host that reads what is new, in a ring that may go round.
#[derive(Default)]
struct Reader {
    read: u16,
    entries: Vec<Entry>,
}

impl Reader {
    fn read_new(&mut self, bench: &mut Bench) {
        loop {
            let head = bench.read(1, 0);
            if head.total == self.read {
                return;
            }
            let reply = bench.read(self.read % 2048 + 1, 10);
            assert!(!reply.entries.is_empty(), "what is counted is there");
            let new = usize::from(head.total.wrapping_sub(self.read));
            self.entries.extend(reply.entries.iter().take(new));
            self.read =
                self.read.wrapping_add(u16::try_from(reply.entries.len().min(new)).unwrap());
        }
    }
}

#[test]
fn an_input_that_toggles_for_an_hour_costs_four_entries_and_hides_nothing_of_the_others() {
    const TOGGLES_EVERY_MS: u32 = 20;
    let mut bench = Bench::with(Model::Ser320, Debounce::OFF, 2048, bench::Survivors::default());
    let chatter = Some(ChatterFilter {
        changes: NonZeroU8::new(5).unwrap(),
        window_ms: 1000,
        rearm_ms: 1000,
    });
    set(&mut bench, 0, InputFilter { debounce_ms: 0, chatter });
    bench.ask(&Command::SetClock(TEN_O_CLOCK));
    let began_ms = bench.tick_ms;
    let (mut expected, mut toggled, mut reader) = (Vec::new(), 0, Reader::default());
    while bench.tick_ms < began_ms + HOUR_MS {
        let at_ms = bench.tick_ms + 1 - began_ms;
        let mut inputs = bench.inputs;
        if at_ms.is_multiple_of(TOGGLES_EVERY_MS) {
            inputs ^= 1;
            toggled += 1;
        }
        // Another input, twice in each second, also in milliseconds of the one that chatters.
        let others = 1 << (1 + at_ms / 1000 % 31);
        if [340, 343, 720, 721].contains(&(at_ms % 1000)) {
            inputs ^= others;
            expected.push((at_ms, others, inputs & others));
        }
        bench.contacts(inputs);
        if at_ms.is_multiple_of(100_000) {
            reader.read_new(&mut bench);
        }
    }
    bench.pass_ms(2_000);
    reader.read_new(&mut bench);
    let of_input_1 = reader.entries.iter().filter(|entry| entry.changed.0 & 1 == 1).count();
    // It came to rest as it was recorded last.
    assert_eq!((of_input_1, toggled), (4, HOUR_MS / TOGGLES_EVERY_MS));
    assert_eq!(left_out(&mut bench, 1), toggled - 4);
    let seen: Vec<_> = reader
        .entries
        .iter()
        .filter(|entry| entry.changed.0 & !1 != 0)
        .map(|entry| {
            let others = entry.changed.0 & !1;
            (since_ten_ms(entry.time), others, entry.state.0 & others)
        })
        .collect();
    assert!(seen == expected, "{} of {}", seen.len(), expected.len());
    for input in 2..=32 {
        assert_eq!(left_out(&mut bench, input), 0, "input {input}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// At every setting that the recorder takes, and in whichever seconds the changes are.
    #[test]
    fn an_input_with_four_changes_in_any_second_is_never_taken_for_chatter(
        window_ms in 1..=MAX_CHATTER_WINDOW_MS,
        changes in 1..=MAX_CHATTER_CHANGES,
        rearm_ms: u16,
        gaps in prop::collection::vec(prop_oneof![3 => 1..4_u32, 1 => 1..1500_u32], 1..60),
    ) {
        let changes = NonZeroU8::new(changes).unwrap();
        let chatter = Some(ChatterFilter { changes, window_ms, rearm_ms });
        let filter = InputFilter { debounce_ms: 0, chatter };
        prop_assume!(filter.check().is_ok());
        let mut bench = Bench::new(Model::Ser160);
        set(&mut bench, 7, filter);
        let mut moments: Vec<u32> = Vec::new();
        for gap_ms in gaps {
            let after = moments.last().map_or(0, |last| last + gap_ms);
            // The fifth change comes a second after the first of them, or later.
            let four_before = moments.len().checked_sub(4).and_then(|place| moments.get(place));
            moments.push(after.max(four_before.map_or(0, |first| first + 1000)));
        }
        let began_ms = bench.tick_ms + 1;
        for &at_ms in &moments {
            let pause_ms = (began_ms + at_ms).checked_sub(bench.tick_ms + 1).unwrap();
            bench.pass_ms(pause_ms);
            bench.contacts(bench.inputs ^ 1 << 6);
        }
        prop_assert_eq!(usize::from(bench.read(1, 0).total), moments.len());
        prop_assert_eq!(left_out(&mut bench, 7), 0);
    }

    /// Entries and count of an input that bounces and chatters, by a plain model of both filters.
    #[test]
    fn debounce_and_chatter_of_one_input_are_what_a_plain_model_of_both_makes_of_it(
        debounce_ms in prop_oneof![Just(0_u8), 1..30_u8],
        window_ms in 1..=1000_u16,
        changes in 5..12_u8,
        more_ms in 0..300_u16,
        runs in prop::collection::vec(prop_oneof![4 => 1..40_u32, 1 => 1..1500_u32], 1..80),
        others in prop::collection::vec(1..400_u32, 0..20),
    ) {
        let chatter = ChatterFilter {
            changes: NonZeroU8::new(changes).unwrap(),
            window_ms,
            rearm_ms: window_ms + more_ms,
        };
        let mut bench = Bench::new(Model::Ser160);
        set(&mut bench, 1, InputFilter { debounce_ms, chatter: Some(chatter) });
        bench.ask(&Command::SetClock(TEN_O_CLOCK));
        bench.pass_ms(5);
        let began_ms = bench.tick_ms - 5;
        // Input 1 is toggled after each run, and input 2 by itself.
        let toggles = |runs: &[u32]| {
            runs.iter().scan(5, |at, run| { *at += run; Some(*at) }).collect::<Vec<u32>>()
        };
        let (first, second) = (toggles(&runs), toggles(&others));
        let end_ms = first.iter().chain(&second).max().unwrap() + 4000;
        for at_ms in 6..=end_ms {
            let toggled = u32::from(first.contains(&at_ms)) | u32::from(second.contains(&at_ms)) << 1;
            bench.contacts(bench.inputs ^ toggled);
        }
        let mut reader = Reader::default();
        reader.read_new(&mut bench);
        let of = |bit: u32| {
            let entries = reader.entries.iter().filter(move |entry| entry.changed.0 & bit != 0);
            entries.map(|entry| since_ten_ms(entry.time)).collect::<Vec<_>>()
        };
        prop_assert_eq!(bench.tick_ms - began_ms, end_ms);
        let (shown, suppressed) = plain(debounce_ms, chatter, &first, end_ms);
        prop_assert_eq!(of(1), shown);
        prop_assert_eq!(left_out(&mut bench, 1), suppressed);
        prop_assert_eq!(of(2), second, "the other input loses nothing");
    }
}

/// When the log shows a change of an input that was toggled at these times, and how many changes
/// were left out.
fn plain(debounce_ms: u8, filter: ChatterFilter, toggled: &[u32], end_ms: u32) -> (Vec<u32>, u32) {
    // What counts has held for long enough: there and back again counts for nothing.
    let mut counts: Vec<u32> = Vec::new();
    let (mut on, mut accepted) = (false, false);
    for (place, &at_ms) in toggled.iter().enumerate() {
        on = !on;
        let until_ms = toggled.get(place + 1).copied().unwrap_or(end_ms);
        if on != accepted && until_ms - at_ms > debounce_ms.into() {
            accepted = on;
            counts.push(at_ms);
        }
    }
    let (mut shown, mut left_out) = (Vec::new(), 0);
    let (mut is_on, mut shows_on) = (false, false);
    let mut window: Option<(u32, u32)> = None;
    // When an input that chatters changed last.
    let mut chatters: Option<u32> = None;
    let rearm_ms = u32::from(filter.rearm_ms);
    for at_ms in counts.into_iter().map(Some).chain([None]) {
        if let Some(last_ms) = chatters
            && at_ms.is_none_or(|at_ms| at_ms > last_ms + rearm_ms)
        {
            (chatters, window) = (None, None);
            if is_on != shows_on {
                shown.push(last_ms + rearm_ms);
                shows_on = is_on;
            }
        }
        let Some(at_ms) = at_ms else { break };
        is_on = !is_on;
        if chatters.is_none() {
            let goes_on = |&(from_ms, _): &(u32, u32)| at_ms - from_ms < filter.window_ms.into();
            let (from_ms, changes) = window.filter(goes_on).unwrap_or((at_ms, 0));
            window = Some((from_ms, changes + 1));
            if changes + 1 < filter.changes.get().into() {
                shown.push(at_ms);
                shows_on = is_on;
                continue;
            }
        }
        chatters = Some(at_ms);
        left_out += 1;
    }
    (shown, left_out)
}
