//! What breakers did: how long they took, and how their contacts bounced.

use std::collections::HashMap;

use super::Row;
use crate::site::Role;
use crate::timeline::{ChangeId, Delta, Timeline};

/// A breaker opened or closed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Operation {
    /// Its name, from the site.
    pub equipment: String,
    /// Whether it opened.
    pub opened: bool,
    /// The command that told it to, if it was recorded: the last one before, which no other operation
    /// has followed, and which did not end long before.
    pub command: Option<ChangeId>,
    /// The auxiliary contact that showed it first.
    pub contact: ChangeId,
    /// From the command to the contact.
    pub took: Option<Delta>,
    /// How that contact bounced.
    pub bounce: Option<Bounce>,
    /// After how long it was back where it had been, if it came to rest there with no command.
    pub returned: Option<Delta>,
}

/// A contact that did not come to rest at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bounce {
    /// Changes after the first one, without the one with which it returned for good.
    pub changes: usize,
    /// Until the last one.
    pub lasted: Delta,
}

/// All operations that the rows show, in their order.
pub(super) fn operations(timeline: &Timeline<'_>, rows: &[Row]) -> Vec<Operation> {
    let points = &timeline.site().points;
    let mut breakers: HashMap<&str, Breaker> = HashMap::new();
    let mut movements: Vec<Movement> = Vec::new();
    for row in rows {
        let point = row.point.and_then(|id| points.get(id.0));
        let Some((point, on)) = point.zip(row.on) else { continue };
        let (Some(equipment), Some(role)) = (&point.equipment, point.role) else { continue };
        let breaker = breakers.entry(equipment).or_default();
        match role {
            Role::Trip => breaker.trip.takes(row.change, on),
            Role::Close => breaker.close.takes(row.change, on),
            Role::BreakerClosed | Role::BreakerOpen => {
                let opened = on == (role == Role::BreakerOpen);
                let current = breaker.current.and_then(|place| movements.get_mut(place));
                let command = breaker.command(opened).why(timeline, row.change);
                let seen = Seen { change: row.change, opened, is_told: command.is_some() };
                if current.is_some_and(|movement| movement.goes_on_with(timeline, seen)) {
                    continue;
                }
                breaker.current = Some(movements.len());
                *breaker.command(opened) = Command::default();
                movements.push(Movement::new(equipment, command, row.change, opened));
            }
            Role::Pickup | Role::Lockout | Role::Alarm => {}
        }
    }
    movements.into_iter().map(|movement| movement.operation(timeline)).collect()
}

/// A breaker while the rows go by.
#[derive(Clone, Copy, Debug, Default)]
struct Breaker {
    trip: Command,
    close: Command,
    /// The index of its last movement.
    current: Option<usize>,
}

impl Breaker {
    /// What tells it to open, or to close.
    fn command(&mut self, opens: bool) -> &mut Command {
        if opens { &mut self.trip } else { &mut self.close }
    }
}

/// A command that no operation has followed yet.
#[derive(Clone, Copy, Debug, Default)]
struct Command {
    given: Option<ChangeId>,
    /// When it went off again.
    ended: Option<ChangeId>,
}

/// A breaker that has not moved so long after a command ended, in microseconds, moves because of
/// something else.
const AFTER_COMMAND_US: i64 = 1_000_000;

impl Command {
    fn takes(&mut self, change: ChangeId, on: bool) {
        if on {
            *self = Command { given: Some(change), ended: None };
        } else if self.given.is_some_and(|given| is_same_input(given, change)) {
            self.ended = Some(change);
        }
    }

    /// The command, if it can be why the breaker moves.
    fn why(&self, timeline: &Timeline<'_>, moves: ChangeId) -> Option<ChangeId> {
        let ended = self.ended.and_then(|ended| timeline.delta(ended, moves).middle_us());
        self.given.filter(|_| ended.is_none_or(|us| us <= AFTER_COMMAND_US))
    }
}

/// A change of one of its contacts.
#[derive(Clone, Copy, Debug)]
struct Seen {
    change: ChangeId,
    opened: bool,
    /// Whether a command told the breaker to.
    is_told: bool,
}

/// A breaker moved, and its contacts until they rest.
#[derive(Debug)]
struct Movement {
    equipment: String,
    opened: bool,
    command: Option<ChangeId>,
    /// The changes of the contact that moved first.
    changes: Vec<ChangeId>,
    /// Whether the breaker is open after them.
    rests_open: bool,
    /// The last change of any of its contacts.
    last: ChangeId,
}

impl Movement {
    fn new(equipment: &str, command: Option<ChangeId>, contact: ChangeId, opened: bool) -> Self {
        let (equipment, changes) = (equipment.to_owned(), vec![contact]);
        Movement { equipment, opened, command, changes, rests_open: opened, last: contact }
    }

    /// Takes a change of a contact that has not come to rest, or of the other contact.
    fn goes_on_with(&mut self, timeline: &Timeline<'_>, seen: Seen) -> bool {
        let Seen { change, opened, is_told } = seen;
        let is_first = self.changes.first().is_some_and(|&one| is_same_input(one, change));
        // A breaker that was told to go back does not bounce.
        let is_other = is_told && opened != self.opened;
        if is_other || !is_bounce(timeline, self.last, change) {
            return !is_first && opened == self.rests_open;
        }
        self.last = change;
        if is_first {
            self.changes.push(change);
            self.rests_open = opened;
        }
        true
    }

    fn operation(self, timeline: &Timeline<'_>) -> Operation {
        let Movement { equipment, opened, command, changes, rests_open, last } = self;
        let returned = rests_open != opened;
        let contact = changes.first().copied().unwrap_or(last);
        let until = |change: Option<&ChangeId>| Some(timeline.delta(contact, *change?));
        let bounced = changes.len().saturating_sub(if returned { 2 } else { 1 });
        let lasted = until(changes.get(bounced)).filter(|_| bounced > 0);
        Operation {
            equipment,
            opened,
            command,
            contact,
            took: command.map(|command| timeline.delta(command, contact)),
            bounce: lasted.map(|lasted| Bounce { changes: bounced, lasted }),
            returned: until(changes.last()).filter(|_| returned),
        }
    }
}

fn is_same_input(one: ChangeId, other: ChangeId) -> bool {
    (one.event.recorder, one.input) == (other.event.recorder, other.input)
}

/// Whether a change is so soon after that the contact cannot have come to rest. Contacts bounce for
/// a few milliseconds. What takes as long as a tenth of a chatter is an operation.
fn is_bounce(timeline: &Timeline<'_>, first: ChangeId, later: ChangeId) -> bool {
    let within = (timeline.site().incident.chatter.within_us / 10).max(1);
    timeline.delta(first, later).middle_us().is_some_and(|us| us <= within)
}
