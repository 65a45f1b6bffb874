//! What goes wrong, at random or when told. The same seed always gives the same accidents.

use super::device_id::DeviceId;
use oorandom::Rand64;

/// How often messages suffer, in millionths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Noise {
    /// Where the sequence of accidents begins.
    pub seed: u64,
    /// Messages that nobody can read: a bus error to everyone.
    pub damaged_ppm: u32,
    /// Messages that a receiver cannot read, drawn for each receiver separately: a bus error to it.
    pub lost_ppm: u32,
    /// Messages that arrive although the sender gets no acknowledgement.
    pub unacknowledged_ppm: u32,
}

/// Something that goes wrong once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The next messages on the bus are damaged.
    Damage {
        /// How many.
        messages: u32,
    },
    /// A device does not understand the next messages.
    Deafen {
        /// The device.
        device: DeviceId,
        /// How many.
        messages: u32,
    },
    /// A device is cut off from the bus for a while, both ways.
    Disconnect {
        /// The device.
        device: DeviceId,
        /// For how long.
        for_us: u64,
    },
    /// Something happens inside a device.
    Inside {
        /// The device.
        device: DeviceId,
        /// What.
        fault: DeviceFault,
    },
}

/// Something that goes wrong inside a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceFault {
    /// A self-test during operation finds these faults (bits of the hardware status byte). The
    /// board stops.
    FailSelfTest(u8),
    /// The self-test at the next reset, and only that one, finds these faults.
    FailNextStart(u8),
    /// The processor stops without a word.
    Hang,
    /// The processor starts from the beginning.
    Reset,
    /// From now on everything that the host asks for takes this much longer.
    AnswerLate {
        /// How much longer.
        by_us: u64,
    },
    /// There is no memory for the next datagrams that the host wants to send.
    OutOfMemory {
        /// How many of them.
        datagrams: u32,
    },
    /// Someone turned the switches for the bus address.
    ChangeAddress(u8),
}

/// The accidents that are still to come.
#[derive(Debug)]
pub(super) struct Accidents {
    noise: Noise,
    numbers: Rand64,
    damage: u32,
}

impl Accidents {
    pub(super) fn new(noise: Noise) -> Accidents {
        Accidents { noise, numbers: Rand64::new(noise.seed.into()), damage: 0 }
    }

    pub(super) fn damage(&mut self, messages: u32) {
        self.damage = self.damage.saturating_add(messages);
    }

    pub(super) fn damaged(&mut self) -> bool {
        if self.damage > 0 {
            self.damage -= 1;
            return true;
        }
        self.happens(self.noise.damaged_ppm)
    }

    pub(super) fn lost(&mut self) -> bool {
        self.happens(self.noise.lost_ppm)
    }

    pub(super) fn unacknowledged(&mut self) -> bool {
        self.happens(self.noise.unacknowledged_ppm)
    }

    /// True this many times in a million. Draws nothing when that is never.
    fn happens(&mut self, per_million: u32) -> bool {
        per_million > 0 && self.numbers.rand_range(0..1_000_000) < u64::from(per_million)
    }
}
