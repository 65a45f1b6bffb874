//! From contacts to inputs: wires and the delays of input circuits.

use ser_evidence::site::Delays;

use crate::chance::Chance;
use crate::contact::Contact;
use crate::true_time::{Ps, US};

/// A contact that is wired to an input.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wire {
    pub(crate) input: u8,
    pub(crate) contact: usize,
    /// Whether the input is on while the contact is open.
    pub(crate) is_inverted: bool,
    pub(crate) is_on_at_first: bool,
}

/// A change at a sampled input.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Edge {
    pub(crate) arrives: Ps,
    pub(crate) input: u8,
    pub(crate) is_on: bool,
    pub(crate) contact: usize,
    /// When the contact moved.
    pub(crate) moved: Ps,
}

impl Edge {
    /// Puts the change into the levels of all inputs.
    pub(crate) fn apply(self, levels: &mut u32) {
        let bit = 1 << (self.input - 1);
        if self.is_on { *levels |= bit } else { *levels &= !bit }
    }
}

/// All changes at the inputs, in the order in which they arrive.
pub(crate) fn edges(
    wires: &[Wire],
    contacts: &[Contact],
    delays: Delays,
    chance: &mut Chance,
) -> Vec<Edge> {
    let mut edges: Vec<Edge> = Vec::new();
    for wire in wires {
        edges.extend(edges_of(wire, &contacts[wire.contact], delays, chance));
    }
    edges.sort_by_key(|edge| edge.arrives);
    edges
}

fn edges_of(wire: &Wire, contact: &Contact, delays: Delays, chance: &mut Chance) -> Vec<Edge> {
    let mut edges: Vec<Edge> = Vec::new();
    for moved in &contact.moves {
        let is_on = moved.closes != wire.is_inverted;
        let (shortest, longest) = if is_on { delays.closing_us } else { delays.opening_us };
        let delay = if chance.one_in(3) {
            i64::from(chance.of(&[shortest, longest]))
        } else {
            chance.between(shortest.into(), longest.into())
        };
        let arrives = moved.at + delay * US;
        // A pulse that the circuit swallows: it would be over before it arrives.
        if edges.last().is_some_and(|last| last.arrives >= arrives) {
            edges.pop();
            continue;
        }
        edges.push(Edge {
            arrives,
            input: wire.input,
            is_on,
            contact: wire.contact,
            moved: moved.at,
        });
    }
    edges
}
