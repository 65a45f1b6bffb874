//! A breaker trip as a recorder in a small substation sees it.

use crate::contacts::scenario::Scenario;
use crate::contacts::step::Step;

/// What the inputs stand for.
const NAMES: [(u8, &str); 32] = [
    (1, "50/51 phase A pickup"),
    (2, "50/51 phase B pickup"),
    (3, "50/51 phase C pickup"),
    (4, "50N ground pickup"),
    (5, "Relay trip output"),
    (6, "Breaker 52-1 trip coil energised"),
    (7, "Breaker 52-1 closed (52a)"),
    (8, "Breaker 52-1 open (52b)"),
    (9, "86 lockout relay operated"),
    (10, "79 reclose initiate"),
    (11, "79 reclose close command"),
    (12, "79 recloser locked out"),
    (13, "27 bus undervoltage"),
    (14, "59N neutral overvoltage"),
    (15, "81 underfrequency"),
    (16, "87T differential blocked"),
    (17, "Motor 1 contactor closed"),
    (18, "Motor 2 contactor closed"),
    (19, "Motor 3 contactor closed"),
    (20, "Motor 4 contactor closed"),
    (21, "Tie breaker 52-T closed (52a)"),
    (22, "Tie breaker 52-T open (52b)"),
    (23, "Transfer scheme started"),
    (24, "Breaker spring charged"),
    (25, "Emergency generator start"),
    (26, "Emergency generator at speed"),
    (27, "Fault recorder triggered"),
    (28, "UPS on battery"),
    (29, "DC supply low"),
    (30, "Cooling fan running"),
    (31, "Door open"),
    (32, "Annunciator horn"),
];

/// `(ms, input, closed)`. The first group is the healthy state; the fault comes 100 ms later.
///
/// Mechanical contacts bounce, coils take a cycle or two, and several things happen in the same
/// millisecond: the order that an operator needs to see is spread over a second and a half.
const STEPS: &[(u64, u8, bool)] = &[
    // Healthy: breaker and motors in, spring charged, fan running, tie open.
    (0, 7, true),
    (0, 17, true),
    (0, 18, true),
    (0, 19, true),
    (0, 20, true),
    (0, 22, true),
    (0, 24, true),
    (0, 30, true),
    // Fault from phase A to ground, phase C follows.
    (100, 1, true),
    (100, 4, true),
    (100, 27, true),
    (104, 3, true),
    (108, 13, true),
    // The relay trips; the breaker opens about three cycles later.
    (117, 5, true),
    (117, 10, true),
    (118, 6, true),
    (139, 7, false),
    (141, 7, true),
    (142, 7, false),
    (151, 8, true),
    (152, 8, false),
    (154, 8, true),
    (158, 1, false),
    (158, 3, false),
    (159, 4, false),
    (166, 5, false),
    (167, 6, false),
    // The bus is dead: contactors drop out each in its own time, the horn sounds, the UPS takes
    // over.
    (183, 19, false),
    (187, 17, false),
    (187, 18, false),
    (189, 18, true),
    (190, 18, false),
    (204, 20, false),
    (210, 32, true),
    (214, 28, true),
    (231, 30, false),
    // One fast reclose, half a second after the trip, onto the fault that is still there.
    (617, 11, true),
    (618, 24, false),
    (662, 8, false),
    (671, 7, true),
    (672, 7, false),
    (673, 7, true),
    (676, 13, false),
    (680, 1, true),
    (680, 4, true),
    (683, 3, true),
    (684, 13, true),
    (690, 11, false),
    (692, 5, true),
    (693, 6, true),
    (712, 7, false),
    (725, 8, true),
    (727, 8, false),
    (728, 8, true),
    (731, 1, false),
    (731, 3, false),
    (732, 4, false),
    // Lockout, and the transfer to the other bus.
    (735, 9, true),
    (735, 10, false),
    (735, 12, true),
    (741, 5, false),
    (742, 6, false),
    (760, 23, true),
    (761, 25, true),
    (803, 22, false),
    (812, 21, true),
    (814, 21, false),
    (815, 21, true),
    (829, 13, false),
    (845, 28, false),
    (846, 30, true),
    (850, 23, false),
    // Motors come back one after the other.
    (1002, 17, true),
    (1152, 18, true),
    (1154, 18, false),
    (1155, 18, true),
    (1302, 19, true),
    (1452, 20, true),
    (1480, 26, true),
    (1500, 32, false),
];

impl Scenario {
    /// A breaker trip on 32 inputs: fault, trip, one unsuccessful reclose, lockout and transfer, in
    /// a second and a half. [`Scenario::names`] says what the inputs stand for.
    #[must_use]
    pub fn breaker_trip() -> Scenario {
        let steps = STEPS.iter().map(|&(at_ms, input, on)| Step { at_ms, input, on });
        Scenario::from_steps(steps).with_names(&NAMES)
    }
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use ser_proto::Model;

    use super::*;

    #[test]
    fn it_is_a_correct_scenario_in_which_every_step_moves_its_contact() {
        let mut csv = String::from("ms,input,state\n");
        let mut closed = 0_u32;
        for &(at_ms, input, on) in STEPS {
            writeln!(csv, "{at_ms},{input},{}", u8::from(on)).unwrap();
            let bit = 1 << (input - 1);
            assert_eq!(closed & bit == 0, on, "input {input} at {at_ms} ms is there already");
            closed ^= bit;
        }
        let read = Scenario::from_csv("breaker trip", csv.as_bytes(), Model::Ser320).unwrap();
        assert_eq!(read.steps(), Scenario::breaker_trip().steps());
    }

    #[test]
    fn every_input_has_a_name() {
        let names = Scenario::breaker_trip().names();
        assert_eq!(
            names.iter().map(|&(input, _)| input).collect::<Vec<_>>(),
            (1..=32).collect::<Vec<_>>()
        );
    }
}
