//! A recorder that passes over quiet stretches behaves like one that lives through every
//! millisecond of them.

use chrono::NaiveDate;
use proptest::prelude::*;
use ser_node::{Debounce, Diagnostics};
use ser_proto::{AutoReport, Baud, Command, Configure, FrameEncoder, Model, TimeStamp};
use ser_sim::{LineRate, NonVolatile, Ram, Scenario, SimNode, SimNodeOptions, SimRtc, Step};

/// Something that happens to a recorder before some time passes.
#[derive(Clone, Debug)]
enum Deed {
    /// Contacts move, each after this many milliseconds.
    Contacts(Vec<(u64, u8, bool)>),
    /// Bytes arrive: a frame, or its beginning.
    Say(Command, bool),
    /// Somebody takes what the node has said.
    Listen,
    /// The main loop is held up for this many milliseconds.
    HoldUp(u64),
    GrowOlder(u64),
}

fn time() -> impl Strategy<Value = TimeStamp> {
    (1..=12_u8, 1..=28_u8, 0..24_u8, 0..1000_u16).prop_map(|(month, day, hour, millisecond)| {
        TimeStamp { year: 26, month, day, hour, minute: 59, second: 59, millisecond }
    })
}

fn configure() -> impl Strategy<Value = Command> {
    let baud = prop::option::of(prop::sample::select(Baud::ALL.to_vec()));
    let report = prop::sample::select(vec![AutoReport::Off, AutoReport::Rs232]);
    (prop::option::of(1..=2048_u16), baud, report, any::<bool>()).prop_map(
        |(size, baud, auto_report, auto_print)| {
            Command::Configure(Configure { size, baud, auto_report, report_address: 0, auto_print })
        },
    )
}

fn command() -> impl Strategy<Value = Command> {
    prop_oneof![
        4 => configure(),
        2 => (1..2048_u16, 0..=10_u8).prop_map(|(start, count)| Command::Read { start, count }),
        1 => (1..20_u16, 0..=30_u16).prop_map(|(start, count)| Command::Print { start, count }),
        1 => time().prop_map(Command::SetClock),
        1 => any::<bool>().prop_map(|recording| Command::SetMode { recording }),
        1 => Just(Command::Erase),
    ]
}

fn deed() -> impl Strategy<Value = Deed> {
    let step = (0..700_u64, 1..=16_u8, any::<bool>());
    prop_oneof![
        4 => prop::collection::vec(step, 1..40).prop_map(Deed::Contacts),
        3 => (command(), prop::bool::weighted(0.9)).prop_map(|(command, whole)| Deed::Say(command, whole)),
        3 => Just(Deed::Listen),
        1 => (1..600_u64).prop_map(Deed::HoldUp),
        1 => (0..5_000_000_000_u64).prop_map(Deed::GrowOlder),
    ]
}

/// Milliseconds from one deed to the next. Often they are few, so that deeds overlap, and sometimes
/// a minute.
fn pause() -> impl Strategy<Value = u64> {
    prop_oneof![3 => 0..20_u64, 3 => 0..2_000_u64, 1 => 0..60_000_u64]
}

type Advance = fn(&mut SimNode<'_>, u64);

/// All that can be seen of a recorder from outside, at every deed and at the end.
fn life(
    options: &SimNodeOptions,
    deeds: &[(u64, Deed)],
    advance: Advance,
) -> Vec<(u64, Vec<u8>, Baud, Diagnostics)> {
    let mut ram = Ram::new();
    let rtc = NaiveDate::from_ymd_opt(2026, 12, 31).unwrap().and_hms_opt(23, 59, 58).unwrap();
    let non_volatile = NonVolatile { rtc: SimRtc::held_at(rtc), ..NonVolatile::new() };
    let mut node = SimNode::new(SimNodeOptions { non_volatile, ..options.clone() }, &mut ram);
    let mut seen = Vec::new();
    // At the end everything that is still on its way comes out.
    let ending = (0..15).map(|_| (60_000, Deed::Listen));
    for (pause_ms, deed) in deeds.iter().cloned().chain(ending) {
        let until_ms = node.now_ms() + pause_ms;
        advance(&mut node, until_ms);
        match deed {
            Deed::Contacts(steps) => {
                let steps = steps.iter().map(|&(at_ms, input, on)| Step { at_ms, input, on });
                node.play(&Scenario::from_steps(steps));
            }
            Deed::Say(command, whole) => {
                let mut bytes: Vec<u8> = FrameEncoder::new(command.to_body()).collect();
                bytes.truncate(if whole { bytes.len() } else { bytes.len() / 2 });
                node.receive(&bytes);
            }
            Deed::Listen => {
                let count = node.output().len();
                seen.push((node.now_ms(), node.output().to_vec(), node.baud(), node.diagnostics()));
                node.taken(count);
            }
            Deed::HoldUp(ms) => node.hold_up_to(until_ms + ms),
            Deed::GrowOlder(ms) => node.grow_older(ms),
        }
    }
    seen
}

// These are functions, because the methods themselves are not general enough over the node's
// lifetime.
fn live_through(node: &mut SimNode<'_>, ms: u64) {
    node.advance_to(ms);
}

fn leap(node: &mut SimNode<'_>, ms: u64) {
    node.leap_to(ms);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn leaping_over_quiet_stretches_changes_nothing(
        deeds in prop::collection::vec((pause(), deed()), 1..40),
        debounce in prop_oneof![Just(0), 1..10_u8, any::<u8>()],
        other_debounce: u8,
        line_rate in prop::sample::select(vec![LineRate::Real, LineRate::Unlimited]),
    ) {
        let debounce = Debounce::uniform(debounce).with(3, other_debounce);
        let options = SimNodeOptions { debounce, line_rate, ..SimNodeOptions::new(Model::Ser160) };
        let lived = life(&options, &deeds, live_through);
        let leapt = life(&options, &deeds, leap);
        prop_assert_eq!(lived, leapt);
    }
}

#[test]
fn a_leap_ends_where_a_contact_moves() {
    let mut ram = Ram::new();
    let mut node = SimNode::new(SimNodeOptions::new(Model::Ser160), &mut ram);
    node.play(&Scenario::from_steps([Step { at_ms: 86_400_000, input: 1, on: true }]));
    let moves_ms = node.next_move_ms().unwrap();
    node.leap_to(10 * 86_400_000);
    let played = node.take_played();
    assert_eq!(played.len(), 1);
    assert_eq!(
        (played[0].tick_before, u64::from(played[0].tick_after)),
        (node.tick_at(moves_ms), moves_ms)
    );
    assert_eq!((node.now_ms(), node.diagnostics().samples_missed), (864_000_000, 0));
}
