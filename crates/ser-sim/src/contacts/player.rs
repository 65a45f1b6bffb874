//! Which contacts move when: scenarios played one after the other.

use std::collections::VecDeque;

use ser_proto::Inputs;

use crate::contacts::scenario::Scenario;
use crate::contacts::scenario_lines::Item;
use crate::contacts::step::Step;

/// How long a stream's scenario waits for its further lines when they did not come together with
/// the first.
///
/// Lines that a script writes one by one reach us one by one. Without the wait, all but the first
/// would be late.
pub const STREAM_LEAD_MS: u64 = 100;

/// Contacts that moved together, and when the recorder can have seen it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Played {
    /// When their scenario began, in milliseconds from power-up of the simulator.
    pub start_ms: u64,
    /// When they were to move, in milliseconds from that beginning.
    pub at_ms: u64,
    /// The contacts that moved.
    pub changed: Inputs,
    /// The contacts that were closed from then on.
    pub state: Inputs,
    /// The latest sample that cannot have seen the move, or the very sample that did. It is never
    /// later than the stamp's tick.
    pub tick_before: u32,
    /// The first sample known to have seen the move. It is never earlier than the stamp's tick.
    pub tick_after: u32,
}

/// Contacts that are to move together now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Move {
    pub(crate) start_ms: u64,
    pub(crate) at_ms: u64,
    pub(crate) changed: u32,
    pub(crate) state: u32,
}

impl Move {
    pub(crate) fn played(self, tick_before: u32, tick_after: u32) -> Played {
        let (changed, state) = (Inputs(self.changed), Inputs(self.state));
        Played {
            start_ms: self.start_ms,
            at_ms: self.at_ms,
            changed,
            state,
            tick_before,
            tick_after,
        }
    }
}

/// Steps waiting for their time.
#[derive(Debug, Default)]
pub(crate) struct Player {
    state: u32,
    waiting: VecDeque<Waiting>,
    /// The first millisecond in which no scenario laid out so far moves anything.
    free_from_ms: u64,
    /// When the stream's scenario began, while that scenario is not complete.
    stream_start_ms: Option<u64>,
}

#[derive(Clone, Copy, Debug)]
struct Waiting {
    start_ms: u64,
    step: Step,
}

impl Waiting {
    fn due_ms(&self) -> u64 {
        self.start_ms.saturating_add(self.step.at_ms)
    }
}

impl Player {
    /// The closed contacts.
    pub(crate) fn state(&self) -> u32 {
        self.state
    }

    /// Lays out a scenario from the next millisecond on, or after the scenarios before it. Returns
    /// when it begins.
    pub(crate) fn play(&mut self, now_ms: u64, scenario: &Scenario) -> u64 {
        let start_ms = self.free_from_ms.max(now_ms + 1);
        for &step in scenario.steps() {
            self.add(start_ms, step);
        }
        start_ms
    }

    /// Lays out what arrived together on a stream. Returns by how much the latest step was late, if
    /// one was.
    pub(crate) fn stream(&mut self, now_ms: u64, items: &[Item]) -> Option<u64> {
        let mut late_ms = None;
        for (index, item) in items.iter().enumerate() {
            match *item {
                Item::End => self.stream_start_ms = None,
                Item::Step(step) | Item::NodeStep(_, step) => {
                    let start_ms = self.stream_start_ms.unwrap_or_else(|| {
                        let complete = items[index..].contains(&Item::End);
                        let lead_ms = if complete { 1 } else { STREAM_LEAD_MS };
                        self.free_from_ms.max(now_ms + lead_ms)
                    });
                    self.stream_start_ms = Some(start_ms);
                    let due_ms = self.add(start_ms, step);
                    late_ms = late_ms
                        .max((now_ms + 1).checked_sub(due_ms).filter(|&late_ms| late_ms > 0));
                }
            }
        }
        late_ms
    }

    /// The first millisecond in which no scenario laid out so far moves anything.
    pub(crate) fn free_from_ms(&self) -> u64 {
        self.free_from_ms
    }

    /// Lets the next scenario begin no earlier than this millisecond.
    pub(crate) fn reserve_until(&mut self, ms: u64) {
        self.free_from_ms = self.free_from_ms.max(ms);
    }

    /// Begins the stream's scenario in this millisecond, if none is under way.
    pub(crate) fn begin_stream(&mut self, start_ms: u64) {
        self.stream_start_ms.get_or_insert(start_ms);
    }

    fn add(&mut self, start_ms: u64, step: Step) -> u64 {
        let waiting = Waiting { start_ms, step };
        let due_ms = waiting.due_ms();
        self.free_from_ms = self.free_from_ms.max(due_ms.saturating_add(1));
        self.waiting.push_back(waiting);
        due_ms
    }

    /// What moves at `now_ms`. To be asked once for every opportunity to move contacts.
    ///
    /// Contacts that are late move at the next opportunity, but never together with those of
    /// another millisecond.
    pub(crate) fn due(&mut self, now_ms: u64) -> Option<Move> {
        while let Some(first) =
            self.waiting.front().copied().filter(|first| first.due_ms() <= now_ms)
        {
            let before = self.state;
            while let Some(next) = self.waiting.front().copied() {
                if (next.start_ms, next.step.at_ms) != (first.start_ms, first.step.at_ms) {
                    break;
                }
                self.waiting.pop_front();
                let bit = 1 << (next.step.input - 1);
                self.state = if next.step.on { self.state | bit } else { self.state & !bit };
            }
            let changed = before ^ self.state;
            if changed != 0 {
                let (start_ms, at_ms) = (first.start_ms, first.step.at_ms);
                return Some(Move { start_ms, at_ms, changed, state: self.state });
            }
        }
        None
    }

    /// When the next of the steps laid out so far is due.
    pub(crate) fn next_due_ms(&self) -> Option<u64> {
        self.waiting.front().map(Waiting::due_ms)
    }

    /// How many steps wait for their time.
    pub(crate) fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// Whether every step laid out so far has been handed over and no scenario is half known.
    pub(crate) fn is_idle(&self) -> bool {
        self.waiting.is_empty() && self.stream_start_ms.is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(at_ms: u64, input: u8, on: bool) -> Step {
        Step { at_ms, input, on }
    }

    /// Every move with the millisecond in which it came.
    fn moves(player: &mut Player, from_ms: u64, to_ms: u64) -> Vec<(u64, u32)> {
        (from_ms..=to_ms).filter_map(|ms| player.due(ms).map(|moved| (ms, moved.state))).collect()
    }

    #[test]
    fn contacts_of_one_millisecond_move_together_and_only_real_changes_count() {
        let mut player = Player::default();
        let scenario = Scenario::from_steps([
            step(0, 1, true),
            step(0, 2, true),
            step(3, 1, true),
            step(3, 3, false),
            step(4, 2, false),
        ]);
        assert_eq!(player.play(10, &scenario), 11);
        assert!(!player.is_idle());
        assert_eq!(moves(&mut player, 11, 20), [(11, 0b11), (15, 0b01)]);
        assert!(player.is_idle());
    }

    #[test]
    fn scenarios_play_one_after_the_other() {
        let mut player = Player::default();
        let tap = Scenario::from_steps([step(0, 1, true), step(5, 1, false)]);
        assert_eq!(player.play(0, &tap), 1);
        assert_eq!(player.play(0, &tap), 7);
        assert_eq!(player.play(100, &tap), 101);
        assert_eq!(
            moves(&mut player, 1, 200),
            [(1, 1), (6, 0), (7, 1), (12, 0), (101, 1), (106, 0)]
        );
    }

    #[test]
    fn a_stream_counts_from_the_first_line_of_each_scenario() {
        let mut player = Player::default();
        let (on, off) = (Item::Step(step(0, 1, true)), Item::Step(step(2, 1, false)));
        assert_eq!(player.stream(10, &[on, off, Item::End, on, off, Item::End]), None);
        assert!(player.is_idle() || player.waiting.len() == 4);
        assert_eq!(moves(&mut player, 11, 50), [(11, 1), (13, 0), (14, 1), (16, 0)]);
    }

    #[test]
    fn a_stream_that_comes_line_by_line_has_a_lead_and_late_lines_are_reported_but_not_merged() {
        let mut player = Player::default();
        let line = |at_ms, on| Item::Step(step(at_ms, 1, on));
        assert_eq!(player.stream(10, &[line(0, true)]), None);
        assert_eq!(player.stream(60, &[line(1, false)]), None);
        assert_eq!(moves(&mut player, 61, 200), [(110, 1), (111, 0)]);
        assert!(!player.is_idle());
        assert_eq!(player.stream(200, &[line(80, true), line(81, false), Item::End]), Some(11));
        assert_eq!(moves(&mut player, 201, 210), [(201, 1), (202, 0)]);
        assert!(player.is_idle());
    }
}
