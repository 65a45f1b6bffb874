//! The recorder itself.
