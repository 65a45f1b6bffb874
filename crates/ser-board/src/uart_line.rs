//! The main loop's end of the RS-232 line, for any UART: rings on this side, registers on the
//! board's.

use ser_proto::Baud;

use crate::main_loop::Line;
use crate::ring::{Reader, Writer};
use crate::serial_line::{self, LineErrors, ReceivedByte};

/// A UART as the main loop's end of the line sees it. The interrupts move the bytes.
pub trait Uart {
    /// Says that the main loop has made room for received bytes. A UART whose interrupt holds bytes
    /// back while the ring is full lets them through again.
    fn let_through(&mut self);

    /// Says that a byte is about to enter the ring to send.
    fn will_send(&mut self);

    /// Says that a byte has entered the ring to send. The transmit interrupt must come now, or as
    /// soon as the UART has room.
    fn wake_transmitter(&mut self);

    /// Whether everything has left the transmitter. `ring_empty` says that no byte waits in the
    /// ring.
    fn is_quiet(&mut self, ring_empty: bool, now_ms: u32) -> bool;

    /// Changes the rate. Called only when the line is quiet.
    fn set_baud(&mut self, baud: Baud);
}

/// The main loop's ends of the rings, with the UART behind them.
pub struct UartLine<'a, U, const RECEIVE: usize, const TRANSMIT: usize> {
    uart: U,
    received: Reader<'a, ReceivedByte, RECEIVE>,
    errors: LineErrors<'a>,
    to_send: Writer<'a, u8, TRANSMIT>,
    bytes: u32,
}

impl<'a, U: Uart, const RECEIVE: usize, const TRANSMIT: usize> UartLine<'a, U, RECEIVE, TRANSMIT> {
    /// Takes the ends from [`SerialEnds`](crate::serial_line::SerialEnds).
    pub const fn new(
        uart: U,
        received: Reader<'a, ReceivedByte, RECEIVE>,
        errors: LineErrors<'a>,
        to_send: Writer<'a, u8, TRANSMIT>,
    ) -> Self {
        UartLine { uart, received, errors, to_send, bytes: 0 }
    }

    /// Whether bytes are waiting to be taken.
    pub fn has_received(&self) -> bool {
        !self.received.is_empty()
    }

    /// Bytes received and sent; wraps.
    pub const fn bytes(&self) -> u32 {
        self.bytes
    }
}

impl<U: Uart, const RECEIVE: usize, const TRANSMIT: usize> Line
    for UartLine<'_, U, RECEIVE, TRANSMIT>
{
    const MAX_BYTES: usize = RECEIVE;

    fn receive(&mut self, now_ms: u32) -> Option<ReceivedByte> {
        let received = serial_line::take_until(&mut self.received, now_ms);
        if received.is_some() {
            self.bytes = self.bytes.wrapping_add(1);
        } else {
            self.uart.let_through();
        }
        received
    }

    fn errors(&mut self) -> u32 {
        self.errors.take()
    }

    fn can_send(&self) -> bool {
        self.to_send.has_room()
    }

    fn send(&mut self, byte: u8) {
        self.bytes = self.bytes.wrapping_add(1);
        self.uart.will_send();
        // There is room, because the main loop has asked.
        let _ = self.to_send.push(byte);
        self.uart.wake_transmitter();
    }

    fn is_quiet(&mut self, now_ms: u32) -> bool {
        self.uart.is_quiet(self.to_send.is_empty(), now_ms)
    }

    fn set_baud(&mut self, baud: Baud) {
        self.uart.set_baud(baud);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::serial_line::{SerialEnds, SerialRings};

    /// What the line does with its UART, in that order.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    enum Did {
        LetThrough,
        WillSend,
        Wake,
        Look { ring_empty: bool, now_ms: u32 },
        SetBaud(Baud),
    }

    #[derive(Default)]
    struct Mock {
        did: Vec<Did>,
    }

    impl Uart for Mock {
        fn let_through(&mut self) {
            self.did.push(Did::LetThrough);
        }

        fn will_send(&mut self) {
            self.did.push(Did::WillSend);
        }

        fn wake_transmitter(&mut self) {
            self.did.push(Did::Wake);
        }

        fn is_quiet(&mut self, ring_empty: bool, now_ms: u32) -> bool {
            self.did.push(Did::Look { ring_empty, now_ms });
            ring_empty
        }

        fn set_baud(&mut self, baud: Baud) {
            self.did.push(Did::SetBaud(baud));
        }
    }

    type Rings = SerialRings<4, 2>;

    #[test]
    fn what_was_received_comes_in_order_and_then_the_uart_is_let_through() {
        let mut rings = Rings::new();
        let SerialEnds { mut receiver, received, errors, to_send, .. } = rings.split();
        let mut line = UartLine::new(Mock::default(), received, errors, to_send);
        assert!(!line.has_received());
        let [first, late] =
            [(b'a', 5), (b'b', 7)].map(|(byte, at)| ReceivedByte { byte, at: u32::into(at) });
        receiver.push(first);
        receiver.push(late);
        assert!(line.has_received());
        assert_eq!((line.receive(6), &line.uart.did[..]), (Some(first), &[][..]));
        // A byte that came after the tick was read waits, although there is room.
        assert_eq!((line.receive(6), &line.uart.did[..]), (None, &[Did::LetThrough][..]));
        assert_eq!((line.receive(7), line.receive(7)), (Some(late), None));
        assert_eq!((line.bytes(), line.has_received()), (2, false));
    }

    #[test]
    fn errors_are_told_once() {
        let mut rings = Rings::new();
        let SerialEnds { mut receiver, received, errors, to_send, .. } = rings.split();
        let mut line = UartLine::new(Mock::default(), received, errors, to_send);
        receiver.count_error();
        receiver.count_error();
        assert_eq!((line.errors(), line.errors()), (2, 0));
    }

    #[test]
    fn a_byte_is_in_the_ring_before_the_transmitter_is_woken() {
        struct Waker<'a>(&'a mut Vec<u8>, crate::ring::Reader<'a, u8, 2>);
        impl Uart for Waker<'_> {
            fn let_through(&mut self) {}
            fn will_send(&mut self) {}
            fn wake_transmitter(&mut self) {
                self.0.extend(self.1.pop());
            }
            fn is_quiet(&mut self, ring_empty: bool, _now_ms: u32) -> bool {
                ring_empty
            }
            fn set_baud(&mut self, _baud: Baud) {}
        }
        let (mut rings, mut sent) = (Rings::new(), Vec::new());
        let SerialEnds { received, errors, to_send, transmitter, .. } = rings.split();
        let mut line = UartLine::new(Waker(&mut sent, transmitter), received, errors, to_send);
        for byte in *b"abc" {
            assert!(line.can_send());
            line.send(byte);
        }
        assert_eq!(line.bytes(), 3);
        assert_eq!(sent, b"abc");
    }

    #[test]
    fn the_line_is_as_quiet_as_ring_and_uart_say() {
        let mut rings = Rings::new();
        let SerialEnds { received, errors, to_send, mut transmitter, .. } = rings.split();
        let mut line = UartLine::new(Mock::default(), received, errors, to_send);
        line.send(b'x');
        line.send(b'y');
        assert!(!line.can_send());
        assert!(!line.is_quiet(3));
        assert_eq!((transmitter.pop(), transmitter.pop()), (Some(b'x'), Some(b'y')));
        assert!(line.is_quiet(4));
        line.set_baud(Baud::B300);
        let looks =
            [(false, 3), (true, 4)].map(|(ring_empty, now_ms)| Did::Look { ring_empty, now_ms });
        let sends = [Did::WillSend, Did::Wake, Did::WillSend, Did::Wake];
        assert_eq!(line.uart.did, [&sends[..], &looks, &[Did::SetBaud(Baud::B300)]].concat());
    }
}
