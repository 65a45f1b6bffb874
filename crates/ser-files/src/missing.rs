//! The words for what is missing, as more than one part of this crate has to have them.

/// How a row of our CSV for PRC-002 begins its state where it says that something is missing.
pub(crate) const RECORDS_MISSING: &str = "RECORDS MISSING";
