//! Bytes in PLC words: two to a word, the first one in the low half.

use heapless::Vec;

/// The words that hold `bytes`. An odd number of bytes leaves 0 in the high half of the last word.
pub fn words_of_bytes(bytes: &[u8]) -> impl Iterator<Item = u16> + '_ {
    bytes.chunks(2).map(|pair| match *pair {
        [low, high] => u16::from_le_bytes([low, high]),
        [low] => low.into(),
        _ => 0,
    })
}

/// The first `count` bytes that `words` hold, or all of them when there are fewer.
pub fn bytes_of_words(words: &[u16], count: usize) -> impl Iterator<Item = u8> + '_ {
    words.iter().flat_map(|word| word.to_le_bytes()).take(count)
}

/// Collects items into a fixed buffer. Every caller stays within the capacity by construction, so
/// an item that does not fit is a bug of this crate. `collect` would panic then, which a recorder
/// must not.
pub(super) fn gather<T, const N: usize>(items: impl IntoIterator<Item = T>) -> Vec<T, N> {
    let mut gathered = Vec::new();
    for item in items {
        let fits = gathered.push(item).is_ok();
        debug_assert!(fits, "more than {N} items");
    }
    gathered
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{bytes_of_words, words_of_bytes};

    #[test]
    fn the_first_byte_is_in_the_low_half() {
        assert_eq!(words_of_bytes(&[0x52, 0x01, 0xF4]).collect::<Vec<_>>(), [0x0152, 0x00F4]);
        assert_eq!(words_of_bytes(&[]).count(), 0);
        assert_eq!(bytes_of_words(&[0x0152, 0xAAF4], 3).collect::<Vec<_>>(), [0x52, 0x01, 0xF4]);
    }

    proptest! {
        #[test]
        fn any_bytes_survive(bytes: Vec<u8>) {
            let words: Vec<_> = words_of_bytes(&bytes).collect();
            prop_assert_eq!(words.len(), bytes.len().div_ceil(2));
            prop_assert_eq!(bytes_of_words(&words, bytes.len()).collect::<Vec<_>>(), bytes);
        }
    }
}
