//! What the factory wrote into the chip.

use core::ptr;

use ser_proto::RecorderId;

/// The unique device number of 96 bits (reference manual, "Unique device ID register").
const DEVICE_NUMBER: usize = 0x1FFF_7A10;

/// The number that no other chip has.
pub(crate) fn id() -> Option<RecorderId> {
    let number = ptr::with_exposed_provenance::<[u32; 3]>(DEVICE_NUMBER);
    // SAFETY: system memory of the chip, aligned, readable at any time and never written.
    let words = unsafe { ptr::read_volatile(number) };
    let mut bytes = [0; RecorderId::LEN];
    for (bytes, word) in bytes.as_chunks_mut().0.iter_mut().zip(words) {
        *bytes = word.to_le_bytes();
    }
    RecorderId::new(bytes)
}
