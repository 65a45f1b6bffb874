//! Logs how earlier runs ended, which counters have moved, and how deep the stack has been.
//!
//! The protocol has no place for any of this. The log is the only trace of what was dropped,
//! refused or lost.

use geni_board::Counters;
use ser_node::{Diagnostics, GeniusDiagnostics};

use crate::clock_chip::ClockState;
use crate::health::{Failures, Health};
use crate::last_words::Boot;

/// Counters that run all the time must not fill the log.
const INTERVAL_MS: u32 = 1000;

/// Logs how the previous run ended, if that was a fault, or else what the latest fault reported.
/// Called once, at start-up.
pub fn last_words(boot: &Boot) {
    let told = boot.last_words.as_ref().filter(|words| words.starts_ago == 1);
    if boot.cause.is_fault() {
        let text = told.map_or("", |words| words.text.as_str());
        defmt::error!("the previous run ended with a fault: {}: {=str}", boot.cause, text);
    }
    if let Some(words) = &boot.last_words
        && !(boot.cause.is_fault() && told.is_some())
    {
        let text = words.text.as_str();
        defmt::warn!(
            "the latest fault was {=u32} starts ago: {}: {=str}",
            words.starts_ago,
            words.fault,
            text
        );
    }
}

/// What the log knows already.
pub struct Report<'a> {
    looked_ms: u32,
    health: &'a Health<'a>,
    failures: Failures,
    clock: ClockState,
    /// Records written and sectors erased.
    storage: (u32, u32),
    diagnostics: Diagnostics,
    genius: GeniusDiagnostics,
    stack_bytes: usize,
}

impl<'a> Report<'a> {
    /// Starts with the state of the clock already logged and nothing else. The first pass that logs
    /// is a second after `now_ms`.
    #[must_use]
    pub fn new(now_ms: u32, health: &'a Health<'a>) -> Report<'a> {
        let clock = health.clock.state();
        log_clock(clock);
        Report {
            looked_ms: now_ms,
            health,
            failures: Failures::default(),
            clock,
            storage: (0, 0),
            diagnostics: Diagnostics::default(),
            genius: GeniusDiagnostics::default(),
            stack_bytes: 0,
        }
    }

    /// Logs what has changed, at most once a second. Called in every pass of the main loop. Asks
    /// for the counters, and for the high-water mark of the stack in bytes, only when a second is
    /// over.
    pub fn pass(
        &mut self,
        now_ms: u32,
        diagnostics: impl FnOnce() -> (Diagnostics, Option<GeniusDiagnostics>),
        stack_bytes: impl FnOnce() -> usize,
    ) {
        if now_ms.wrapping_sub(self.looked_ms) < INTERVAL_MS {
            return;
        }
        self.looked_ms = now_ms;
        let (diagnostics, genius) = diagnostics();
        log_changed(&self.diagnostics, &diagnostics);
        self.diagnostics = diagnostics;
        if let Some(genius) = genius {
            log_changed_genius(&self.genius, &genius);
            self.genius = genius;
        }
        self.log_health();
        let stack_bytes = stack_bytes();
        if stack_bytes > self.stack_bytes {
            self.stack_bytes = stack_bytes;
            defmt::info!("stack: {=usize} bytes used at most", stack_bytes);
        }
    }

    fn log_health(&mut self) {
        let failures = self.health.failures();
        log_changed_failures(&self.failures, &failures);
        self.failures = failures;
        let clock = self.health.clock.state();
        if clock != self.clock {
            self.clock = clock;
            log_clock(clock);
        }
        let storage = (self.health.storage.writes.get(), self.health.storage.erases.get());
        if storage != self.storage {
            self.storage = storage;
            let (writes, erases) = storage;
            defmt::info!(
                "configuration: {=u32} records written, {=u32} sectors erased",
                writes,
                erases
            );
        }
    }
}

fn log_clock(state: ClockState) {
    defmt::info!("battery-backed clock: {}", state);
}

/// Logs a line for each counter of a structure that has moved. Every field is either listed as a
/// counter or named as something else, so that a new one is not forgotten here.
macro_rules! log_counters {
    ($Type:ident, $before:expr, $after:expr, [$($counter:ident),* $(,)?] $(, other [$($other:ident),*])?) => {
        let (before, after): (&$Type, &$Type) = ($before, $after);
        let $Type { $($counter,)* $($($other: _,)*)? } = after;
        for (name, before, after) in [$((stringify!($counter), before.$counter, *$counter)),*] {
            if after != before {
                defmt::warn!("{=str}: {=u32}", name, after);
            }
        }
    };
}

fn log_changed(before: &Diagnostics, after: &Diagnostics) {
    log_counters!(
        Diagnostics,
        before,
        after,
        [
            frames_interrupted,
            frames_not_hex,
            frames_checksum,
            frames_too_long,
            frames_empty,
            line_errors,
            commands_unknown,
            commands_wrong_length,
            parameters_refused,
            commands_overrun,
            edges_lost,
            samples_missed,
            settings_late,
            events_unreported,
            events_unprinted,
            storage_errors,
        ]
    );
}

fn log_changed_failures(before: &Failures, after: &Failures) {
    log_counters!(
        Failures,
        before,
        after,
        [
            samples_failed,
            input_outages,
            serialiser_bus_errors,
            serialiser_check_errors,
            field_supply_lost,
            field_supply_low,
            serialisers_too_hot,
            clock_writes_failed,
            storage_failed,
        ]
    );
}

fn log_changed_genius(before: &GeniusDiagnostics, after: &GeniusDiagnostics) {
    if let Some(failure) = after.last_failure
        && before.board.failures != after.board.failures
    {
        defmt::warn!("{}", failure);
    }
    log_counters!(
        Counters,
        &before.board,
        &after.board,
        [
            failures,
            resets,
            bus_losses,
            bus_errors,
            configurations_refused,
            commands_timed_out,
            commands_late,
            commands_blocked,
            commands_refused,
            commands_failed,
            commands_unknown,
            datagrams_refused,
            requests_refused,
            requests_unanswered,
            requests_malformed,
            request_queue_full,
            request_pointers_refused,
            device_records_refused,
            lockouts_foreign,
            lockouts_lost,
        ],
        other[own_broadcasts]
    );
    // Broadcasts and arrived reports are normal operation, so they are not logged.
    log_counters!(
        GeniusDiagnostics,
        before,
        after,
        [datagrams_ignored, clocks_refused, replies_lost, reports_failed],
        other [board, last_failure, broadcasts, reports_sent]
    );
}
