//! What the counters of a recorder count.
//!
//! Ids 1–31 are counters of the recorder and its RS-232 port, 32–63 those of its Genius port,
//! 64–127 those of its driver of the GENI board, and 128–159 those of its inputs. The names are
//! those of the recorder's own log, with `board_` before those of the driver. An id keeps its
//! meaning for ever. What is written above each name here is also what people are shown
//! ([`Counter::meaning`]).

use core::fmt;
use core::num::NonZeroU8;

/// A counter, by its id. Ids without a name here belong to later recorders, and are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Counter(NonZeroU8);

/// What it means that a counter is not zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CounterWeight {
    /// The recorder works as it should.
    Ordinary,
    /// Something went wrong on a line or with a board, and was dealt with: asked again, refused, or
    /// reset.
    Trouble,
    /// The log lacks something, or something in it is wrong; or what a host told the recorder, or
    /// should have been told, is lost.
    Lost,
}

/// The parts of a recorder that count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum CounterGroup {
    /// The recorder and its RS-232 port. Ids 1–31.
    Recorder,
    /// Its Genius port. Ids 32–63.
    Genius,
    /// Its driver of the GENI board. Ids 64–127.
    Board,
    /// Its inputs, with the changes that were left out. Ids 128–159.
    Inputs,
    /// Of a later recorder. Ids 160–255.
    Other,
}

/// What is known of a counter.
struct Named {
    counter: Counter,
    name: &'static str,
    meaning: &'static str,
    weight: CounterWeight,
}

macro_rules! counters {
    ($($(#[doc = $doc:literal])+ $id:literal $constant:ident $name:literal $weight:ident,)+) => {
        impl Counter {
            $($(#[doc = $doc])+ pub const $constant: Counter = Counter::known($id);)+

            /// Those with a name, in the order of their ids.
            const NAMED: &[Named] = &[$(Named {
                counter: Counter::$constant,
                name: $name,
                meaning: concat!($($doc),+),
                weight: CounterWeight::$weight,
            }),+];
        }
    };
}

counters! {
    /// Frames given up because a new one began.
    1 FRAMES_INTERRUPTED "frames_interrupted" Trouble,
    /// Frames given up at a character that is no hexadecimal digit.
    2 FRAMES_NOT_HEX "frames_not_hex" Trouble,
    /// Frames with a wrong checksum.
    3 FRAMES_CHECKSUM "frames_checksum" Trouble,
    /// Frames longer than any command.
    4 FRAMES_TOO_LONG "frames_too_long" Trouble,
    /// Frames without a command byte.
    5 FRAMES_EMPTY "frames_empty" Trouble,
    /// Bytes that the UART lost or could not read.
    6 LINE_ERRORS "line_errors" Trouble,
    /// Bodies with an unknown command byte.
    7 COMMANDS_UNKNOWN "commands_unknown" Trouble,
    /// Bodies that have a wrong length for their command.
    8 COMMANDS_WRONG_LENGTH "commands_wrong_length" Trouble,
    /// Commands with a parameter that is out of range.
    9 PARAMETERS_REFUSED "parameters_refused" Trouble,
    /// Commands that found no place to wait for their reply.
    10 COMMANDS_OVERRUN "commands_overrun" Trouble,
    /// Input changes that found the capture queue full.
    11 EDGES_LOST "edges_lost" Lost,
    /// Milliseconds in which no sample was taken.
    12 SAMPLES_MISSED "samples_missed" Lost,
    /// Settings of clock or mode that were read too late: changes after their arrival had already
    /// been recorded. Those changes have the old clock and mode.
    13 SETTINGS_LATE "settings_late" Lost,
    /// Events overwritten before auto report had sent them.
    14 EVENTS_UNREPORTED "events_unreported" Lost,
    /// Events overwritten before auto print had printed them.
    15 EVENTS_UNPRINTED "events_unprinted" Lost,
    /// Configurations that could not be stored.
    16 STORAGE_ERRORS "storage_errors" Lost,
    /// Datagrams that are not for a recorder, or are malformed.
    32 DATAGRAMS_IGNORED "datagrams_ignored" Ordinary,
    /// Commands that came by broadcast and were carried out.
    33 BROADCASTS "broadcasts" Ordinary,
    /// Replies that the board could not send, or that were lost when it failed, before or after
    /// their commands were carried out.
    34 REPLIES_LOST "replies_lost" Trouble,
    /// Set-clock commands that were not carried out, and marks that were not kept, because the time
    /// of their arrival is not known.
    35 CLOCKS_REFUSED "clocks_refused" Lost,
    /// Auto reports that arrived.
    36 REPORTS_SENT "reports_sent" Ordinary,
    /// Auto reports that did not arrive, or whose arrival is not known. Each is sent again.
    37 REPORTS_FAILED "reports_failed" Trouble,
    /// Times the board was found to have failed.
    64 BOARD_FAILURES "board_failures" Trouble,
    /// Times the board was reset because of that.
    65 BOARD_RESETS "board_resets" Trouble,
    /// Times the board left the bus.
    66 BOARD_BUS_LOSSES "board_bus_losses" Trouble,
    /// Bus errors that the board counted.
    67 BOARD_BUS_ERRORS "board_bus_errors" Trouble,
    /// Configurations that the board refused.
    68 BOARD_CONFIGURATIONS_REFUSED "board_configurations_refused" Trouble,
    /// Commands that were not finished in time.
    69 BOARD_COMMANDS_TIMED_OUT "board_commands_timed_out" Trouble,
    /// Commands that finished after they had been given up.
    70 BOARD_COMMANDS_LATE "board_commands_late" Trouble,
    /// Commands that had to wait because the block held another program's command.
    71 BOARD_COMMANDS_BLOCKED "board_commands_blocked" Trouble,
    /// Commands that the board refused as wrong.
    72 BOARD_COMMANDS_REFUSED "board_commands_refused" Trouble,
    /// Commands that failed: no acknowledgement, no reply, no memory.
    73 BOARD_COMMANDS_FAILED "board_commands_failed" Trouble,
    /// Commands that ended with an undefined status, or vanished.
    74 BOARD_COMMANDS_UNKNOWN "board_commands_unknown" Trouble,
    /// Received datagrams with an impossible source or length.
    75 BOARD_DATAGRAMS_REFUSED "board_datagrams_refused" Trouble,
    /// This board's own broadcasts, which it always receives too.
    76 BOARD_OWN_BROADCASTS "board_own_broadcasts" Ordinary,
    /// Requests for this host's memory that were refused.
    77 BOARD_REQUESTS_REFUSED "board_requests_refused" Trouble,
    /// Requests refused because no answer came in time; also counted as requests refused.
    78 BOARD_REQUESTS_UNANSWERED "board_requests_unanswered" Trouble,
    /// Requests refused because of an impossible length; also counted as requests refused.
    79 BOARD_REQUESTS_MALFORMED "board_requests_malformed" Trouble,
    /// Times the request queue was found full: requests may have been lost.
    80 BOARD_REQUEST_QUEUE_FULL "board_request_queue_full" Trouble,
    /// Request queue pointers that were out of range.
    81 BOARD_REQUEST_POINTERS_REFUSED "board_request_pointers_refused" Trouble,
    /// Device table entries that contradict themselves.
    82 BOARD_DEVICE_RECORDS_REFUSED "board_device_records_refused" Trouble,
    /// Lockouts in force that this driver had not asked for.
    83 BOARD_LOCKOUTS_FOREIGN "board_lockouts_foreign" Trouble,
    /// Lockouts that ended before the driver gave them back.
    84 BOARD_LOCKOUTS_LOST "board_lockouts_lost" Trouble,
}

impl Counter {
    /// The lowest id that there can be, 1.
    pub const FIRST: Counter = Counter(NonZeroU8::MIN);

    /// The counter with this id.
    #[must_use]
    pub const fn from_id(id: NonZeroU8) -> Counter {
        Counter(id)
    }

    /// The changes of an input, 1–32, that were left out because it chattered; `None` for other
    /// numbers.
    #[must_use]
    pub fn suppressed(input: u8) -> Option<Counter> {
        let id = Counter::INPUTS.checked_add(input)?;
        NonZeroU8::new(id).filter(|_| (1..=32).contains(&input)).map(Counter)
    }

    /// The input whose left out changes this counts, if it counts those of one.
    #[must_use]
    pub fn suppressed_input(self) -> Option<u8> {
        self.0.get().checked_sub(Counter::INPUTS).filter(|input| (1..=32).contains(input))
    }

    /// One below the id of input 1.
    const INPUTS: u8 = 127;

    /// The id.
    #[must_use]
    pub const fn id(self) -> NonZeroU8 {
        self.0
    }

    /// The name, as in the recorder's own log, if it is known here.
    #[must_use]
    pub fn name(self) -> Option<&'static str> {
        self.named().map(|named| named.name)
    }

    /// What it counts, as a sentence or two, if that is known here.
    #[must_use]
    pub fn meaning(self) -> Option<&'static str> {
        match self.suppressed_input() {
            Some(_) => Some("Changes of this input that were left out because it chattered."),
            None => self.named().map(|named| named.meaning.trim_start()),
        }
    }

    /// What it means that it is not zero, if that is known here.
    #[must_use]
    pub fn weight(self) -> Option<CounterWeight> {
        match self.suppressed_input() {
            Some(_) => Some(CounterWeight::Lost),
            None => self.named().map(|named| named.weight),
        }
    }

    /// Which part of the recorder counts this.
    #[must_use]
    pub const fn group(self) -> CounterGroup {
        match self.0.get() {
            ..=31 => CounterGroup::Recorder,
            32..=63 => CounterGroup::Genius,
            64..=127 => CounterGroup::Board,
            128..=159 => CounterGroup::Inputs,
            160.. => CounterGroup::Other,
        }
    }

    fn named(self) -> Option<&'static Named> {
        Counter::NAMED.iter().find(|named| named.counter == self)
    }

    #[expect(clippy::panic, reason = "evaluated by the compiler only")]
    const fn known(id: u8) -> Counter {
        match NonZeroU8::new(id) {
            Some(id) => Counter(id),
            None => panic!("ids begin with 1"),
        }
    }
}

/// As `edges_lost`, `suppressed_7` or `counter 200`.
impl fmt::Display for Counter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name() {
            Some(name) => f.write_str(name),
            None => match self.suppressed_input() {
                Some(input) => write!(f, "suppressed_{input}"),
                None => write!(f, "counter {}", self.0),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_ascend_and_no_name_comes_twice() {
        for pair in Counter::NAMED.windows(2) {
            assert!(pair[0].counter < pair[1].counter, "{}", pair[1].name);
        }
        let names: std::collections::BTreeSet<_> =
            Counter::NAMED.iter().map(|named| named.name).collect();
        assert_eq!(names.len(), Counter::NAMED.len());
    }

    #[test]
    fn a_counter_reads_as_its_name_and_one_without_as_its_id() {
        assert_eq!(Counter::EDGES_LOST.to_string(), "edges_lost");
        assert_eq!(Counter::EDGES_LOST.id().get(), 11);
        assert_eq!(Counter::BROADCASTS.id().get(), 33);
        assert_eq!(Counter::BOARD_FAILURES.id().get(), 64);
        assert_eq!(Counter(NonZeroU8::MAX).to_string(), "counter 255");
        let of_inputs = (1..=32).map(|input| Counter::suppressed(input).unwrap());
        let ids: Vec<u8> = of_inputs.map(|counter| counter.id().get()).collect();
        assert_eq!(ids, (128..160).collect::<Vec<u8>>());
        assert_eq!((Counter::suppressed(0), Counter::suppressed(33)), (None, None));
        let last = Counter::suppressed(32).unwrap();
        assert_eq!((last.to_string(), last.suppressed_input()), ("suppressed_32".into(), Some(32)));
        assert_eq!(Counter::BOARD_LOCKOUTS_LOST.suppressed_input(), None);
    }

    #[test]
    fn a_counter_says_what_it_counts_and_what_that_means() {
        for named in Counter::NAMED {
            let meaning = named.counter.meaning().unwrap();
            assert!(meaning.ends_with('.') && !meaning.contains(['`', '\n']), "{meaning}");
            assert!(!meaning.starts_with(' ') && !meaning.contains("  "), "{meaning}");
        }
        let late = Counter::SETTINGS_LATE;
        assert_eq!(
            (late.weight(), late.group()),
            (Some(CounterWeight::Lost), CounterGroup::Recorder)
        );
        assert!(late.meaning().unwrap().contains("already been recorded. Those"));
        let own = Counter::BOARD_OWN_BROADCASTS;
        assert_eq!(
            (own.weight(), own.group()),
            (Some(CounterWeight::Ordinary), CounterGroup::Board)
        );
        assert_eq!(Counter::BROADCASTS.group(), CounterGroup::Genius);
        let input = Counter::suppressed(7).unwrap();
        assert_eq!(
            (input.weight(), input.group()),
            (Some(CounterWeight::Lost), CounterGroup::Inputs)
        );
        assert!(input.meaning().is_some());
        let later = Counter(NonZeroU8::MAX);
        assert_eq!((later.weight(), later.meaning()), (None, None));
        assert_eq!(later.group(), CounterGroup::Other);
    }
}
