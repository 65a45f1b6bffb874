//! Time limits: the manual's figures, and this crate's where the manual gives none.

/// The host keeps away from the RAM this long after the reset line has been released (chapter 3,
/// Startup).
pub const NO_ACCESS_MS: u32 = 1_700;

/// The board sets its OK flag within this time after reset (chapter 3, Startup).
pub const START_UP_MS: u32 = 2_000;

/// Added to [`START_UP_MS`] before the board counts as failed, because its clock and the host's
/// started at different moments.
pub const START_UP_MARGIN_MS: u32 = 500;

/// The host may configure for this long between the OK flag and the board's first message on the
/// bus (chapter 3, Startup). The board is also off the bus for this long after a change of
/// configuration (chapter 10, Configuration Change).
pub const OFF_BUS_MS: u32 = 1_500;

/// Duration of the reset at power-up: the larger of the two figures in chapter 2 (Interrupt and
/// Reset Timing). The signal table has 20 ms *after the supplies are in tolerance*, a moment that a
/// host does not know.
pub const POWER_UP_RESET_MS: u32 = 2_000;

/// Duration of a reset in operation. The manual asks for 10 µs; this is many times more and still
/// short.
pub const RESET_MS: u32 = 20;

/// The board sets its OK flag this often (chapter 5, GENI OK Status).
pub const HEARTBEAT_MS: u32 = 200;

/// A board without a heartbeat for five periods has failed. The limit is below [`NO_ACCESS_MS`], so
/// a board that restarted by itself is noticed before its fresh tables can be mistaken for answers.
pub const HEARTBEAT_TIMEOUT_MS: u32 = 5 * HEARTBEAT_MS;

/// The least time for a command. The manual gives it five bus scans (chapter 10, Example
/// Algorithms), but a datagram of normal priority waits for a scan in which no other device sends
/// one.
pub const TRANSMIT_TIMEOUT_MS: u32 = 2_000;

/// The board gives up on a reply after 10 s (chapter 10, Transmit Datagram with Reply). The host
/// waits a little longer to hear of it.
pub const REPLY_TIMEOUT_MS: u32 = 12_000;

/// A command block that stays occupied this long belongs to a failed board. The limit applies to a
/// command that was given up, that nobody waits for, or that moves no data over the bus.
pub const COMMAND_STUCK_MS: u32 = 5_000;

/// The board grants or ends a lockout after the table access in progress. The host must not
/// withdraw a request (chapter 9), so a board that does not answer it for this long has failed.
pub const LOCKOUT_STUCK_MS: u32 = 5_000;

/// Flags are checked this often even when the summary byte shows none.
pub const FLAGS_PERIOD_MS: u32 = 20;

/// Queues and tables are checked this often even without a flag, so a lost flag loses no data.
pub const SAFETY_PERIOD_MS: u32 = 1_000;

/// A memory request without an answer is refused after this time, which keeps the queue from
/// filling.
pub const REQUEST_ANSWER_MS: u32 = 2_000;

/// Longest pause between two attempts to start a board.
pub const MAX_RETRY_MS: u32 = 60_000;

/// Bus scan that is assumed when the status table shows none. It is also the shortest possible scan
/// (chapter 3, Steady State Operation).
pub const MIN_SCAN_MS: u16 = 3;

/// Longest bus scan that the driver believes.
pub const MAX_SCAN_MS: u16 = 1_000;
