//! One pass of the main loop between the ports and the recorder, the same on every board.
//!
//! The board supplies a [`Line`], its UART with the rings in front of it, and the [`GeniBoard`]
//! where there is one. A pass never waits and does no more than the rings hold. A line that takes
//! and gives bytes as fast as they come therefore cannot hold up the main loop.

use geni_board::SharedRam;
use ser_node::{DebounceTimes, Node, Rtc, Storage};
use ser_proto::Baud;

use crate::genius::{GeniBoard, Genius};
use crate::serial_line::ReceivedByte;

/// A board's RS-232 line as the main loop sees it.
pub trait Line {
    /// The most bytes received, and the most sent, in one pass: the longer ring's length.
    const MAX_BYTES: usize;

    /// The next byte, if it arrived no later than at this tick: see
    /// [`take_until`](crate::serial_line::take_until).
    fn receive(&mut self, now_ms: u32) -> Option<ReceivedByte>;

    /// How many bytes have been lost or misread since the last call.
    fn errors(&mut self) -> u32;

    /// Whether another byte may be sent.
    fn can_send(&self) -> bool;

    /// Queues a byte for the transmitter. Called only when there is room.
    fn send(&mut self, byte: u8);

    /// Whether everything sent has left the transmitter. Asked in every pass; see
    /// [`Quiet`](crate::serial_line::Quiet).
    fn is_quiet(&mut self, now_ms: u32) -> bool;

    /// Changes the rate. Called only when the line is quiet.
    fn set_baud(&mut self, baud: Baud);
}

/// Hands over what has arrived, records what has changed, and takes what is to be sent. Returns the
/// tick of the pass.
///
/// The order makes stamps right. The pass first reads the tick, then takes the pulses of the GENI
/// board's interrupt line, and then takes the bytes that arrived no later than that tick.
/// Interrupts come at any point. A pulse that this pass has not taken came after the tick was read,
/// so it is not older than any byte handled or any change recorded here.
pub fn pass<S: Storage, R: Rtc, L: Line, W: SharedRam, B: GeniBoard>(
    node: &mut Node<'_, S, R>,
    line: &mut L,
    mut genius: Option<&mut Genius<W, B>>,
) -> u32 {
    let now_ms = node.tick_ms();
    if let Some(genius) = &mut genius {
        genius.take_pulses(node);
    }
    take_in(node, line, now_ms);
    node.poll(now_ms);
    change_baud(node, line, now_ms);
    hand_out(node, line);
    if let Some(genius) = genius {
        genius.serve(node);
    }
    now_ms
}

/// Hands other debounce times over to capture, if some are wanted. `take` lets capture take them
/// ([`Capture::take_times`](ser_node::Capture::take_times)) while its interrupt is held off. It is
/// tried again in the next pass where that is not possible now.
pub fn change_debounce<S: Storage, R: Rtc>(
    node: &mut Node<'_, S, R>,
    take: impl FnOnce(&DebounceTimes) -> bool,
) {
    if let Some(debounce) = node.debounce_change()
        && take(&DebounceTimes::new(&debounce))
    {
        node.debounce_changed(debounce);
    }
}

fn take_in<S: Storage, R: Rtc, L: Line>(node: &mut Node<'_, S, R>, line: &mut L, now_ms: u32) {
    node.serial_line_errors(line.errors());
    for _ in 0..L::MAX_BYTES {
        // Commands that find no room in the node wait in the ring, as do bytes that came after the
        // tick was read.
        if !node.serial_has_room() {
            break;
        }
        let Some(received) = line.receive(now_ms) else { break };
        node.serial_receive(received.byte, received.at);
    }
}

fn change_baud<S: Storage, R: Rtc, L: Line>(node: &mut Node<'_, S, R>, line: &mut L, now_ms: u32) {
    // Asked in every pass, so that the line notices when the transmitter falls idle.
    let quiet = line.is_quiet(now_ms);
    if let Some(baud) = node.baud_change()
        && quiet
    {
        line.set_baud(baud);
        node.baud_changed(baud);
    }
}

fn hand_out<S: Storage, R: Rtc, L: Line>(node: &mut Node<'_, S, R>, line: &mut L) {
    for _ in 0..L::MAX_BYTES {
        if !line.can_send() {
            break;
        }
        let Some(byte) = node.serial_transmit() else { break };
        line.send(byte);
    }
}
