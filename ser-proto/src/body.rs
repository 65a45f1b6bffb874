//! A message body in a buffer of its own.

use core::ops::Deref;

use heapless::Vec;

use crate::{Code, MAX_ENTRIES, Model};

/// Bytes of the longest body, a read reply with ten 32-input entries.
pub const MAX_BODY_LEN: usize = Model::Ser320.read_reply_len(MAX_ENTRIES);

/// The bytes of a message: the command byte and its parameters, without framing. Never empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Body(Vec<u8, MAX_BODY_LEN>);

impl Body {
    /// A body of the command byte alone.
    pub(crate) fn new(code: Code) -> Body {
        let mut body = Body(Vec::new());
        body.put(&[code.byte()]);
        body
    }

    /// Appends bytes. Every message type stays within [`MAX_BODY_LEN`] by construction, so bytes
    /// that do not fit are a bug of this crate.
    pub(crate) fn put(&mut self, bytes: &[u8]) {
        let fits = self.0.extend_from_slice(bytes).is_ok();
        debug_assert!(fits, "a message is longer than MAX_BODY_LEN");
    }

    pub(crate) fn put_u16(&mut self, value: u16) {
        self.put(&value.to_be_bytes());
    }

    pub(crate) fn put_u32(&mut self, value: u32) {
        self.put(&value.to_be_bytes());
    }
}

impl Deref for Body {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.0
    }
}
