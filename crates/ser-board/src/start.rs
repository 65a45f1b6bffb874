//! What every board's recorder consists of once its chip is up.

use core::mem::MaybeUninit;

use chrono::NaiveDate;
use embedded_storage::nor_flash::MultiwriteNorFlash;
use ser_node::{Capture, CaptureChannel, Debounce, Event, Node, NodeParts, Work};
use ser_proto::{Model, RecorderId};

use crate::clock_chip::{ClockChip, KeepsTime};
use crate::flash_log::FlashLog;
use crate::health::Health;

/// Events that the log holds: the largest size that can be configured.
pub const LOG_LEN: usize = 2048;

/// No clock can show an earlier day, because the recorder did not exist then.
pub const NOT_BEFORE: NaiveDate = NaiveDate::from_ymd_opt(2026, 1, 1).unwrap();

/// A node whose configuration is in flash memory `F` and whose clock is the chip `C`.
pub type BoardNode<'a, F, C> = Node<'a, FlashLog<'a, F>, ClockChip<'a, C>>;

/// What a recorder keeps in RAM. It belongs in a static.
pub struct Memory<'a, F, C> {
    channel: CaptureChannel,
    events: [Event; LOG_LEN],
    work: Work,
    node: MaybeUninit<BoardNode<'a, F, C>>,
}

impl<F, C> Memory<'_, F, C> {
    /// The state at power-up.
    #[must_use]
    pub const fn new() -> Self {
        Memory {
            channel: CaptureChannel::new(),
            events: [Event::EMPTY; LOG_LEN],
            work: Work::new(),
            node: MaybeUninit::uninit(),
        }
    }
}

impl<F, C> Default for Memory<'_, F, C> {
    fn default() -> Self {
        Self::new()
    }
}

/// The parts that differ from board to board.
pub struct BoardParts<F, C> {
    /// Which recorder it is.
    pub model: Model,
    /// Debounce times of its inputs.
    pub debounce: Debounce,
    /// The flash memory of the configuration.
    pub flash: F,
    /// The battery-backed clock.
    pub clock: C,
    /// The number that tells this recorder from all others, if it has one.
    pub id: Option<RecorderId>,
}

/// Powers a recorder up; returns the capture interrupt's end and the main loop's.
pub fn start<'a, F: MultiwriteNorFlash, C: KeepsTime>(
    memory: &'a mut Memory<'a, F, C>,
    parts: BoardParts<F, C>,
    health: &Health<'a>,
) -> (Capture<'a>, &'a mut BoardNode<'a, F, C>) {
    let Memory { channel, events, work, node } = memory;
    let (capture, reader) = channel.split(parts.debounce);
    let node = node.write(Node::new(NodeParts {
        model: parts.model,
        log: events,
        work,
        capture: reader,
        storage: FlashLog::new(parts.flash, health.storage),
        rtc: ClockChip::new(parts.clock, NOT_BEFORE, health.clock),
        id: parts.id,
    }));
    (capture, node)
}
