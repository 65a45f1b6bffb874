//! What counters have counted between two looks.

use ser_proto::Counter;

/// What a recorder told at one moment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Look {
    pub(super) counters: Vec<(Counter, u32)>,
    /// How long the recorder has been on, if it tells.
    pub(super) tick_us: Option<u64>,
}

/// What has grown from one look to the next.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::commands) struct Growth {
    /// Whether the recorder was switched on in between: then all counters have grown from zero.
    pub(super) began_anew: bool,
    /// Each counter that has grown, by how much, and its value now.
    pub(super) grown: Vec<(Counter, u32, u32)>,
}

impl Growth {
    /// From `before` to `now`.
    pub(super) fn between(before: &Look, now: &Look) -> Growth {
        let earlier = |counter| {
            let known = before.counters.iter().find(|(known, _)| *known == counter);
            known.map_or(0, |(_, value)| *value)
        };
        let began_anew = now.counters.iter().any(|&(counter, value)| value < earlier(counter))
            || now.tick_us.zip(before.tick_us).is_some_and(|(now, before)| now < before);
        let grown = now.counters.iter().filter_map(|&(counter, value)| {
            let from = if began_anew { 0 } else { earlier(counter) };
            let by = value.checked_sub(from).filter(|&by| by > 0)?;
            Some((counter, by, value))
        });
        Growth { began_anew, grown: grown.collect() }
    }

    /// By how much a counter has grown.
    pub(super) fn of(&self, counter: Counter) -> u32 {
        self.grown.iter().find(|(known, ..)| *known == counter).map_or(0, |(_, by, _)| *by)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(lost: u32, missed: u32, tick_us: u64) -> Look {
        let counters = vec![(Counter::EDGES_LOST, lost), (Counter::SAMPLES_MISSED, missed)];
        Look { counters, tick_us: Some(tick_us) }
    }

    #[test]
    fn a_host_subtracts() {
        let growth = Growth::between(&look(3, 7, 10), &look(3, 9, 20));
        assert_eq!(growth.grown, [(Counter::SAMPLES_MISSED, 2, 9)]);
        assert!(!growth.began_anew);
        assert_eq!((growth.of(Counter::SAMPLES_MISSED), growth.of(Counter::EDGES_LOST)), (2, 0));
        assert_eq!(Growth::between(&look(3, 7, 10), &look(3, 7, 20)).grown, []);
    }

    #[test]
    fn after_a_power_up_all_has_grown_from_zero() {
        let grown = |growth: Growth| (growth.began_anew, growth.grown);
        let lost = (Counter::EDGES_LOST, 3, 3);
        // A counter that went back tells it, and so does the time since power-up.
        assert_eq!(grown(Growth::between(&look(3, 7, 10), &look(3, 0, 20))), (true, vec![lost]));
        assert_eq!(grown(Growth::between(&look(3, 0, 10), &look(3, 0, 9))), (true, vec![lost]));
    }
}
