//! Watches the device table of a running board, a few entries at a time.

use crate::counters::{Counters, count};
use crate::device_table::{Device, Record, read_record};
use crate::event::{DeviceChange, Event};
use crate::map;
use crate::ram::SharedRam;
use crate::setup_table::BoardSwitches;

/// Entries checked in one poll.
const RECORDS_PER_POLL: usize = 4;

/// The devices as last seen.
#[derive(Debug)]
pub(super) struct DeviceWatch {
    known: [Option<Device>; map::DEVICE_COUNT as usize],
    /// The next entry to check, and how many are left.
    next: u8,
    left: u8,
}

impl DeviceWatch {
    pub(super) const fn new() -> DeviceWatch {
        DeviceWatch { known: [None; map::DEVICE_COUNT as usize], next: 0, left: 0 }
    }

    pub(super) fn due(&mut self) {
        self.left = map::DEVICE_COUNT;
    }

    pub(super) fn poll<R: SharedRam>(
        &mut self,
        ram: &R,
        buffer_len: u8,
        counters: &mut Counters,
    ) -> Option<Event> {
        for _ in 0..RECORDS_PER_POLL {
            self.left = self.left.checked_sub(1)?;
            let number = self.next;
            self.next = (number + 1) % map::DEVICE_COUNT;
            // The board does not use the entry of its own address.
            if number == BoardSwitches::read(ram).device_number {
                continue;
            }
            let seen = match read_record(ram, number, buffer_len) {
                Record::Present(device) => Some(device),
                Record::Absent => None,
                Record::Impossible => {
                    count(&mut counters.device_records_refused);
                    None
                }
            };
            let known = self.known.get_mut(usize::from(number))?;
            let change = change(*known, seen);
            *known = seen;
            if let Some(change) = change {
                return Some(Event::Device { number, change });
            }
        }
        None
    }
}

/// A change of the outputs flag is not reported, because the host made it.
fn change(known: Option<Device>, seen: Option<Device>) -> Option<DeviceChange> {
    match (known, seen) {
        (None, Some(device)) => Some(DeviceChange::LoggedIn(device)),
        (Some(_), None) => Some(DeviceChange::LoggedOut),
        (Some(known), Some(device)) => {
            let known = Device { outputs_disabled: device.outputs_disabled, ..known };
            (known != device).then_some(DeviceChange::Changed(device))
        }
        (None, None) => None,
    }
}
