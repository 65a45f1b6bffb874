//! A message body in a buffer of its own.

use core::ops::Deref;

use heapless::Vec;

use crate::genius::MAX_SER_DATA;
use crate::{Code, MAX_ENTRIES, Model};

/// The most bytes that a body may have: the length byte of a frame ends there. What a recorder
/// sends today is shorter, but a reply of our extension may grow.
pub const MAX_BODY_LEN: usize = 255;

/// Bytes of the longest body that is sent today: a read reply with ten 32-input entries, which is
/// also the longest one that a recorder sends without being asked.
pub const LONGEST_READ_REPLY: usize = Model::Ser320.read_reply_len(MAX_ENTRIES);

/// The bytes of a message: the command byte and its parameters, without framing. Never empty.
///
/// It has room for what is sent today, not for [`MAX_BODY_LEN`]: a recorder holds one all the time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Body(Vec<u8, LONGEST_READ_REPLY>);

// Every other message goes into a datagram.
const _: () = assert!(MAX_SER_DATA <= LONGEST_READ_REPLY && LONGEST_READ_REPLY <= MAX_BODY_LEN);

impl Body {
    /// A body of the command byte alone.
    pub(crate) fn new(code: Code) -> Body {
        let mut body = Body(Vec::new());
        body.put(&[code.byte()]);
        body
    }

    /// Appends bytes. Every message type stays within [`LONGEST_READ_REPLY`] by construction, so
    /// bytes that do not fit are a bug of this crate.
    pub(crate) fn put(&mut self, bytes: &[u8]) {
        let fits = self.0.extend_from_slice(bytes).is_ok();
        debug_assert!(fits, "a message is longer than a body");
    }

    pub(crate) fn put_u16(&mut self, value: u16) {
        self.put(&value.to_be_bytes());
    }

    pub(crate) fn put_u32(&mut self, value: u32) {
        self.put(&value.to_be_bytes());
    }

    pub(crate) fn put_u64(&mut self, value: u64) {
        self.put(&value.to_be_bytes());
    }

    pub(crate) fn put_i64(&mut self, value: i64) {
        self.put(&value.to_be_bytes());
    }
}

impl Deref for Body {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.0
    }
}
