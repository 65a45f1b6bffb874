//! The counters as `D` tells them: page by page, by their ids.

use core::num::NonZeroU8;

use ser_proto::{Counter, Counters, Model};

use crate::chatter::Chatter;
use crate::diagnostics::Diagnostics;
use crate::genius_port::GeniusDiagnostics;

/// Where the counters of the Genius port begin, and those of its driver.
const OF_PORT: u8 = Counter::DATAGRAMS_IGNORED.id().get();
const OF_DRIVER: u8 = Counter::BOARD_FAILURES.id().get();

/// Everything that is counted.
pub(crate) struct Counts<'c> {
    pub(crate) recorder: Diagnostics,
    /// `None` without a Genius port.
    pub(crate) genius: Option<&'c GeniusDiagnostics>,
    pub(crate) chatter: &'c Chatter<'c>,
    pub(crate) model: Model,
}

impl Counts<'_> {
    /// The counters from this one on, as many as follow one another and find room.
    pub(crate) fn page(&self, asked: Counter) -> Counters {
        let mut ids = (asked.id().get()..=u8::MAX).filter_map(|id| Some((id, self.value(id)?)));
        let mut page = Counters { first: asked, next: None, values: heapless::Vec::new() };
        let mut expected = None;
        for (id, value) in &mut ids {
            let Some(counter) = NonZeroU8::new(id).map(Counter::from_id) else { continue };
            let is_next = expected.is_none_or(|expected| expected == id);
            if !is_next || page.values.push(value).is_err() {
                page.next = Some(counter);
                break;
            }
            if expected.is_none() {
                page.first = counter;
            }
            expected = id.checked_add(1);
        }
        page
    }

    fn value(&self, id: u8) -> Option<u32> {
        if let Some(input) = NonZeroU8::new(id).map(Counter::from_id)?.suppressed_input() {
            return (input <= self.model.inputs()).then(|| self.chatter.suppressed(input));
        }
        match id {
            OF_DRIVER.. => {
                let (_, value) = *self.genius?.board.all().get(usize::from(id - OF_DRIVER))?;
                Some(value)
            }
            OF_PORT.. => self.genius?.all().get(usize::from(id - OF_PORT)).copied(),
            _ => self.recorder.all().get(usize::from(id.checked_sub(1)?)).copied(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chatter::Input;

    fn counts<'c>(genius: Option<&'c GeniusDiagnostics>, chatter: &'c Chatter<'c>) -> Counts<'c> {
        let recorder = Diagnostics { edges_lost: 7, storage_errors: 9, ..Diagnostics::default() };
        Counts { recorder, genius, chatter, model: Model::Ser160 }
    }

    /// All counters that a host gets that asks on until the end.
    fn all(counts: &Counts<'_>) -> Vec<(Counter, u32)> {
        let (mut all, mut next) = (Vec::new(), Some(Counter::FIRST));
        while let Some(first) = next {
            let page = counts.page(first);
            all.extend(page.counters());
            assert!(page.next.is_none_or(|next| next > first));
            next = page.next;
        }
        all
    }

    #[test]
    fn every_counter_comes_once_by_its_name() {
        let mut inputs = [Input::NEW; 32];
        let (chatter, mut genius) = (Chatter::new(&mut inputs), GeniusDiagnostics::default());
        genius.reports_failed = 3;
        genius.board.failures = 5;
        let seen = all(&counts(Some(&genius), &chatter));
        let value = |counter| seen.iter().find(|(known, _)| *known == counter).map(|seen| seen.1);
        assert_eq!(value(Counter::EDGES_LOST), Some(7));
        assert_eq!(value(Counter::STORAGE_ERRORS), Some(9));
        assert_eq!(value(Counter::REPORTS_FAILED), Some(3));
        assert_eq!(value(Counter::BOARD_FAILURES), Some(5));
        assert_eq!(seen.len(), 16 + 6 + genius.board.all().len() + 16);
        for ((counter, _), (name, _)) in seen.iter().skip(16 + 6).zip(genius.board.all()) {
            assert_eq!(counter.name(), Some(format!("board_{name}").as_str()));
        }
        for pair in seen.windows(2) {
            assert!(pair[0].0 < pair[1].0);
        }
    }

    #[test]
    fn without_a_genius_port_there_are_none_of_its_counters() {
        let mut inputs = [Input::NEW; 32];
        let chatter = Chatter::new(&mut inputs);
        let counts = counts(None, &chatter);
        let page = counts.page(Counter::FIRST);
        assert_eq!((page.values.len(), page.next), (16, Counter::suppressed(1)));
        let end = counts.page(Counter::suppressed(16).unwrap());
        assert_eq!((end.values.len(), end.next), (1, None));
        let beyond = counts.page(Counter::suppressed(17).unwrap());
        assert_eq!((beyond.values.len(), beyond.next), (0, None));
        assert_eq!(beyond.first, Counter::suppressed(17).unwrap());
    }
}
