//! What hosts want from recorders.

use std::num::NonZeroU8;

use ser_proto::{
    AutoReport, Baud, ChatterFilter, Code, Command, Configure, Counter, InputFilter, TimeStamp,
};

use super::chance::Chance;
use super::conversation::Order;

/// Where reports can be sent on the bus: to the host, to a board without a host, and to nobody.
pub const ADDRESSES: [u8; 3] = [31, 20, 29];

/// The way by which orders go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// RS-232: its rate can be changed.
    Line,
    /// To one recorder on the bus.
    Bus,
}

/// What a host asks for next, which is most often the log.
pub fn next_order(chance: &mut Chance, way: Way) -> Order {
    match chance.below(116) {
        0..60 => Order::Read,
        60..67 => set_clock(chance),
        67..77 => Order::Ask(Command::Configure(configure(chance, way))),
        77..80 => Order::Ask(Command::Erase),
        80..82 => Order::Ask(Command::SetMode { recording: false }),
        82..90 => Order::Ask(Command::SetMode { recording: true }),
        90..92 => Order::Ask(print(chance)),
        92..94 => Order::Ask(Command::QueryConfiguration),
        94..96 => Order::Ask(Command::LastBroadcast),
        96..98 => Order::Ask(odd_read(chance)),
        98..100 => Order::Ask(Command::QueryMode),
        100..106 => Order::Ask(time(chance)),
        106..108 => Order::Ask(Command::Identify),
        108..110 => Order::Ask(Command::Diagnostics { first: any_counter(chance) }),
        110..112 => Order::Ask(Command::QueryFilters { first: any_input(chance) }),
        _ => Order::Ask(set_filter(chance)),
    }
}

/// A question for the time, or a mark where it is said to all.
fn time(chance: &mut Chance) -> Command {
    Command::Time { token: u16::from_be_bytes([chance.byte(), chance.byte()]) }
}

fn any_counter(chance: &mut Chance) -> Counter {
    let suppressed = Counter::suppressed(small(chance, 1, 32)).unwrap_or(Counter::FIRST);
    chance.pick(&[Counter::FIRST, Counter::DATAGRAMS_IGNORED, suppressed, suppressed])
}

fn any_input(chance: &mut Chance) -> NonZeroU8 {
    NonZeroU8::new(small(chance, 1, 33)).unwrap_or(NonZeroU8::MIN)
}

/// A filter for an input, or for all: most often one that takes a loose contact for chatter. Not
/// every recorder has the input.
fn set_filter(chance: &mut Chance) -> Command {
    let debounce_ms = if chance.one_in(3) { small(chance, 0, 255) } else { 0 };
    let window_ms = u16::try_from(chance.spread(1..=7000)).unwrap_or(1000);
    let least = 1 + 4 * u64::from(window_ms.div_ceil(1000));
    let changes = NonZeroU8::new(small(chance, least, 32));
    let rearm_ms = u16::try_from(u64::from(window_ms) + chance.below(3_000)).unwrap_or(window_ms);
    let chatter = changes.map(|changes| ChatterFilter { changes, window_ms, rearm_ms });
    let chatter = chatter.filter(|_| !chance.one_in(5));
    let input = NonZeroU8::new(small(chance, 1, 32));
    let input = input.filter(|_| chance.one_in(2));
    Command::SetFilter { input, filter: InputFilter { debounce_ms, chatter } }
}

/// A body that is no command: nothing at all, a command byte that there is not, a command of a wrong
/// length, or one with a value that there is not.
pub fn odd_body(chance: &mut Chance) -> Vec<u8> {
    match chance.below(4) {
        0 => vec![],
        1 => vec![chance.byte() | 0x80; usize::from(small(chance, 1, 12))],
        2 => vec![Code::Erase.byte(), 0, 0, 0],
        _ => vec![Code::Filters.byte(), 0x7F],
    }
}

/// What is said to all recorders.
pub fn next_broadcast(chance: &mut Chance) -> Command {
    match chance.below(14) {
        0..5 => Command::SetClock(valid_time(chance)),
        5 => Command::Erase,
        6 => Command::SetMode { recording: false },
        7..9 => Command::SetMode { recording: true },
        9 => Command::Configure(configure(chance, Way::Bus)),
        10 => set_filter(chance),
        _ => time(chance),
    }
}

fn set_clock(chance: &mut Chance) -> Order {
    if chance.one_in(8) {
        // There is no such day, so the recorder refuses it with silence.
        return Order::Ask(Command::SetClock(TimeStamp {
            month: 2,
            day: 30,
            ..valid_time(chance)
        }));
    }
    Order::SetClock(valid_time(chance))
}

/// A valid time. It is often a few seconds before midnight, a New Year, a leap day or the end of
/// the hundred years.
fn valid_time(chance: &mut Chance) -> TimeStamp {
    let eve = |year, month, day| TimeStamp {
        year,
        month,
        day,
        hour: 23,
        minute: 59,
        second: 50,
        millisecond: 0,
    };
    let time = match chance.below(6) {
        0 => eve(26, 12, 31),
        1 => eve(69, 12, 31),
        2 => eve(28, 2, 28),
        3 => eve(99, 12, 31),
        _ => TimeStamp {
            year: small(chance, 0, 99),
            month: small(chance, 1, 12),
            day: small(chance, 1, 28),
            hour: small(chance, 0, 23),
            minute: small(chance, 0, 59),
            second: small(chance, 0, 49),
            millisecond: 0,
        },
    };
    let millisecond = u16::try_from(chance.below(1000)).unwrap_or(0);
    TimeStamp { second: time.second + small(chance, 0, 9), millisecond, ..time }
}

fn small(chance: &mut Chance, from: u64, to: u64) -> u8 {
    u8::try_from(chance.within(from..=to)).unwrap_or(0)
}

fn configure(chance: &mut Chance, way: Way) -> Configure {
    // The slowest rates take minutes for what others do in seconds, and no plant would choose them.
    let rates =
        [Baud::B300, Baud::B1200, Baud::B2400, Baud::B4800, Baud::B9600, Baud::B9600, Baud::B19200];
    let rate = chance.pick(&rates);
    let size = match chance.below(8) {
        0 => Some(u16::from(small(chance, 1, 40))),
        1 | 2 => Some(u16::try_from(chance.within(41..=2048)).unwrap_or(2048)),
        _ => None,
    };
    Configure {
        size,
        baud: (way == Way::Line && chance.one_in(3) || chance.one_in(40)).then_some(rate),
        auto_report: chance.pick(&[AutoReport::Off, AutoReport::Genius, AutoReport::Rs232]),
        report_address: chance.pick(&ADDRESSES),
        auto_print: chance.one_in(4),
    }
}

fn print(chance: &mut Chance) -> Command {
    let start = u16::try_from(chance.spread(1..=2048)).unwrap_or(1);
    Command::Print { start, count: u16::from(small(chance, 0, 60)) }
}

/// A read outside of the log, or of more entries than there can be.
fn odd_read(chance: &mut Chance) -> Command {
    let start = chance.pick(&[0, 1, 2047, 2048, 2049, u16::MAX]);
    Command::Read { start, count: small(chance, 0, 255) }
}
