//! Every archive does what the cases say, in a file and in a database.

mod cases;
mod common;
