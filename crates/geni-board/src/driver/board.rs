//! The life of the board, from reset to the bus.

use super::{Arrivals, Done, Driver};
use crate::command_block::CommandStatus;
use crate::counters::count;
use crate::elapsed::elapsed_ms;
use crate::event::{ConfigurationOutcome, Event, Failure};
use crate::interrupts::Interrupts;
use crate::map;
use crate::options::Start;
use crate::ram::SharedRam;
use crate::setup_table::Configuration;
use crate::timing;

/// How often a configuration may end in an undefined status.
const MAX_FUTILE_CONFIGURATIONS: u8 = 3;

/// The phases of a board's life.
#[derive(Clone, Copy, Debug)]
pub(super) enum Phase {
    /// Before the first poll.
    Begin,
    /// The reset line is low.
    Reset { since_ms: u32, hold_ms: u32 },
    /// The reset line goes up after this poll, so time counts from the next one.
    Released,
    /// Self-test. The RAM is not accessed at first; then the driver waits for the OK flag.
    SelfTest { since_ms: u32 },
    /// A board that should be running. The driver clears its OK flag, which should come back.
    Attaching { since_ms: u32, cleared: bool },
    /// The OK flag is set. `window_since_ms` is the tick since which it was, for a board that is
    /// not yet on the bus.
    Configuring { window_since_ms: Option<u32>, futile: u8 },
    /// The board stays off the bus for a while. The tables of a `silent` board need no lock.
    Joining { since_ms: Option<u32>, silent: bool },
    /// Normal traffic.
    Running,
    /// The board is left alone for a while.
    Failed { since_ms: u32, pause_ms: u32 },
}

/// The pause before another attempt: none at first, then one second, doubled after each futile
/// start.
pub(super) fn pause_ms(futile_starts: u32) -> u32 {
    match futile_starts {
        0 => 0,
        futile => 1_000_u32.saturating_mul(1 << (futile - 1).min(6)).min(timing::MAX_RETRY_MS),
    }
}

impl<R: SharedRam> Driver<R> {
    /// Takes one step, whatever the phase is.
    pub(super) fn step(&mut self, now_ms: u32) -> Result<Option<Event>, Failure> {
        match self.phase {
            Phase::Begin => {
                let phase = self.first_phase(now_ms);
                self.go(now_ms, phase)
            }
            Phase::Reset { since_ms, hold_ms } if elapsed_ms(now_ms, since_ms) < hold_ms => {
                Ok(None)
            }
            Phase::Reset { .. } => self.go(now_ms, Phase::Released),
            Phase::Released => self.go(now_ms, Phase::SelfTest { since_ms: now_ms }),
            Phase::SelfTest { since_ms } => self.await_self_test(now_ms, since_ms),
            Phase::Attaching { since_ms, cleared } => {
                self.await_heartbeat(now_ms, since_ms, cleared)
            }
            Phase::Configuring { window_since_ms, futile } => {
                self.watch_heart(now_ms, timing::OFF_BUS_MS)?;
                self.look(now_ms);
                self.configuring(now_ms, window_since_ms, futile)
            }
            Phase::Joining { since_ms, silent } => {
                self.watch_heart(now_ms, timing::OFF_BUS_MS)?;
                self.look(now_ms);
                Ok(self.joining(now_ms, since_ms, silent))
            }
            Phase::Running => {
                self.locker.end_hold(&mut self.ram, now_ms, &mut self.counters);
                self.watch_heart(now_ms, 0)?;
                self.look(now_ms);
                self.serve(now_ms)
            }
            Phase::Failed { since_ms, pause_ms } if elapsed_ms(now_ms, since_ms) < pause_ms => {
                Ok(None)
            }
            Phase::Failed { .. } => {
                let phase = self.phase_after_failure(now_ms);
                self.go(now_ms, phase)
            }
        }
    }

    fn go(&mut self, now_ms: u32, phase: Phase) -> Result<Option<Event>, Failure> {
        self.phase = phase;
        match phase {
            Phase::Attaching { since_ms, cleared } => {
                self.await_heartbeat(now_ms, since_ms, cleared)
            }
            _ => Ok(None),
        }
    }

    fn first_phase(&self, now_ms: u32) -> Phase {
        match self.options.start {
            Start::Reset { hold_ms } if self.options.reset_line => {
                Phase::Reset { since_ms: now_ms, hold_ms }
            }
            Start::Reset { .. } | Start::Released => Phase::SelfTest { since_ms: now_ms },
            Start::Running => Phase::Attaching { since_ms: now_ms, cleared: false },
        }
    }

    fn phase_after_failure(&mut self, now_ms: u32) -> Phase {
        if self.options.reset_line {
            count(&mut self.counters.resets);
            Phase::Reset { since_ms: now_ms, hold_ms: timing::RESET_MS }
        } else {
            Phase::Attaching { since_ms: now_ms, cleared: false }
        }
    }

    fn await_heartbeat(
        &mut self,
        now_ms: u32,
        since_ms: u32,
        cleared: bool,
    ) -> Result<Option<Event>, Failure> {
        match self.ram.read(map::STATUS_OK) {
            1 if cleared => self.enter_configuring(now_ms, None),
            // The flag may be left over from an earlier run.
            0 | 1 if !cleared => {
                self.ram.write(map::STATUS_OK, 0);
                self.phase = Phase::Attaching { since_ms, cleared: true };
            }
            // Any other value means a board in its self-test, or no board. The driver must not
            // write to it.
            _ if elapsed_ms(now_ms, since_ms) >= self.options.heartbeat_timeout_ms => {
                return Err(Failure::NoHeartbeat);
            }
            _ => {}
        }
        Ok(None)
    }

    fn joining(&mut self, now_ms: u32, since_ms: Option<u32>, silent: bool) -> Option<Event> {
        if silent {
            // The board's first global data must not be whatever its memory happened to hold.
            self.global.write(&mut self.ram, self.in_force.broadcast_len());
        }
        let joined =
            since_ms.is_none_or(|since_ms| elapsed_ms(now_ms, since_ms) >= timing::OFF_BUS_MS);
        joined.then(|| self.ready(now_ms))
    }

    fn await_self_test(&mut self, now_ms: u32, since_ms: u32) -> Result<Option<Event>, Failure> {
        let elapsed = elapsed_ms(now_ms, since_ms);
        if elapsed < timing::NO_ACCESS_MS {
            return Ok(None);
        }
        if self.ram.read(map::STATUS_OK) == 1 {
            self.enter_configuring(now_ms, Some(now_ms));
            return Ok(None);
        }
        if elapsed < timing::START_UP_MS + timing::START_UP_MARGIN_MS {
            return Ok(None);
        }
        Err(Failure::SelfTest { faults: self.ram.read(map::STATUS_FAULTS) })
    }

    fn enter_configuring(&mut self, now_ms: u32, window_since_ms: Option<u32>) {
        self.heart.begin(now_ms);
        self.commander.forget();
        self.arrivals = Arrivals::new();
        self.options.interrupts.enable(&mut self.ram);
        Interrupts::take(&mut self.ram);
        self.phase = Phase::Configuring { window_since_ms, futile: 0 };
    }

    /// Allows `more_ms` more while the board starts up or changes its configuration, when it may
    /// have no time for heartbeats.
    fn watch_heart(&mut self, now_ms: u32, more_ms: u32) -> Result<(), Failure> {
        let patience_ms = self.options.heartbeat_timeout_ms.saturating_add(more_ms);
        if self.heart.watch(&mut self.ram, now_ms, patience_ms)? {
            self.status.due();
        }
        Ok(())
    }

    /// The command is sent even when the setup table already holds what is wanted, because another
    /// program may have written it without the command. It costs nothing: the board answers that
    /// nothing has changed.
    fn configuring(
        &mut self,
        now_ms: u32,
        window_since_ms: Option<u32>,
        futile: u8,
    ) -> Result<Option<Event>, Failure> {
        let status =
            match self.commander.poll(&self.ram, now_ms, self.in_force, &mut self.counters)? {
                Some(Done::Configured(status)) => status,
                Some(_) => return Ok(None),
                None => {
                    if self.commander.is_idle() {
                        self.configure_due = false;
                        let configuration = self.options.configuration;
                        self.commander.start_configure(
                            &mut self.ram,
                            now_ms,
                            configuration,
                            &mut self.counters,
                        );
                    }
                    return Ok(None);
                }
            };
        let accepted = match status {
            CommandStatus::Complete => ConfigurationOutcome::Changed,
            CommandStatus::ProcessError => ConfigurationOutcome::Unchanged,
            // The board has restored the configuration in force.
            CommandStatus::SyntaxError => ConfigurationOutcome::Refused(
                Configuration::read(&self.ram).unwrap_or(self.in_force),
            ),
            CommandStatus::Cleared | CommandStatus::Pending | CommandStatus::Unknown(_) => {
                count(&mut self.counters.commands_unknown);
                let futile = futile + 1;
                if futile >= MAX_FUTILE_CONFIGURATIONS {
                    return Err(Failure::Configuration);
                }
                self.phase = Phase::Configuring { window_since_ms, futile };
                return Ok(None);
            }
        };
        self.take_configuration(now_ms, window_since_ms, accepted).map(Some)
    }

    /// Takes over the board's answer; its table now holds the configuration in force.
    fn take_configuration(
        &mut self,
        now_ms: u32,
        window_since_ms: Option<u32>,
        accepted: ConfigurationOutcome,
    ) -> Result<Event, Failure> {
        let before = self.in_force;
        self.in_force = Configuration::read(&self.ram).map_err(|_| Failure::Configuration)?;
        let outcome = if self.in_force == self.commander.configured() {
            accepted
        } else {
            ConfigurationOutcome::Refused(self.in_force)
        };
        let changed = accepted == ConfigurationOutcome::Changed;
        self.phase = Phase::Joining {
            since_ms: if changed { Some(now_ms) } else { window_since_ms },
            silent: window_since_ms.is_some()
                || (changed && self.in_force.silences_the_bus(before)),
        };
        self.global.due();
        Ok(self.configured(outcome))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_up_to_a_minute() {
        let pauses: Vec<u32> = (0..10).map(pause_ms).collect();
        assert_eq!(pauses, [0, 1_000, 2_000, 4_000, 8_000, 16_000, 32_000, 60_000, 60_000, 60_000]);
        assert_eq!(pause_ms(u32::MAX), 60_000);
    }
}
