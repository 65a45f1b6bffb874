//! One broadcast sets the clocks of recorders that report all the time. Their boards are busy
//! sending when it comes, and hand it over late.

use chrono::NaiveDateTime;
use geni_board::Destination::Broadcast;
use ser_node::HELD_BACK_MS;
use ser_proto::{Code, Command, Entry, Inputs, LastBroadcast, Model, Reply, TimeStamp};
use ser_sim::genius::tick_ms;
use ser_sim::{Scenario, Step};
use ser_trial::genius_world::{Recorder, World};
use ser_trial::simulation::chance::Chance;

/// How far clocks may differ. Recorders here look at their boards at the same moment; real ones can
/// be up to 1 ms apart.
const CLOCKS_AGREE_WITHIN_MS: i64 = 1;

/// An input that toggles all the time, so that every recorder has a report to send whenever it may.
const BUSY: u8 = 1;

/// An input that moves at all recorders at once. Its stamps are compared.
const COMMON: u8 = 2;

/// Milliseconds between two changes of the busy input.
const PERIOD_MS: u64 = 3;

/// The longest that a recorder waits for its place in the scan.
const CARRIED_OUT_WITHIN_MS: u64 = 10_000;

/// Recorders that report all the time.
struct Plant {
    world: World,
    chance: Chance,
    common_on: bool,
    /// When the common contact moved last.
    moved_ms: u64,
}

impl Plant {
    fn new(recorders: u8) -> Plant {
        let units: Vec<(u8, Model)> =
            (1..=recorders).map(|number| (number, Model::Ser160)).collect();
        let mut world = World::started(&units);
        world.report_to_host();
        let chance = Chance::new(recorders.into());
        let mut plant = Plant { world, chance, common_on: false, moved_ms: 0 };
        plant.run(2_000);
        plant
    }

    /// Lets a millisecond pass. The common contact moves at all recorders if `moves` says so.
    fn step(&mut self, moves: bool) {
        let Plant { world, common_on, moved_ms, .. } = self;
        let next_ms = world.now_ms + 1;
        if moves {
            *common_on ^= true;
            *moved_ms = next_ms;
        }
        let busy = next_ms.is_multiple_of(PERIOD_MS).then(|| Step {
            at_ms: 0,
            input: BUSY,
            on: next_ms.is_multiple_of(2 * PERIOD_MS),
        });
        let common = moves.then_some(Step { at_ms: 0, input: COMMON, on: *common_on });
        if busy.or(common).is_some() {
            for recorder in &mut world.recorders {
                recorder.node.play(&Scenario::from_steps(busy.into_iter().chain(common)));
            }
        }
        world.step();
        world.host.inbox.clear();
    }

    fn run(&mut self, ms: u64) {
        for _ in 0..ms {
            self.step(false);
        }
    }

    /// How many broadcasts each recorder has carried out.
    fn carried_out(&self) -> Vec<u32> {
        self.world.recorders.iter().map(|recorder| recorder.port.diagnostics().broadcasts).collect()
    }

    /// Sends one broadcast. The common contact moves this long after the first recorder has carried
    /// it out. Returns how long after the first the last one did so.
    fn broadcast(&mut self, command: &Command, move_after_ms: u64) -> u64 {
        let before = self.carried_out();
        while !self.world.host.driver.can_transmit() {
            self.step(false);
        }
        self.world.send(Broadcast, command);
        let (mut first_ms, mut last_ms) = (None, None);
        for _ in 0..CARRIED_OUT_WITHIN_MS {
            let now_ms = self.world.now_ms;
            let moves = first_ms.is_some_and(|first_ms| first_ms + move_after_ms == now_ms);
            self.step(moves);
            let done =
                self.carried_out().iter().zip(&before).filter(|(now, before)| now > before).count();
            if done > 0 {
                first_ms.get_or_insert(self.world.now_ms);
            }
            if done == before.len() {
                last_ms.get_or_insert(self.world.now_ms);
            }
            if let (Some(first_ms), Some(last_ms)) = (first_ms, last_ms)
                && self.world.now_ms > first_ms + move_after_ms
            {
                // What waited for the broadcast is now recorded.
                self.step(false);
                return last_ms - first_ms;
            }
        }
        panic!(
            "not all of {} have carried out the broadcast: {:?}",
            before.len(),
            self.carried_out()
        );
    }

    /// When each recorder looked at the broadcast that it carried out last, after its board had
    /// received it. Recorders look in every millisecond, and there is no interrupt line here.
    fn seen_ms(&mut self) -> Vec<u64> {
        self.world
            .recorders
            .iter_mut()
            .map(|recorder| recorder.read_arrived_us().div_ceil(1000))
            .collect()
    }

    /// What the clocks show in the millisecond in which the common contact moved last, if a
    /// broadcast has set them to this time.
    fn true_stamps_ms(&mut self, time: TimeStamp) -> Vec<i64> {
        let moved_ms = self.moved_ms;
        let since = |seen_ms| signed(moved_ms) - signed(seen_ms);
        self.seen_ms().into_iter().map(|seen_ms| milliseconds(time) + since(seen_ms)).collect()
    }

    /// The recorders' stamps of their latest event of this kind.
    fn stamps_ms(&self, is: impl Fn(Inputs) -> bool) -> Vec<i64> {
        let stamp = |log: Vec<Entry>| {
            let entry = log.into_iter().rfind(|entry| is(entry.changed)).expect("it is recorded");
            milliseconds(entry.time)
        };
        self.world.recorders.iter().map(|recorder| stamp(recorder.node.log().1)).collect()
    }

    fn any_time(&mut self) -> TimeStamp {
        let mut part = |end| u8::try_from(self.chance.below(end)).expect("small");
        let (day, hour, minute, second) = (1 + part(30), part(24), part(60), part(60));
        let millisecond = u16::try_from(self.chance.below(1000)).expect("small");
        TimeStamp { year: 26, month: 11, day, hour, minute, second, millisecond }
    }

    /// Checks that the boards of all recorders were busy sending when broadcasts came, and handed
    /// these over late.
    fn assert_was_busy(&self, rounds: u32, longest_ms: u64) {
        let sent =
            self.world.recorders.iter().map(|recorder| recorder.port.diagnostics().reports_sent);
        assert!(
            longest_ms > 10,
            "the last recorder is no more than {longest_ms} ms behind the first"
        );
        assert!(sent.clone().all(|sent| sent >= rounds / 4), "{:?}", sent.collect::<Vec<_>>());
        self.world.assert_lawful();
    }
}

/// How far stamps are apart.
fn spread(stamps: &[i64]) -> i64 {
    stamps.iter().max().expect("some") - stamps.iter().min().expect("some")
}

fn milliseconds(time: TimeStamp) -> i64 {
    NaiveDateTime::try_from(time).expect("a date").and_utc().timestamp_millis()
}

fn signed(ms: u64) -> i64 {
    i64::try_from(ms).expect("short")
}

/// What a recorder tells about the broadcast that it heard last.
fn last_broadcasts(plant: &mut Plant) -> Vec<LastBroadcast> {
    let ask = |recorder: &mut Recorder| match recorder.serial_ask(&Command::LastBroadcast) {
        Reply::LastBroadcast(Some(last)) => last,
        other => panic!("{other:?}"),
    };
    plant.world.recorders.iter_mut().map(ask).collect()
}

/// Sets all clocks repeatedly, at any phase of the scan, each time to another time. A contact of
/// all recorders moves up to `soon_ms` later, while the others have not yet carried out the
/// broadcast, and again when all have. Where one recorder takes longer than changes wait for it,
/// only the second move counts.
fn clocks_agree(recorders: u8, rounds: u32, soon_ms: Option<u64>) {
    let mut plant = Plant::new(recorders);
    let (mut widest_ms, mut longest_ms, mut beyond) = (0, 0, 0);
    let moved = |changed: Inputs| changed.contains(COMMON);
    for round in 0..rounds {
        let pause_ms = plant.chance.below(60);
        plant.run(pause_ms);
        let time = plant.any_time();
        let move_after_ms = soon_ms.map_or(0, |soon_ms| plant.chance.below(soon_ms + 1));
        let took_ms = plant.broadcast(&Command::SetClock(time), move_after_ms);
        longest_ms = longest_ms.max(took_ms);
        if soon_ms.is_some() && took_ms <= HELD_BACK_MS {
            let stamps = plant.stamps_ms(moved);
            assert_eq!(
                stamps,
                plant.true_stamps_ms(time),
                "{move_after_ms} ms after it, round {round}"
            );
        }
        beyond += u32::from(took_ms > HELD_BACK_MS);
        // A recorder that has recorded changes too early knows it.
        let late =
            plant.world.recorders.iter().map(|recorder| recorder.node.diagnostics().settings_late);
        assert_eq!(late.sum::<u32>() > 0, beyond > 0, "round {round}, {took_ms} ms");
        plant.step(true);
        let stamps = plant.stamps_ms(moved);
        assert_eq!(stamps, plant.true_stamps_ms(time), "round {round}, set to {time}");
        widest_ms = widest_ms.max(spread(&stamps));
        assert!(widest_ms <= CLOCKS_AGREE_WITHIN_MS, "round {round}, set to {time}: {stamps:?}");
        let told = (Code::SetClock.byte(), time.hour, time.minute, time.second, time.millisecond);
        for last in last_broadcasts(&mut plant) {
            assert_eq!((last.code, last.hour, last.minute, last.second, last.millisecond), told);
        }
    }
    println!(
        "{recorders} recorders, {rounds} rounds: within {widest_ms} ms of each other, though the \
         last carried the \
         broadcast out up to {longest_ms} ms after the first, and in {beyond} rounds later than \
         changes wait for it"
    );
    // In nearly all rounds, changes soon after a broadcast waited for it.
    assert!(soon_ms.is_none() || beyond <= rounds / 100, "{beyond}");
    plant.assert_was_busy(rounds, longest_ms);
}

#[test]
fn one_broadcast_sets_3_recorders_that_report_all_the_time() {
    clocks_agree(3, 1_000, Some(60));
}

#[test]
fn one_broadcast_sets_12_recorders_that_report_all_the_time() {
    clocks_agree(12, 1_000, Some(60));
}

/// The last of so many recorders carries out a broadcast when earlier changes have long been
/// recorded: see `ser_node::HELD_BACK_MS`. What counts is that all agree afterwards.
#[test]
fn one_broadcast_sets_30_recorders_that_report_all_the_time() {
    clocks_agree(30, 1_000, None);
}

/// All inputs of the plant change repeatedly. What is recorded last before recording stops, and
/// first after it starts, is the same everywhere.
#[test]
fn one_broadcast_stops_and_starts_recorders_that_report_all_the_time_in_the_same_millisecond() {
    const ROUNDS: u32 = 300;
    let mut plant = Plant::new(3);
    let time = plant.any_time();
    plant.broadcast(&Command::SetClock(time), 0);
    let set_ms = plant.seen_ms();
    let mut longest_ms = 0;
    for round in 0..ROUNDS {
        let pause_ms = plant.chance.below(60);
        plant.run(pause_ms);
        let recording = round % 2 == 1;
        longest_ms = longest_ms.max(plant.broadcast(&Command::SetMode { recording }, 5));
        let of = if recording { "after the start" } else { "before the stop" };
        let stamps = plant.stamps_ms(|_| true);
        assert_eq!(spread(&stamps), 0, "latest event, round {round}: {stamps:?}");
        if !recording {
            // The sample of the millisecond in which a stop is seen is still recorded.
            let last_ms = plant.seen_ms().into_iter().map(|seen_ms| seen_ms - seen_ms % PERIOD_MS);
            let since =
                last_ms.zip(&set_ms).map(|(last_ms, &set_ms)| signed(last_ms) - signed(set_ms));
            assert_eq!(
                stamps,
                since.map(|ms| milliseconds(time) + ms).collect::<Vec<_>>(),
                "round {round}"
            );
        }
        let counts: Vec<u16> =
            plant.world.recorders.iter().map(|recorder| recorder.node.log().0).collect();
        assert!(counts.iter().all(|count| *count == counts[0]), "{of}, round {round}: {counts:?}");
    }
    plant.assert_was_busy(ROUNDS, longest_ms);
}

/// The main loop of a recorder is held up when a broadcast comes, as while a flash sector is
/// erased.
struct Away {
    /// When the board received the broadcast.
    arrived_ms: i64,
    /// When the main loop first looks at the board after that.
    looks_ms: i64,
    /// What the clock then shows, by the stamp of a contact that moves after the main loop is back.
    shows_ms: i64,
    /// Stamps of contacts that moved while the main loop was held up, relative to what the clock
    /// shows then.
    stamps_off_ms: Vec<i64>,
}

/// Holds up the main loop for a while, with or without the interrupt line.
fn away(has_line: bool) -> Away {
    const AWAY_MS: u64 = 300;
    const MOVES: u8 = 8;
    let mut world = World::started(&[(1, Model::Ser160)]);
    // Earlier interrupts have been dealt with.
    let _ = world.recorders[0].port.window().take_interrupts();
    world.send(Broadcast, &Command::SetClock(TEN_O_CLOCK));
    // Contacts move all the time.
    let began_ms = world.now_ms;
    let steps =
        (0..MOVES).map(|index| Step { at_ms: 35 * u64::from(index), input: 3 + index, on: true });
    world.recorders[0].node.play(&Scenario::from_steps(steps));
    for _ in 0..AWAY_MS {
        world.now_ms += 1;
        world.bus.borrow_mut().advance_to(world.now_ms * 1000);
        world.host.driver.poll(u32::try_from(world.now_ms).expect("small"));
    }
    let Recorder { node, port, board, .. } = &mut world.recorders[0];
    let pulses = port.window().take_interrupts();
    if has_line {
        pulses.iter().for_each(|us| node.interrupt(port, tick_ms(*us)));
    }
    node.hold_up_to(world.now_ms);
    let board = *board;
    world.run(50);
    let read = world.bus.borrow().get(board).latest_read().expect("the broadcast");
    let arrived_ms = signed(tick_ms(read.arrived_us));
    world.recorders[0].contact(COMMON, true);
    world.run(2);
    let moved_ms = signed(world.now_ms) - 1;
    let entries = world.recorders[0].node.log().1;
    let last = entries.last().expect("the contact");
    assert!(last.changed.contains(COMMON), "{last:?}");
    let at_ms = |input: u8| signed(began_ms + 1) + 35 * i64::from(input - 3);
    let after = |entry: &&Entry| {
        let input = entry.changed.numbers().next().expect("one");
        (3..3 + MOVES).contains(&input) && at_ms(input) > arrived_ms
    };
    let off_ms = |entry: &Entry| {
        let input = entry.changed.numbers().next().expect("one");
        milliseconds(entry.time) - milliseconds(TEN_O_CLOCK) - (at_ms(input) - arrived_ms)
    };
    Away {
        arrived_ms,
        looks_ms: signed(began_ms + AWAY_MS + 1),
        shows_ms: milliseconds(last.time) - (moved_ms - arrived_ms),
        stamps_off_ms: entries.iter().filter(after).map(off_ms).collect(),
    }
}

const TEN_O_CLOCK: TimeStamp =
    TimeStamp { year: 26, month: 11, day: 22, hour: 10, minute: 0, second: 0, millisecond: 0 };

#[test]
fn a_main_loop_that_is_away_knows_by_the_interrupt_line_when_a_broadcast_came() {
    let away = away(true);
    assert_eq!(away.shows_ms, milliseconds(TEN_O_CLOCK));
    // What moved after the broadcast has waited for it.
    assert!(away.stamps_off_ms.len() >= 7, "{:?}", away.stamps_off_ms);
    assert!(away.stamps_off_ms.iter().all(|&off_ms| off_ms == 0), "{:?}", away.stamps_off_ms);
}

#[test]
fn without_the_line_a_main_loop_that_is_away_is_late_by_no_more_than_that() {
    let away = away(false);
    let late_ms = milliseconds(TEN_O_CLOCK) - away.shows_ms;
    assert_eq!(late_ms, away.looks_ms - away.arrived_ms);
    assert!(late_ms > 250, "{late_ms} ms: it was away for most of them");
}
