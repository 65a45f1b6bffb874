//! The firmware version as a recorder reports it.

use ser_proto::FirmwareVersion;

/// Firmware version in three parts.
pub(crate) const FIRMWARE: FirmwareVersion = FirmwareVersion {
    major: digit(env!("CARGO_PKG_VERSION_MAJOR")),
    minor: digit(env!("CARGO_PKG_VERSION_MINOR")),
    patch: digit(env!("CARGO_PKG_VERSION_PATCH")),
};

/// Firmware version as in the `M` reply, in hundredths: 0.1.0 is 10, 1.2.3 is 123.
pub const VERSION: u8 = 100 * FIRMWARE.major + 10 * FIRMWARE.minor + FIRMWARE.patch;

#[expect(clippy::panic, reason = "evaluated by the compiler only")]
const fn digit(text: &str) -> u8 {
    match text.as_bytes() {
        [digit @ b'0'..=b'9'] => *digit - b'0',
        _ => panic!("the version byte has room for one digit per part of the version"),
    }
}
