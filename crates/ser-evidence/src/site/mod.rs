//! The site: what people know of the plant and of their recorders.
//!
//! A site is read from a TOML file in stages, each with its own types: text, a document that keeps
//! its places, plain structs, and the resolved [`Site`], in which every name has become an index.

mod model;

pub use model::{
    Chatter, ClockRule, Delays, Edge, Expectation, Group, GroupId, HandObservation, IncidentRules,
    Point, PointId, Recorder, RecorderId, Role, Shift, Site,
};
