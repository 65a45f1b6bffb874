//! One reading of a recorder's log from a cursor that the caller keeps.

use super::follower::LogFollower;
use crate::reading::cursor::Cursor;
use crate::reading::delivery::Delivery;
use crate::reading::summary::Summary;
use crate::unit::Unit;
use crate::unit::request_error::RequestError;

impl Unit {
    /// Reads what has happened since `cursor` from a log of `size` entries, or everything if there
    /// is no cursor. Each event is delivered once and in order, and losses are reported; see
    /// [`reader`](crate::reader).
    ///
    /// `cursor` moves on with every reply, never past what was handed to `on`. After an error the
    /// next call continues where this one stopped.
    ///
    /// # Errors
    /// If no reply comes, the line fails, or the log is changed again and again while it is read.
    pub fn read_new(
        &mut self,
        cursor: &mut Option<Cursor>,
        size: u16,
        on: &mut dyn FnMut(Delivery),
    ) -> Result<Summary, RequestError> {
        let mut follower = LogFollower::new(*cursor, size).starting_near(self.last_position.take());
        let summary = follower.read_new(self, &mut |step| {
            step.deliveries.iter().copied().for_each(&mut *on);
            *cursor = step.cursor;
            Ok::<(), RequestError>(())
        })?;
        self.last_position = follower.position();
        Ok(summary)
    }
}
