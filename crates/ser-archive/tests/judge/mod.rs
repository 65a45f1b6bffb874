//! A program in another language, written by the page on the archive, comes to the same digests.

mod needs_python_readers;
