//! A ring between an interrupt and the main loop. One end puts items in, the other takes them out,
//! and neither waits.
//!
//! # Design
//! Every cell is made of atomics, so the ring is shared without any unsafe code. The two positions
//! run freely and wrap; a mask of a length known to the compiler turns a position into a cell. The
//! code therefore has no division, no bounds check that could fail and no panicking path. An
//! interrupt of the highest priority must have none of these.
//!
//! # Tradeoffs
//! An item has to fit into a handful of atomics (see [`Slot`]). `heapless::spsc` takes any item,
//! but its two ends do not have the length in their types. Each step then divides by a number from
//! memory, and the compiler adds the panic for zero.
//!
//! # Notes
//! All `N` cells can be in use. On Cortex-M the loads and stores are the ordinary ones; acquire and
//! release each cost a barrier instruction.

use core::sync::atomic::{AtomicU8, AtomicU32, AtomicUsize, Ordering};

/// Something that a [`Ring`] can hold.
///
/// Its cell is written by one side and read by the other, never both at once, so relaxed loads and
/// stores will do.
pub trait Slot: Copy {
    /// The atomics that hold one item.
    type Cell;

    /// A cell that holds nothing of interest.
    const EMPTY: Self::Cell;

    /// Writes the item.
    fn store(self, cell: &Self::Cell);

    /// Reads the item back.
    fn load(cell: &Self::Cell) -> Self;
}

impl Slot for u8 {
    type Cell = AtomicU8;
    const EMPTY: AtomicU8 = AtomicU8::new(0);

    #[inline]
    fn store(self, cell: &AtomicU8) {
        cell.store(self, Ordering::Relaxed);
    }

    #[inline]
    fn load(cell: &AtomicU8) -> u8 {
        cell.load(Ordering::Relaxed)
    }
}

/// For ticks, for instance.
impl Slot for u32 {
    type Cell = AtomicU32;
    const EMPTY: AtomicU32 = AtomicU32::new(0);

    #[inline]
    fn store(self, cell: &AtomicU32) {
        cell.store(self, Ordering::Relaxed);
    }

    #[inline]
    fn load(cell: &AtomicU32) -> u32 {
        cell.load(Ordering::Relaxed)
    }
}

/// Memory of a ring, for a static.
pub struct Ring<T: Slot, const N: usize> {
    /// Position of the oldest item. Only the [`Reader`] moves it.
    head: AtomicUsize,
    /// Position after the newest item. Only the [`Writer`] moves it.
    tail: AtomicUsize,
    cells: [T::Cell; N],
}

impl<T: Slot, const N: usize> Ring<T, N> {
    /// An empty ring. `N` must be a power of two; anything else does not compile.
    #[must_use]
    pub const fn new() -> Ring<T, N> {
        const { assert!(N.is_power_of_two(), "a position becomes a cell by masking") };
        Ring { head: AtomicUsize::new(0), tail: AtomicUsize::new(0), cells: [T::EMPTY; N] }
    }

    /// The two ends. Items that are in the ring stay in it.
    pub fn split(&mut self) -> (Writer<'_, T, N>, Reader<'_, T, N>) {
        (Writer { ring: self }, Reader { ring: self })
    }

    #[inline]
    fn cell(&self, position: usize) -> Option<&T::Cell> {
        // Always `Some`: the mask is less than the length.
        self.cells.get(position & (N - 1))
    }
}

impl<T: Slot, const N: usize> Default for Ring<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

/// The end that puts items in.
pub struct Writer<'a, T: Slot, const N: usize> {
    ring: &'a Ring<T, N>,
}

impl<T: Slot, const N: usize> Writer<'_, T, N> {
    /// Whether another item finds room. Once true, it stays true until this end has put one in.
    #[inline]
    #[must_use]
    pub fn has_room(&self) -> bool {
        self.has_room_at(self.ring.tail.load(Ordering::Relaxed))
    }

    #[inline]
    fn has_room_at(&self, tail: usize) -> bool {
        // Acquire: the reader is done with the cell before it moves the head.
        tail.wrapping_sub(self.ring.head.load(Ordering::Acquire)) < N
    }

    /// Whether the other end has taken everything.
    #[inline]
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.ring.tail.load(Ordering::Relaxed) == self.ring.head.load(Ordering::Acquire)
    }

    /// Puts an item in. False when there is no room for it; the item is then dropped.
    #[inline]
    #[must_use = "an item that found no room is lost"]
    pub fn push(&mut self, item: T) -> bool {
        let tail = self.ring.tail.load(Ordering::Relaxed);
        if !self.has_room_at(tail) {
            return false;
        }
        if let Some(cell) = self.ring.cell(tail) {
            item.store(cell);
        }
        // Release: whoever sees the new tail sees the item.
        self.ring.tail.store(tail.wrapping_add(1), Ordering::Release);
        true
    }
}

/// The end that takes items out.
pub struct Reader<'a, T: Slot, const N: usize> {
    ring: &'a Ring<T, N>,
}

impl<T: Slot, const N: usize> Reader<'_, T, N> {
    /// Whether there is nothing to take.
    #[inline]
    #[must_use]
    pub fn is_empty(&self) -> bool {
        // Acquire: whoever sees the new tail sees the item.
        self.ring.tail.load(Ordering::Acquire) == self.ring.head.load(Ordering::Relaxed)
    }

    /// The oldest item, left where it is.
    #[inline]
    #[must_use]
    pub fn peek(&self) -> Option<T> {
        if self.is_empty() {
            return None;
        }
        self.ring.cell(self.ring.head.load(Ordering::Relaxed)).map(T::load)
    }

    /// Takes the oldest item out.
    #[inline]
    pub fn pop(&mut self) -> Option<T> {
        let item = self.peek()?;
        let head = self.ring.head.load(Ordering::Relaxed);
        // Release: the item has been read before the cell is given back.
        self.ring.head.store(head.wrapping_add(1), Ordering::Release);
        Some(item)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;
    use std::thread;
    use std::time::{Duration, Instant};

    use proptest::prelude::*;

    use super::*;

    /// Generous, because machines stall for seconds.
    const PATIENCE: Duration = Duration::from_secs(120);

    #[test]
    fn items_come_out_in_the_order_in_which_they_went_in() {
        let mut ring = Ring::<u8, 4>::new();
        let (mut writer, mut reader) = ring.split();
        assert_eq!(reader.pop(), None);
        assert!(writer.push(1) && writer.push(2));
        assert_eq!((reader.pop(), reader.pop(), reader.pop()), (Some(1), Some(2), None));
    }

    #[test]
    fn every_cell_can_be_in_use_and_one_more_item_is_refused() {
        let mut ring = Ring::<u8, 4>::new();
        let (mut writer, mut reader) = ring.split();
        assert!((0..4).all(|item| writer.push(item)));
        assert!(!writer.has_room() && !writer.push(4));
        assert_eq!(reader.pop(), Some(0));
        assert!(writer.has_room() && writer.push(5));
        assert_eq!(std::iter::from_fn(|| reader.pop()).collect::<Vec<_>>(), [1, 2, 3, 5]);
        assert!(writer.is_empty() && reader.is_empty());
    }

    #[test]
    fn positions_may_wrap() {
        let mut ring = Ring::<u8, 2>::new();
        for position in [&ring.head, &ring.tail] {
            position.store(usize::MAX, Ordering::Relaxed);
        }
        let (mut writer, mut reader) = ring.split();
        assert!(writer.push(7) && writer.push(8) && !writer.push(9));
        assert_eq!((reader.pop(), reader.pop(), reader.pop()), (Some(7), Some(8), None));
    }

    #[test]
    fn two_threads_pass_a_million_bytes_without_losing_one() {
        let mut ring = Ring::<u8, 16>::new();
        let (mut writer, mut reader) = ring.split();
        let bytes = || (0..1_000_000_u32).map(|count| (count % 251).to_le_bytes()[0]);
        let end = Instant::now() + PATIENCE;
        let wait = || {
            assert!(Instant::now() < end, "a byte is missing");
            thread::yield_now();
        };
        thread::scope(|scope| {
            scope.spawn(move || {
                for byte in bytes() {
                    while !writer.push(byte) {
                        wait();
                    }
                }
            });
            for expected in bytes() {
                let item = loop {
                    match reader.pop() {
                        Some(item) => break item,
                        None => wait(),
                    }
                };
                assert_eq!(item, expected);
            }
        });
        assert!(reader.is_empty());
    }

    proptest! {
        #[test]
        fn a_ring_does_what_a_bounded_queue_does(steps in prop::collection::vec(any::<Option<u8>>(), 0..200)) {
            let mut ring = Ring::<u8, 8>::new();
            let (mut writer, mut reader) = ring.split();
            let mut model = VecDeque::new();
            for step in steps {
                match step {
                    Some(item) => {
                        let fits = model.len() < 8;
                        if fits {
                            model.push_back(item);
                        }
                        prop_assert_eq!(writer.push(item), fits);
                    }
                    None => prop_assert_eq!(reader.pop(), model.pop_front()),
                }
                prop_assert_eq!(writer.has_room(), model.len() < 8);
                prop_assert_eq!(reader.peek(), model.front().copied());
                prop_assert_eq!(reader.is_empty(), model.is_empty());
            }
        }
    }
}
