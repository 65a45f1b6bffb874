//! Lists in UTC and whole milliseconds, in the order of what happened, without anything twice.
//!
//! A stamp that is finer than a millisecond is rounded up: a change lies in the millisecond that ends
//! with its stamp. Files of one recorder overlap; lists that share a row and contradict each other
//! nowhere are one.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, HashMap};

use jiff::tz::TimeZone;

use super::calendar::DateOrder;
use super::list::{Change, List, Order, To};
use super::notes::{Notes, Refusal};
use super::zone::{Doubt, Utc, in_utc};

const MS_NS: i64 = 1_000_000;

/// A list in UTC.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Timed {
    /// By place.
    pub(super) rows: Vec<TimedRow>,
    /// Whether the order of the rows is that of their times.
    pub(super) by_time: bool,
    /// Whether places count from the beginning of the log.
    pub(super) counts_from_beginning: bool,
    /// How many rows were overwritten before the first place that was left.
    pub(super) overwritten: Option<u64>,
    /// Whether it is made of samples, which show all states.
    pub(super) is_sampled: bool,
    /// What is lost behind the last row, as [`TimedRow::torn`].
    pub(super) torn_at_end: Option<Vec<usize>>,
}

/// A row in UTC.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct TimedRow {
    pub(super) line: u64,
    /// Milliseconds since 1970.
    pub(super) at_ms: i64,
    pub(super) doubt: Option<Doubt>,
    pub(super) place: u64,
    pub(super) forgets: bool,
    /// The points that are known to have changed between the row before and this one, if something is
    /// lost there.
    pub(super) torn: Option<Vec<usize>>,
    pub(super) learnt: Vec<(usize, bool)>,
    pub(super) changes: Vec<Change>,
}

impl TimedRow {
    /// Whether it may be the same row in another file.
    fn is_same(&self, other: &TimedRow) -> bool {
        (self.at_ms, &self.changes) == (other.at_ms, &other.changes)
    }
}

/// Puts a list into UTC.
pub(super) fn timed(
    list: List,
    order: DateOrder,
    zone: Option<&TimeZone>,
    notes: &mut Notes,
) -> Result<Timed, Refusal> {
    let times = in_utc(&list, order, zone, notes)?;
    let List { rows, order, counts_from_beginning, overwritten, is_sampled, .. } = list;
    let mut torn_at_end = list.torn_at_end;
    let mut is_torn = false;
    let mut timed: Vec<(Utc, TimedRow)> = Vec::with_capacity(rows.len());
    let mut lost: Option<Vec<usize>> = None;
    for (mut row, time) in rows.into_iter().zip(times) {
        if let Some(torn) = row.torn.take() {
            lost.get_or_insert_default().extend(torn);
        }
        let Some(utc) = time else {
            is_torn = true;
            lost.get_or_insert_default();
            continue;
        };
        let forgets = row.forgets || std::mem::take(&mut is_torn);
        timed.push((
            utc,
            TimedRow {
                line: row.line,
                at_ms: utc.ns.div_euclid(MS_NS) + i64::from(utc.ns.rem_euclid(MS_NS) > 0),
                doubt: utc.doubt,
                place: row.place,
                forgets,
                torn: lost.take(),
                learnt: row.learnt,
                changes: row.changes,
            },
        ));
    }
    if let Some(lost) = lost {
        torn_at_end.get_or_insert_default().extend(lost);
    }
    match order {
        Order::Places => {}
        Order::PlacesOrReversed => turn(&mut timed, &mut torn_at_end, notes),
        Order::Times => put_in_order(&mut timed, &mut torn_at_end),
    }
    let rows = timed.into_iter().map(|(_, row)| row).collect();
    let by_time = order == Order::Times;
    Ok(Timed { rows, by_time, counts_from_beginning, overwritten, is_sampled, torn_at_end })
}

/// Puts rows in the order of their times. One millisecond has no order: it is that of the file, so
/// that it is the same each time.
fn put_in_order(timed: &mut [(Utc, TimedRow)], torn_at_end: &mut Option<Vec<usize>>) {
    if let (Some((first, _)), Some((last, _))) = (timed.first(), timed.last())
        && first.ns > last.ns
    {
        turn_tears(timed, torn_at_end);
        timed.reverse();
    }
    timed.sort_by_key(|(utc, _)| utc.ns);
}

/// Turns a list round whose times all say that it is upside down.
fn turn(timed: &mut [(Utc, TimedRow)], torn_at_end: &mut Option<Vec<usize>>, notes: &mut Notes) {
    let steps = || {
        timed.windows(2).filter_map(|pair| match pair {
            [(one, _), (other, _)] => Some(one.ns.cmp(&other.ns)),
            _ => None,
        })
    };
    let is_upside_down =
        steps().all(std::cmp::Ordering::is_ge) && steps().filter(|step| step.is_gt()).count() >= 2;
    if !is_upside_down {
        return;
    }
    notes.remark(None, "by all of its times this list is the other way round; it was turned");
    let last = timed.last().map_or(0, |(_, row)| row.place);
    turn_tears(timed, torn_at_end);
    timed.reverse();
    let mut place_before = None;
    for (_, row) in timed.iter_mut() {
        row.place = last + 1 - row.place;
        row.forgets |= place_before.is_some_and(|before| before + 1 != row.place);
        place_before = Some(row.place);
    }
}

/// What is lost before a row is lost after it where the rows come the other way round.
fn turn_tears(timed: &mut [(Utc, TimedRow)], torn_at_end: &mut Option<Vec<usize>>) {
    let mut after = torn_at_end.take();
    for (_, row) in timed.iter_mut().rev() {
        std::mem::swap(&mut after, &mut row.torn);
    }
    *torn_at_end = after;
}

/// Joins the lists of one recorder that belong together.
pub(super) fn joined(lists: Vec<Timed>) -> Vec<Timed> {
    let (by_time, mut by_place): (Vec<Timed>, Vec<Timed>) =
        lists.into_iter().partition(|list| list.by_time);
    by_place.sort_by_key(|list| (list.rows.first().map(|row| row.at_ms), list.rows.len()));
    let mut all = Joined::default();
    for list in by_place {
        all.add(list);
    }
    all.lists.extend(of_times(by_time));
    all.lists.retain(|list| !list.rows.is_empty());
    all.lists
}

/// Lists that were joined so far.
#[derive(Default)]
struct Joined {
    lists: Vec<Timed>,
    /// In which list, and at which place, a moment is first.
    by_moment: HashMap<i64, (usize, u64)>,
}

/// So many rows are looked for elsewhere before a list is one of its own.
const LOOKED_FOR: usize = 64;

impl Joined {
    fn add(&mut self, list: Timed) {
        let home = self.home(&list);
        let (index, first) = match home {
            Some((index, shift)) => (index, self.merge(index, list, shift)),
            None => {
                self.lists.push(list);
                (self.lists.len() - 1, 0)
            }
        };
        if let Some(list) = self.lists.get(index) {
            for row in list.rows.get(first..).unwrap_or_default() {
                self.by_moment.entry(row.at_ms).or_insert((index, row.place));
            }
        }
    }

    /// The list that this one goes on with or repeats, and what is added to its places then.
    fn home(&self, list: &Timed) -> Option<(usize, i128)> {
        let counted = |other: &Timed| other.counts_from_beginning && list.counts_from_beginning;
        if let Some(index) = self.lists.iter().position(counted) {
            return self.agree(index, list, 0).then_some((index, 0));
        }
        let firsts = list.rows.iter().filter_map(|row| {
            let (index, place) = *self.by_moment.get(&row.at_ms)?;
            Some((index, i128::from(place) - i128::from(row.place)))
        });
        firsts.take(LOOKED_FOR).find(|(index, shift)| self.shares(*index, list, *shift))
    }

    fn pairs<'a>(
        &'a self,
        index: usize,
        list: &'a Timed,
        shift: i128,
    ) -> impl Iterator<Item = (&'a TimedRow, &'a TimedRow)> {
        let rows = self.lists.get(index).map_or(&[][..], |list| &list.rows);
        list.rows.iter().filter_map(move |row| {
            let place = u64::try_from(i128::from(row.place) + shift).ok()?;
            let at = rows.binary_search_by_key(&place, |row| row.place).ok()?;
            Some((rows.get(at)?, row))
        })
    }

    fn agree(&self, index: usize, list: &Timed, shift: i128) -> bool {
        self.pairs(index, list, shift).all(|(one, other)| one.is_same(other))
    }

    fn shares(&self, index: usize, list: &Timed, shift: i128) -> bool {
        self.pairs(index, list, shift).next().is_some() && self.agree(index, list, shift)
    }

    /// Adds a list to another one. Returns from which row on that may be another one than before.
    fn merge(&mut self, index: usize, list: Timed, shift: i128) -> usize {
        let Some(home) = self.lists.get_mut(index) else { return 0 };
        let end = |rows: &[TimedRow], shift: i128| {
            rows.last().map_or(0, |row| i128::from(row.place) + shift)
        };
        home.torn_at_end = match end(&home.rows, 0).cmp(&end(&list.rows, shift)) {
            std::cmp::Ordering::Less => list.torn_at_end,
            std::cmp::Ordering::Equal => home.torn_at_end.take().and(list.torn_at_end),
            std::cmp::Ordering::Greater => home.torn_at_end.take(),
        };
        // Places count from 1, so what comes before the first one moves all others.
        let first = list.rows.first().map_or(1, |row| i128::from(row.place) + shift);
        let up = u64::try_from(1 - first.min(1)).unwrap_or_default();
        if up > 0 {
            home.rows.iter_mut().for_each(|row| row.place += up);
            self.by_moment.retain(|_, (list, _)| *list != index);
        }
        let moved =
            |place: u64| u64::try_from(i128::from(place) + shift + i128::from(up)).unwrap_or(1);
        let first = list.rows.first().map_or(u64::MAX, |row| moved(row.place));
        // Usually a list goes on where another one ends, which is not gone over then.
        let at = home.rows.partition_point(|row| row.place < first);
        let tail = home.rows.split_off(at);
        let mut rows: BTreeMap<u64, TimedRow> =
            tail.into_iter().map(|row| (row.place, row)).collect();
        for mut row in list.rows {
            row.place = moved(row.place);
            match rows.entry(row.place) {
                // A row that one list begins with, or that follows on a hole there, need not do so.
                Entry::Occupied(mut known) => {
                    let known = known.get_mut();
                    known.forgets &= row.forgets;
                    known.torn = known.torn.take().and(row.torn);
                }
                Entry::Vacant(vacant) => _ = vacant.insert(row),
            }
        }
        home.rows.extend(rows.into_values());
        home.overwritten = home.overwritten.max(list.overwritten);
        if up > 0 { 0 } else { at }
    }
}

/// Lists whose rows have the order of their times are one. A change that is in several is there once.
fn of_times(lists: Vec<Timed>) -> Option<Timed> {
    let last = |list: &Timed| list.rows.last().map(|row| row.at_ms);
    let end = lists.iter().filter_map(last).max();
    let mut rows: Vec<(usize, TimedRow)> = Vec::new();
    let mut torn_at_end = None;
    // Where a list ends torn and another goes on, the next row follows on what is lost.
    let mut torn_behind: Vec<i64> = Vec::new();
    for (place, list) in lists.into_iter().enumerate() {
        match (list.torn_at_end.is_some(), last(&list)) {
            (true, Some(at_ms)) if Some(at_ms) < end => torn_behind.push(at_ms),
            (true, Some(_)) => torn_at_end = Some(Vec::new()),
            _ => {}
        }
        rows.extend(list.rows.into_iter().map(|row| (place, row)));
    }
    rows.sort_by_key(|(_, row)| row.at_ms);
    for at_ms in torn_behind {
        let next = rows.partition_point(|(_, row)| row.at_ms <= at_ms);
        if let Some((_, row)) = rows.get_mut(next) {
            row.torn.get_or_insert_default();
        }
    }
    let mut together: Vec<TimedRow> = Vec::new();
    let mut rows = rows.into_iter().peekable();
    while let Some((list, first)) = rows.next() {
        let at_ms = first.at_ms;
        let mut moment = Instant::of(list, first);
        while let Some((list, row)) = rows.next_if(|(_, row)| row.at_ms == at_ms) {
            moment.add(list, row);
        }
        together.extend(moment.rows());
    }
    let mut place = 0;
    for row in &mut together {
        // What is lost has a place of its own.
        place += 1 + u64::from(row.torn.is_some() && place > 0);
        row.place = place;
    }
    (!together.is_empty()).then(|| Timed {
        rows: together,
        by_time: true,
        torn_at_end,
        ..Timed::default()
    })
}

/// What several lists say of one millisecond. Only the changes of each point have an order there.
struct Instant {
    /// The first row; the changes are kept by point.
    row: TimedRow,
    /// The points, in the order in which they are first named.
    points: Vec<usize>,
    /// By point: what became of it, one after the other, as all lists before the present one say it,
    /// and as that one does.
    of_points: HashMap<usize, (Vec<To>, Vec<To>)>,
    list: usize,
}

impl Instant {
    fn of(list: usize, mut row: TimedRow) -> Instant {
        let changes = std::mem::take(&mut row.changes);
        let mut instant = Instant { row, points: Vec::new(), of_points: HashMap::new(), list };
        instant.take(changes);
        instant
    }

    fn add(&mut self, list: usize, row: TimedRow) {
        if list != self.list {
            self.list = list;
            self.of_points.values_mut().for_each(settle);
        }
        self.row.torn = self.row.torn.take().or(row.torn);
        self.take(row.changes);
    }

    fn take(&mut self, changes: Vec<Change>) {
        for Change { point, to } in changes {
            let (_, now) = self.of_points.entry(point).or_insert_with(|| {
                self.points.push(point);
                Default::default()
            });
            // The same row twice is one change.
            if now.last() != Some(&to) {
                now.push(to);
            }
        }
    }

    /// As few rows as hold the changes of each point in their order.
    fn rows(mut self) -> Vec<TimedRow> {
        self.of_points.values_mut().for_each(settle);
        let mut rows: Vec<TimedRow> = Vec::new();
        for point in self.points {
            let Some((changes, _)) = self.of_points.remove(&point) else { continue };
            for (nth, to) in changes.into_iter().enumerate() {
                if nth == rows.len() {
                    let torn = if nth == 0 { self.row.torn.take() } else { None };
                    rows.push(TimedRow { torn, ..self.row.clone() });
                }
                if let Some(row) = rows.get_mut(nth) {
                    row.changes.push(Change { point, to });
                }
            }
        }
        rows
    }
}

/// Adds what one list says of a point to what others say: the longer account of the two if one
/// begins as the other, else one after the other.
fn settle((all, now): &mut (Vec<To>, Vec<To>)) {
    let now = std::mem::take(now);
    if now.starts_with(all) {
        *all = now;
    } else if !all.starts_with(&now) {
        all.extend(now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(point: usize, is_on: bool) -> Change {
        Change { point, to: To::State(is_on) }
    }

    fn list(rows: &[(i64, usize, bool)]) -> Timed {
        let rows = (1..).zip(rows).map(|(place, &(at_ms, point, is_on))| TimedRow {
            line: place,
            at_ms,
            doubt: None,
            place,
            forgets: false,
            torn: None,
            learnt: Vec::new(),
            changes: vec![change(point, is_on)],
        });
        Timed { rows: rows.collect(), by_time: true, ..Timed::default() }
    }

    fn changes(lists: &[&Timed]) -> Vec<(i64, Vec<Change>)> {
        let joined = joined(lists.iter().map(|&list| list.clone()).collect());
        joined.into_iter().flat_map(|list| list.rows).map(|row| (row.at_ms, row.changes)).collect()
    }

    #[test]
    fn a_list_that_is_there_twice_says_everything_once() {
        let one = list(&[(5, 0, true), (5, 0, false), (5, 1, true), (7, 0, true)]);
        let expected = [
            (5, vec![change(0, true), change(1, true)]),
            (5, vec![change(0, false)]),
            (7, vec![change(0, true)]),
        ];
        assert_eq!(changes(&[&one]), expected);
        assert_eq!(changes(&[&one, &one]), expected);
        // A part of it says nothing new; what contradicts it is kept.
        assert_eq!(changes(&[&one, &list(&[(5, 0, true)])]), expected);
        assert_eq!(changes(&[&one, &list(&[(5, 0, false)])]).len(), 4);
    }

    /// So many that a look at each other one would take hours.
    #[test]
    fn many_changes_of_one_millisecond_are_joined_at_once() {
        let many: Vec<(i64, usize, bool)> =
            (0..200_000).map(|place| (5, place % 60_000, place / 60_000 % 2 == 0)).collect();
        assert_eq!(changes(&[&list(&many), &list(&many)]).len(), 4);
    }
}
