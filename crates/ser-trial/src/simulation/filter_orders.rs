//! Filters that hosts order, and when a recorder has set them.
//!
//! A recorder sets a filter when the reply has its turn, and stores it in the same moment. The
//! simulation looks at the recorder's memory after each step, as one could with a probe at the chip:
//! so the millisecond is known in which a chatter filter takes effect, exactly.

use std::num::NonZeroU8;

use ser_node::{CopyNumber, Debounce, RECORD_LEN, Storage};
use ser_proto::{Filters, InputFilter, MAX_FILTERS};
use ser_sim::MemoryStorage;

/// The filters of all inputs that there can be.
pub type FilterTable = [InputFilter; 32];

/// Where a stored record says whether there are filters. They follow.
const HAS_FILTERS: usize = 2 + 4 + 6 + 4 + 4;

/// An order of a host: a filter for an input, or for all.
#[derive(Clone, Copy, Debug)]
pub struct FilterOrder {
    /// The input; `None` for all.
    pub input: Option<NonZeroU8>,
    /// Its filter.
    pub filter: InputFilter,
}

impl FilterOrder {
    /// The filters of a recorder with so many inputs once this is carried out.
    #[must_use]
    pub fn applied_to(&self, before: &FilterTable, inputs: u8) -> FilterTable {
        let mut filters = [InputFilter::OFF; 32];
        for ((number, filter), before) in (1..=inputs).zip(&mut filters).zip(before) {
            let is_meant = self.input.is_none_or(|input| input.get() == number);
            *filter = if is_meant { self.filter } else { *before };
        }
        filters
    }
}

/// A question for filters, or an order, which is answered with them.
#[derive(Clone, Copy, Debug)]
pub struct FiltersQuestion {
    /// The first input of the answer.
    pub first: NonZeroU8,
    /// The order.
    pub order: Option<FilterOrder>,
    /// Which filters were in force when it came.
    pub since: usize,
}

impl FiltersQuestion {
    /// Whether an answer tells filters that were in force since the question came, those that were
    /// ordered with it among them. `tables` are all filters since power-up.
    #[must_use]
    pub fn is_answered_by(&self, page: &Filters, tables: &[FilterTable], inputs: u8) -> bool {
        let from = usize::from(self.first.get()) - 1;
        let is_told = |table: &&FilterTable| {
            let there = table[..inputs.into()].iter().skip(from).take(MAX_FILTERS);
            let is_obeyed =
                self.order.is_none_or(|order| order.applied_to(table, inputs) == **table);
            page.first == self.first && there.eq(&page.filters) && is_obeyed
        };
        tables[self.since..].iter().any(|table| is_told(&table))
    }
}

/// The debounce times of these filters.
#[must_use]
pub fn times(filters: &FilterTable) -> Debounce {
    let times = (1..).zip(filters);
    times.fold(Debounce::OFF, |all, (number, filter)| all.with(number, filter.debounce_ms))
}

/// The filters that a recorder's memory holds; `None` if no host has ever set one.
#[must_use]
pub fn stored(memory: &MemoryStorage) -> Option<FilterTable> {
    let mut memory = memory.clone();
    let copies = [CopyNumber::First, CopyNumber::Second].into_iter().filter_map(|copy| {
        let mut record = [0; RECORD_LEN];
        memory.read(copy, &mut record).ok().filter(|()| record[..2] == *b"S\x02").map(|()| record)
    });
    // Each record has a number, and is written over the older one.
    let record = copies.max_by_key(number).filter(|record| record[HAS_FILTERS] != 0)?;
    let mut filters = [InputFilter::OFF; 32];
    let bytes = record[HAS_FILTERS + 1..].as_chunks::<{ InputFilter::LEN }>().0;
    filters
        .iter_mut()
        .zip(bytes)
        .for_each(|(filter, bytes)| *filter = InputFilter::from_bytes(*bytes));
    Some(filters)
}

fn number(record: &[u8; RECORD_LEN]) -> u32 {
    u32::from_le_bytes([record[2], record[3], record[4], record[5]])
}
