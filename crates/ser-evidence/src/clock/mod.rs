//! From observations of a recorder's clock to its offset, with its doubt.
//!
//! A recorder's clock drifts slowly and is set now and then. The entries between two sets are a
//! *run*. All observations of a run bound its offset, each less so the further away it is. Two
//! recorders that heard one broadcast, or that watch one contact, bound each other's.
//!
//! `envelope` reckons with bounds that age; `hosts` knows the clocks of the observers, and `when`
//! says by them when something was. `runs` finds where clocks were set, `secret_steps` where nobody
//! told of it, and `lives` does so for all that is told of a recorder. `placing` says to which run an
//! observation belongs, and `sorting` gives it to that. `offsets` makes bounds of them, and `links`
//! lets recorders bound each other. `local` is for clocks that nobody observed. `successions` and
//! `layout` find a place in one list for everything, and `model` puts all this together.

pub(crate) mod envelope;
mod finding;
pub(crate) mod hosts;
pub(crate) mod layout;
pub(crate) mod links;
pub(crate) mod lives;
pub(crate) mod local;
pub(crate) mod model;
pub(crate) mod offsets;
pub(crate) mod placing;
pub(crate) mod runs;
mod secret_steps;
pub(crate) mod sorting;
mod successions;
pub(crate) mod when;

pub use finding::Finding;
pub use links::LinkReason;
pub use local::Nominal;
pub use offsets::Home;
