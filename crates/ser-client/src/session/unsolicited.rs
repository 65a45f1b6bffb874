//! What a recorder sends without being asked, in a queue of bounded length.
//!
//! The queue knows which messages came before the last answer. Reports among them are older than
//! it.

use std::collections::VecDeque;

use ser_proto::ReadReply;

use super::text_line::TextLine;

/// A message that answers no request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Unsolicited {
    /// An unsolicited read reply: an auto report. In rare cases it is the late answer to a read
    /// that was given up. So the place of its entries follows from their numbers and the header,
    /// not from the order of arrival.
    Report(ReadReply),
    /// A line of text: auto print, or an answer to a print command.
    Line(TextLine),
}

/// Messages that wait to be taken; when there are too many the oldest are dropped.
#[derive(Debug, Default)]
pub(crate) struct UnsolicitedQueue {
    messages: VecDeque<Unsolicited>,
    /// How many of them came before the mark.
    before_mark: usize,
    dropped: u64,
}

impl UnsolicitedQueue {
    pub(crate) const CAPACITY: usize = 4096;

    pub(crate) fn push(&mut self, message: Unsolicited) {
        if self.messages.len() == Self::CAPACITY {
            self.pop();
            self.dropped += 1;
        }
        self.messages.push_back(message);
    }

    pub(crate) fn pop(&mut self) -> Option<Unsolicited> {
        self.before_mark = self.before_mark.saturating_sub(1);
        self.messages.pop_front()
    }

    /// Forgets lines and keeps reports.
    pub(crate) fn drop_lines(&mut self) {
        self.messages.retain(|message| !matches!(message, Unsolicited::Line(_)));
        self.before_mark = self.before_mark.min(self.messages.len());
    }

    /// Sets the mark after the messages that are now in the queue.
    pub(crate) fn mark(&mut self) {
        self.before_mark = self.messages.len();
    }

    /// Forgets reports from before the mark and keeps lines.
    pub(crate) fn drop_reports_before_mark(&mut self) {
        let later = self.messages.split_off(self.before_mark.min(self.messages.len()));
        self.messages.retain(|message| matches!(message, Unsolicited::Line(_)));
        self.before_mark = self.messages.len();
        self.messages.extend(later);
    }

    pub(crate) const fn dropped(&self) -> u64 {
        self.dropped
    }
}
