//! RS-232 on UART 0.
//!
//! # Design
//! One ring per direction between the interrupts and the main loop. A received byte keeps the tick at which it arrived.
//! When the main loop is behind and the ring is full, the interrupt is masked and the byte stays in the UART, so that what
//! is lost is lost there, and the UART's overrun flag tells.
//!
//! # Tradeoffs
//! The UART holds one byte per direction; at 19200 bit/s the receive interrupt has half a millisecond, which only the
//! capture interrupt delays.
//!
//! # Notes
//! The transmit interrupt comes when the byte buffer becomes *empty*, never because it *is* empty, hence the main loop
//! pends it. "Not full" says nothing about the shift register: before the rate changes, two characters' time has to
//! pass. QEMU keeps no line speed: bytes come and go as fast as the other side takes them, and it holds back
//! what the UART has no room for.

use cortex_m::peripheral::NVIC;
use heapless::spsc::{Consumer, Producer, Queue};
use ser_proto::Baud;

use crate::device::{self, Interrupt, base};
use crate::mmio::Word;

/// Received bytes that may wait for the main loop: 133 ms at 19200 bit/s.
pub(crate) const RECEIVE_RING_LEN: usize = 256;
/// Bytes that may wait for the transmitter; little more is in flight when a baud change or a reset comes.
pub(crate) const TRANSMIT_RING_LEN: usize = 128;

/// Bits of a character with start and stop bit.
const CHARACTER_BITS: u32 = 10;

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

/// What the receive interrupt hands over.
#[derive(Clone, Copy)]
pub(crate) struct Received {
    pub(crate) byte: u8,
    pub(crate) tick_ms: u32,
    /// At least one byte was lost before or after this one: which of them the UART keeps is up to it.
    pub(crate) overrun: bool,
}

/// Memory of both rings.
pub(crate) struct Rings {
    receive: Queue<Received, RECEIVE_RING_LEN>,
    transmit: Queue<u8, TRANSMIT_RING_LEN>,
}

impl Rings {
    pub(crate) const fn new() -> Rings {
        Rings { receive: Queue::new(), transmit: Queue::new() }
    }
}

/// Starts the UART; gives the main loop's end and the two interrupts' ends.
pub(crate) fn start(
    rings: &'static mut Rings,
    baud: Baud,
) -> (SerialLine, ReceiveInterrupt, TransmitInterrupt) {
    let (receive_in, receive_out) = rings.receive.split();
    let (transmit_in, transmit_out) = rings.transmit.split();
    CONTROL.write(0);
    BAUD_DIVIDER.write(divider(baud));
    STATE.write(RECEIVE_OVERRUN);
    INTERRUPT_CLEAR.write(TRANSMIT_INTERRUPT | RECEIVE_INTERRUPT);
    CONTROL.write(TRANSMIT_ENABLE | RECEIVE_ENABLE | TRANSMIT_INTERRUPT_ENABLE | RECEIVE_INTERRUPT_ENABLE);
    (
        SerialLine { received: receive_out, to_send: transmit_in, baud, idle_since_ms: None },
        ReceiveInterrupt { received: receive_in },
        TransmitInterrupt { to_send: transmit_out },
    )
}

fn divider(baud: Baud) -> u32 {
    device::CLOCK_HZ / baud.bits_per_second()
}

/// The receive interrupt's end.
pub(crate) struct ReceiveInterrupt {
    received: Producer<'static, Received>,
}

impl ReceiveInterrupt {
    /// Moves what has arrived into the ring.
    pub(crate) fn on_interrupt(&mut self, tick_ms: u32) {
        while STATE.read() & RECEIVE_FULL != 0 {
            if !self.received.ready() {
                // The main loop lets it through again when it has made room.
                NVIC::mask(Interrupt::UART0_RX);
                return;
            }
            INTERRUPT_CLEAR.write(RECEIVE_INTERRUPT);
            let byte = (DATA.read() & 0xFF) as u8;
            let overrun = STATE.read() & RECEIVE_OVERRUN != 0;
            if overrun {
                STATE.write(RECEIVE_OVERRUN);
            }
            // There is room: it was asked for above, and nobody else fills the ring.
            let _ = self.received.enqueue(Received { byte, tick_ms, overrun });
        }
    }
}

/// The transmit interrupt's end.
pub(crate) struct TransmitInterrupt {
    to_send: Consumer<'static, u8>,
}

impl TransmitInterrupt {
    /// Gives the UART what it has room for.
    pub(crate) fn on_interrupt(&mut self) {
        INTERRUPT_CLEAR.write(TRANSMIT_INTERRUPT);
        while STATE.read() & TRANSMIT_FULL == 0 {
            let Some(byte) = self.to_send.dequeue() else { return };
            DATA.write(u32::from(byte));
        }
    }
}

/// The main loop's end.
pub(crate) struct SerialLine {
    received: Consumer<'static, Received>,
    to_send: Producer<'static, u8>,
    baud: Baud,
    /// Since when the transmitter has not been seen at work.
    idle_since_ms: Option<u32>,
}

impl SerialLine {
    /// The next byte that has arrived.
    pub(crate) fn receive(&mut self) -> Option<Received> {
        let received = self.received.dequeue();
        if received.is_none() && !NVIC::is_enabled(Interrupt::UART0_RX) {
            // SAFETY: the interrupt masked itself outside of any critical section, waiting for this.
            unsafe { NVIC::unmask(Interrupt::UART0_RX) };
        }
        received
    }

    /// Whether bytes are waiting to be taken.
    pub(crate) fn has_received(&self) -> bool {
        self.received.ready()
    }

    /// Whether another byte may be sent.
    pub(crate) fn can_send(&self) -> bool {
        self.to_send.ready()
    }

    /// Puts a byte in line for the transmitter; one for which there is no room is dropped.
    pub(crate) fn send(&mut self, byte: u8) {
        self.idle_since_ms = None;
        let _ = self.to_send.enqueue(byte);
        NVIC::pend(Interrupt::UART0_TX);
    }

    /// Whether everything sent has left the transmitter. Counts from the first time that it is asked and finds nothing
    /// to do, so however late it is asked, no character is cut short.
    pub(crate) fn is_quiet(&mut self, now_ms: u32) -> bool {
        if !self.to_send.is_empty() || STATE.read() & TRANSMIT_FULL != 0 {
            self.idle_since_ms = None;
            return false;
        }
        let idle_since_ms = *self.idle_since_ms.get_or_insert(now_ms);
        // One character may be in the shift register; the tick may be just about to end.
        let characters_ms = 2 * CHARACTER_BITS * 1000 / self.baud.bits_per_second() + 1;
        now_ms.wrapping_sub(idle_since_ms) > characters_ms
    }

    /// Changes the rate; what is in the transmitter would be garbled.
    pub(crate) fn set_baud(&mut self, baud: Baud) {
        self.baud = baud;
        BAUD_DIVIDER.write(divider(baud));
    }
}
