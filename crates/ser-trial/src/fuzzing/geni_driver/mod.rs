//! The GENI driver against a shared RAM that nobody controls, and then against a board that works.

mod bench;
mod ram;
mod recovery;

use geni_board::{
    AnswerError, Completion, Configuration, Data, Destination, Interrupts, Options, RequestAnswer,
    RequestStatus, Requests, Start, Transmission, TransmitPriority,
};

use super::script::Script;
use bench::Bench;
use ram::Puppet;

/// How many milliseconds the hostility lasts at most.
const MAX_POLLS: u32 = 4_000;

/// `data` says how the driver is set up, what changes in the RAM between two accesses and between
/// two polls, what the host wants, and how time passes.
///
/// - A poll makes a bounded number of accesses, and none while the board must be left alone.
/// - Only what belongs to the host is written, and nothing is read from the reserved area. Lockout
///   is requested and given back only when that is allowed by what the driver has seen.
/// - A board without a heartbeat is not trusted any longer than agreed.
/// - A datagram is handed out either with a tick or without one. The tick is one at which its flag
///   was seen or, where the interrupt line is for datagrams only, at which the line was pulsed.
/// - Counters never go back. Each datagram that was accepted ends once, in the way that was asked
///   for.
/// - When a board that works takes over, the driver is ready within a bounded time, sends, keeps
///   the board's global data up to date, knows when datagrams arrive and breaks no rule of the
///   board.
///
/// # Panics
/// When one of these does not hold.
pub fn geni_driver(data: &[u8]) {
    let mut script = Script::new(data);
    let bits = script.byte();
    let options = options(bits, &mut script);
    let start_ms = u32::from(script.byte()).wrapping_mul(0x0101_0101);
    let warm = script.byte() % 2 == 1 || !options.reset_line;
    let noise = script.run();
    let mut bench = Bench::new(options, start_ms, noise);
    while !script.is_over() && bench.polls() < MAX_POLLS {
        act(&mut bench, &mut script);
        bench.poll();
    }
    // This takes a hundred times as long as all the rest, so the fuzzer may leave it out.
    if bits & 0x40 == 0 {
        recovery::assert_recovers(bench, warm);
    }
}

fn options(bits: u8, script: &mut Script<'_>) -> Options {
    let start = match bits % 4 {
        0 => Start::Running,
        1 => Start::Released,
        _ => Start::Reset { hold_ms: u32::from(bits) },
    };
    let requests = if bits & 0x10 == 0 { Requests::Refuse } else { Requests::Ask };
    let reset_line = bits & 0x20 == 0;
    // Whether the interrupt line, if there is one, is for datagrams only.
    let interrupts = if bits & 0x80 == 0 {
        Interrupts::ALL.without(Interrupts::OUTPUTS_SENT)
    } else {
        Interrupts::RECEIVE_QUEUE
    };
    Options { start, requests, reset_line, interrupts, ..Options::new(configuration(script)) }
}

fn configuration(script: &mut Script<'_>) -> Configuration {
    let lengths = [script.byte(), script.byte(), script.byte()];
    Configuration::new(script.word(), lengths[0], lengths[1], lengths[2])
        .unwrap_or_else(|_| Configuration::new(7, 4, 0, 128).expect("possible lengths"))
}

/// Lets something happen between two polls.
fn act(bench: &mut Bench, script: &mut Script<'_>) {
    let what = script.byte();
    match what % 16 {
        0 => bench.ram().set(script.word(), script.byte()),
        1 => bench.ram().set(0x0880 + u16::from(script.byte() % 0x52), script.byte()),
        2 => bench.ram().set_lockout(script.byte()),
        3 => bench.ram().fill(script.word(), u16::from(script.byte()) * 16, script.byte()),
        4 => bench.ram().put_datagram(script.byte(), script.byte(), script.byte()),
        5 => bench.ram().put_request(script.byte(), script.take(8)),
        6 => bench.ram().noisiness = script.byte(),
        7 => bench.ram().puppet = Puppet::from_byte(script.byte()),
        8 => bench.transmit(transmission(script)),
        9 => bench.driver.request_tables(),
        10 => {
            let len = if script.byte().is_multiple_of(4) {
                script.byte()
            } else {
                bench.wanted.broadcast_len()
            };
            bench.set_global_data(&vec![script.byte(); len.into()]);
        }
        11 => bench.configure(configuration(script)),
        12 => answer(bench, script),
        13 => bench.pulse(u32::from(what / 16)),
        14 => bench.pass(u32::from(script.word() % 4096)),
        _ => {
            for _ in 0..script.byte() {
                bench.poll();
            }
        }
    }
}

fn transmission(script: &mut Script<'_>) -> Transmission {
    let bits = script.byte();
    Transmission {
        destination: match bits % 8 {
            0 => Destination::Broadcast,
            _ => Destination::Device(script.byte() % 40),
        },
        function: script.byte() % 128,
        subfunction: script.byte(),
        priority: if bits & 0x20 == 0 { TransmitPriority::Normal } else { TransmitPriority::High },
        completion: match bits >> 6 {
            0 => Completion::Taken,
            1 => Completion::Acknowledged,
            _ => Completion::Reply { subfunction: bits },
        },
        data: Data::from_slice(&vec![bits; usize::from(script.byte() % 135)])
            .expect("134 bytes fit"),
    }
}

/// Answers with data of a length that may be right, or with one of the other answers.
fn answer(bench: &mut Bench, script: &mut Script<'_>) {
    let (kind, len) = (script.byte(), script.byte());
    let data = vec![kind; len.into()];
    let answered = bench.driver.answer_request(match kind % 4 {
        0 => RequestAnswer::Status(RequestStatus::Busy),
        1 => RequestAnswer::Status(RequestStatus::Checksum),
        _ => RequestAnswer::Data(&data),
    });
    bench.check_writes();
    if let Err(AnswerError::WrongLength { expected }) = answered {
        assert_ne!(expected, len);
        // The request is still waiting, and takes an answer that fits if it has not gone.
        let again = bench.driver.answer_request(RequestAnswer::Data(&vec![0; expected.into()]));
        assert!(matches!(again, Ok(()) | Err(AnswerError::NoRequest)), "{again:?}");
        bench.check_writes();
    }
}
