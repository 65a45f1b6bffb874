//! RS-232 on USART 2: 8 data bits, no parity, 1 stop bit.
//!
//! # Design
//! The rings of `ser_board` lie between the interrupt and the main loop. Both directions share one
//! interrupt, at the priority of the receiver, which has one character's time. The transmitter's
//! part of it is a byte and half a dozen instructions.
//!
//! # Notes
//! Transmission complete is set when the last stop bit has left, so the line is known to be quiet,
//! not assumed. `ser_board` interprets what an overrun or a framing error leaves in the data
//! register; both are counted as line errors.

use ser_board::budget::{RECEIVE_RING_LEN, TRANSMIT_RING_LEN};
use ser_board::ring::Reader;
use ser_board::serial_line::{ReceiveStatus, Receiver, SerialEnds, SerialRings};
use ser_board::uart_line::{Uart, UartLine};
use ser_node::TickStamp;
use ser_proto::Baud;
use stm32f4::stm32f407::{RCC, USART2};

use crate::clocks;

/// Memory of both rings.
pub(crate) type Rings = SerialRings<RECEIVE_RING_LEN, TRANSMIT_RING_LEN>;

/// Starts the serial port; returns the main loop's end and the interrupt's end.
pub(crate) fn start(
    rcc: &RCC,
    uart: USART2,
    rings: &'static mut Rings,
    baud: Baud,
) -> (SerialLine, SerialInterrupt) {
    rcc.apb1enr().modify(|_, w| w.usart2en().set_bit());
    clocks::settle();
    set_divider(&uart, baud);
    uart.cr1().write(|w| w.ue().set_bit().te().set_bit().re().set_bit().rxneie().set_bit());
    let SerialEnds { receiver, received, errors, to_send, transmitter } = rings.split();
    // SAFETY: the two ends share the registers. Only the interrupt touches the data register, and
    // only the main loop the divider. For the one bit that both change see
    // `Usart2::wake_transmitter`.
    let shared = unsafe { USART2::steal() };
    (
        UartLine::new(Usart2(shared), received, errors, to_send),
        SerialInterrupt { uart, receiver, transmitter },
    )
}

fn set_divider(uart: &USART2, baud: Baud) {
    let bits_per_second = baud.bits_per_second();
    #[expect(clippy::cast_possible_truncation, reason = "see `clocks`: 35 000 at 300 bit/s")]
    let divider = ((clocks::PCLK1_HZ + bits_per_second / 2) / bits_per_second) as u16;
    // SAFETY: with 16 samples per bit the register holds the divider as it is.
    uart.brr().write(|w| unsafe { w.bits(divider) });
}

/// The interrupt's end.
pub(crate) struct SerialInterrupt {
    uart: USART2,
    receiver: Receiver<'static, RECEIVE_RING_LEN>,
    transmitter: Reader<'static, u8, TRANSMIT_RING_LEN>,
}

impl SerialInterrupt {
    /// Takes the byte that has arrived, and sends one if there is room.
    pub(crate) fn on_interrupt(&mut self, now: TickStamp) {
        // Reading status and then data clears the error flags.
        let status = self.uart.sr().read();
        let shown = ReceiveStatus {
            has_byte: status.rxne().bit_is_set(),
            overrun: status.ore().bit_is_set(),
            misread: status.fe().bit_is_set() || status.nf().bit_is_set(),
        };
        let data = || {
            let [byte, ..] = self.uart.dr().read().bits().to_le_bytes();
            byte
        };
        self.receiver.take(shown, data, now);
        if status.txe().bit_is_set() {
            match self.transmitter.pop() {
                Some(byte) => {
                    self.uart.dr().write(|w| w.dr().set(byte.into()));
                }
                None => {
                    self.uart.cr1().modify(|_, w| w.txeie().clear_bit());
                }
            }
        }
    }
}

/// The main loop's end.
pub(crate) type SerialLine = UartLine<'static, Usart2, RECEIVE_RING_LEN, TRANSMIT_RING_LEN>;

/// USART 2 as the main loop sees it.
pub(crate) struct Usart2(USART2);

impl Uart for Usart2 {
    /// Bytes that find no room are lost: nothing is held back.
    fn let_through(&mut self) {}

    fn will_send(&mut self) {}

    fn wake_transmitter(&mut self) {
        // The interrupt may clear this bit between the read and the write, because it has just
        // found the ring empty. Then it is set here, as it should be. Nothing else in the register
        // ever changes.
        self.0.cr1().modify(|_, w| w.txeie().set_bit());
    }

    fn is_quiet(&mut self, ring_empty: bool, _now_ms: u32) -> bool {
        ring_empty && self.0.sr().read().tc().bit_is_set()
    }

    fn set_baud(&mut self, baud: Baud) {
        set_divider(&self.0, baud);
    }
}
