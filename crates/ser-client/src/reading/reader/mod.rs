//! Reading a log by cursor: which entries to ask for next, and what the replies mean.
//!
//! [`LogReader`] delivers every event once and in order: across the end of the ring, across the
//! wrap of the 16-bit total, and with events arriving meanwhile. It counts exactly what the
//! recorder overwrote before it could be read.
//!
//! The reader performs no I/O. The caller sends what [`request`](LogReader::request) asks for and
//! hands in the replies with [`take`](LogReader::take), until there is no request and no reply is
//! awaited. One request at a time is enough. With two, the next reply can follow the last one
//! without a gap.
//!
//! # The files
//!
//! `locating` makes the first request and finds what the reading stands on. From then on,
//! `requests` plans what is asked next, and `replies` and `ring` take what comes. All three work on
//! `progress`. The files below it hold a part each: `head`, `footing`, `growth`, `losses`,
//! `overrun`, `outstanding` and `read_ahead`.
//!
//! # How it works
//!
//! Events have a running index, 0 for the first after an erase. A recorder with total `T` and next
//! slot `S` keeps event `q` in slot `(S - (T - q)) mod size`, and has overwritten it once `T - q >
//! size`. Every reply carries `T` and `S` of the very moment at which its entries were copied. So
//! it is certain which event each entry is, as long as the log is the same as before.
//!
//! Only an entry can tell that it is the same log. After an erase, total and next slot may agree by
//! chance with what recording would have made of them. So nothing is delivered before a reply has
//! shown the *anchor* in its place: the last event that was delivered. (The first events of all
//! have no anchor, and rest on total and next slot.) An erase takes the anchor away for good, since
//! what is recorded later has another time.
//!
//! If a reply shows the anchor, nothing was erased between the reply that first brought it and this
//! one. All replies copied between these two are of the same log, whatever the order of the
//! requests. This argument needs one thing: replies have to be taken in the order in which they
//! were copied. Requests may overlap, be lost, or be repeated.
//!
//! Nine events fit the reply that begins with the anchor. If there are no more, one request is all.
//! If there are more, those that do not fit are asked for first, up to seven replies, and are kept.
//! Then comes the request for the anchor and the events right after it, and its reply proves all of
//! them. So the proof costs one entry in eighty. The same is done where the end of the ring leaves
//! the anchor alone in its request.
//!
//! Reading ahead must not cost the oldest events. It goes only so far that the anchor, which is
//! overwritten next, is still there as long as events come no faster than they are read.
//!
//! If another entry or none is in the place of the anchor, the log was erased or lost its contents.
//! Reading then begins anew with [`Lost::LogRestarted`](crate::Lost::LogRestarted).
//!
//! If the anchor itself is overwritten, the log must be full, and the entry with the highest number
//! shows whether it is. If that entry does not exist, the log was erased, or the ring was made
//! larger; then total and next slot do not agree, and what the resize threw away is counted.
//! Without an anchor, only the size of the ring tells which event an entry is. So what is read then
//! is kept until the entry with the highest number has been asked for once more, and nobody can
//! have resized the ring in between.
//!
//! A reading ends when everything that had happened when it began is delivered. So it also ends
//! when events come faster than they can be read. Events that come meanwhile are delivered when
//! they fit the same replies. A program that follows a log without end [keeps
//! up](LogReader::keeping_up) instead.
//!
//! # When events come faster than they can be read
//!
//! The anchor is then overwritten again and again, and looking for it would take the whole line. So
//! an overrun reader takes whatever the ring holds. It asks for ten entries some way ahead of the
//! oldest, and while these are on the line, for the entry with the highest number. Total and next
//! slot in each reply say which events the entries are; the highest number says that the ring still
//! has its size. About one byte in seven goes into the proof, and the rest into events. They are
//! delivered in stretches, and what is missing between the stretches is counted.
//!
//! # Changes without an entry
//!
//! Between two neighbouring entries, the inputs that changed must lead from one state to the other.
//! Where they do not, something changed without an entry, because recording was stopped or the
//! recorder could not take all changes: [`Lost::Unrecorded`](crate::Lost::Unrecorded).
//!
//! # What cannot be known
//!
//! - The total counts modulo 65536. If more than 65,535 events happen between two readings, the
//!   count of lost ones is too low by a multiple of 65536. Where the total then makes it seem that
//!   the anchor must still be there, the log seems to have begun anew.
//! - An erase or a loss of power looks like overwriting if it is followed by at least as many
//!   events as the log holds before the next look at the anchor. The events are delivered. The
//!   count of lost ones is taken from the totals, although it is then meaningless.
//! - An event that is recorded after an erase passes for the anchor if it is in the same slot, with
//!   the same inputs and, since the clock was set back, with the same time.
//! - A log that was empty has no anchor. Events that came and were erased before the next reading
//!   leave no trace.
//! - The first reading of a log cannot know how often the total has wrapped:
//!   [`Lost::OverwrittenAtLeast`](crate::Lost::OverwrittenAtLeast).
//! - Events may come so fast that the oldest entries are overwritten while the request for them is
//!   on its way, or while the ring is looked at once more. The reader then gives up some more of
//!   the oldest, to get ahead of the recorder. They are counted as lost like the rest.
//! - A resize before the first reading of a program puts another entry in the place of the anchor.
//!   If the program does not know of it, the log seems to have begun anew.
//! - A resize in the middle of a reading shows when total and next slot part, when the anchor is in
//!   another place, or when the ring no longer has the size that it had before the anchor was given
//!   up. If several resizes follow each other within one reading and end where they began, all of
//!   this may agree by chance, and one entry may be taken for another. The events are right then,
//!   and the count of the lost ones between them is not.
//! - Replies of one entry do not show whether the ring has its size. All known recorders make room
//!   for more.
//!
//! The size of the ring must be right. An original recorder does not tell it.

mod footing;
mod growth;
mod head;
mod locating;
mod losses;
mod outstanding;
mod overrun;
mod progress;
mod read_ahead;
mod replies;
mod requests;
mod ring;

use ser_proto::{Model, ReadReply};

use super::cursor::Cursor;
use super::delivery::Delivery;
pub use super::disturbed::Disturbed;
use super::log_position::LogPosition;
pub use super::read_request::ReadRequest;
pub use super::summary::Summary;
use locating::Locating;
use outstanding::Purpose;
use progress::{Batch, Progress};

/// A reading sometimes needs a few replies that bring no event. This many in a row mean that
/// something is wrong.
const MAX_FRUITLESS: u32 = 32;

/// One reading from a cursor to the end of the log; see the [module documentation](self).
#[derive(Debug)]
pub struct LogReader {
    locating: Locating,
    /// `None` before the first reply.
    progress: Option<Progress>,
    /// Replies in a row that have brought no event.
    fruitless: u32,
}

impl LogReader {
    /// Reads what has happened since `cursor`, or everything, from a log of `size` entries. A size
    /// outside 1–2048 is taken for the nearest one inside.
    #[must_use]
    pub fn new(cursor: Option<Cursor>, size: u16) -> LogReader {
        LogReader { locating: Locating::new(cursor, size), progress: None, fruitless: 0 }
    }

    /// Says that this is another log than the one at the cursor, as the recorder itself has told. It
    /// is read from its beginning, whatever its entries look like.
    #[must_use]
    pub fn of_another_log(mut self) -> LogReader {
        self.locating.is_another_log = true;
        self
    }

    /// Uses the position in which an earlier reading ended. If nothing has happened since, one
    /// request will do instead of two.
    ///
    /// A ring that goes round earlier or later than it did then has another size, or was erased:
    /// [`Disturbed::Changed`]. A position that belongs to another cursor shows in the same way.
    #[must_use]
    pub fn starting_near(mut self, position: LogPosition) -> LogReader {
        self.locating.start_near(position);
        self
    }

    /// Continues as long as there is enough for a full reply. The reading then need not find its
    /// place again and again while events come fast.
    ///
    /// Without this, a reading ends when it has come past what had happened when it began.
    #[must_use]
    pub fn keeping_up(mut self, keeps_up: bool) -> LogReader {
        self.locating.keeps_up = keeps_up;
        if let Some(progress) = &mut self.progress {
            progress.keeps_up = keeps_up;
        }
        self
    }

    /// The entries to ask for next. Each call returns others, because several requests may be under
    /// way. `None` if there are none before a reply comes. The reading is done when no reply [is
    /// awaited](Self::is_waiting) either.
    pub fn request(&mut self) -> Option<ReadRequest> {
        match &mut self.progress {
            None => self.locating.request(),
            Some(progress) => {
                let asked = progress.plan()?;
                progress.outstanding.add(asked)
            }
        }
    }

    /// Whether a reply is still to come.
    #[must_use]
    pub fn is_waiting(&self) -> bool {
        match &self.progress {
            None => self.locating.is_waiting(),
            Some(progress) => !progress.outstanding.is_empty(),
        }
    }

    /// Takes the reply to a [`request`](Self::request) and delivers what it brings or proves.
    /// Replies must be taken in the order in which the recorder sent them, which need not be that
    /// of the requests. A reply is ignored if its first entry is not that of any request.
    ///
    /// # Errors
    /// See [`Disturbed`].
    pub fn take(
        &mut self,
        reply: &ReadReply,
        on: &mut dyn FnMut(Delivery),
    ) -> Result<(), Disturbed> {
        let position = LogPosition::from(reply);
        let Some(progress) = &mut self.progress else {
            let Some(request) = self.locating.take_asked(reply.start) else { return Ok(()) };
            let progress = self.progress.insert(self.locating.see_header(position)?);
            self.locating.begin(progress, request, batch(reply, request), on)?;
            return self.judge(0);
        };
        let Some(asked) = progress.outstanding.take(reply.start) else { return Ok(()) };
        let delivered_before = progress.delivered;
        progress.see_header(position)?;
        if asked.purpose == Purpose::Abandoned {
            return Ok(());
        }
        progress.take(asked, batch(reply, asked.request), on)?;
        self.judge(delivered_before)
    }

    /// Ends a reading that no longer brings events.
    fn judge(&mut self, delivered_before: u32) -> Result<(), Disturbed> {
        let Some(progress) = &mut self.progress else { return Ok(()) };
        progress.leave_anchor_if_overrun();
        let is_fruitless = progress.delivered == delivered_before;
        self.fruitless = if is_fruitless { self.fruitless + 1 } else { 0 };
        if self.fruitless > MAX_FRUITLESS { Err(Disturbed::NoProgress) } else { Ok(()) }
    }

    /// Where the next reading must begin. It never moves past what was delivered.
    #[must_use]
    pub const fn cursor(&self) -> Option<Cursor> {
        match &self.progress {
            None => self.locating.cursor,
            Some(progress) => progress.cursor,
        }
    }

    /// How many events the log is known to hold that are not delivered yet.
    #[must_use]
    pub fn pending(&self) -> u32 {
        let held = |progress: &Progress| progress.behind().min(progress.head.size);
        u32::try_from(self.progress.as_ref().map_or(0, held)).unwrap_or(u32::MAX)
    }

    /// The result of the reading so far.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let nothing = Summary {
            delivered: 0,
            lost: 0,
            unrecorded: 0,
            restarted: false,
            position: LogPosition { total: 0, next_slot: 0 },
        };
        self.progress.as_ref().map_or(nothing, Progress::summary)
    }
}

/// The entries of a reply, at most as many as were asked for.
fn batch(reply: &ReadReply, request: ReadRequest) -> Batch<'_> {
    let asked_for = reply.entries.len().min(request.count.into());
    let entries = reply.entries.get(..asked_for).unwrap_or_default();
    Batch { entries, model: reply.model.unwrap_or(Model::Ser160) }
}
