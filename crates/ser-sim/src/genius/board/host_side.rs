//! The host's access to the shared RAM.

use super::Board;
use super::commands::CommandState;
use super::presence::Power;
use super::violations::{Violation, ViolationKind};
use crate::genius::map::{self, RAM_LEN};

/// What a host writes last to hand something over. It is therefore read first from a RAM that both
/// sides can change.
const HANDED_OVER: [usize; 3] = [map::REQUEST_HEAD, map::COMMAND_STATUS, map::LOCKOUT_REQUEST];

impl Board {
    /// The host reads a byte. Only the low 14 bits of the offset count.
    pub fn host_read(&mut self, offset: u16) -> u8 {
        let at = usize::from(offset) % RAM_LEN;
        self.check_not_too_early(at);
        if self.power == Power::Running && (map::RESERVED..map::DEVICES).contains(&at) {
            self.violations.note(self.now_us, ViolationKind::ReservedArea, at);
        }
        self.ram.get(at)
    }

    /// The host reads several bytes.
    pub fn host_read_to(&mut self, offset: u16, bytes: &mut [u8]) {
        for (offset, byte) in (usize::from(offset)..).zip(bytes) {
            *byte = self.host_read(low_bits(offset));
        }
    }

    /// The host writes a byte. Only the low 14 bits of the offset count.
    pub fn host_write(&mut self, offset: u16, byte: u8) {
        let at = usize::from(offset) % RAM_LEN;
        if self.power == Power::InReset {
            return;
        }
        self.check_not_too_early(at);
        if self.power == Power::Running {
            self.check_rules(at, byte);
        }
        self.ram.set(at, byte);
        if self.power == Power::Running {
            self.notice(at);
        }
    }

    /// The host writes several bytes, in order.
    pub fn host_write_from(&mut self, offset: u16, bytes: &[u8]) {
        for (offset, &byte) in (usize::from(offset)..).zip(bytes) {
            self.host_write(low_bits(offset), byte);
        }
    }

    /// The shared RAM as it is, for an onlooker who is not the host.
    #[must_use]
    pub fn ram(&self) -> &[u8; RAM_LEN] {
        self.ram.bytes()
    }

    /// The rules that the host broke. Only the first few dozen are kept.
    #[must_use]
    pub fn violations(&self) -> &[Violation] {
        self.violations.kept()
    }

    /// The rules that the host broke since this was last asked.
    pub(crate) fn take_new_violations(&mut self) -> Vec<Violation> {
        self.violations.take_new()
    }

    /// Whether the board has logged in a device.
    pub(crate) fn has_logged_in(&self, number: u8) -> bool {
        // A board that starts up has test patterns there, and never a plain 1.
        self.ram().get(map::device(number) + map::DEVICE_PRESENT) == Some(&1)
    }

    /// Takes over what another process has written to its image of the shared RAM since the latest
    /// [`publish`](Board::publish).
    ///
    /// `image` is the whole RAM as that process sees it, and must not change meanwhile. If it may
    /// change, use [`sync_with`](Board::sync_with). A file that stands for the RAM begins as zeros.
    pub fn sync_from_host(&mut self, image: &[u8; RAM_LEN]) {
        self.sync_with(|offset| image[usize::from(offset)]);
    }

    /// Does the same for an image that changes while it is read. Pointers and flags are read first,
    /// so what they hand over is complete.
    pub fn sync_with(&mut self, mut read: impl FnMut(u16) -> u8) {
        let handed_over = HANDED_OVER.map(|at| (at, read(low_bits(at))));
        for at in 0..RAM_LEN {
            if !HANDED_OVER.contains(&at) {
                self.take_over(at, read(low_bits(at)));
            }
        }
        for (at, byte) in handed_over {
            self.take_over(at, byte);
        }
    }

    fn take_over(&mut self, at: usize, byte: u8) {
        if self.host_image[at] != byte {
            self.host_image[at] = byte;
            self.host_write(low_bits(at), byte);
        }
    }

    /// Hands out every byte that differs from the host's image. The bytes are to be written to that
    /// image in this order: data before the flags that announce them.
    pub fn publish(&mut self, mut write: impl FnMut(u16, u8)) {
        let (ram, image) = (self.ram.bytes(), &mut self.host_image);
        let mut changed: Vec<usize> = (0..RAM_LEN).filter(|&at| ram[at] != image[at]).collect();
        changed.sort_by_key(|&at| rank(at));
        for at in changed {
            image[at] = ram[at];
            write(low_bits(at), ram[at]);
        }
    }

    fn check_rules(&mut self, at: usize, byte: u8) {
        let kind = match at {
            map::REQUEST_TAIL => ViolationKind::TailPointer,
            map::BOARD_OK => return,
            map::DIP_SWITCHES | map::STATUS..map::INTERRUPT_STATUS => ViolationKind::ReadOnly,
            map::COMMAND_STATUS if self.live.command != CommandState::Free => {
                ViolationKind::CommandBusy
            }
            map::LOCKOUT_STATE => ViolationKind::Lockout,
            map::LOCKOUT_REQUEST => {
                // A lockout is requested only when neither byte is set, and released only when both
                // are.
                let (requested, wanted) = (self.ram.bit0(at), byte & 1 != 0);
                let granted = self.live.lockout.granted;
                let allowed = if wanted { !requested && !granted } else { !requested || granted };
                if allowed {
                    return;
                }
                ViolationKind::Lockout
            }
            map::RESERVED..map::DEVICES => ViolationKind::ReservedArea,
            map::DEVICES..map::DIRECTED_IN
                if (at - map::DEVICES) % map::DEVICE_LEN != map::DEVICE_OUTPUTS =>
            {
                ViolationKind::ReadOnly
            }
            _ => return,
        };
        self.violations.note(self.now_us, kind, at);
    }

    /// Some writes get the board's attention.
    fn notice(&mut self, at: usize) {
        let look_us = Some(self.now_us + self.options.timing.notice_us + self.faults.late_by_us);
        match at {
            map::REQUEST_TAIL => self.hang_request_queue(),
            map::REQUEST_HEAD => self.live.requests.look_us = look_us,
            map::COMMAND_STATUS | map::COMMAND => self.live.command_look_us = look_us,
            map::LOCKOUT_REQUEST => self.live.lockout.look_us = look_us,
            _ => {}
        }
    }
}

/// How much other data a byte announces. Bytes with a higher rank are published later.
fn rank(at: usize) -> u8 {
    match at {
        map::INTERRUPT_STATUS | map::BOARD_OK => 3,
        _ if (map::INTERRUPT_STATUS..map::INTERRUPT_STATUS + map::INTERRUPTS).contains(&at) => 2,
        map::REQUEST_TAIL | map::COMMAND_STATUS | map::LOCKOUT_STATE => 1,
        _ if (map::DEVICES..map::DIRECTED_IN).contains(&at)
            && (at - map::DEVICES) % map::DEVICE_LEN == map::DEVICE_PRESENT =>
        {
            1
        }
        _ => 0,
    }
}

/// Only the low 14 address lines exist.
fn low_bits(at: usize) -> u16 {
    #[expect(clippy::cast_possible_truncation, reason = "reduced to 14 bits")]
    let offset = (at % RAM_LEN) as u16;
    offset
}
