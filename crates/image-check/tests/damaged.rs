//! A damaged or malicious file is judged or refused like any other.

mod elf;

use std::fs::File;
use std::io::{Seek, Write};

use image_check::{Checked, MPS2_AN385, ReadError, check, verdict};
use tempfile::NamedTempFile;

/// A file with changing content. It is never truncated first, because some systems then wait for
/// the disk.
struct Image {
    file: NamedTempFile,
}

impl Image {
    fn new() -> Image {
        Image { file: NamedTempFile::new().expect("a file") }
    }

    fn checked(&mut self, bytes: &[u8]) -> Result<Checked, ReadError> {
        let file: &mut File = self.file.as_file_mut();
        file.rewind().expect("a file");
        file.write_all(bytes).expect("a file");
        file.set_len(bytes.len() as u64).expect("a file");
        check(&MPS2_AN385, self.file.path())
    }

    /// Checks the bytes; there must be an answer, whatever they are.
    fn is_good(&mut self, bytes: &[u8]) -> bool {
        self.checked(bytes).is_ok_and(|image| verdict(&[image]).is_ok())
    }
}

#[test]
fn the_image_is_good_as_it_is() {
    let image = Image::new().checked(&elf::image()).expect("an image");
    assert_eq!(verdict(std::slice::from_ref(&image)), Ok(()), "{image:#?}");
    assert_eq!(image.stack_bytes, Some(16));
}

#[test]
fn every_byte_and_every_word_may_be_anything() {
    let (mut image, good) = (Image::new(), elf::image());
    let mut refused = 0;
    for at in 0..good.len() {
        for value in [0, 1, 0x7F, 0x80, 0xFF] {
            let mut bytes = good.clone();
            bytes[at] = value;
            refused += u32::from(!image.is_good(&bytes));
        }
    }
    for at in (0..good.len() - 4).step_by(4) {
        for value in [u32::MAX, 0x7FFF_FFFF, 0x8000_0000, 0xFFFF_FFF0, 0x1000_0000, 0x0F] {
            let mut bytes = good.clone();
            bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
            refused += u32::from(!image.is_good(&bytes));
        }
    }
    assert!(refused > 1000, "{refused}");
}

#[test]
fn a_file_that_ends_early_is_never_good() {
    let (mut image, good) = (Image::new(), elf::image());
    for end in 0..good.len() {
        assert!(!image.is_good(&good[..end]), "{end}");
    }
}

#[test]
fn a_file_that_no_board_could_hold_is_refused_before_it_is_read_to_its_end() {
    let mut image = Image::new();
    image.checked(&elf::image()).expect("an image");
    image.file.as_file().set_len(1 << 40).expect("a file with a hole");
    let error = check(&MPS2_AN385, image.file.path()).expect_err("too large").to_string();
    assert!(error.contains("too large for any board"), "{error}");
}

/// To follow all calls would take more stack than there is, here and on the board.
#[test]
fn calls_that_go_deeper_than_any_program_have_no_bound() {
    let image = Image::new().checked(&elf::image_of_calls(100_000)).expect("an image");
    assert_eq!(image.stack_bytes, None);
    let depth = image.outcomes.iter().find(|outcome| outcome.what == "stack at its deepest");
    let wrong = &depth.expect("a check of the stack").wrong;
    assert!(
        wrong.iter().any(|wrong| wrong.contains("nested deeper than any program")),
        "{wrong:?}"
    );
}
