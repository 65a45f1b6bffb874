//! What test files share: the pages of the documentation that name tests, and the protocol vectors.

pub mod pages;
pub mod vectors;
