//! Which input of which recorder each point gets.
//!
//! Only points that moved take an input, in the order in which they first did. A recorder has 32. What
//! goes beyond is on further ones, `NAME (2)`, which show the same clock.

use std::collections::{BTreeMap, BTreeSet};

use super::list::Texts;
use super::map::Map;
use super::timed::Timed;

/// The most recorders that one foreign recorder becomes.
pub(super) const MOST_RECORDERS: usize = 64;

/// An input of a recorder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Place {
    /// The recorder, by its place in [`Inputs::recorders`].
    pub(super) recorder: usize,
    /// The input, from 1.
    pub(super) input: u8,
}

/// Where all points are.
#[derive(Debug, Default)]
pub(super) struct Inputs {
    /// The names of the recorders.
    pub(super) recorders: Vec<String>,
    of_points: BTreeMap<usize, Place>,
    /// Points that moved and got none.
    pub(super) without_input: BTreeSet<usize>,
}

impl Inputs {
    /// Gives each point that moves an input.
    pub(super) fn of(lists: &[Timed], points: &Texts, name: &str, map: &Map) -> Inputs {
        let mut inputs = Inputs::default();
        let mut taken: BTreeSet<(String, u8)> = map
            .targets()
            .map(|(recorder, input)| (recorder.unwrap_or(name).to_owned(), input))
            .collect();
        let mut spare = (1_usize, 1_u8);
        // What changed where something is lost has a name, too.
        let moved = lists.iter().flat_map(|list| {
            let rows = list.rows.iter().flat_map(|row| {
                let changes = row.changes.iter().map(|change| change.point);
                row.torn.iter().flatten().copied().chain(changes)
            });
            rows.chain(list.torn_at_end.iter().flatten().copied())
        });
        for point in moved {
            if inputs.of_points.contains_key(&point) || inputs.without_input.contains(&point) {
                continue;
            }
            let (recorder, input) = match map.target(points.get(point)) {
                Some((recorder, input)) => (recorder.unwrap_or(name).to_owned(), input),
                None => match next(name, &mut spare, &mut taken) {
                    Some(found) => found,
                    None => {
                        inputs.without_input.insert(point);
                        continue;
                    }
                },
            };
            let recorder = inputs.recorder(recorder);
            inputs.of_points.insert(point, Place { recorder, input });
        }
        inputs
    }

    /// Where a point is; `None` if it never moved.
    pub(super) fn of_point(&self, point: usize) -> Option<Place> {
        self.of_points.get(&point).copied()
    }

    /// All points of a recorder, by input.
    pub(super) fn points(&self, recorder: usize) -> Vec<(u8, usize)> {
        let own = self.of_points.iter().filter(|(_, place)| place.recorder == recorder);
        let mut points: Vec<(u8, usize)> =
            own.map(|(point, place)| (place.input, *point)).collect();
        points.sort_unstable();
        points
    }

    fn recorder(&mut self, name: String) -> usize {
        let known = self.recorders.iter().position(|known| *known == name);
        known.unwrap_or_else(|| {
            self.recorders.push(name);
            self.recorders.len() - 1
        })
    }
}

/// The next input that nobody has.
fn next(
    name: &str,
    spare: &mut (usize, u8),
    taken: &mut BTreeSet<(String, u8)>,
) -> Option<(String, u8)> {
    while spare.0 <= MOST_RECORDERS {
        let (number, input) = *spare;
        *spare = if input == 32 { (number + 1, 1) } else { (number, input + 1) };
        let recorder = if number == 1 { name.to_owned() } else { format!("{name} ({number})") };
        if taken.insert((recorder.clone(), input)) {
            return Some((recorder, input));
        }
    }
    None
}
