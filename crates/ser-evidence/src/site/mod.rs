//! The site: what people know of the plant and of their recorders.
//!
//! A site is read from a TOML file in stages, each with its own types: text, a document that keeps
//! its places, plain structs, and the resolved [`Site`], in which every name has become an index.
//! What is wrong with the file is told as data, [`Diagnostic`]s; each comes from one check, and each
//! check has a file of its own.

mod checks;
mod diagnostic;
mod digest;
mod file;
mod model;
mod nearest;
mod reading;
mod resolve;

pub use diagnostic::{Diagnostic, Related, Severity, Span};
pub use digest::SiteDigest;
pub use model::{
    Chatter, ClockRule, Delays, Edge, Expectation, Group, GroupId, HandObservation, IncidentRules,
    Point, PointId, Recorder, RecorderId, Role, Shift, Site,
};
pub use reading::{PortPlace, Reading, inspect, read};
