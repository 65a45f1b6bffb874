//! RS-232 on UART 0.
//!
//! # Design
//! The rings of `ser_board` lie between the interrupts and the main loop. When the main loop is
//! behind and the ring is full, the interrupt is masked and the byte stays in the UART. Bytes are
//! therefore lost only in the UART, whose overrun flag reports it.
//!
//! # Tradeoffs
//! The UART holds one byte per direction. At 19200 bit/s the receive interrupt has half a
//! millisecond, and only the capture interrupt delays it.
//!
//! # Notes
//! The transmit interrupt comes when the byte buffer *becomes* empty, never because it *is* empty,
//! so the main loop pends it. "Not full" says nothing about the shift register, so the line counts
//! as quiet only after a wait. QEMU has no line speed: bytes come and go as fast as the other side
//! takes them, and it holds back what the UART has no room for.

use cortex_m::peripheral::NVIC;
use ser_board::budget::{RECEIVE_RING_LEN, TRANSMIT_RING_LEN};
use ser_board::ring::Reader;
use ser_board::serial_line::{Quiet, ReceivedByte, Receiver, SerialEnds, SerialRings};
use ser_board::uart_line::{Uart, UartLine};
use ser_node::TickStamp;
use ser_proto::Baud;

use crate::device::{self, Interrupt, base};
use crate::mmio::Word;

const TRANSMIT_FULL: u32 = 1 << 0;
const RECEIVE_FULL: u32 = 1 << 1;
const RECEIVE_OVERRUN: u32 = 1 << 3;

const TRANSMIT_ENABLE: u32 = 1 << 0;
const RECEIVE_ENABLE: u32 = 1 << 1;
const TRANSMIT_INTERRUPT_ENABLE: u32 = 1 << 2;
const RECEIVE_INTERRUPT_ENABLE: u32 = 1 << 3;

const TRANSMIT_INTERRUPT: u32 = 1 << 0;
const RECEIVE_INTERRUPT: u32 = 1 << 1;

// SAFETY: AN385 has the UART's registers at these addresses.
const DATA: Word = unsafe { Word::at(base::UART0) };
// SAFETY: as above.
const STATE: Word = unsafe { Word::at(base::UART0 + 0x4) };
// SAFETY: as above.
const CONTROL: Word = unsafe { Word::at(base::UART0 + 0x8) };
// SAFETY: as above.
const INTERRUPT_CLEAR: Word = unsafe { Word::at(base::UART0 + 0xC) };
// SAFETY: as above.
const BAUD_DIVIDER: Word = unsafe { Word::at(base::UART0 + 0x10) };

/// Memory of both rings.
pub(crate) type Rings = SerialRings<RECEIVE_RING_LEN, TRANSMIT_RING_LEN>;

/// Starts the UART; returns the main loop's end and the two interrupts' ends.
pub(crate) fn start(
    rings: &'static mut Rings,
    baud: Baud,
) -> (SerialLine, ReceiveInterrupt, TransmitInterrupt) {
    let SerialEnds { receiver, received, errors, to_send, transmitter } = rings.split();
    CONTROL.write(0);
    BAUD_DIVIDER.write(divider(baud));
    STATE.write(RECEIVE_OVERRUN);
    INTERRUPT_CLEAR.write(TRANSMIT_INTERRUPT | RECEIVE_INTERRUPT);
    CONTROL.write(
        TRANSMIT_ENABLE | RECEIVE_ENABLE | TRANSMIT_INTERRUPT_ENABLE | RECEIVE_INTERRUPT_ENABLE,
    );
    (
        UartLine::new(Uart0 { baud, quiet: Quiet::new() }, received, errors, to_send),
        ReceiveInterrupt { receiver },
        TransmitInterrupt { transmitter },
    )
}

fn divider(baud: Baud) -> u32 {
    device::CLOCK_HZ / baud.bits_per_second()
}

/// The receive interrupt's end.
pub(crate) struct ReceiveInterrupt {
    receiver: Receiver<'static, RECEIVE_RING_LEN>,
}

impl ReceiveInterrupt {
    /// Moves what has arrived into the ring.
    pub(crate) fn on_interrupt(&mut self, now: TickStamp) {
        while STATE.read() & RECEIVE_FULL != 0 {
            if !self.receiver.has_room() {
                // The main loop unmasks it when it has made room.
                NVIC::mask(Interrupt::UART0_RX);
                return;
            }
            INTERRUPT_CLEAR.write(RECEIVE_INTERRUPT);
            let [byte, ..] = DATA.read().to_le_bytes();
            if STATE.read() & RECEIVE_OVERRUN != 0 {
                STATE.write(RECEIVE_OVERRUN);
                self.receiver.count_error();
            }
            self.receiver.push(ReceivedByte { byte, at: now });
        }
    }
}

/// The transmit interrupt's end.
pub(crate) struct TransmitInterrupt {
    transmitter: Reader<'static, u8, TRANSMIT_RING_LEN>,
}

impl TransmitInterrupt {
    /// Fills the UART as far as it has room.
    pub(crate) fn on_interrupt(&mut self) {
        INTERRUPT_CLEAR.write(TRANSMIT_INTERRUPT);
        while STATE.read() & TRANSMIT_FULL == 0 {
            let Some(byte) = self.transmitter.pop() else { return };
            DATA.write(u32::from(byte));
        }
    }
}

/// The main loop's end.
pub(crate) type SerialLine = UartLine<'static, Uart0, RECEIVE_RING_LEN, TRANSMIT_RING_LEN>;

/// UART 0 as the main loop sees it.
pub(crate) struct Uart0 {
    baud: Baud,
    quiet: Quiet,
}

impl Uart for Uart0 {
    fn let_through(&mut self) {
        if !NVIC::is_enabled(Interrupt::UART0_RX) {
            // SAFETY: the interrupt masked itself, outside of any critical section, and waits for
            // this.
            unsafe { NVIC::unmask(Interrupt::UART0_RX) };
        }
    }

    fn will_send(&mut self) {
        self.quiet.sent();
    }

    fn wake_transmitter(&mut self) {
        NVIC::pend(Interrupt::UART0_TX);
    }

    fn is_quiet(&mut self, ring_empty: bool, now_ms: u32) -> bool {
        let idle = ring_empty && STATE.read() & TRANSMIT_FULL == 0;
        self.quiet.look(idle, now_ms, self.baud)
    }

    fn set_baud(&mut self, baud: Baud) {
        self.baud = baud;
        BAUD_DIVIDER.write(divider(baud));
    }
}
