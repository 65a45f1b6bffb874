//! How long things may take. The manual's figures, and what is done where it gives none.

/// The host keeps away from the RAM this long after the reset line has been released (chapter 3,
/// Startup).
pub const NO_ACCESS_MS: u32 = 1_700;

/// The board sets its OK flag within this time after reset (chapter 3, Startup).
pub const START_UP_MS: u32 = 2_000;

/// Added to [`START_UP_MS`] before the board counts as failed: its clock and ours started at
/// different moments.
pub const START_UP_MARGIN_MS: u32 = 500;

/// Between the OK flag and the first word on the bus the host may configure (chapter 3, Startup),
/// and this long the board is off the bus after a change of configuration (chapter 10,
/// Configuration Change).
pub const OFF_BUS_MS: u32 = 1_500;

/// The reset line at power-up: the larger of the two figures in chapter 2 (Interrupt and Reset
/// Timing; the signal table has 20 ms *after the supplies are in tolerance*, which a host does not
/// know).
pub const POWER_UP_RESET_MS: u32 = 2_000;

/// The reset line in operation. The manual asks for 10 µs; this is many times more on any supply
/// and still short.
pub const RESET_MS: u32 = 20;

/// The board sets its OK flag this often (chapter 5, GENI OK Status).
pub const HEARTBEAT_MS: u32 = 200;

/// Without a heartbeat for five periods the board has failed. Less than [`NO_ACCESS_MS`], so that a
/// board that restarted by itself is found out before its fresh tables can be mistaken for answers.
pub const HEARTBEAT_TIMEOUT_MS: u32 = 5 * HEARTBEAT_MS;

/// A command is given five bus scans (chapter 10, Example Algorithms), but at least this long: a
/// datagram of normal priority waits for a scan in which nobody else sends one.
pub const TRANSMIT_TIMEOUT_MS: u32 = 2_000;

/// The board itself gives up on a reply after 10 s (chapter 10, Transmit Datagram with Reply); it
/// gets a little longer to say so.
pub const REPLY_TIMEOUT_MS: u32 = 12_000;

/// A command block that stays occupied this long, by a command that was given up, that nobody waits
/// for or that moves no data over the bus, belongs to a board that has failed.
pub const COMMAND_STUCK_MS: u32 = 5_000;

/// A lockout is granted or ended after the table access in progress. The host must not withdraw a
/// request (chapter 9), so a board that never answers it has failed.
pub const LOCKOUT_STUCK_MS: u32 = 5_000;

/// Flags are looked at this often even when the summary byte says there is none.
pub const FLAGS_PERIOD_MS: u32 = 20;

/// Queues and tables are looked at this often even when no flag asks for it: a lost flag must not
/// lose data.
pub const SAFETY_PERIOD_MS: u32 = 1_000;

/// A memory request that is not answered in this time is refused, so that the queue cannot fill.
pub const REQUEST_ANSWER_MS: u32 = 2_000;

/// Longest pause between two attempts to start a board that will not start.
pub const MAX_RETRY_MS: u32 = 60_000;

/// Bus scan that is assumed when the status table has none to show, and the shortest there is
/// (chapter 3, Steady State Operation).
pub const MIN_SCAN_MS: u16 = 3;

/// Longest bus scan that is believed.
pub const MAX_SCAN_MS: u16 = 1_000;
