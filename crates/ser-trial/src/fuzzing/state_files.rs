//! The file in which `ser-cli` keeps, from one run to the next, what it has delivered.

use ser_cli::Delivered;

/// `data` is the content of the file. It is read or refused, and what is read is the same after it
/// has been written down again.
///
/// # Panics
/// When this does not hold.
pub fn state_files(data: &[u8]) {
    match Delivered::from_text(data) {
        Ok(delivered) => {
            let text = delivered.to_text("/dev/ttyUSB0").expect("what was read can be written");
            assert_eq!(Delivered::from_text(text.as_bytes()), Ok(delivered), "{text}");
        }
        Err(why) => assert!(!why.to_string().is_empty()),
    }
}
