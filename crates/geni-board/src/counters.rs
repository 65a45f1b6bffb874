//! Counters of what was lost, refused or out of order.

macro_rules! counters {
    ($($(#[$doc:meta])+ $name:ident,)+) => {
        /// Counts since the driver was made. A counter stops at its largest value.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub struct Counters {
            $($(#[$doc])+ pub $name: u32,)+
        }

        impl Counters {
            /// All counters by name.
            #[must_use]
            pub const fn all(&self) -> [(&'static str, u32); [$(stringify!($name)),+].len()] {
                [$((stringify!($name), self.$name)),+]
            }
        }
    };
}

counters! {
    /// Times the board was found to have failed.
    failures,
    /// Times the board was reset because of that.
    resets,
    /// Times the board left the bus.
    bus_losses,
    /// Bus errors that the board counted.
    bus_errors,
    /// Configurations that the board refused.
    configurations_refused,
    /// Commands that were not finished in time.
    commands_timed_out,
    /// Commands that finished after they had been given up.
    commands_late,
    /// Commands that had to wait because the block held another program's command.
    commands_blocked,
    /// Commands that the board refused as wrong.
    commands_refused,
    /// Commands that failed: no acknowledgement, no reply, no memory.
    commands_failed,
    /// Commands that ended with an undefined status, or vanished.
    commands_unknown,
    /// Received datagrams with an impossible source or length.
    datagrams_refused,
    /// This board's own broadcasts, which it always receives too.
    own_broadcasts,
    /// Requests for this host's memory that were refused.
    requests_refused,
    /// Requests refused because no answer came in time; also in `requests_refused`.
    requests_unanswered,
    /// Requests refused because of an impossible length; also in `requests_refused`.
    requests_malformed,
    /// Times the request queue was found full: requests may have been lost.
    request_queue_full,
    /// Request queue pointers that were out of range.
    request_pointers_refused,
    /// Device table entries that contradict themselves.
    device_records_refused,
    /// Lockouts in force that this driver had not asked for.
    lockouts_foreign,
    /// Lockouts that ended before the driver gave them back.
    lockouts_lost,
}

/// Adds one to a counter that stops at its largest value.
pub(crate) fn count(counter: &mut u32) {
    count_by(counter, 1);
}

/// Adds to a counter that stops at its largest value.
pub(crate) fn count_by(counter: &mut u32, by: u32) {
    *counter = counter.saturating_add(by);
}
