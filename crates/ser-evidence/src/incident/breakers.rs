//! What breakers did: how long they took, and how their contacts bounced.

use super::Row;
use crate::site::{PointId, Role};
use crate::timeline::{ChangeId, Delta, Timeline};

/// A breaker opened or closed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Operation {
    /// Its name, from the site.
    pub equipment: String,
    /// Whether it opened.
    pub opened: bool,
    /// The command that told it to, if it was recorded.
    pub command: Option<ChangeId>,
    /// The auxiliary contact that showed it first.
    pub contact: ChangeId,
    /// From the command to the contact.
    pub took: Option<Delta>,
    /// How that contact bounced.
    pub bounce: Option<Bounce>,
}

/// A contact that did not come to rest at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bounce {
    /// Changes after the first one.
    pub changes: usize,
    /// Until the last one.
    pub lasted: Delta,
}

/// All operations that the rows show, in their order.
pub(super) fn operations(timeline: &Timeline<'_>, rows: &[Row]) -> Vec<Operation> {
    let site = timeline.site();
    let point = |row: &Row| row.point.and_then(|PointId(index)| site.points.get(index));
    let mut operations: Vec<Operation> = Vec::new();
    let mut rest = rows.iter();
    while let Some(row) = rest.next() {
        let Some(moved) = point(row) else { continue };
        let (Some(equipment), Some(opened)) = (&moved.equipment, opened(moved.role, row.on)) else {
            continue;
        };
        // Bounces, and the other contact of the same movement.
        let is_known = operations.iter().rev().find(|known| known.equipment == *equipment);
        if let Some(known) = is_known
            && (known.opened == opened || is_bounce(timeline, known.contact, row.change))
        {
            continue;
        }
        let before = rows.iter().take_while(|other| other.change != row.change);
        let wanted = if opened { Role::Trip } else { Role::Close };
        let command = before.filter(|other| other.on == Some(true)).filter(|other| {
            point(other).is_some_and(|point| {
                point.role == Some(wanted) && point.equipment.as_ref() == Some(equipment)
            })
        });
        let command = command.last().map(|row| row.change);
        operations.push(Operation {
            equipment: equipment.clone(),
            opened,
            command,
            contact: row.change,
            took: command.map(|command| timeline.delta(command, row.change)),
            bounce: bounce(timeline, row, rest.as_slice()),
        });
    }
    operations
}

/// Whether a breaker opened, by one of its contacts; `None` if that contact says nothing of it.
fn opened(role: Option<Role>, on: Option<bool>) -> Option<bool> {
    let on = on?;
    match role? {
        Role::BreakerClosed => Some(!on),
        Role::BreakerOpen => Some(on),
        Role::Trip | Role::Close | Role::Pickup | Role::Lockout | Role::Alarm => None,
    }
}

/// Whether a change is so soon after that the contact cannot have come to rest.
fn is_bounce(timeline: &Timeline<'_>, first: ChangeId, later: ChangeId) -> bool {
    let within = bounce_window_us(timeline);
    timeline.delta(first, later).middle_us().is_some_and(|us| us <= within)
}

/// Contacts bounce for a few milliseconds. What takes as long as half of a chatter is an operation.
fn bounce_window_us(timeline: &Timeline<'_>) -> i64 {
    (timeline.site().incident.chatter.within_us / 10).max(1)
}

fn bounce(timeline: &Timeline<'_>, row: &Row, later: &[Row]) -> Option<Bounce> {
    let same = |other: &&Row| {
        (other.change.event.recorder, other.change.input)
            == (row.change.event.recorder, row.change.input)
    };
    let mut last = row.change;
    let mut changes = 0;
    for other in later.iter().filter(same) {
        if !is_bounce(timeline, last, other.change) {
            break;
        }
        last = other.change;
        changes += 1;
    }
    (changes > 0).then(|| Bounce { changes, lasted: timeline.delta(row.change, last) })
}
