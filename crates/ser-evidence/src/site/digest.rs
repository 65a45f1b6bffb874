//! Which version of a site file a result was made with.

use std::fmt;

use sha2::{Digest, Sha256};

/// The SHA-256 of a site file's text.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct SiteDigest([u8; 32]);

impl SiteDigest {
    /// The digest of a text.
    #[must_use]
    pub fn of(text: &str) -> SiteDigest {
        SiteDigest(Sha256::digest(text.as_bytes()).into())
    }

    /// Its 32 bytes.
    #[must_use]
    pub const fn bytes(&self) -> &[u8; 32] {
        &self.0
    }
}

/// As 64 hexadecimal digits.
impl fmt::Display for SiteDigest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for SiteDigest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SiteDigest({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_what_sha256sum_prints() {
        assert_eq!(
            SiteDigest::of("abc").to_string(),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
    }
}
