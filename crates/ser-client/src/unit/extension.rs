//! What our recorders can be asked beyond the manual.
//!
//! An original recorder must never notice. So nothing of this is sent before it has answered a
//! command of the manual; then it is asked once who it is. One that stays silent, or answers
//! nonsense, is taken for an original as long as the connection lasts.

use std::num::NonZeroU8;
use std::time::Duration;

use ser_proto::{
    Capabilities, ClockReading, Code, Command, Counter, Filters, Identity, InputFilter, Reply,
};

use super::{Unit, unexpected};
use crate::reading::read_request::ReadRequest;
use crate::session::change::filter_refused;
use crate::unit::request_error::RequestError;

/// What is known of a recorder's extension.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Extension {
    /// It was not asked.
    #[default]
    NotAsked,
    /// It has none.
    Absent,
    /// It has said who it is.
    Present(Identity),
}

/// What a recorder's clock showed, and when.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockLook {
    /// What it showed when the last byte of the question arrived.
    pub reading: ClockReading,
    /// Between which times of the host that was.
    pub between: (Duration, Duration),
}

impl Unit {
    /// Who the recorder is and what it can be asked; `None` for an original one. It is asked once
    /// in a connection; [`take_for_original`](Self::take_for_original) spares that.
    ///
    /// # Errors
    /// If it answers no command of the manual, or the line fails.
    pub fn identity(&mut self) -> Result<Option<Identity>, RequestError> {
        if self.extension == Extension::NotAsked {
            if !self.has_answered {
                self.read(ReadRequest::POSITION)?;
            }
            self.extension = match self.request(&Command::Identify) {
                Ok(Reply::Identity(identity)) => Extension::Present(identity),
                Ok(_) | Err(RequestError::NoReply { .. }) => Extension::Absent,
                Err(error) => return Err(error),
            };
        }
        Ok(match self.extension {
            Extension::Present(identity) => Some(identity),
            Extension::NotAsked | Extension::Absent => None,
        })
    }

    /// Asks a recorder that has said who it is once more, because its log may have begun anew
    /// since. `None` for one that has not, or that does not answer.
    ///
    /// # Errors
    /// If the line fails.
    pub fn identity_again(&mut self) -> Result<Option<Identity>, RequestError> {
        let Extension::Present(_) = self.extension else { return Ok(None) };
        match self.request(&Command::Identify) {
            Ok(Reply::Identity(identity)) => {
                self.extension = Extension::Present(identity);
                Ok(Some(identity))
            }
            Ok(_) | Err(RequestError::NoReply { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Says that this recorder is an original one, as an earlier connection has found.
    pub fn take_for_original(&mut self) {
        self.extension = Extension::Absent;
    }

    /// What the recorder's clock shows; `None` where it cannot be asked. Asked once, since the
    /// answer to another try would be about another moment.
    ///
    /// # Errors
    /// If no reply comes or the line fails.
    pub fn clock_look(&mut self) -> Result<Option<ClockLook>, RequestError> {
        if !self.has(Capabilities::TIME)? {
            return Ok(None);
        }
        self.token = self.token.wrapping_add(1);
        let Reply::Time(reading) = self.request(&Command::Time { token: self.token })? else {
            return Err(unexpected(Code::Time));
        };
        let between = self.last_exchange().map(|exchange| exchange.carried_out());
        Ok(between.map(|between| ClockLook { reading, between }))
    }

    /// The filters of all inputs, input 1 first; `None` where they cannot be asked for.
    ///
    /// # Errors
    /// If no reply comes or the line fails.
    pub fn filters(&mut self) -> Result<Option<Vec<InputFilter>>, RequestError> {
        let Some(identity) = self.identity()? else { return Ok(None) };
        if !identity.capabilities.contains(Capabilities::FILTERS) {
            return Ok(None);
        }
        let inputs = usize::from(identity.model.inputs());
        let mut filters = Vec::with_capacity(inputs);
        while filters.len() < inputs {
            let next = u8::try_from(filters.len() + 1).ok().and_then(NonZeroU8::new);
            let first = next.unwrap_or(NonZeroU8::MAX);
            let Reply::Filters(page) = self.request(&Command::QueryFilters { first })? else {
                return Err(unexpected(Code::Filters));
            };
            // An empty page would be asked for over and over.
            if page.filters.is_empty() {
                return Err(unexpected(Code::Filters));
            }
            filters.extend(page.filters);
        }
        filters.truncate(inputs);
        Ok(Some(filters))
    }

    /// Sets the filter of an input, or of all; `None` where that cannot be done. Returns those in
    /// force from this input on, as many as one reply holds.
    ///
    /// # Errors
    /// If no reply comes, the recorder has another filter in force than was asked for, or the line
    /// fails.
    pub fn set_filter(
        &mut self,
        input: Option<NonZeroU8>,
        filter: InputFilter,
    ) -> Result<Option<Filters>, RequestError> {
        if !self.has(Capabilities::FILTERS)? {
            return Ok(None);
        }
        let Reply::Filters(page) = self.request(&Command::SetFilter { input, filter })? else {
            return Err(unexpected(Code::Filters));
        };
        if page.filters.is_empty() {
            return Err(unexpected(Code::Filters));
        }
        match filter_refused(input, &filter, &page) {
            Some((input, in_force)) => Err(RequestError::FilterRefused { input, in_force }),
            None => Ok(Some(page)),
        }
    }

    /// Everything that the recorder counts; `None` where it cannot be asked for.
    ///
    /// # Errors
    /// If no reply comes or the line fails.
    pub fn recorder_counters(&mut self) -> Result<Option<Vec<(Counter, u32)>>, RequestError> {
        self.counters_from(Counter::FIRST)
    }

    /// How many changes of each input were left out since power-up; `None` where that cannot be
    /// asked for.
    ///
    /// # Errors
    /// If no reply comes or the line fails.
    pub fn suppressed_changes(&mut self) -> Result<Option<Vec<(u8, u32)>>, RequestError> {
        let first = Counter::suppressed(1).unwrap_or(Counter::FIRST);
        let counters = self.counters_from(first)?;
        let of_input =
            |(counter, value): (Counter, u32)| Some((counter.suppressed_input()?, value));
        Ok(counters.map(|counters| counters.into_iter().filter_map(of_input).collect()))
    }

    fn counters_from(
        &mut self,
        first: Counter,
    ) -> Result<Option<Vec<(Counter, u32)>>, RequestError> {
        if !self.has(Capabilities::DIAGNOSTICS)? {
            return Ok(None);
        }
        let (mut counters, mut next) = (Vec::new(), Some(first));
        while let Some(first) = next {
            let Reply::Diagnostics(page) = self.request(&Command::Diagnostics { first })? else {
                return Err(unexpected(Code::Diagnostics));
            };
            counters.extend(page.counters());
            // Each page is behind the one before, so there is an end.
            next = page.next.filter(|next| *next > first);
        }
        Ok(Some(counters))
    }

    fn has(&mut self, capability: Capabilities) -> Result<bool, RequestError> {
        let identity = self.identity()?;
        Ok(identity.is_some_and(|identity| identity.capabilities.contains(capability)))
    }
}
