//! A RAM full of noise: no panic, no endless poll, and no write outside the host's bytes.

use geni_board::{
    Completion, Configuration, Data, Destination, Event, Options, RequestAnswer, Requests, Start,
    Transmission, TransmitPriority,
};
use proptest::prelude::*;

use crate::board::Board;
use crate::world::{World, configuration};

/// Most accesses in one poll. The longest poll grants a lockout (128 bytes of global data), sees
/// flags and checks devices.
const MAX_ACCESSES: usize = 600;

/// An event between two polls.
#[derive(Clone, Debug)]
enum Noise {
    /// One byte anywhere.
    Byte {
        offset: u16,
        byte: u8,
    },
    /// One byte in a sensitive place.
    Control {
        offset: u16,
        byte: u8,
    },
    /// A run of bytes.
    Run {
        offset: u16,
        len: u16,
        byte: u8,
    },
    /// A datagram with any header.
    Receive {
        source: u8,
        directed: u8,
        len: u8,
    },
    /// A request with any header.
    Request {
        header: [u8; 8],
    },
    /// A request of the host.
    Transmit {
        completion: u8,
    },
    Tables,
    Global {
        byte: u8,
    },
    Configure {
        broadcast_len: u8,
        buffer_len: u8,
    },
    Answer {
        len: usize,
    },
    Interrupt,
    /// Time passes.
    Pause {
        ms: u16,
    },
}

fn noise() -> impl Strategy<Value = Noise> {
    let telling = prop_oneof![any::<u8>(), 0_u8..=8, Just(0x10_u8)];
    prop_oneof![
        2 => (0_u16..0x4000, any::<u8>()).prop_map(|(offset, byte)| Noise::Byte { offset, byte }),
        8 => (0x0880_u16..0x08D2, telling.clone()).prop_map(|(offset, byte)| Noise::Control { offset, byte }),
        2 => (0x0A48_u16..0x0A4A, 0_u8..3).prop_map(|(offset, byte)| Noise::Control { offset, byte }),
        1 => (0_u16..0x4000, 1_u16..4096, telling).prop_map(|(offset, len, byte)| Noise::Run { offset, len, byte }),
        2 => (0_u8..34, 0_u8..3, any::<u8>())
            .prop_map(|(source, directed, len)| Noise::Receive { source, directed, len }),
        2 => any::<[u8; 8]>().prop_map(|header| Noise::Request { header }),
        2 => (0_u8..3).prop_map(|completion| Noise::Transmit { completion }),
        1 => Just(Noise::Tables),
        1 => any::<u8>().prop_map(|byte| Noise::Global { byte }),
        1 => (0_u8..=128, 1_u8..=128)
            .prop_map(|(broadcast_len, buffer_len)| Noise::Configure { broadcast_len, buffer_len }),
        1 => (0_usize..200).prop_map(|len| Noise::Answer { len }),
        1 => Just(Noise::Interrupt),
        2 => (1_u16..3_000).prop_map(|ms| Noise::Pause { ms }),
    ]
}

fn transmission(completion: u8) -> Transmission {
    Transmission {
        destination: Destination::Device(1),
        function: 0x40,
        subfunction: 0x50,
        priority: TransmitPriority::High,
        completion: match completion {
            0 => Completion::Taken,
            1 => Completion::Acknowledged,
            _ => Completion::Reply { subfunction: 0x51 },
        },
        data: Data::from_slice(&[0x5A; 134]).expect("134 bytes"),
    }
}

/// Calls whatever the driver offers.
fn make_use_of(world: &mut World, event: &Event) {
    let mut bytes = [0; 256];
    if *event == Event::TablesLocked {
        let mut tables = world.driver.tables().expect("locked");
        for number in 0..=255 {
            let _ = tables.inputs(number, &mut bytes);
            let _ = tables.set_outputs(number, &bytes[..usize::from(number) % 130]);
        }
        let _ = tables.directed_inputs(&mut bytes);
    }
    for number in 0..=33 {
        let _ = world.driver.input_byte(number);
        let _ = world.driver.set_output_byte(number, 1);
        let _ = world.driver.enable_outputs(number, true);
    }
}

fn apply(world: &mut World, noise: &Noise) {
    match *noise {
        Noise::Byte { offset, byte } | Noise::Control { offset, byte } => {
            world.board().ram[usize::from(offset)] = byte;
        }
        Noise::Run { offset, len, byte } => {
            let start = usize::from(offset);
            let end = (start + usize::from(len)).min(geni_board::RAM_LEN);
            world.board().ram[start..end].fill(byte);
        }
        Noise::Receive { source, directed, len } => {
            world.board().receive(source, directed, &[len; 134]);
            if let Some(incoming) = world.board().receive_queue.back_mut() {
                incoming.len = len;
            }
        }
        Noise::Request { mut header } => {
            header[2] &= 0x9F;
            world.board().request(&header);
        }
        Noise::Transmit { completion } => {
            let _ = world.driver.transmit(transmission(completion));
        }
        Noise::Tables => world.driver.request_tables(),
        Noise::Global { byte } => {
            let _ = world.driver.set_global_data(&[byte; 128]);
        }
        Noise::Configure { broadcast_len, buffer_len } => {
            world.driver.configure(configuration(broadcast_len, 0, buffer_len));
        }
        Noise::Answer { len } => {
            let _ = world.driver.answer_request(RequestAnswer::Data(&[0; 200][..len]));
        }
        Noise::Interrupt => {
            let now_ms = world.now_ms;
            world.driver.interrupt(now_ms);
        }
        Noise::Pause { ms } => world.pace_ms = ms.into(),
    }
}

fn options(start: Start, requests: Requests, reset_line: bool) -> Options {
    Options { start, requests, reset_line, ..Options::new(configuration(128, 128, 128)) }
}

/// One poll, with its accesses checked.
fn watched_step(world: &mut World) -> Option<Event> {
    world.now_ms = world.now_ms.wrapping_add(world.pace_ms);
    world.board().accesses = 0;
    // The board works with whatever the noise has left.
    world.board.borrow_mut().step(world.now_ms, world.driver.reset_held());
    let event = world.driver.poll(world.now_ms);
    assert!(
        world.board().accesses <= MAX_ACCESSES,
        "{} accesses in one poll",
        world.board().accesses
    );
    world.pace_ms = 1;
    event
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    #[test]
    fn noise_does_no_harm(
        script in prop::collection::vec((noise(), 1_usize..40), 1..150),
        start in prop_oneof![Just(Start::Running), Just(Start::Released)],
        requests in prop_oneof![Just(Requests::Refuse), Just(Requests::Ask)],
        reset_line: bool,
        responds: bool,
    ) {
        let mut board = Board::running(0);
        board.checks_handshakes = false;
        board.misbehaviour.stalls = !responds;
        let mut world = World::new(board, options(start, requests, reset_line));
        for (noise, polls) in script {
            apply(&mut world, &noise);
            for _ in 0..polls {
                // The heart usually goes on beating, so that the noise gets far into the driver.
                if world.now_ms.is_multiple_of(3) {
                    world.board().ram[0x0893] = 1;
                    if !responds {
                        // The noise is the only answer there is.
                        world.board().ram[0x08C2] = 4;
                    }
                }
                if let Some(event) = watched_step(&mut world) {
                    make_use_of(&mut world, &event);
                }
            }
        }
    }

    /// A board that does its work overcomes noise in its tables: in the end there is traffic.
    #[test]
    fn a_board_that_calms_down_is_brought_back(
        script in prop::collection::vec(noise(), 1..60),
        requests in prop_oneof![Just(Requests::Refuse), Just(Requests::Ask)],
    ) {
        let mut board = Board::running(0);
        board.checks_handshakes = false;
        let mut world = World::new(board, options(Start::Running, requests, true));
        for noise in script {
            apply(&mut world, &noise);
            world.pace_ms = 1;
            for _ in 0..20 {
                if let Some(event) = world.step() {
                    make_use_of(&mut world, &event);
                }
            }
        }
        // Whatever is broken now is repaired or detected within half a minute.
        world.run(30_000);
        let mut waited_ms = 0;
        while !world.driver.can_transmit() {
            world.run(100);
            waited_ms += 100;
            prop_assert!(waited_ms < 200_000, "{:?}", world.driver);
        }
        world.driver.transmit(transmission(1)).expect("can transmit");
        let (_, events) = world.until(10_000, |event| matches!(event, Event::Sent(_)));
        prop_assert_eq!(events.last(), Some(&Event::Sent(Ok(()))));
    }
}

#[test]
fn a_ram_that_is_not_there_is_a_failed_board() {
    for byte in [0x00, 0xFF, 0x01] {
        let mut board = Board::running(0);
        board.checks_handshakes = false;
        board.ram.fill(byte);
        let mut world = World::new(
            board,
            Options { start: Start::Released, ..Options::new(Configuration::DEFAULT) },
        );
        let mut failed = false;
        for _ in 0..60_000 {
            world.board().ram.fill(byte);
            failed |= matches!(watched_step(&mut world), Some(Event::Failed(_)));
            assert!(!world.driver.is_ready());
        }
        assert!(failed, "{byte:02X}h");
    }
}
