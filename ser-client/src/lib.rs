//! A host`s conversation with a recorder.
