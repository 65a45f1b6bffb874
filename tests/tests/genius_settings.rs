//! A bus and a line together set a recorder's clock and mode as fast as they can, while debounce
//! holds changes back. What was in force when a contact moved decides about the change.

use geni_board::{Completion, Data, Destination, Transmission, TransmitPriority};
use ser_node::Debounce;
use ser_proto::genius::{FUNCTION_HORNER, SUBFUNCTION_SER};
use ser_proto::{Command, Model, TimeStamp};
use ser_trial::genius_world::World;

const UNIT: u8 = 5;

/// The longest debounce time. Settings have to be remembered for that long.
const DEBOUNCE_MS: u8 = 255;

/// The time between clock settings on the line. It is shorter than a setting takes at the line's
/// highest rate, so a real line sets the clock less often.
const LINE_PERIOD_MS: u64 = 5;

/// Each input moves once, one after the other.
const MOVES: u8 = 32;
const MOVE_PERIOD_MS: u64 = 8;

/// What is set, and when.
#[derive(Clone, Copy, Debug)]
struct Set {
    at_ms: u64,
    command: Command,
}

/// A command that says which one it is: the hour is that of the port.
fn numbered(hour: u8, number: u64) -> Command {
    let part = |unit, of| u8::try_from(number / unit % of).expect("small");
    let (minute, second) = (part(60, 60), part(1, 60));
    Command::SetClock(TimeStamp {
        year: 26,
        month: 11,
        day: 22,
        hour,
        minute,
        second,
        millisecond: 0,
    })
}

/// A recorder whose clock both ports set all the time.
struct Plant {
    world: World,
    sent: Vec<Command>,
    /// How many datagrams the recorder had already read.
    read_before: u64,
    set: Vec<Set>,
}

impl Plant {
    fn new() -> Plant {
        let debounce = Debounce::uniform(DEBOUNCE_MS);
        let world = World::started_with(&[(UNIT, Model::Ser320)], debounce);
        let read_before = Plant::read(&world).map_or(0, |(number, _)| number);
        Plant { world, sent: Vec::new(), read_before, set: Vec::new() }
    }

    /// The number of the datagram that the recorder's board handed over last, and when it came.
    fn read(world: &World) -> Option<(u64, u64)> {
        let bus = world.bus.borrow();
        bus.get(world.recorders[0].board).latest_read().map(|read| (read.number, read.arrived_us))
    }

    fn step(&mut self) {
        let Plant { world, sent, read_before, set } = self;
        if world.host.driver.can_transmit() {
            let command = numbered(1, sent.len() as u64);
            let data = Data::from_slice(&command.to_body()).expect("short");
            // The host sends in every turn, which is as fast as a bus can.
            let transmission = Transmission {
                destination: Destination::Broadcast,
                function: FUNCTION_HORNER,
                subfunction: SUBFUNCTION_SER,
                priority: TransmitPriority::High,
                completion: Completion::Taken,
                data,
            };
            world.host.driver.transmit(transmission).expect("the board takes it");
            sent.push(command);
        }
        world.step();
        // They are read in the order in which they were sent, at most one in a millisecond.
        if let Some((number, arrived_us)) = Plant::read(world)
            && let Some(index) = number.checked_sub(*read_before + 1)
        {
            let index = usize::try_from(index).expect("few");
            let already = set
                .iter()
                .filter(|set| matches!(set.command, Command::SetClock(time) if time.hour == 1));
            if already.count() == index {
                // Without an interrupt line the datagram counts from the next look, and there is
                // one in every millisecond.
                set.push(Set { at_ms: arrived_us.div_ceil(1000), command: sent[index] });
            }
        }
        if world.now_ms.is_multiple_of(LINE_PERIOD_MS) {
            let command = numbered(2, set.len() as u64);
            world.recorders[0].serial_send(&command);
            let _ = world.recorders[0].serial_said();
            set.push(Set { at_ms: world.now_ms, command });
        }
    }

    /// The clocks that may be in force in a millisecond: that of the latest setting before it, or
    /// one of several.
    fn in_force(&self, at_ms: u64) -> Vec<(u64, TimeStamp)> {
        let latest = self.set.iter().map(|set| set.at_ms).filter(|&set_ms| set_ms < at_ms).max();
        let of = |set: &Set| match set.command {
            Command::SetClock(time) if Some(set.at_ms) == latest => Some((set.at_ms, time)),
            _ => None,
        };
        self.set.iter().filter_map(of).collect()
    }
}

fn milliseconds(time: TimeStamp) -> u64 {
    ((u64::from(time.hour) * 60 + u64::from(time.minute)) * 60 + u64::from(time.second)) * 1000
        + u64::from(time.millisecond)
}

#[test]
fn every_setting_that_a_bus_and_a_line_bring_decides_about_the_changes_of_its_time() {
    let mut plant = Plant::new();
    for _ in 0..300 {
        plant.step();
    }
    let began_ms = plant.world.now_ms;
    let mut moved_ms = Vec::new();
    for input in 1..=MOVES {
        plant.world.recorders[0].contact(input, true);
        moved_ms.push(plant.world.now_ms + 1);
        for _ in 0..MOVE_PERIOD_MS {
            plant.step();
        }
    }
    for _ in 0..2 * u64::from(DEBOUNCE_MS) {
        plant.step();
    }
    let (_, entries) = plant.world.recorders[0].node.log();
    assert_eq!(entries.len(), usize::from(MOVES));
    for (entry, &at_ms) in entries.iter().zip(&moved_ms) {
        let shown: Vec<u64> = plant
            .in_force(at_ms)
            .into_iter()
            .map(|(set_ms, time)| milliseconds(time) + (at_ms - set_ms))
            .collect();
        assert!(
            shown.contains(&milliseconds(entry.time)),
            "moved at {at_ms}: {}, not {shown:?}",
            entry.time
        );
    }
    // Both ports have had their part, and there were more settings than a line alone can bring.
    let window = began_ms..began_ms + u64::from(DEBOUNCE_MS);
    let within = |hour| {
        let of = |set: &&Set| matches!(set.command, Command::SetClock(time) if time.hour == hour);
        plant.set.iter().filter(of).filter(|set| window.contains(&set.at_ms)).count()
    };
    println!(
        "{} settings over the bus and {} over the line in {DEBOUNCE_MS} ms",
        within(1),
        within(2)
    );
    assert!(within(1) >= 50 && within(2) >= 50, "{} and {}", within(1), within(2));
    plant.world.assert_lawful();
}
