//! The plant of the demo: what its two recorders see, and its site file.

use ser_proto::Model;
use ser_sim::{Scenario, Step};

/// A recorder of the plant.
pub(super) struct Recorder {
    pub(super) name: &'static str,
    pub(super) model: Model,
    /// How many entries its log is made to hold.
    pub(super) log_size: u16,
    /// Inputs that are on before anything happens.
    healthy: &'static [u8],
    fault: &'static [Move],
    afterwards: &'static [Move],
}

/// `(ms, input, closed)`.
type Move = (u64, u8, bool);

/// The recorder at the feeder's relay, and the one at the switchgear.
pub(super) const RECORDERS: [Recorder; 2] = [
    Recorder {
        name: "SER1",
        model: Model::Ser320,
        log_size: 2048,
        healthy: &[7],
        // A fault from phase A to ground. The relay trips; the breaker takes 71 ms.
        fault: &[
            (0, 1, true),
            (3, 4, true),
            (17, 5, true),
            (88, 7, false),
            (97, 8, true),
            (104, 1, false),
            (105, 4, false),
            (121, 5, false),
        ],
        afterwards: &[],
    },
    Recorder {
        name: "SER2",
        model: Model::Ser160,
        log_size: 16,
        healthy: &[1, 3],
        // The bus voltage is low until the fault is gone. Opening has used up the spring.
        fault: &[(19, 2, true), (88, 1, false), (109, 2, false), (140, 3, false)],
        // The motor of the spring starts, and the limit switch at the end of the spring does not
        // find its place. With the last entry the small ring has gone round by one.
        afterwards: &[
            (0, 4, true),
            (200, 3, true),
            (211, 3, false),
            (219, 3, true),
            (232, 3, false),
            (240, 3, true),
            (251, 3, false),
            (263, 3, true),
            (270, 3, false),
            (282, 3, true),
            (291, 3, false),
            (303, 3, true),
            (310, 3, false),
            (322, 3, true),
            (331, 3, false),
            (344, 3, true),
            (390, 4, false),
        ],
    },
];

impl Recorder {
    /// The state of the plant before anything happens.
    pub(super) fn healthy(&self) -> Scenario {
        Scenario::from_steps(self.healthy.iter().map(|&input| Step { at_ms: 0, input, on: true }))
    }

    /// What it sees of the fault.
    pub(super) fn fault(&self) -> Scenario {
        scenario(self.fault)
    }

    /// What it sees after the fault.
    pub(super) fn afterwards(&self) -> Scenario {
        scenario(self.afterwards)
    }
}

fn scenario(moves: &[Move]) -> Scenario {
    Scenario::from_steps(moves.iter().map(|&(at_ms, input, on)| Step { at_ms, input, on }))
}

/// The site file, with the recorders at these ports.
pub(super) fn site_file(ports: [&str; 2]) -> String {
    let text = include_str!("north.toml");
    RECORDERS.iter().zip(ports).fold(text.to_owned(), |text, (recorder, port)| {
        text.replace(&format!("{{port of {}}}", recorder.name), port)
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn the_site_file_has_no_errors_and_a_name_for_every_input_that_moves() {
        let reading = ser_evidence::site::inspect(&site_file(["tcp://a:1", "tcp://a:2"]));
        assert!(reading.diagnostics.is_empty(), "{:?}", reading.diagnostics);
        let site = reading.site.expect("a site");
        for (index, recorder) in RECORDERS.iter().enumerate() {
            let moved = recorder.fault.iter().chain(recorder.afterwards);
            let moved: BTreeSet<u8> = moved.map(|&(_, input, _)| input).collect();
            let points = site.points.iter().filter(|point| point.recorder.0 == index);
            assert_eq!(moved, points.map(|point| point.input).collect(), "{}", recorder.name);
        }
    }

    #[test]
    fn every_step_moves_its_contact_and_one_entry_is_one_too_many() {
        for recorder in &RECORDERS {
            let mut on: BTreeSet<u8> = recorder.healthy.iter().copied().collect();
            for &(at_ms, input, closed) in recorder.fault.iter().chain(recorder.afterwards) {
                let moves = if closed { on.insert(input) } else { on.remove(&input) };
                assert!(moves, "{}: input {input} at {at_ms} ms", recorder.name);
            }
        }
        let small = &RECORDERS[1];
        assert_eq!(small.afterwards.len(), usize::from(small.log_size) + 1);
    }
}
