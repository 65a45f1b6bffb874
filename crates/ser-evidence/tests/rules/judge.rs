//! Compares what is said of a story with what is true in its world.

use std::collections::{BTreeMap, BTreeSet};

use ser_evidence::record::{Boot, EntryRecord, Record};

use ser_proto::{Entry, Inputs};

use crate::adapter::{Ends, Row, Said, Sayings, history};
use crate::chance::Chance;
use crate::recorder::{SeenMove, TrueEntry};
use crate::story::{Story, shuffle};
use crate::true_time::{Ps, US};
use crate::world::Trouble;

/// A millisecond of a slow clock is a little longer than one, and ends are whole microseconds.
pub(crate) const TOLERANCE_US: i64 = 1;

/// A row with the truth about it.
#[derive(Clone, Copy)]
pub(crate) struct Judged<'a> {
    pub(crate) row: Row,
    pub(crate) truth: &'a TrueEntry,
}

/// Something that was said and is not so, or was not said and should have been.
#[derive(Debug)]
pub(crate) struct Fault {
    /// The rule against which it is.
    pub(crate) rule: &'static str,
    pub(crate) text: String,
}

/// A story with what is said of it, and what is wrong with that.
pub(crate) struct Judge<'a> {
    pub(crate) story: &'a Story,
    pub(crate) said: &'a Sayings<'a>,
    pub(crate) rows: Vec<Judged<'a>>,
    pub(crate) faults: Vec<Fault>,
}

/// Everything that is wrong with what is said of the story of a seed.
pub(crate) fn faults_of(seed: u64) -> Vec<Fault> {
    let story = Story::of(seed);
    let held = history(&story.world.site, &story.sources);
    let said = Sayings::of(&story.world.site, &held);
    let mut judge = Judge { story: &story, said: &said, rows: Vec::new(), faults: Vec::new() };
    judge.find_truth();
    judge.list_is_complete();
    judge.order_of_records_does_not_matter();
    match story.world.trouble {
        Trouble::None => {
            judge.nothing_is_contradicted();
            judge.truth_is_inside();
            judge.order_is_true();
            judge.enough_is_said();
            judge.incidents_are_true();
            judge.known_states_are_kept();
            judge.no_partner_is_overlooked();
            judge.one_movement_is_one();
        }
        Trouble::Conflict => judge.conflict_is_told(),
        Trouble::WrongObservation => judge.wrong_observation_is_told(),
        Trouble::SecretSet => {}
        Trouble::SecretSetBack => {
            judge.truth_is_inside();
            judge.order_is_true();
            judge.incidents_are_true();
        }
    }
    // Where what is told is wrong, or nobody told that a clock was set, proofs may contradict each
    // other, whether that is noticed or not.
    let is_believable = match story.world.trouble {
        Trouble::None => true,
        Trouble::Conflict => judge.stamps_are_true(),
        Trouble::WrongObservation | Trouble::SecretSet | Trouble::SecretSetBack => false,
    };
    if is_believable && story.world.are_hosts_true && said.contradictions().is_empty() {
        judge.list_respects_order();
    }
    judge.faults
}

impl<'a> Judge<'a> {
    pub(crate) fn fault(&mut self, rule: &'static str, text: impl Into<String>) {
        self.faults.push(Fault { rule, text: text.into() });
    }

    /// Finds the true entry of each row.
    fn find_truth(&mut self) {
        for &row in &self.said.rows {
            let recorder = &self.story.world.recorders[row.recorder];
            let is_it = |truth: &&TrueEntry| {
                let life = &recorder.lives[truth.life];
                let sequence = life.sequence(truth.total);
                if row.life.is_known() {
                    return row.life == life.name && row.sequence == sequence;
                }
                let is_place = row.is_by_number || row.sequence % 65_536 == truth.total % 65_536;
                is_seen_as(truth.entry, row.entry, row.known) && is_place
            };
            match recorder.entries.iter().find(is_it) {
                Some(truth) => self.rows.push(Judged { row, truth }),
                None => self.fault("complete", format!("{row:?} never was")),
            }
        }
    }

    /// Whether all entries are shown with their true stamps. Of two that contradict each other either
    /// may be shown.
    fn stamps_are_true(&self) -> bool {
        self.rows.iter().all(|judged| judged.row.entry.time == judged.truth.entry.time)
    }

    /// Each entry that was read is there once.
    fn list_is_complete(&mut self) {
        let mut named = BTreeSet::new();
        let mut unnamed = Vec::new();
        for told in self.story.sources.iter().flatten() {
            let Record::Entry(entry) = &told.record else { continue };
            let recorder = self.story.world.site.recorder(&told.recorder).expect("in the site").0;
            match entry.sequence {
                Some(sequence) if entry.life.is_known() => {
                    named.insert((recorder, entry.life, sequence));
                }
                _ => unnamed.push((recorder, entry.entry, entry.known)),
            }
        }
        let rows = self.rows.clone();
        for &(recorder, entry, known) in &unnamed {
            let is_it = |j: &&Judged<'_>| {
                j.row.recorder == recorder && is_seen_as(j.truth.entry, entry, known)
            };
            if self.story.world.trouble != Trouble::Conflict && rows.iter().find(is_it).is_none() {
                self.fault("complete", format!("an entry without a life is missing: {entry:?}"));
            }
        }
        let mut seen = BTreeMap::new();
        for Judged { row, .. } in rows.iter().filter(|judged| judged.row.life.is_known()) {
            *seen.entry((row.recorder, row.life, row.sequence)).or_insert(0) += 1;
        }
        for key in &named {
            if !seen.contains_key(key) {
                self.fault("complete", format!("an entry is missing: {key:?}"));
            }
        }
        for (key, _) in seen.iter().filter(|&(_, &count)| count > 1) {
            self.fault("complete", format!("an entry is there more than once: {key:?}"));
        }
    }

    /// Other orders of the records give the same list and the same bounds.
    fn order_of_records_does_not_matter(&mut self) {
        let mut sources = self.story.sources.clone();
        shuffle(&mut sources, &mut Chance::new(!self.story.world.seed));
        let site = &self.story.world.site;
        let held = history(site, &sources);
        let other = Sayings::of(site, &held);
        let of = |said: &Sayings<'_>| -> Vec<String> {
            // Lives without a name that are alike may be the other way round.
            let content = |row: &Row| {
                let ends = said.utc(row.event, None);
                format!("{row:?} {:?} {ends:?} {}", row.entry, row.is_by_number)
            };
            said.rows.iter().map(content).collect()
        };
        let (one, other) = (of(self.said), of(&other));
        if let Some(at) = (0..one.len().max(other.len())).find(|&at| one.get(at) != other.get(at)) {
            self.fault(
                "any order",
                format!(
                    "with the records in another order, row {at} is {:?}, not {:?}",
                    other.get(at),
                    one.get(at)
                ),
            );
        }
    }

    fn nothing_is_contradicted(&mut self) {
        for contradiction in self.said.contradictions() {
            self.fault(
                "no contradiction",
                format!("nothing is wrong, and this is told: {contradiction}"),
            );
        }
    }

    /// What one reader knows of the states is not lost because another one knows less.
    fn known_states_are_kept(&mut self) {
        let told = self.story.sources.iter().flatten();
        let whole: BTreeSet<_> = told
            .filter_map(|told| match told.record {
                Record::Entry(entry) if entry.known == EntryRecord::ALL_KNOWN => {
                    Some((entry.life, entry.sequence?))
                }
                _ => None,
            })
            .collect();
        for Judged { row, truth } in self.rows.clone() {
            let is_whole = row.known == EntryRecord::ALL_KNOWN;
            let was_told = row.life.is_known() && whole.contains(&(row.life, row.sequence));
            let is_true = is_seen_as(truth.entry, row.entry, row.known);
            if was_told && !is_whole || !is_true {
                self.fault("known states", format!("{row:?} knows {:?} only", row.known));
            }
        }
    }

    /// A contact that two recorders watch is not said to have been seen by one if both saw it.
    fn no_partner_is_overlooked(&mut self) {
        for ((event, input), is_missing) in self.said.lonely_changes() {
            let judged = *self.rows.iter().find(|judged| judged.row.event == event).expect("a row");
            let of_input = |truth: &'a TrueEntry, input: u8| {
                truth.moves.iter().filter(move |seen| seen.input == input)
            };
            let is_partner = |other: &&Judged<'a>| {
                let mut theirs = other.truth.moves.iter();
                let is_one = |seen: &SeenMove| {
                    let mut mine = of_input(judged.truth, input);
                    mine.any(|mine| (mine.contact, mine.at) == (seen.contact, seen.at))
                };
                other.row.recorder != judged.row.recorder && theirs.any(is_one)
            };
            if let Some(partner) = self.rows.iter().find(is_partner) {
                let what = if is_missing { "missing" } else { "apart" };
                let text = format!("{:?} is {what} of {:?} {input}", partner.row, judged.row);
                self.fault("contact on two recorders", text);
            }
        }
    }

    /// Changes of two recorders that are said to be one movement are one.
    fn one_movement_is_one(&mut self) {
        for judged in self.rows.clone() {
            for seen in &judged.truth.moves {
                let Some((event, input)) = self.said.same_movement((judged.row.event, seen.input))
                else {
                    continue;
                };
                let other =
                    *self.rows.iter().find(|other| other.row.event == event).expect("a row");
                let mut theirs = other.truth.moves.iter().filter(|theirs| theirs.input == input);
                if !theirs.any(|theirs| (theirs.contact, theirs.at) == (seen.contact, seen.at)) {
                    let text = format!("{seen:?} is not input {input}: {}", show(judged, other));
                    self.fault("contact on two recorders", text);
                }
                if self.said.delta((judged.row.event, seen.input), (event, input))
                    != (Some(0), Some(0))
                {
                    self.fault("contact on two recorders", format!("{seen:?} moved twice"));
                }
            }
        }
    }

    fn conflict_is_told(&mut self) {
        let Some(planted) = &self.story.planted else { return };
        let Record::Entry(planted) = &planted.record else { return };
        let is_it = |(_, life, sequence, entries): &(_, _, _, [ser_proto::Entry; 2])| {
            *life == planted.life
                && Some(*sequence) == planted.sequence
                && entries.contains(&planted.entry)
        };
        if !self.said.conflicts().iter().any(is_it) {
            self.fault("conflict", format!("a conflict is not told: {planted:?}"));
        }
    }

    /// The true moment of each change is in each bound of it.
    fn truth_is_inside(&mut self) {
        for Judged { row, truth } in self.rows.clone() {
            for seen in &truth.moves {
                for input in [Some(seen.input), None] {
                    if !self.is_utc_honest(row, seen.at, input) {
                        let ends = self.said.utc(row.event, input);
                        let at = self.utc_us(seen.at);
                        self.fault(
                            "truth in UTC",
                            format!("{row:?} input {input:?}: {at} us is not in {ends:?}"),
                        );
                    }
                    for (boot, ends) in self.said.on_hosts(row.event, input) {
                        let at = self.host_us(boot, seen.at);
                        if !contains(ends, at) {
                            self.fault("truth on host", format!(
                                "{row:?} input {input:?} on host {boot}: {at} us is not in {ends:?}"
                            ));
                        }
                    }
                }
            }
        }
    }

    fn is_utc_honest(&self, row: Row, at: Ps, input: Option<u8>) -> bool {
        contains(self.said.utc(row.event, input), self.utc_us(at))
    }

    /// UTC, rounded down.
    pub(crate) fn utc_us(&self, at: Ps) -> i64 {
        self.story.world.start_utc_us + at.div_euclid(US)
    }

    /// What the monotonic clock of a host shows, rounded down.
    pub(crate) fn host_us(&self, boot: Boot, at: Ps) -> i64 {
        let host = self.story.world.hosts.iter().find(|host| host.boot == boot);
        host.expect("a host of the world").monotonic_us(at)
    }

    /// Nothing is said of the order, nor of the time between, that is not true; and what the bounds
    /// themselves say is said.
    fn order_is_true(&mut self) {
        for (one, other) in self.pairs() {
            let said = self.said.order(one.row.event, other.row.event);
            let back = self.said.order(other.row.event, one.row.event);
            if back != said.reversed() {
                self.fault(
                    "order both ways",
                    format!("{said:?}, and the other way round {back:?}: {}", show(one, other)),
                );
            }
            if !is_true(said, one, other) {
                self.fault("order is true", format!("{said:?} is said: {}", show(one, other)));
            }
            if said != Said::Before && self.is_apart(one, other) {
                self.fault(
                    "order is said",
                    format!("{said:?}, and the bounds are apart: {}", show(one, other)),
                );
            }
            self.delta_is_true(one, other);
        }
    }

    fn delta_is_true(&mut self, one: Judged<'_>, other: Judged<'_>) {
        for a in &one.truth.moves {
            for b in &other.truth.moves {
                let ends = self.said.delta((one.row.event, a.input), (other.row.event, b.input));
                let truth = (b.at - a.at).div_euclid(US);
                if !contains(ends, truth) {
                    self.fault(
                        "delta is true",
                        format!(
                            "from input {} to {}: {truth} us is not in {ends:?}: {}",
                            a.input,
                            b.input,
                            show(one, other)
                        ),
                    );
                }
            }
        }
    }

    /// Whether what is said of the times of two entries puts the first one first.
    fn is_apart(&self, one: Judged<'_>, other: Judged<'_>) -> bool {
        let is_before =
            |one: Ends, other: Ends| matches!((one.1, other.0), (Some(hi), Some(lo)) if hi < lo);
        if is_before(self.said.utc(one.row.event, None), self.said.utc(other.row.event, None)) {
            return true;
        }
        let others = self.said.on_hosts(other.row.event, None);
        let mut ones = self.said.on_hosts(one.row.event, None).into_iter();
        ones.any(|(boot, ends)| {
            others.iter().any(|&(host, others)| host == boot && is_before(ends, others))
        })
    }

    /// No row is above one that came before it.
    fn list_respects_order(&mut self) {
        let rows = self.said.rows.clone();
        let at = |event| rows.iter().position(|row| row.event == event);
        for (one, other) in self.pairs() {
            let said = self.said.order(one.row.event, other.row.event);
            let is_above = at(one.row.event) < at(other.row.event);
            if said == Said::Before && !is_above || said == Said::After && is_above {
                self.fault(
                    "list respects order",
                    format!("the list is against this: {said:?}: {}", show(one, other)),
                );
            }
        }
    }

    /// All pairs of rows, or many if there are too many.
    pub(crate) fn pairs(&self) -> Vec<(Judged<'a>, Judged<'a>)> {
        const MOST: usize = 1500;
        let rows = &self.rows;
        if rows.len() < 2 {
            return Vec::new();
        }
        if rows.len() * rows.len() <= MOST {
            let others = |one: usize| (0..rows.len()).filter(move |&other| other != one);
            let pair = |one: usize| others(one).map(move |other| (rows[one], rows[other]));
            return (0..rows.len()).flat_map(pair).collect();
        }
        let mut chance = Chance::new(self.story.world.seed);
        let mut draw = || {
            let one = chance.below(rows.len());
            // Near in the list, most of the time: there it matters.
            let other = if chance.one_in(4) {
                chance.below(rows.len())
            } else {
                (one + 1 + chance.below(8)) % rows.len()
            };
            (rows[one], rows[other])
        };
        (0..MOST).map(|_| draw()).filter(|(one, other)| one.row != other.row).collect()
    }
}

impl Said {
    fn reversed(self) -> Said {
        match self {
            Said::Before => Said::After,
            Said::After => Said::Before,
            Said::Same | Said::Unknown => self,
        }
    }
}

/// Whether this is true of two different rows.
fn is_true(said: Said, one: Judged<'_>, other: Judged<'_>) -> bool {
    let is_before = |one: Judged<'_>, other: Judged<'_>| {
        let is_one_life =
            (one.row.recorder, one.truth.life) == (other.row.recorder, other.truth.life);
        if is_one_life {
            return one.truth.total < other.truth.total;
        }
        one.truth.moved().1 < other.truth.moved().0 + TOLERANCE_US * US
    };
    match said {
        Said::Before => is_before(one, other),
        Said::After => is_before(other, one),
        Said::Same => false,
        Said::Unknown => true,
    }
}

/// Whether an entry looks like this to a reader who knows the state of some inputs only.
fn is_seen_as(truth: Entry, seen: Entry, known: Inputs) -> bool {
    let is_same_state = (truth.state.0 ^ seen.state.0) & known.0 == 0;
    (truth.time, truth.changed) == (seen.time, seen.changed) && is_same_state
}

pub(crate) fn contains((lo, hi): Ends, at: i64) -> bool {
    lo.is_none_or(|lo| lo <= at + TOLERANCE_US) && hi.is_none_or(|hi| at - TOLERANCE_US <= hi)
}

pub(crate) fn show(one: Judged<'_>, other: Judged<'_>) -> String {
    let show = |Judged { row, truth }: Judged<'_>| {
        let moved = truth.moves.iter().map(|seen| seen.at).collect::<Vec<_>>();
        format!("{row:?} moved at {moved:?} ps")
    };
    format!("{} | {}", show(one), show(other))
}
