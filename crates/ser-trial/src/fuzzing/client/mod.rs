//! The host's side: a session and readers of the log, against a line that brings anything, and
//! against a recorder that tells the truth over a line that does not always.

mod anything;
mod truth;
mod truthful_unit;

use super::script::Script;

/// The first byte of `data` selects one of two trials.
///
/// Against a line that brings anything:
/// - an answer belongs to the request; what nobody asked for is kept up to a limit; lines have an
///   end;
/// - readers take any reply to any request, and their cursors move as far as they deliver.
///
/// Against a recorder that tells the truth, on a line that loses, cuts and damages messages and
/// brings some late:
/// - no event is delivered twice, out of order, or different from what it was;
/// - the events delivered and the events reported as lost make up the whole log;
/// - every erase is reported, unless the log is full again when it is looked at, or nothing was
///   known of it before.
///
/// # Panics
/// When one of these does not hold.
pub fn client(data: &[u8]) {
    let mut script = Script::new(data);
    if script.byte().is_multiple_of(2) {
        anything::talk(script);
    } else {
        truth::follow(script);
    }
}
