//! The tables of a site file as plain structs. Names are still names, and every value has its
//! place.
//!
//! What could not be understood is `None`: it has been told, and the rest is read nevertheless.

mod fields;
mod kind;
mod number;
mod readers;
mod tables;
mod text;
mod words;

pub(super) use tables::{
    EdgeText, ExpectTable, GroupTable, ObservationTable, Owner, PointTable, RecorderTable,
    ShiftTable, SiteTable,
};
