//! Counters of what was lost, refused or out of order.

/// Counts since the driver was made. A counter stops at its largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Counters {
    /// Times the board was found to have failed.
    pub failures: u32,
    /// Times the board was reset because of that.
    pub resets: u32,
    /// Times the board left the bus.
    pub bus_losses: u32,
    /// Bus errors that the board counted.
    pub bus_errors: u32,
    /// Configurations that the board refused.
    pub configurations_refused: u32,
    /// Commands that were not finished in time.
    pub commands_timed_out: u32,
    /// Commands that finished after they had been given up.
    pub commands_late: u32,
    /// Commands that had to wait because the block held another program's command.
    pub commands_blocked: u32,
    /// Commands that the board refused as wrong.
    pub commands_refused: u32,
    /// Commands that failed: no acknowledgement, no reply, no memory.
    pub commands_failed: u32,
    /// Commands that ended with an undefined status, or vanished.
    pub commands_unknown: u32,
    /// Received datagrams with an impossible source or length.
    pub datagrams_refused: u32,
    /// This board's own broadcasts, which it always receives too.
    pub own_broadcasts: u32,
    /// Requests for this host's memory that were refused.
    pub requests_refused: u32,
    /// Requests refused because no answer came in time; also in `requests_refused`.
    pub requests_unanswered: u32,
    /// Requests refused because of an impossible length; also in `requests_refused`.
    pub requests_malformed: u32,
    /// Times the request queue was found full: requests may have been lost.
    pub request_queue_full: u32,
    /// Request queue pointers that were out of range.
    pub request_pointers_refused: u32,
    /// Device table entries that contradict themselves.
    pub device_records_refused: u32,
    /// Lockouts in force that this driver had not asked for.
    pub lockouts_foreign: u32,
    /// Lockouts that ended before the driver gave them back.
    pub lockouts_lost: u32,
}

/// Adds one to a counter that stops at its largest value.
pub(crate) fn count(counter: &mut u32) {
    count_by(counter, 1);
}

/// Adds to a counter that stops at its largest value.
pub(crate) fn count_by(counter: &mut u32, by: u32) {
    *counter = counter.saturating_add(by);
}
