//! The chip's battery-backed clock, on its 32 kHz crystal.
//!
//! # Design
//! The crystal takes up to seconds to start when the battery is new, and recording waits for no
//! clock. It is switched on at start-up and checked again when the clock is set. Every wait is
//! bounded.
//!
//! # Tradeoffs
//! All 15 bits of the divider are synchronous. The clock is read back in steps of 31 µs instead of
//! 4 ms, and draws a little more current from the battery.
//!
//! # Notes
//! INITS shows that the clock was never set, or has lost battery *and* supply. A crystal that stood
//! still while the battery held does not show: the chip has no flag for that. (RM0090, chapter
//! "Real-time clock".)

use chrono::NaiveDateTime;
use rtcc::DateTimeAccess;
use ser_board::clock_chip::{ClockHealth, KeepsTime};
use ser_board::stm32_rtc::{self, Calendar, CalendarRegisters, Shift};
use stm32f4::stm32f407::{PWR, RCC, RTC};

use crate::clocks::settle;

/// 32768 Hz in one step.
const PREDIV_S: u16 = 0x7FFF;

const KEYS: [u8; 2] = [0xCA, 0x53];

/// Looks at a flag before it is given up: 10 ms, where two periods of the crystal are due.
const MAX_LOOKS: u32 = 50_000;

pub(crate) static HEALTH: ClockHealth = ClockHealth::new();

/// What went wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RtcError {
    /// The crystal does not oscillate.
    NoCrystal,
    /// The clock does not respond.
    TimedOut,
    /// The registers hold no date, or cannot hold this one.
    NoDate,
}

/// The clock.
pub(crate) struct ChipClock {
    clocks: RCC,
    registers: RTC,
}

impl ChipClock {
    /// Starts the clock, or finds it running.
    pub(crate) fn start(clocks: &RCC, power: &PWR, registers: RTC) -> ChipClock {
        clocks.apb1enr().modify(|_, w| w.pwren().set_bit());
        settle();
        // The battery-backed registers are locked after reset.
        power.cr().modify(|_, w| w.dbp().set_bit());
        // A write before the lock is off is lost. A lock that stays, or a choice that does not
        // stay, leaves a clock without a crystal. Such a clock is not believed and cannot be set.
        let _ = wait_for(|| power.cr().read().dbp().bit_is_set());
        let _ = wait_for(|| {
            choose_crystal(clocks);
            let control = clocks.bdcr().read();
            control.lseon().bit_is_set() && control.rtcsel().is_lse()
        });
        clocks.bdcr().modify(|_, w| w.rtcen().set_bit());
        // SAFETY: from here on only its register of the battery-backed part is used, and that is
        // only read.
        ChipClock { clocks: unsafe { RCC::steal() }, registers }
    }

    fn has_crystal(&self) -> bool {
        let control = self.clocks.bdcr().read();
        control.lserdy().bit_is_set() && control.rtcsel().is_lse()
    }

    /// Does `change` with the clock stopped and its registers open.
    fn initialise(&mut self, change: impl FnOnce(&RTC)) -> Result<(), RtcError> {
        self.registers.isr().modify(|_, w| w.init().set_bit());
        let open = wait_for(|| self.registers.isr().read().initf().bit_is_set());
        if open.is_ok() {
            change(&self.registers);
        }
        self.registers.isr().modify(|_, w| w.init().clear_bit());
        open
    }

    fn set(&mut self, calendar: Calendar, shift: Option<Shift>) -> Result<(), RtcError> {
        self.initialise(|registers| {
            registers.cr().modify(|_, w| w.fmt().twenty_four_hour().bypshad().set_bit());
            // The divider takes two writes, the synchronous part first.
            // SAFETY: both fields take any value; date and time are what `Calendar` says they are.
            #[expect(clippy::multiple_unsafe_ops_per_block, reason = "one reason for all four")]
            unsafe {
                registers.prer().modify(|_, w| w.prediv_s().bits(PREDIV_S));
                registers.prer().modify(|_, w| w.prediv_a().bits(0));
                registers.tr().write(|w| w.bits(calendar.tr));
                registers.dr().write(|w| w.bits(calendar.dr));
            }
        })?;
        let Some(Shift { add_second, subtract }) = shift else { return Ok(()) };
        wait_for(|| self.registers.isr().read().shpf().bit_is_clear())?;
        // SAFETY: the field takes any value; a second is added at the same time, so the clock is
        // not put back.
        self.registers
            .shiftr()
            .write(|w| unsafe { w.add1s().bit(add_second).subfs().bits(subtract) });
        wait_for(|| self.registers.isr().read().shpf().bit_is_clear())
    }

    fn unlock(&self) {
        for key in KEYS {
            // SAFETY: the key register takes any value.
            self.registers.wpr().write(|w| unsafe { w.key().bits(key) });
        }
    }

    fn lock(&self) {
        // SAFETY: as above; anything but the keys locks.
        self.registers.wpr().write(|w| unsafe { w.key().bits(0xFF) });
    }
}

/// Switches the 32 kHz crystal on and makes the clock count it.
fn choose_crystal(clocks: &RCC) {
    if !clocks.bdcr().read().rtcsel().is_lse() {
        // A choice made by another program holds until all of this part is reset. Without a choice
        // there is nothing to lose.
        clocks.bdcr().modify(|_, w| w.bdrst().set_bit());
        clocks.bdcr().modify(|_, w| w.bdrst().clear_bit());
        clocks.bdcr().modify(|_, w| w.rtcsel().lse());
    }
    clocks.bdcr().modify(|_, w| w.lseon().set_bit());
}

fn wait_for(mut condition: impl FnMut() -> bool) -> Result<(), RtcError> {
    if (0..MAX_LOOKS).any(|_| condition()) { Ok(()) } else { Err(RtcError::TimedOut) }
}

impl CalendarRegisters for ChipClock {
    fn ssr(&mut self) -> u16 {
        self.registers.ssr().read().ss().bits()
    }

    fn tr(&mut self) -> u32 {
        self.registers.tr().read().bits()
    }

    fn dr(&mut self) -> u32 {
        self.registers.dr().read().bits()
    }
}

impl DateTimeAccess for ChipClock {
    type Error = RtcError;

    fn datetime(&mut self) -> Result<NaiveDateTime, RtcError> {
        let (ssr, calendar) = stm32_rtc::read(self).ok_or(RtcError::TimedOut)?;
        calendar.to_date_time(ssr, PREDIV_S).ok_or(RtcError::NoDate)
    }

    fn set_datetime(&mut self, datetime: &NaiveDateTime) -> Result<(), RtcError> {
        let calendar = Calendar::from_date_time(*datetime).ok_or(RtcError::NoDate)?;
        if !self.has_crystal() {
            return Err(RtcError::NoCrystal);
        }
        self.unlock();
        let set = self.set(calendar, Shift::to_fraction_of(*datetime, PREDIV_S));
        self.lock();
        set
    }
}

impl KeepsTime for ChipClock {
    const RESOLUTION_MS: u16 = 1;

    fn has_lost_time(&mut self) -> Result<bool, RtcError> {
        let is_set = self.registers.isr().read().inits().bit_is_set();
        // Another program has set the clock with another divider, so its sub-seconds mean something
        // else.
        let is_ours = self.registers.prer().read().prediv_s().bits() == PREDIV_S;
        Ok(!(is_set && is_ours && self.has_crystal()))
    }

    /// INITS has no bit to clear: it follows from the year that was set.
    fn time_is_good(&mut self) -> Result<(), RtcError> {
        Ok(())
    }
}
