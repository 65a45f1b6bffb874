//! What contacts do: single edges, cascades, chatter, all at once, storms, and hours of silence.

use ser_sim::{Scenario, Step};

use super::chance::Chance;

/// How far ahead all inputs are told to toggle.
const FLAT_OUT_MS: u64 = 1000;

/// How busy the plant is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tempo {
    /// Something happens every few seconds or minutes, and now and then nothing for hours.
    Plant,
    /// Something happens all the time.
    Busy,
    /// All inputs toggle in every millisecond.
    Flat,
}

/// The contacts of one recorder.
#[derive(Clone, Debug)]
pub struct Activity {
    chance: Chance,
    inputs: u8,
    state: u32,
    next_ms: u64,
}

impl Activity {
    /// Contacts that are all open.
    #[must_use]
    pub fn new(chance: Chance, inputs: u8) -> Activity {
        Activity { chance, inputs, state: 0, next_ms: 0 }
    }

    /// When something happens next.
    #[must_use]
    pub fn next_ms(&self) -> u64 {
        self.next_ms
    }

    /// What happens now, and for how long nothing happens afterwards.
    pub fn next_scene(&mut self, now_ms: u64, tempo: Tempo) -> Scenario {
        let mut steps = Vec::new();
        match self.chance.below(100) {
            _ if tempo == Tempo::Flat => self.flat_out(&mut steps),
            0..40 => self.toggle_any(&mut steps, 0),
            40..65 => self.cascade(&mut steps),
            65..80 => self.chatter(&mut steps),
            80..93 => self.together(&mut steps),
            _ => self.storm(&mut steps),
        }
        let lasts_ms = steps.last().map_or(0, |step: &Step| step.at_ms);
        let pause_ms = match (tempo, self.chance.below(100)) {
            // The first millisecond of the next scene follows the last one of this scene.
            (Tempo::Flat, _) => 0,
            (Tempo::Busy, _) => self.chance.spread(1..=3_000),
            (Tempo::Plant, 0..60) => self.chance.spread(10..=60_000),
            (Tempo::Plant, 60..96) => self.chance.spread(1_000..=3_600_000),
            (Tempo::Plant, _) => self.chance.within(3_600_000..=12 * 3_600_000),
        };
        self.next_ms = now_ms + lasts_ms + pause_ms + 1;
        Scenario::from_steps(steps)
    }

    fn toggle(&mut self, steps: &mut Vec<Step>, at_ms: u64, input: u8) {
        self.state ^= 1 << (input - 1);
        steps.push(Step { at_ms, input, on: self.state >> (input - 1) & 1 == 1 });
    }

    fn any_input(&mut self) -> u8 {
        u8::try_from(self.chance.within(1..=self.inputs.into())).unwrap_or(1)
    }

    fn toggle_any(&mut self, steps: &mut Vec<Step>, at_ms: u64) {
        let input = self.any_input();
        self.toggle(steps, at_ms, input);
    }

    /// A breaker trips, and others follow.
    fn cascade(&mut self, steps: &mut Vec<Step>) {
        let mut at_ms = 0;
        for _ in 0..self.chance.within(3..=12) {
            self.toggle_any(steps, at_ms);
            at_ms += self.chance.below(30);
        }
    }

    /// A loose contact.
    fn chatter(&mut self, steps: &mut Vec<Step>) {
        let input = self.any_input();
        let mut at_ms = 0;
        for _ in 0..self.chance.spread(10..=300) {
            self.toggle(steps, at_ms, input);
            at_ms += self.chance.within(1..=5);
        }
    }

    /// The supply of all contacts goes or comes.
    fn together(&mut self, steps: &mut Vec<Step>) {
        for at_ms in 0..self.chance.within(1..=3) {
            (1..=self.inputs).for_each(|input| self.toggle(steps, at_ms * 7, input));
        }
    }

    /// As many events as there can be, for a while: often more than the log holds.
    fn storm(&mut self, steps: &mut Vec<Step>) {
        for at_ms in 0..self.chance.spread(50..=3_000) {
            self.toggle_any(steps, at_ms);
        }
    }

    fn flat_out(&mut self, steps: &mut Vec<Step>) {
        for at_ms in 0..FLAT_OUT_MS {
            (1..=self.inputs).for_each(|input| self.toggle(steps, at_ms, input));
        }
    }
}
