//! A bus with hosts on it that follow the manual's example algorithms.

use crate::genius::{Board, BoardOptions, Bus, BusTiming, Handle, Noise};

pub(super) type Host = Handle<Board>;

pub(super) const SECOND_US: u64 = 1_000_000;

/// Command block status values, as chapter 10 lists them.
pub(super) const COMPLETE: u8 = 4;
pub(super) const SYNTAX_ERROR: u8 = 8;
pub(super) const PROCESS_ERROR: u8 = 0x10;

pub(super) struct Rig {
    pub(super) bus: Bus,
}

impl Rig {
    pub(super) fn new() -> Rig {
        Rig { bus: Bus::new(BusTiming::default()) }
    }

    pub(super) fn with_noise(noise: Noise) -> Rig {
        Rig { bus: Bus::with_noise(BusTiming::default(), noise) }
    }

    /// Connects hosts with these bus addresses, their boards just out of reset.
    pub(super) fn connect<const N: usize>(&mut self, numbers: [u8; N]) -> [Host; N] {
        numbers.map(|number| self.bus.connect(Board::powered(BoardOptions::at(number))))
    }

    /// Hosts whose boards are on the bus and know each other.
    pub(super) fn started<const N: usize>(numbers: [u8; N]) -> (Rig, [Host; N]) {
        let mut rig = Rig::new();
        let hosts = rig.connect(numbers);
        rig.bus.advance_to(4 * SECOND_US);
        for host in hosts {
            assert_eq!(rig.read(host, 0x0893), 1, "OK flag");
            for number in numbers {
                let present = rig.device(host, number)[2];
                assert_eq!(
                    present,
                    u8::from(number != rig.bus.get(host).number()),
                    "{number} present"
                );
            }
        }
        (rig, hosts)
    }

    pub(super) fn read(&mut self, host: Host, offset: u16) -> u8 {
        self.bus.get_mut(host).host_read(offset)
    }

    pub(super) fn read_word(&mut self, host: Host, offset: u16) -> u16 {
        u16::from_le_bytes(self.read_array(host, offset))
    }

    pub(super) fn read_array<const N: usize>(&mut self, host: Host, offset: u16) -> [u8; N] {
        let mut bytes = [0; N];
        self.bus.get_mut(host).host_read_to(offset, &mut bytes);
        bytes
    }

    pub(super) fn write(&mut self, host: Host, offset: u16, byte: u8) {
        self.bus.get_mut(host).host_write(offset, byte);
    }

    pub(super) fn write_all(&mut self, host: Host, offset: u16, bytes: &[u8]) {
        self.bus.get_mut(host).host_write_from(offset, bytes);
    }

    /// A device's entry in the device table.
    pub(super) fn device(&mut self, host: Host, number: u8) -> [u8; 8] {
        self.read_array(host, 0x1E00 + 8 * u16::from(number))
    }

    pub(super) fn advance_ms(&mut self, ms: u64) {
        self.bus.advance_by(ms * 1000);
    }

    /// Waits for a byte to have a value. The bound is generous, and missing it is a failure.
    pub(super) fn wait_for(&mut self, host: Host, offset: u16, value: u8) {
        let at = usize::from(offset);
        let came = self.bus.advance_until(20 * SECOND_US, |bus| bus.get(host).ram()[at] == value);
        assert!(came, "{offset:04X}h is {:02X}h", self.read(host, offset));
    }

    /// The basic algorithm for starting a command: check OK, check that the block is free, write
    /// the options, then the status byte.
    pub(super) fn start_command(&mut self, host: Host, command: u8, options: &[u8]) {
        assert_eq!(self.read(host, 0x0893), 1, "the board is not OK");
        let status = self.read(host, 0x08C2);
        assert!(status == 0 || status >= 4, "the command block is not free: {status:02X}h");
        self.write_all(host, 0x08C4, options);
        self.write(host, 0x08C3, command);
        self.write(host, 0x08C2, 1);
    }

    /// Algorithm 1 for completing a command: wait until the status byte is 4 or above.
    pub(super) fn complete_command(&mut self, host: Host) -> u8 {
        let done = self.bus.advance_until(11 * SECOND_US, |bus| bus.get(host).ram()[0x08C2] >= 4);
        assert!(done, "the command does not end");
        self.read(host, 0x08C2)
    }

    pub(super) fn command(&mut self, host: Host, command: u8, options: &[u8]) -> u8 {
        self.start_command(host, command, options);
        self.complete_command(host)
    }

    /// Transmit Datagram: directed, or to 255 for all.
    pub(super) fn transmit(
        &mut self,
        host: Host,
        to: u8,
        codes: [u8; 2],
        priority: u8,
        data: &[u8],
    ) -> u8 {
        self.start_transmit(host, to, codes, priority, data);
        self.complete_command(host)
    }

    pub(super) fn start_transmit(
        &mut self,
        host: Host,
        to: u8,
        codes: [u8; 2],
        priority: u8,
        data: &[u8],
    ) {
        self.write_all(host, 0x08D2, data);
        let length = u8::try_from(data.len()).unwrap();
        self.start_command(host, 2, &[to, codes[0], codes[1], priority, length]);
    }

    /// Read Datagram: returns source, function, subfunction, directed, and the data; `None` when
    /// the queue is empty.
    pub(super) fn read_datagram(&mut self, host: Host) -> Option<([u8; 4], Vec<u8>)> {
        match self.command(host, 1, &[]) {
            COMPLETE => {
                let [source, function, subfunction, directed, length] =
                    self.read_array(host, 0x08C4);
                let mut data = vec![0; length.into()];
                self.bus.get_mut(host).host_read_to(0x09C2, &mut data);
                Some(([source, function, subfunction, directed], data))
            }
            SYNTAX_ERROR => None,
            status => panic!("Read Datagram ends with {status:02X}h"),
        }
    }

    /// Writes a setup (reference, broadcast, directed and buffer length) and sends a Configuration
    /// Change.
    pub(super) fn configure(&mut self, host: Host, setup: [u8; 5]) -> u8 {
        self.write_all(host, 0x0883, &setup);
        self.command(host, 4, &[])
    }

    /// Checks that every host kept the rules of the manual.
    pub(super) fn assert_lawful(&self, hosts: &[Host]) {
        for &host in hosts {
            assert_eq!(self.bus.get(host).violations(), []);
        }
    }
}

/// The setup table's bytes 2 to 6 with these lengths and nothing else changed.
pub(super) fn lengths(broadcast: u8, directed: u8, buffer: u8) -> [u8; 5] {
    [0xFF, 0xFF, broadcast, directed, buffer]
}
