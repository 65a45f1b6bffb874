//! What the order of the entries of a life says about the clocks of its runs.

use super::layout::Succession;
use super::lives::LifeClock;
use super::offsets::RunClock;
use crate::history::History;
use crate::time::shown;

/// Which run of a life comes right before which, by entries whose runs are sure.
pub(super) fn successions(
    history: &History,
    lives: &[Vec<LifeClock>],
    runs: &[RunClock],
) -> Vec<Succession> {
    let mut successions = Successions::default();
    for (recorder, clocks) in history.recorders.iter().zip(lives) {
        for (life, clock) in recorder.lives.iter().zip(clocks) {
            successions.begin_life();
            for held in &life.entries {
                let Some(stamp) = shown(&held.entry.time) else { continue };
                let possible = clock.runs.of(held.sequence, Some(stamp)).runs();
                let ids = possible.filter_map(|run| clock.ids.get(run).copied());
                let x = |run: usize| runs.get(run).map(|clock| (run, clock.unwrapped(stamp)));
                successions.add(ids.filter_map(x).collect());
            }
        }
    }
    successions.all
}

/// What an entry may be: the runs in which it may be, and what the clock showed in each.
type Possible = Vec<(usize, i64)>;

/// Finds what the order of the entries of a life says that their stamps do not.
#[derive(Debug, Default)]
struct Successions {
    all: Vec<Succession>,
    /// The last entry whose run is sure.
    sure: Option<(usize, i64)>,
    /// After that: the last entry of each stretch of entries that may be in the same runs.
    doubtful: Vec<Possible>,
}

impl Successions {
    fn begin_life(&mut self) {
        self.sure = None;
        self.doubtful.clear();
    }

    fn add(&mut self, possible: Possible) {
        match possible.as_slice() {
            [] => {}
            [only] => self.add_sure(*only),
            _ => self.add_doubtful(possible),
        }
    }

    fn add_sure(&mut self, next: (usize, i64)) {
        if let Some(sure) = self.sure.filter(|(run, _)| *run != next.0) {
            self.all.push(Succession { earlier: vec![sure], later: vec![next] });
        }
        for earlier in self.doubtful.drain(..) {
            self.all.push(Succession { earlier, later: vec![next] });
        }
        self.sure = Some(next);
    }

    fn add_doubtful(&mut self, possible: Possible) {
        let runs = |possible: &Possible| possible.iter().map(|(run, _)| *run).collect::<Vec<_>>();
        match self.doubtful.last_mut() {
            Some(last) if runs(last) == runs(&possible) => *last = possible,
            _ => {
                if let Some(sure) = self.sure {
                    let (earlier, later) = (vec![sure], possible.clone());
                    self.all.push(Succession { earlier, later });
                }
                self.doubtful.push(possible);
            }
        }
    }
}
