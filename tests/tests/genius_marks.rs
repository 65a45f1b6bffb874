//! Marks on a bus of thirty recorders that report all the time: a broadcast question for the time
//! compares all clocks at one instant. Each recorder keeps what its clock showed then, whenever its
//! board hands the broadcast over, and one that did not get it says nothing of it.

use chrono::{DateTime, Datelike, NaiveDateTime};
use geni_board::Destination::{Broadcast, Device};
use geni_board::{SharedRam, map};
use ser_proto::{ClockReading, ClockSource, Command, Entry, Inputs, Mark, Model, Reply, TimeStamp};
use ser_sim::genius::{Board, DeviceFault, Fault, Noise, Read};
use ser_sim::{Scenario, Step};
use ser_trial::genius_world::{Recorder, World};
use ser_trial::simulation::chance::Chance;

const RECORDERS: u8 = 30;

/// How far what a recorder keeps may be from what its clock showed when its board got the mark:
/// behind by the time since its latest sample where the interrupt line tells, ahead by the time to
/// its next look where it does not.
const WITHIN_US: i64 = 999;

/// How far apart the boards get the same broadcast.
const ONE_INSTANT_US: u64 = 100;

/// An input that toggles all the time, so that every recorder has a report to send whenever it may.
const BUSY: u8 = 1;
const PERIOD_MS: u64 = 3;

/// An input that moves at all recorders at once, to compare a mark with a stamp.
const COMMON: u8 = 2;

/// Which of a board's flags tells of a datagram.
const RECEIVE_QUEUE_FLAG: u16 = 6;

/// The longest that a recorder waits for its place in the scan.
const TAKEN_WITHIN_MS: u64 = 20_000;

/// What the clocks of two neighbours are apart.
const YEAR_US: i64 = 365 * 86_400_000_000;

/// Thirty recorders that report all the time.
struct Plant {
    world: World,
    chance: Chance,
    common_on: bool,
}

impl Plant {
    fn new(noise: Noise) -> Plant {
        let units: Vec<(u8, Model)> =
            (1..=RECORDERS).map(|number| (number, Model::Ser160)).collect();
        let mut world = World::started_with_noise(&units, noise);
        world.report_to_host();
        // Their own looks tell one half of the recorders when a mark came, and the line the other.
        world.recorders.iter_mut().step_by(2).for_each(|recorder| recorder.has_line = true);
        let mut plant = Plant { world, chance: Chance::new(noise.seed), common_on: false };
        plant.run(2_000);
        plant
    }

    fn step(&mut self) {
        let next_ms = self.world.now_ms + 1;
        if next_ms.is_multiple_of(PERIOD_MS) {
            let on = next_ms.is_multiple_of(2 * PERIOD_MS);
            self.everywhere(Step { at_ms: 0, input: BUSY, on });
        }
        self.world.step();
        self.world.host.inbox.clear();
    }

    fn everywhere(&mut self, step: Step) {
        for recorder in &mut self.world.recorders {
            recorder.node.play(&Scenario::from_steps([step]));
        }
    }

    fn run(&mut self, ms: u64) {
        (0..ms).for_each(|_| self.step());
    }

    fn until(&mut self, what: &str, mut is: impl FnMut(&mut World) -> bool) {
        let from_ms = self.world.now_ms;
        while !is(&mut self.world) {
            assert!(self.world.now_ms <= from_ms + TAKEN_WITHIN_MS, "{what} takes too long");
            self.step();
        }
    }

    /// What each board handed over last. The only datagrams for recorders here are marks.
    fn reads(&mut self) -> Vec<Option<Read>> {
        let read = |recorder: &mut Recorder| recorder.port.window().look(Board::latest_read);
        self.world.recorders.iter_mut().map(read).collect()
    }

    /// Broadcasts a mark, and waits until every recorder whose board has got it has taken it.
    /// Returns when each board got it; `None` where it did not. Neither the recorders nor their
    /// ports are asked.
    fn mark(&mut self, token: u16) -> Vec<Option<u64>> {
        let before = self.reads();
        while !self.world.recorders.iter_mut().any(is_unread) {
            self.world.send(Broadcast, &Command::Time { token });
            // On a bad and busy bus the host's board may find no turn. It gives up, and what it
            // has given up may go out a moment later.
            let until_ms = self.world.now_ms + TAKEN_WITHIN_MS;
            self.until("the broadcast", |world| {
                world.now_ms >= until_ms || world.recorders.iter_mut().any(is_unread)
            });
        }
        self.until("the last recorder", |world| !world.recorders.iter_mut().any(is_unread));
        // What was handed over last is taken a moment later, and the host's board is free again.
        self.run(20);
        self.until("the host's board", |world| world.host.driver.can_transmit());
        let number = |read: Option<Read>| read.map_or(0, |read| read.number);
        let got = |(before, after): (Option<Read>, Option<Read>)| {
            let came = number(after) - number(before);
            assert!(came <= 1, "{came} datagrams, and one mark was sent");
            after.filter(|_| came == 1).map(|read| read.arrived_us)
        };
        before.into_iter().zip(self.reads()).map(got).collect()
    }

    /// What each recorder says, asked on its own line.
    fn readings(&mut self) -> Vec<ClockReading> {
        let ask = |recorder: &mut Recorder| match recorder.serial_ask(&Command::Time { token: 0 }) {
            Reply::Time(reading) => reading,
            other => panic!("{other:?}"),
        };
        self.world.recorders.iter_mut().map(ask).collect()
    }

    /// Moves the common contact. Returns in which millisecond, and the stamps.
    fn move_common(&mut self) -> (u64, Vec<i64>) {
        self.common_on ^= true;
        let moved_ms = self.world.now_ms + 1;
        let on = self.common_on;
        self.everywhere(Step { at_ms: 0, input: COMMON, on });
        self.run(2);
        let moved = |changed: Inputs| changed.contains(COMMON);
        let stamp = |log: Vec<Entry>| {
            milliseconds(log.into_iter().rfind(|entry| moved(entry.changed)).expect("it").time)
        };
        let logs = self.world.recorders.iter().map(|recorder| recorder.node.log().1);
        (moved_ms, logs.map(stamp).collect())
    }
}

/// Whether its board holds a datagram for it.
fn is_unread(recorder: &mut Recorder) -> bool {
    recorder.port.window().look(Board::unread_since_us).is_some()
}

/// What the clock of a recorder shows at this time of the bus. Nobody has set it, and it shows a
/// year more than that of the recorder before it.
fn true_clock_us(number: u8, at_us: u64) -> i64 {
    i64::from(number) * YEAR_US + i64::try_from(at_us).expect("short")
}

fn milliseconds(time: TimeStamp) -> i64 {
    NaiveDateTime::try_from(time).expect("a date").and_utc().timestamp_millis()
}

/// Marks at any phase of the scan. Returns how many recorders did not get theirs.
fn marks_tell_all_clocks_at_one_instant(noise: Noise, late: bool, rounds: u16) -> usize {
    let mut plant = Plant::new(noise);
    if late {
        // Some boards take long for everything that their recorder asks for.
        for (index, recorder) in plant.world.recorders.iter().enumerate().step_by(3) {
            let device = recorder.board.id();
            let by_us = 1_000 * (1 + index as u64);
            let fault = Fault::Inside { device, fault: DeviceFault::AnswerLate { by_us } };
            plant.world.bus.borrow_mut().inject(fault);
        }
    }
    let mut kept: Vec<Option<Mark>> = vec![None; RECORDERS.into()];
    let (mut missed, mut widest_us) = (0, 0);
    for round in 0..rounds {
        let pause_ms = plant.chance.below(60);
        plant.run(pause_ms);
        // Tokens come in no order, and 0 is one of them.
        let token = round.wrapping_mul(40_503);
        let arrivals = plant.mark(token);
        let instants = || arrivals.iter().flatten();
        let (first, last) = (instants().min().expect("some"), instants().max().expect("some"));
        assert!(last - first <= ONE_INSTANT_US, "round {round}: {arrivals:?}");
        let readings = plant.readings();
        let (moved_ms, stamps) = plant.move_common();
        let mut all_off_us = Vec::new();
        for (index, reading) in readings.iter().enumerate() {
            let number = plant.world.recorders[index].number;
            let Some(_) = arrivals[index] else {
                missed += 1;
                assert_eq!(reading.last_mark, kept[index], "round {round}, recorder {number}");
                continue;
            };
            let mark = reading.last_mark.expect("it got one");
            assert_eq!(mark.token, token, "round {round}, recorder {number}");
            // One instant for all of them, not each board's own.
            let off_us = mark.clock_us - true_clock_us(number, *first);
            let has_line = plant.world.recorders[index].has_line;
            let allowed = if has_line { -WITHIN_US..=0 } else { 0..=WITHIN_US };
            assert!(allowed.contains(&off_us), "round {round}, recorder {number}: {off_us} us");
            all_off_us.push(off_us);
            // It is the clock of the stamps: what lies between mark and change is the same time.
            let since_us = i64::try_from(moved_ms * 1000 - first).expect("later");
            let stamped_us = stamps[index] * 1000 - mark.clock_us;
            assert_eq!(stamped_us, since_us - off_us, "round {round}, recorder {number}");
            kept[index] = Some(mark);
        }
        let (least, most) = (all_off_us.iter().min().expect("some"), all_off_us.iter().max());
        let spread_us = most.expect("some") - least;
        assert!(spread_us <= 1_000, "round {round}: {spread_us} us apart");
        widest_us = widest_us.max(spread_us);
    }
    let reports = |recorder: &Recorder| recorder.port.diagnostics().reports_sent;
    let fewest = plant.world.recorders.iter().map(reports).min();
    assert!(fewest >= Some(u32::from(rounds) / 8), "they were busy: {fewest:?}");
    plant.world.assert_lawful();
    println!("{rounds} marks at {RECORDERS} recorders: within {widest_us} us, {missed} missed");
    missed
}

#[test]
fn a_mark_tells_thirty_busy_clocks_at_one_instant() {
    let missed = marks_tell_all_clocks_at_one_instant(Noise::default(), false, 300);
    assert_eq!(missed, 0);
}

#[test]
fn a_mark_is_as_exact_where_boards_hand_it_over_late() {
    assert_eq!(marks_tell_all_clocks_at_one_instant(Noise::default(), true, 200), 0);
}

#[test]
fn a_recorder_that_missed_a_mark_keeps_the_one_before_and_its_token() {
    let noise = Noise { seed: 3, lost_ppm: 20_000, ..Noise::default() };
    let missed = marks_tell_all_clocks_at_one_instant(noise, false, 200);
    assert!(missed >= 60, "{missed}: nobody was put to the test");
}

/// The flag that tells of a datagram is lost, so nobody knows when the mark came. The recorder finds
/// it in its board a while later.
#[test]
fn a_mark_whose_arrival_nobody_saw_is_not_claimed() {
    let mut world = World::started(&[(1, Model::Ser160)]);
    let mark = |world: &mut World, token, steal: bool| {
        world.until("the host's board", |world| world.host.driver.can_transmit().then_some(()));
        // Before its recorder looks, something else takes the flag.
        world.recorders[0].away_until_ms = u64::MAX;
        world.send(Broadcast, &Command::Time { token });
        world.until("the mark", |world| is_unread(&mut world.recorders[0]).then_some(()));
        if steal {
            let flag = map::INTERRUPT_STATUS.at(RECEIVE_QUEUE_FLAG);
            world.recorders[0].port.window().write(flag, 0);
        }
        world.recorders[0].away_until_ms = 1;
        world.until("its reading", |world| (!is_unread(&mut world.recorders[0])).then_some(()));
        world.run(20);
        let ask = Command::Time { token: 0 };
        let Reply::Time(reading) = world.recorders[0].serial_ask(&ask) else { panic!("no time") };
        (reading.last_mark, world.recorders[0].read_arrived_us())
    };
    let (seen, _) = mark(&mut world, 7, false);
    assert_eq!(seen.map(|mark| mark.token), Some(7));
    let (unseen, arrived_us) = mark(&mut world, 8, true);
    let found_us = world.now_ms * 1000 - arrived_us;
    assert!(found_us > 30_000, "it was late by {found_us} us: nothing was put to the test");
    assert_eq!(unseen, seen);
}

/// The clock is set over the line while a mark and a question wait in the recorder's board. What
/// they are told is what it showed when they came, as a change of that millisecond is stamped.
#[test]
fn what_waited_while_the_clock_was_set_is_told_what_it_showed_before() {
    const SET: TimeStamp =
        TimeStamp { year: 0, month: 11, day: 22, hour: 10, minute: 0, second: 0, millisecond: 0 };
    let mut world = World::started(&[(1, Model::Ser160)]);
    let device = world.recorders[0].board.id();
    let fault = DeviceFault::AnswerLate { by_us: 40_000 };
    world.bus.borrow_mut().inject(Fault::Inside { device, fault });
    world.run(500);
    // Asked by one host, then marked; the clock is set to 2026, then to 2027.
    for (to, token, year) in [(Device(1), 8, 26), (Broadcast, 7, 27)] {
        world.until("the host's board", |world| world.host.driver.can_transmit().then_some(()));
        world.send(to, &Command::Time { token });
        world.until("the datagram", |world| is_unread(&mut world.recorders[0]).then_some(()));
        world.run(2);
        world.recorders[0].serial_ask(&Command::SetClock(TimeStamp { year, ..SET }));
        assert!(is_unread(&mut world.recorders[0]), "it was read too soon: nothing was tested");
        world.run(500);
    }
    let (_, reply) = world.take_message(1).expect("a reply");
    let of_year = |us: i64| DateTime::from_timestamp_micros(us).expect("a date").year();
    let Ok(Reply::Time(reading)) = Reply::parse(&reply) else { panic!("{reply:?}") };
    assert_eq!((reading.token, of_year(reading.clock_us)), (8, 1971));
    assert_eq!(reading.source, ClockSource::Battery);
    let ask = Command::Time { token: 0 };
    let Reply::Time(reading) = world.recorders[0].serial_ask(&ask) else { panic!("no time") };
    assert_eq!(reading.last_mark.map(|mark| (mark.token, of_year(mark.clock_us))), Some((7, 2026)));
    assert_eq!(of_year(reading.clock_us), 2027);
}
