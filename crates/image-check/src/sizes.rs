//! How much of the board's memories an image takes.

use crate::image::Image;

/// Sizes of an image in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Sizes {
    /// Code, constants, and the first values of variables.
    pub(crate) flash: u32,
    pub(crate) variables: u32,
}

impl Sizes {
    pub(crate) fn of(image: &Image) -> Sizes {
        let mut sizes = Sizes::default();
        for piece in &image.pieces {
            if piece.writable {
                sizes.variables = sizes.variables.saturating_add(piece.size);
            }
            if !piece.bytes.is_empty() {
                sizes.flash = sizes.flash.saturating_add(piece.size);
            }
        }
        sizes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Piece;

    #[test]
    fn first_values_of_variables_take_both_memories() {
        let piece = |name: &str, bytes, size, writable| Piece {
            name: name.to_owned(),
            address: 0,
            size,
            bytes: vec![0; bytes],
            writable,
        };
        let pieces = vec![
            piece(".text", 100, 100, false),
            piece(".data", 20, 20, true),
            piece(".bss", 0, 3, true),
        ];
        assert_eq!(Sizes::of(&Image::of_pieces(pieces)), Sizes { flash: 120, variables: 23 });
    }
}
