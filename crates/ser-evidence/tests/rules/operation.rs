//! What hosts do with clocks: they set them, ask them, and send broadcasts.

use crate::chance::Chance;
use crate::true_time::{MS, Ps, S, US};

/// What is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum What {
    /// The clock is set to this.
    Set(i64),
    /// The clock is asked, or a broadcast that does nothing is noted by it.
    Look,
}

/// One thing that a host does with the clock of one recorder, or of all on a bus.
#[derive(Clone, Debug)]
pub(crate) struct Operation {
    pub(crate) what: What,
    pub(crate) host: usize,
    pub(crate) recorders: Vec<usize>,
    pub(crate) broadcast: Option<u64>,
    /// When the total was read before.
    pub(crate) before: Ps,
    /// When the first try was sent.
    pub(crate) sent: Ps,
    /// When the command arrived: once for each try that did.
    pub(crate) arrivals: Vec<Ps>,
    /// When the answer was there, or nothing was to be expected any more.
    pub(crate) received: Ps,
    /// When the total was read afterwards.
    pub(crate) after: Ps,
    /// Whether there was an answer.
    pub(crate) is_answered: bool,
}

impl Operation {
    /// Something that one host does at about this time.
    pub(crate) fn draw(sent: Ps, is_broadcast: bool, chance: &mut Chance) -> Operation {
        let way = chance.of(&[900 * US, 5 * MS, 20 * MS, 300 * MS, 5 * S]);
        let way = chance.between(way / 4, way);
        let mut arrivals = vec![sent + chance.between(0, way)];
        let mut received = sent + way;
        if !is_broadcast && chance.one_in(4) {
            let pause = chance.of(&[2 * S, 20 * S]);
            let again = received + chance.between(0, pause);
            if chance.one_in(2) {
                arrivals.clear();
            }
            arrivals.push(again + chance.between(0, way));
            received = again + way;
        }
        let is_answered = !chance.one_in(8);
        if !is_answered && chance.one_in(2) {
            arrivals.clear();
        }
        let pause = chance.of(&[MS, 50 * MS, 10 * S]);
        Operation {
            what: What::Look,
            host: 0,
            recorders: Vec::new(),
            broadcast: is_broadcast.then(|| chance.bits()),
            before: sent - chance.between(0, pause),
            sent,
            arrivals,
            received,
            after: received + chance.between(0, pause),
            is_answered,
        }
    }

    /// A command that arrives twice before a moment at which something happens, and a look at the
    /// clock between the arrivals.
    pub(crate) fn twice_before(moment: Ps, chance: &mut Chance) -> [Operation; 2] {
        let mut one = || Operation::draw(0, false, chance);
        let (set, look) = (one(), one());
        let arrived = moment - chance.between(10 * MS, 2 * S);
        let asked = arrived - chance.between(2 * S, 9 * S);
        let sent = asked - chance.between(2 * S, 9 * S);
        let received = arrived + chance.between(MS, 8 * MS);
        let set = Operation {
            before: sent - MS,
            sent,
            arrivals: vec![sent + chance.between(MS, S), arrived],
            received,
            after: received + MS,
            is_answered: true,
            ..set
        };
        let received = asked + chance.between(MS, S);
        let arrivals = vec![chance.between(asked, received)];
        let (before, after) = (asked - MS, received + MS);
        let look =
            Operation { before, sent: asked, arrivals, received, after, is_answered: true, ..look };
        [set, look]
    }

    /// The true instant that an answered operation is about.
    pub(crate) fn instant(&self) -> Ps {
        *self.arrivals.last().expect("an answered operation arrived")
    }
}
