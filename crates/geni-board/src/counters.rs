//! Counters of everything that was lost, refused or out of order.

/// Counts since the driver was made; they stop at the largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Counters {
    /// Times the board was found to have failed.
    pub failures: u32,
    /// Times the reset line was pulled because of that.
    pub resets: u32,
    /// Times the board left the bus.
    pub bus_losses: u32,
    /// Bus errors that the board counted.
    pub bus_errors: u32,
    /// Configurations that the board refused.
    pub configurations_refused: u32,
    /// Commands that were not finished in time.
    pub commands_timed_out: u32,
    /// Commands that were finished after all, when nobody waited any more.
    pub commands_late: u32,
    /// Commands that found the block occupied by somebody else's.
    pub commands_blocked: u32,
    /// Commands that the board called wrong.
    pub commands_refused: u32,
    /// Commands that failed: no acknowledgement, no reply, no memory.
    pub commands_failed: u32,
    /// Commands that ended with a status that does not exist, or vanished.
    pub commands_unknown: u32,
    /// Received datagrams with an impossible source or length.
    pub datagrams_refused: u32,
    /// Own broadcasts that came back, as they always do.
    pub own_broadcasts: u32,
    /// Requests for this host's memory that were refused.
    pub requests_refused: u32,
    /// Of these, because no answer came in time.
    pub requests_unanswered: u32,
    /// Of these, because they had an impossible length.
    pub requests_malformed: u32,
    /// Times the request queue was found full: requests may have been lost.
    pub request_queue_full: u32,
    /// Request queue pointers that were out of range.
    pub request_pointers_refused: u32,
    /// Device records that contradict themselves.
    pub device_records_refused: u32,
    /// Lockouts that were found in force although this driver had not asked for them.
    pub lockouts_foreign: u32,
    /// Lockouts that ended before they were given back.
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
