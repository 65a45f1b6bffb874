//! The GENI board on the external bus: the 16 KiB window, its timing, reset and interrupt.
//!
//! # Timing
//! From the GENI board's manual, chapter 2, "Timing for Shared RAM Read Cycle" and "… Write Cycle".
//! A clock of the bus is 1/84 MHz = 11.9 ns.
//!
//! | what                                 | board asks for  | set up as                              | gives         |
//! |--------------------------------------|-----------------|----------------------------------------|---------------|
//! | address and select setup (tas, tsels)| 0 ns at least   | ADDSET 8 + ADDHLD 8 clocks             | 190 ns        |
//! | data setup when writing (tds)        | 0 ns at least   | driven before the strobe begins        | the strobe    |
//! | strobe, until ready (trdyd)          | 937 ns at most  | DATAST 84 clocks: 937 + 60 ns          | 1000 ns       |
//! | data valid before ready (tdv)        | 96 ns at least  | read at the end of the strobe          | is there      |
//! | data hold when writing (tdh)         | 0 ns at least   | one clock after the strobe, see below  | 1.4 ns        |
//! | address hold (tah)                   | 0 ns at least   | the same                               | 0.9 ns        |
//! | strobe high in between (trdr, twrr)  | 136 ns at least | ADDSET + ADDHLD of the next cycle      | 190 ns        |
//! | cycle (trdcyc, twrcyc)               | 615 ns at least | the sum                                | 1190 ns       |
//! | data bus free after select (thz2)    | 32 ns at most   | BUSTURN 8 clocks                       | 95 ns         |
//!
//! The 60 ns are for the buffers between board and controller, 10 ns each way, for 10 ns of wire,
//! and for the setup time that the controller needs before it reads (data sheet, "Asynchronous …
//! read timings": a clock and 4 ns).
//!
//! **Hold when writing.** The controller keeps data, address and select for one clock after `/WR`
//! has risen, and has no field to make that longer. Of the 11.9 ns, 10.9 are left for data and
//! select and 9.9 for the address (data sheet, "Asynchronous … write timings": `th(Data_NWE)`,
//! `th(NE_NWE)`, `th(A_NWE)`) †. Each signal then takes its own way, and the worst case counts:
//! `/WR` through a 74AHCT541 at its slowest, 10 ns †; the data through a 74LVC8T245 at its fastest,
//! 0.5 ns †; address and select through a 74AHCT541 at its fastest, 1 ns †.
//!
//! | held after `/WR` at the board | from the controller | + fastest buffer | − slowest `/WR` | left   |
//! |-------------------------------|---------------------|------------------|-----------------|--------|
//! | data                          | 10.9 ns             | 0.5 ns           | 10 ns           | 1.4 ns |
//! | address                       | 9.9 ns              | 1.0 ns           | 10 ns           | 0.9 ns |
//! | select (the manual has none)  | 10.9 ns             | 1.0 ns           | 10 ns           | 1.9 ns |
//!
//! With a clock of 168 MHz the data would lack 4.6 ns. The data buffer stays enabled while the
//! select line is low, and turned to the board while `/RD` is high, so it does not let go earlier.
//! When reading, the board holds its data for 2 ns (tdh), and the controller needs no hold.
//!
//! † Look it up in the data sheet issue that belongs to the part.
//!
//! # Design
//! In mode D of the controller's asynchronous accesses both strobes are high during address setup
//! *and* address hold. The board's recovery time is thus kept without the program's help.
//!
//! `/RST` is driven low as soon as the pins are set up, and a pull-down holds it low before that. A
//! recorder that is not running must not leave a board on the bus that keeps reporting old inputs.
//! For that reason the line is push-pull.
//!
//! # Tradeoffs
//! The board's `/GENRDY` could end the strobe earlier, at best after half its length (ASYNCWAIT
//! with WAITPOL high, since the line is high while the board is busy; DATAST is then at least 4
//! clocks and 30 ns). It is not used. The manual says that the line may stay high for ever after a
//! reset, a broken board may hold it, and nothing can interrupt an access that waits on the bus.
//! Capture would stand still, and the watchdog would reset a sound recorder over and over. With a
//! strobe of fixed length the worst that a GENI board can do is to deliver wrong bytes, which its
//! driver handles. For 128 bytes of a datagram a pass of the main loop spends 0.15 ms here.
//!
//! # Notes
//! `/INT` pulses for 5.44 µs, and the interrupt controller latches its edge. The port lets only
//! arriving datagrams pull it. Each pulse leaves its tick in a ring, so the main loop learns when
//! the datagrams came, however long it was away. During the 0.5 ms after `/RST`, in which the board
//! must be left alone, a false pulse is to be expected: a pulse counts only if its flag is set.

use core::ptr::{self, NonNull};

use geni_board::WindowRam;
use ser_board::budget::PULSE_RING_LEN;
use ser_board::genius;
use ser_node::ring::{Reader, Ring, Writer};
use stm32f4::stm32f407::{EXTI, FSMC, GPIOG, RCC, SYSCFG};

use crate::{clocks, pins};

/// Address of the controller's bank for select line 1.
pub(crate) const BANK: u32 = 0x6000_0000;
/// The board's shared RAM.
pub(crate) const WINDOW_LEN: u32 = 1 << 14;

/// Nanoseconds of that many bus clocks.
const fn ns(clocks: u32) -> u32 {
    clocks * 1_000_000 / (clocks::HCLK_HZ / 1000)
}

/// Bus clocks that take at least that long.
const fn clocks_for(ns: u32) -> u32 {
    (ns * (clocks::HCLK_HZ / 1_000_000)).div_ceil(1000)
}

/// One bus clock in picoseconds, rounded down.
const CLOCK_PS: u32 = 1_000_000_000 / (clocks::HCLK_HZ / 1000);

const ADDRESS_SETUP: u32 = 8;
const ADDRESS_HOLD: u32 = 8;
const TURNAROUND: u32 = 8;
const STROBE: u32 = clocks_for(READY_DELAY_MAX_NS + MARGIN_NS);
const MODE_D: u32 = 3;

/// CLKDIV and DATLAT mean nothing without a clock on the bus. They keep their reset values.
const UNUSED: u32 = 0xFF << 20;

/// The timing register: ADDSET, ADDHLD, DATAST, BUSTURN, ACCMOD.
const TIMING: u32 =
    ADDRESS_SETUP | ADDRESS_HOLD << 4 | STROBE << 8 | TURNAROUND << 16 | UNUSED | MODE_D << 28;

// What the board requires.
const READY_DELAY_MAX_NS: u32 = 937;
const RECOVERY_MIN_NS: u32 = 136;
const CYCLE_MIN_NS: u32 = 615;
const RELEASE_MAX_NS: u32 = 32;
const HOLD_MIN_PS: u32 = 0;

// Buffers, wire and the controller's setup time.
const MARGIN_NS: u32 = 60;
const BUFFER_MAX_NS: u32 = 10;
const STROBE_BUFFER_MAX_PS: u32 = BUFFER_MAX_NS * 1000;
const ADDRESS_BUFFER_MIN_PS: u32 = 1000;
const DATA_BUFFER_MIN_PS: u32 = 500;
/// How much shorter than a clock the controller's hold may be.
const DATA_HOLD_LACKS_PS: u32 = 1000;
const SELECT_HOLD_LACKS_PS: u32 = 1000;
const ADDRESS_HOLD_LACKS_PS: u32 = 2000;

/// Whether a signal that the controller holds is also held long enough at the board, where the end
/// of `/WR` arrives later.
const fn is_held(lacks_ps: u32, buffer_min_ps: u32) -> bool {
    CLOCK_PS + buffer_min_ps >= STROBE_BUFFER_MAX_PS + lacks_ps + HOLD_MIN_PS
}

const _: () = {
    assert!(ns(STROBE) >= READY_DELAY_MAX_NS + MARGIN_NS);
    // The end of a strobe may reach the board late, and the start of the next one early.
    assert!(ns(ADDRESS_SETUP + ADDRESS_HOLD) >= RECOVERY_MIN_NS + BUFFER_MAX_NS);
    assert!(ns(ADDRESS_SETUP + ADDRESS_HOLD + STROBE) >= CYCLE_MIN_NS);
    assert!(ns(TURNAROUND) >= RELEASE_MAX_NS + 2 * BUFFER_MAX_NS);
    assert!(is_held(DATA_HOLD_LACKS_PS, DATA_BUFFER_MIN_PS));
    assert!(is_held(SELECT_HOLD_LACKS_PS, ADDRESS_BUFFER_MIN_PS));
    assert!(is_held(ADDRESS_HOLD_LACKS_PS, ADDRESS_BUFFER_MIN_PS));
    // The fields have four bits; the strobe's has eight.
    assert!(ADDRESS_SETUP < 16 && ADDRESS_HOLD < 16 && TURNAROUND < 16 && STROBE < 256);
};

/// Ticks of pulses that the main loop has not taken yet.
pub(crate) type Pulses = Ring<u32, PULSE_RING_LEN>;

/// The edge of `/INT`.
pub(crate) struct InterruptLine {
    edges: EXTI,
    pulses: Writer<'static, u32, PULSE_RING_LEN>,
}

impl InterruptLine {
    /// Listens for falling edges on pin 5 of port G.
    pub(crate) fn start(
        rcc: &RCC,
        routing: &SYSCFG,
        edges: EXTI,
        pulses: Writer<'static, u32, PULSE_RING_LEN>,
    ) -> InterruptLine {
        const PORT_G: u8 = 6;
        rcc.apb2enr().modify(|_, w| w.syscfgen().set_bit());
        clocks::settle();
        // SAFETY: the port exists.
        routing.exticr2().modify(|_, w| unsafe { w.exti5().bits(PORT_G) });
        edges.ftsr().modify(|_, w| w.tr5().set_bit());
        edges.imr().modify(|_, w| w.mr5().set_bit());
        InterruptLine { edges, pulses }
    }

    pub(crate) fn on_interrupt(&mut self, tick_ms: u32) {
        // Bits written as one are cleared; the others stay.
        self.edges.pr().write(|w| w.pr5().clear_bit_by_one());
        // A datagram whose pulse finds no room has no room at the board either. A line that is not
        // connected may pulse as it likes.
        let _ = self.pulses.push(tick_ms);
    }
}

/// The node's Genius port with its board.
pub(crate) type Genius = genius::Genius<WindowRam, GeniBoard>;

/// A GENI board that is fitted: its reset and interrupt lines.
pub(crate) struct GeniBoard {
    port: GPIOG,
    pulses: Reader<'static, u32, PULSE_RING_LEN>,
}

impl GeniBoard {
    /// Opens the window.
    ///
    /// # Safety
    /// Call once only: the window belongs to the caller.
    pub(crate) unsafe fn open(
        rcc: &RCC,
        bus: &FSMC,
        pulses: Reader<'static, u32, PULSE_RING_LEN>,
    ) -> Option<(GeniBoard, WindowRam)> {
        rcc.ahb3enr().modify(|_, w| w.fsmcen().set_bit());
        clocks::settle();
        // SAFETY: the values fit into their fields, see there.
        bus.btr1().write(|w| unsafe { w.bits(TIMING) });
        // SAFETY: as above; the register for writing has its fields in the same places.
        bus.bwtr1().write(|w| unsafe { w.bits(TIMING) });
        // An SRAM of 8 bits without bursts, multiplexing and wait line.
        bus.bcr1().write(|w| {
            w.faccen()
                .disabled()
                .mwid()
                .bits8()
                .mtyp()
                .sram()
                .muxen()
                .disabled()
                .bursten()
                .disabled()
                .waiten()
                .disabled();
            w.wren().enabled().extmod().enabled().asyncwait().disabled().mbken().enabled()
        });
        let window = NonNull::new(ptr::with_exposed_provenance_mut(BANK as usize))?;
        // SAFETY: the bank is open and as long as the window, nothing else here reaches it, and the
        // caller has it once only.
        let window = unsafe { WindowRam::new(window) };
        // SAFETY: its set and reset register is all that is used, for one pin.
        let port = unsafe { GPIOG::steal() };
        Some((GeniBoard { port, pulses }, window))
    }
}

impl genius::GeniBoard for GeniBoard {
    fn next_pulse(&mut self) -> Option<u32> {
        self.pulses.pop()
    }

    fn drive_reset(&mut self, held: bool) {
        let set = 1 << pins::GENI_RESET;
        let bits = if held { set << 16 } else { set };
        // SAFETY: the register takes any value; the bit is that of the line.
        self.port.bsrr().write(|w| unsafe { w.bits(bits) });
    }
}
