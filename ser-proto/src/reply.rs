//! What a recorder sends to a host.

use crate::{
    Body, ClockReading, Code, Configuration, Counters, Filters, Identity, LastBroadcast, Mode,
    ParseError, ReadReply,
};

/// A message from the recorder: the answer to a command, or an unsolicited read reply (auto
/// report).
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reply {
    /// `C`: the configuration now in force.
    Configuration(Configuration),
    /// `E`: the event buffer is empty.
    Erased,
    /// `L`: the last broadcast, if there was one.
    LastBroadcast(Option<LastBroadcast>),
    /// `M`: recording mode and version.
    Mode(Mode),
    /// `P`: the text lines follow.
    PrintAccepted,
    /// `R`: entries of the log.
    Read(ReadReply),
    /// `S`: the clock is set.
    ClockSet,
    /// `I`: what the recorder is and can do. This and all that follow are our extension.
    Identity(Identity),
    /// `T`: what the clock showed.
    Time(ClockReading),
    /// `F`: the filters in force.
    Filters(Filters),
    /// `D`: counters.
    Diagnostics(Counters),
}

impl Reply {
    /// Parses a body that came from a recorder.
    ///
    /// Bytes behind what is known of a reply of our extension are ignored: it may have grown.
    ///
    /// # Errors
    /// See [`ParseError`].
    pub fn parse(body: &[u8]) -> Result<Reply, ParseError> {
        let (&byte, params) = body.split_first().ok_or(ParseError::Empty)?;
        let code = Code::from_byte(byte).ok_or(ParseError::UnknownCode { code: byte })?;
        match (code, params.len()) {
            (Code::Configure, _) => Configuration::parse(params).map(Reply::Configuration),
            (Code::Erase, 0) => Ok(Reply::Erased),
            (Code::LastBroadcast, _) => LastBroadcast::parse(params).map(Reply::LastBroadcast),
            (Code::Mode, _) => Mode::parse(params).map(Reply::Mode),
            // The manual's text has the single byte; its example echoes the command.
            (Code::Print, 0 | 2 | 4) => Ok(Reply::PrintAccepted),
            (Code::Read, _) => ReadReply::parse(params).map(Reply::Read),
            (Code::SetClock, 0) => Ok(Reply::ClockSet),
            (Code::Identify, _) => Identity::parse(params).map(Reply::Identity),
            (Code::Time, _) => ClockReading::parse(params).map(Reply::Time),
            (Code::Filters, _) => Filters::parse(params).map(Reply::Filters),
            (Code::Diagnostics, _) => Counters::parse(params).map(Reply::Diagnostics),
            (Code::Erase | Code::Print | Code::SetClock, _) => {
                Err(ParseError::WrongLength { code: byte, length: body.len() })
            }
        }
    }

    /// The bytes of the message.
    #[must_use]
    pub fn to_body(&self) -> Body {
        match self {
            Reply::Configuration(configuration) => configuration.to_body(),
            Reply::LastBroadcast(last) => LastBroadcast::to_body(*last),
            Reply::Mode(mode) => mode.to_body(),
            Reply::Read(reply) => reply.to_body(),
            Reply::Identity(identity) => identity.to_body(),
            Reply::Time(reading) => reading.to_body(),
            Reply::Filters(filters) => filters.to_body(),
            Reply::Diagnostics(counters) => counters.to_body(),
            Reply::Erased | Reply::PrintAccepted | Reply::ClockSet => Body::new(self.code()),
        }
    }

    /// The command byte.
    #[must_use]
    pub const fn code(&self) -> Code {
        match self {
            Reply::Configuration(_) => Code::Configure,
            Reply::Erased => Code::Erase,
            Reply::LastBroadcast(_) => Code::LastBroadcast,
            Reply::Mode(_) => Code::Mode,
            Reply::PrintAccepted => Code::Print,
            Reply::Read(_) => Code::Read,
            Reply::ClockSet => Code::SetClock,
            Reply::Identity(_) => Code::Identify,
            Reply::Time(_) => Code::Time,
            Reply::Filters(_) => Code::Filters,
            Reply::Diagnostics(_) => Code::Diagnostics,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Entry, Inputs, LONGEST_READ_REPLY, MAX_ENTRIES, Model, TimeStamp};

    fn read_reply(model: Model, count: usize) -> ReadReply {
        let time = TimeStamp {
            year: 96,
            month: 8,
            day: 15,
            hour: 14,
            minute: 30,
            second: 50,
            millisecond: 250,
        };
        let entry = Entry {
            changed: Inputs(0x8001_8001 & model.mask()),
            state: Inputs(0x0102 & model.mask()),
            time,
        };
        ReadReply {
            start: 500,
            total: 32_000,
            next_slot: 2000,
            model: (count > 0).then_some(model),
            entries: core::iter::repeat_n(entry, count).collect(),
        }
    }

    #[test]
    fn the_entry_size_shows_the_model() {
        for model in [Model::Ser160, Model::Ser320] {
            for count in 0..=MAX_ENTRIES {
                let reply = Reply::Read(read_reply(model, count));
                let body = reply.to_body();
                assert_eq!(body.len(), model.read_reply_len(count));
                assert_eq!(Reply::parse(&body), Ok(reply));
            }
        }
    }

    #[test]
    fn ten_entries_of_16_inputs_are_128_bytes_and_ten_of_32_the_longest_reply() {
        assert_eq!(Reply::Read(read_reply(Model::Ser160, 10)).to_body().len(), 128);
        assert_eq!(Reply::Read(read_reply(Model::Ser320, 10)).to_body().len(), LONGEST_READ_REPLY);
        assert_eq!(LONGEST_READ_REPLY, 168);
    }

    #[test]
    fn a_count_that_disagrees_with_the_length_is_refused() {
        let mut body = Reply::Read(read_reply(Model::Ser160, 1)).to_body().to_vec();
        body[3] = 5;
        assert_eq!(Reply::parse(&body), Err(ParseError::EntrySize { count: 5, bytes: 12 }));
        body[3] = 0;
        assert_eq!(Reply::parse(&body), Err(ParseError::EntrySize { count: 0, bytes: 12 }));
        body[3] = 11;
        assert_eq!(
            Reply::parse(&body),
            Err(ParseError::BadValue { code: 0x52, offset: 3, value: 11 })
        );
    }

    #[test]
    fn a_next_slot_beyond_the_largest_log_is_refused() {
        let mut body = Reply::Read(read_reply(Model::Ser160, 0)).to_body().to_vec();
        body[6..8].copy_from_slice(&2048_u16.to_be_bytes());
        assert_eq!(
            Reply::parse(&body),
            Err(ParseError::BadValue { code: 0x52, offset: 6, value: 2048 })
        );
    }

    #[test]
    fn an_entry_with_an_impossible_date_is_kept_as_it_is() {
        let mut reply = read_reply(Model::Ser320, 1);
        reply.entries[0].time.month = 0;
        let body = Reply::Read(reply.clone()).to_body();
        assert_eq!(Reply::parse(&body), Ok(Reply::Read(reply)));
    }

    #[test]
    fn the_print_reply_is_one_byte_or_an_echo() {
        for body in [&[0x50][..], &[0x50, 0x32, 0x64], &[0x50, 0, 1, 8, 0]] {
            assert_eq!(Reply::parse(body), Ok(Reply::PrintAccepted));
        }
        assert_eq!(*Reply::PrintAccepted.to_body(), [0x50]);
    }

    #[test]
    fn no_broadcast_yet_is_all_zero() {
        assert_eq!(*Reply::LastBroadcast(None).to_body(), [0x4C, 0, 0, 0, 0, 0, 0]);
        let erase =
            LastBroadcast { code: 0x45, hour: 14, minute: 30, second: 50, millisecond: 250 };
        let body = [0x4C, 0x45, 0x0E, 0x1E, 0x32, 0x00, 0xFA];
        assert_eq!(Reply::parse(&body), Ok(Reply::LastBroadcast(Some(erase))));
        assert_eq!(erase.to_string(), "erase at 14:30:50.250");
        assert_eq!(
            Reply::parse(&[0x4C, 0x45, 24, 0, 0, 0, 0]),
            Err(ParseError::BadValue { code: 0x4C, offset: 2, value: 24 })
        );
    }
}
