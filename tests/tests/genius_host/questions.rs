//! What a host takes for certain of a recorder's clock that it asks over the bus, against the truth:
//! the moment at which the recorder's board showed the question lies in the stated bounds, whatever
//! delays datagrams and loses them.

use std::time::Duration;

use ser_client::{ClockLook, GeniHost, Options, RequestError, Unit};
use ser_proto::{Command, Model};
use ser_sim::genius::{DeviceFault, Fault, Noise};
use ser_sim::{Scenario, Step};
use ser_trial::genius_world::REPORT;
use ser_trial::simulation::chance::Chance;

use crate::desk::Desk;

/// A reply that waits behind twelve busy recorders takes a second and more.
const PATIENCE: Options = Options { timeout: Duration::from_secs(4), retries: 0 };

/// Milliseconds between two changes of a busy input.
const PERIOD_MS: u64 = 3;

/// How much of the future contacts are told at once.
const BUSY_FOR_MS: u64 = 60_000;

/// The longest that a main loop is away.
const AWAY_MS: u64 = 120;

/// What a bus is like.
#[derive(Clone, Copy, Debug)]
struct BusyBus {
    recorders: u8,
    /// Whether all recorders report all the time.
    busy: bool,
    noise: Noise,
    /// How much longer boards take for everything that their recorders ask for.
    late_us: u64,
    /// Whether the main loops of recorders are away now and then, with the interrupt line.
    away: bool,
}

impl BusyBus {
    const QUIET: BusyBus = BusyBus {
        recorders: 3,
        busy: false,
        noise: Noise { seed: 0, damaged_ppm: 0, lost_ppm: 0, unacknowledged_ppm: 0 },
        late_us: 0,
        away: false,
    };

    fn desk(self) -> Desk {
        let crowd: Vec<_> = (1..=self.recorders).map(|number| (number, Model::Ser160)).collect();
        let desk = Desk::with_noise(&crowd, self.noise);
        desk.with(move |bench| {
            for recorder in &mut bench.world.recorders {
                recorder.has_line = self.away;
                if self.busy {
                    recorder.serial_ask(&Command::Configure(REPORT));
                }
                let device = recorder.board.id();
                let fault = DeviceFault::AnswerLate { by_us: self.late_us };
                bench.world.bus.borrow_mut().inject(Fault::Inside { device, fault });
            }
        });
        desk
    }

    /// Keeps all recorders busy.
    fn keep_busy(self, desk: &Desk) {
        if !self.busy {
            return;
        }
        desk.with(|bench| {
            let step = |index: u64| Step {
                at_ms: PERIOD_MS * index,
                input: 1,
                on: index.is_multiple_of(2),
            };
            let steps = Scenario::from_steps((0..BUSY_FOR_MS / PERIOD_MS).map(step));
            for recorder in bench.world.recorders.iter_mut().filter(|it| it.node.is_idle()) {
                recorder.node.play(&steps);
            }
        });
    }
}

/// A host of this recorder that knows that it can be asked. The first questions may be lost, too.
fn known(host: &GeniHost, number: u8) -> Unit {
    loop {
        let mut unit = host.unit(number, PATIENCE);
        if unit.identity().is_ok_and(|identity| identity.is_some()) {
            return unit;
        }
    }
}

/// Asks each recorder so often, and checks each answer. Returns how many came.
fn ask(bus: BusyBus, rounds: u32) -> u32 {
    let desk = bus.desk();
    let host = desk.host();
    let mut chance = Chance::new(bus.noise.seed);
    let mut units: Vec<Unit> = (1..=bus.recorders).map(|number| known(&host, number)).collect();
    let mut answered = 0;
    for _ in 0..rounds {
        bus.keep_busy(&desk);
        for (index, unit) in units.iter_mut().enumerate() {
            desk.run(chance.below(25));
            if bus.away {
                let for_ms = chance.below(AWAY_MS);
                desk.with(move |bench| {
                    bench.world.recorders[index].away_until_ms = bench.world.now_ms + for_ms;
                });
            }
            match unit.clock_look() {
                Ok(Some(look)) => {
                    check(bus, &desk, index, look);
                    answered += 1;
                }
                Ok(None) => panic!("it has said that it can be asked"),
                Err(RequestError::NoReply { .. }) => {}
                Err(error) => panic!("{error}"),
            }
        }
    }
    desk.with(|bench| bench.world.assert_lawful());
    answered
}

/// Checks an answer against the truth. The board handed over nothing after the question: the host
/// sends nothing else.
fn check(bus: BusyBus, desk: &Desk, index: usize, look: ClockLook) {
    let ClockLook { reading, between: (from, to) } = look;
    let arrived_us = desk.with(move |bench| bench.world.recorders[index].read_arrived_us());
    // With the line it counts from the sample before, and without it from the next look.
    let seen_us = if bus.away { arrived_us / 1000 } else { arrived_us.div_ceil(1000) } * 1000;
    assert_eq!(reading.tick_us, seen_us, "recorder {index} of {bus:?}");
    // A recorder of the desk has power from the beginning, so its tick is the desk's time.
    let moment = Duration::from_micros(reading.tick_us);
    assert!((from..=to).contains(&moment), "{moment:?} is not in {from:?}..={to:?}: {bus:?}");
    // And the clock is that of the same moment: nobody has set it, and it began with a year.
    let years_us = 365 * 86_400_000_000 * (1 + index as u64);
    let shows_us = u64::try_from(reading.clock_us).expect("after 1970");
    assert_eq!(shows_us, years_us + seen_us, "recorder {index} of {bus:?}");
}

fn noise(seed: u64, ppm: u32) -> Noise {
    Noise { seed, damaged_ppm: ppm, lost_ppm: ppm, unacknowledged_ppm: ppm }
}

#[test]
fn the_moment_of_a_reading_over_the_bus_is_within_its_bounds_whatever_delays_it() {
    let mut all = 0;
    for (questions, bus) in [
        (1_200, BusyBus::QUIET),
        (1_200, BusyBus { recorders: 12, ..BusyBus::QUIET }),
        (450, BusyBus { busy: true, ..BusyBus::QUIET }),
        (300, BusyBus { busy: true, late_us: 7_000, ..BusyBus::QUIET }),
        (300, BusyBus { busy: true, away: true, ..BusyBus::QUIET }),
        (90, BusyBus { noise: noise(5, 20_000), ..BusyBus::QUIET }),
        (60, BusyBus { busy: true, late_us: 3_000, noise: noise(7, 5_000), ..BusyBus::QUIET }),
        (120, BusyBus { recorders: 12, busy: true, ..BusyBus::QUIET }),
    ] {
        let answered = ask(bus, questions / u32::from(bus.recorders));
        println!("{answered} of {questions} answered: {bus:?}");
        assert!(answered >= questions / 2, "{bus:?}: only {answered} were answered");
        all += answered;
    }
    assert!(all >= 3_500, "{all}");
}

#[test]
fn over_a_quiet_bus_a_reading_is_certain_to_a_few_scans() {
    let desk = BusyBus::QUIET.desk();
    let host = desk.host();
    let scan = Duration::from_millis(desk.with(|bench| bench.scan_ms()));
    let mut unit = known(&host, 2);
    for round in 0..60 {
        desk.run(round % 23);
        let look = unit.clock_look().expect("a reply").expect("it can be asked");
        let (from, to) = look.between;
        assert!(to - from <= 3 * scan + Duration::from_millis(6), "{:?}", to - from);
    }
}
