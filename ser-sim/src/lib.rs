//! The world around a recorder.
