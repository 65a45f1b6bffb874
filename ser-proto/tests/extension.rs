//! The messages of our extension: what is built comes back, what has grown is still understood, and
//! nothing that is cut off passes for whole.

use core::num::NonZeroU8;

use proptest::prelude::*;
use ser_proto::genius::MAX_SER_DATA;
use ser_proto::{
    Capabilities, ChatterFilter, ClockReading, ClockSource, Code, Command, Counter, Counters,
    Filters, FirmwareVersion, Guard, Identity, InputFilter, MAX_BODY_LEN, MAX_COUNTERS,
    MAX_FILTERS, Mark, Model, ParseError, ReadReply, RecorderId, Reply,
};

fn identity() -> impl Strategy<Value = Identity> {
    let model = prop_oneof![Just(Model::Ser160), Just(Model::Ser320)];
    let firmware = any::<(u8, u8, u8)>();
    let id = prop_oneof![Just([0; 12]), any::<[u8; 12]>()];
    (1..=u8::MAX, model, firmware, any::<u32>(), id, any::<(u32, u32)>(), 1..=2048_u16, any::<u8>())
        .prop_map(
            |(level, model, (major, minor, patch), bits, id, (power_ups, life), size, guard)| {
                Identity {
                    level,
                    model,
                    firmware: FirmwareVersion { major, minor, patch },
                    capabilities: Capabilities(bits),
                    id: RecorderId::new(id),
                    power_ups,
                    life,
                    log_capacity: size,
                    guard: Guard::from_code(guard),
                }
            },
        )
}

fn reading() -> impl Strategy<Value = ClockReading> {
    let doubt = prop::option::of(0..u32::MAX);
    let drift = prop::option::of(i32::MIN + 1..=i32::MAX);
    let mark = (any::<u16>(), i64::MIN + 1..=i64::MAX)
        .prop_map(|(token, clock_us)| Mark { token, clock_us });
    let counts = (any::<u64>(), any::<u32>(), any::<u64>());
    (any::<(u16, i64, u8, u32)>(), doubt, drift, counts, prop::option::of(mark)).prop_map(
        |((token, clock_us, source, age_s), doubt_us, drift_ppb, counts, last_mark)| {
            let (tick_us, life, next_sequence) = counts;
            ClockReading {
                token,
                clock_us,
                source: ClockSource::from_code(source),
                age_s,
                doubt_us,
                drift_ppb,
                tick_us,
                life,
                next_sequence,
                last_mark,
            }
        },
    )
}

/// Any filter, whether or not it can be set.
fn filter() -> impl Strategy<Value = InputFilter> {
    let chatter = (1..=u8::MAX, any::<u16>(), any::<u16>()).prop_map(|(changes, window, rearm)| {
        let changes = NonZeroU8::new(changes).unwrap();
        ChatterFilter { changes, window_ms: window, rearm_ms: rearm }
    });
    (any::<u8>(), prop::option::of(chatter))
        .prop_map(|(debounce_ms, chatter)| InputFilter { debounce_ms, chatter })
}

/// A filter that can be set.
fn valid_filter() -> impl Strategy<Value = InputFilter> {
    let chatter = (1..=7000_u16)
        .prop_flat_map(|window| {
            let least = u8::try_from(4 * window.div_ceil(1000) + 1).unwrap();
            (Just(window), least..=32, window..=u16::MAX)
        })
        .prop_map(|(window_ms, changes, rearm_ms)| ChatterFilter {
            changes: NonZeroU8::new(changes).unwrap(),
            window_ms,
            rearm_ms,
        });
    (any::<u8>(), prop::option::of(chatter))
        .prop_map(|(debounce_ms, chatter)| InputFilter { debounce_ms, chatter })
}

fn filters() -> impl Strategy<Value = Filters> {
    (1..=32_u8, prop::collection::vec(filter(), 0..=MAX_FILTERS)).prop_map(|(first, filters)| {
        let inputs = usize::from(33 - first);
        Filters {
            first: NonZeroU8::new(first).unwrap(),
            filters: filters.into_iter().take(inputs).collect(),
        }
    })
}

fn id() -> impl Strategy<Value = NonZeroU8> {
    (1..=u8::MAX).prop_map(|id| NonZeroU8::new(id).unwrap())
}

fn counters() -> impl Strategy<Value = Counters> {
    (id(), any::<u8>(), prop::collection::vec(any::<u32>(), 0..=MAX_COUNTERS)).prop_map(
        |(first, beyond, values)| {
            let room = 256 - usize::from(first.get());
            let values: Vec<_> = values.into_iter().take(room).collect();
            let behind = u32::from(first.get()) + u32::try_from(values.len().max(1)).unwrap();
            let next = u8::try_from(behind + u32::from(beyond)).ok().and_then(NonZeroU8::new);
            Counters {
                first: Counter::from_id(first),
                next: next.map(Counter::from_id),
                values: values.into_iter().collect(),
            }
        },
    )
}

fn reply() -> impl Strategy<Value = Reply> {
    prop_oneof![
        identity().prop_map(Reply::Identity),
        reading().prop_map(Reply::Time),
        filters().prop_map(Reply::Filters),
        counters().prop_map(Reply::Diagnostics),
    ]
}

fn command() -> impl Strategy<Value = Command> {
    let input = prop::option::of((1..=32_u8).prop_map(|input| NonZeroU8::new(input).unwrap()));
    prop_oneof![
        Just(Command::Identify),
        any::<u16>().prop_map(|token| Command::Time { token }),
        id().prop_map(|first| Command::QueryFilters { first }),
        (input, valid_filter()).prop_map(|(input, filter)| Command::SetFilter { input, filter }),
        id().prop_map(|id| Command::Diagnostics { first: Counter::from_id(id) }),
    ]
}

proptest! {
    #[test]
    fn a_command_comes_back_as_it_was(command in command()) {
        let body = command.to_body();
        prop_assert!(body.len() <= 8);
        prop_assert_eq!(Command::parse(&body), Ok(command));
    }

    #[test]
    fn a_reply_comes_back_as_it_was_also_with_more_behind_it(
        reply in reply(),
        more in prop::collection::vec(any::<u8>(), 0..100),
    ) {
        let mut body = reply.to_body().to_vec();
        prop_assert!(body.len() <= MAX_SER_DATA);
        prop_assert_eq!(Reply::parse(&body), Ok(reply.clone()));
        body.extend(more);
        prop_assert!(body.len() <= MAX_BODY_LEN);
        prop_assert_eq!(Reply::parse(&body), Ok(reply));
    }

    #[test]
    fn a_reply_cut_off_anywhere_is_too_short_and_says_where(reply in reply()) {
        let body = reply.to_body();
        for length in 1..body.len() {
            match Reply::parse(&body[..length]) {
                Err(ParseError::TooShort { code, offset, length: found }) => {
                    prop_assert_eq!((code, found), (body[0], length));
                    // The field that is cut off is 12 bytes long at most.
                    prop_assert!((1..=length).contains(&offset.into()));
                    prop_assert!(length - usize::from(offset) < 12);
                }
                other => prop_assert!(false, "{:?} of {} bytes", other, length),
            }
        }
    }

    #[test]
    fn whatever_arrives_is_refused_or_means_the_same_when_it_is_sent_again(
        code in prop::sample::select(b"ITFD".to_vec()),
        small in prop::collection::vec(0..40_u8, 0..4),
        any in prop::collection::vec(any::<u8>(), 0..252),
    ) {
        let body = [&[code][..], &small, &any].concat();
        for length in [body.len(), body.len().min(8), body.len().min(2)] {
            let body = &body[..length];
            if let Ok(command) = Command::parse(body) {
                prop_assert_eq!(Command::parse(&command.to_body()), Ok(command));
                prop_assert_eq!(command.code().byte(), code);
            }
            if let Ok(reply) = Reply::parse(body) {
                prop_assert!(reply.to_body().len() <= length);
                prop_assert_eq!(Reply::parse(&reply.to_body()), Ok(reply.clone()));
                prop_assert_eq!(reply.code().byte(), code);
            }
        }
    }

    #[test]
    fn a_filter_that_can_be_set_is_never_refused_and_one_that_cannot_never_gets_through(
        filter in filter(),
        valid in valid_filter(),
    ) {
        prop_assert_eq!(valid.check(), Ok(()));
        let body = Command::SetFilter { input: None, filter }.to_body();
        prop_assert_eq!(Command::parse(&body).is_ok(), filter.check().is_ok());
    }
}

#[test]
fn a_full_page_fits_a_datagram_and_the_inputs_of_each_model_are_one_page_or_two() {
    assert_eq!((MAX_FILTERS, MAX_COUNTERS), (20, 31));
    let first = NonZeroU8::MIN;
    let filters = core::iter::repeat_n(InputFilter::OFF, MAX_FILTERS).collect();
    assert_eq!(Reply::Filters(Filters { first, filters }).to_body().len(), 123);
    let values = core::iter::repeat_n(0, MAX_COUNTERS).collect();
    let counters = Counters { first: Counter::FIRST, next: None, values };
    assert_eq!(Reply::Diagnostics(counters).to_body().len(), 128);
}

#[test]
fn a_page_names_its_inputs_and_counters() {
    let first = NonZeroU8::new(31).unwrap();
    let on = InputFilter { debounce_ms: 7, chatter: None };
    let filters = Filters { first, filters: [InputFilter::OFF, on].into() };
    assert_eq!(filters.inputs().collect::<Vec<_>>(), [(31, &InputFilter::OFF), (32, &on)]);
    let first = Counter::from_id(NonZeroU8::new(254).unwrap());
    let counters = Counters { first, next: None, values: [5, 6].into() };
    let seen: Vec<_> =
        counters.counters().map(|(counter, value)| (counter.id().get(), value)).collect();
    assert_eq!(seen, [(254, 5), (255, 6)]);
}

#[test]
fn the_messages_of_the_extension_cost_the_others_no_memory() {
    // A read reply is the largest of the manual's; a recorder has one in its main loop.
    assert_eq!(size_of::<Reply>(), size_of::<ReadReply>());
    assert!(size_of::<Command>() <= 10);
    assert!(size_of::<Result<Command, ParseError>>() <= 2 * size_of::<usize>());
}

#[test]
fn the_four_are_told_from_those_of_the_manual() {
    let ours: Vec<_> = Code::ALL.into_iter().filter(|code| code.is_of_extension()).collect();
    assert_eq!(ours, [Code::Identify, Code::Time, Code::Filters, Code::Diagnostics]);
}
