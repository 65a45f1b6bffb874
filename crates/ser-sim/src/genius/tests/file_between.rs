//! Host and board in different processes, with a file between them.

use super::rig::{COMPLETE, Host, Rig, SECOND_US};
use crate::genius::RAM_LEN;

/// The other process's view: an image that both sides write into.
struct File(Box<[u8; RAM_LEN]>);

impl File {
    fn new() -> File {
        File(Box::new([0; RAM_LEN]))
    }

    /// One round of the process that plays the board: takes what the host wrote, lets time pass,
    /// and hands out what the board wrote.
    fn exchange(&mut self, rig: &mut Rig, host: Host, us: u64) -> Vec<u16> {
        rig.bus.get_mut(host).sync_from_host(&self.0);
        rig.bus.advance_by(us);
        let mut written = Vec::new();
        rig.bus.get_mut(host).publish(|offset, byte| {
            self.0[usize::from(offset)] = byte;
            written.push(offset);
        });
        written
    }

    fn wait_for(&mut self, rig: &mut Rig, host: Host, at: usize, value: u8) {
        for _ in 0..1_000 {
            if self.0[at] == value {
                return;
            }
            self.exchange(rig, host, 10_000);
        }
        panic!("{at:04X}h is {:02X}h", self.0[at]);
    }
}

#[test]
fn a_host_behind_a_file_sees_and_does_the_same() {
    let mut rig = Rig::new();
    let [host, other] = rig.connect([30, 31]);
    let mut file = File::new();
    while rig.bus.now_us() < 1_700_000 {
        file.exchange(&mut rig, host, 100_000);
    }
    file.wait_for(&mut rig, host, 0x0893, 1);
    file.wait_for(&mut rig, host, 0x1E02 + 8 * 31, 1);

    file.0[0x08D2..0x08D5].copy_from_slice(&[1, 2, 3]);
    file.0[0x08C3..0x08C9].copy_from_slice(&[2, 31, 0x40, 0x50, 0, 3]);
    file.0[0x08C2] = 1;
    file.exchange(&mut rig, host, 100);
    file.wait_for(&mut rig, host, 0x08C2, 4);
    assert_eq!(rig.read_datagram(other), Some(([30, 0x40, 0x50, 1], vec![1, 2, 3])));

    // The heartbeat: the host clears, the board sets again.
    file.0[0x0893] = 0;
    file.exchange(&mut rig, host, 100);
    assert_eq!(file.0[0x0893], 0);
    file.wait_for(&mut rig, host, 0x0893, 1);
    assert!(rig.bus.get(host).violations().is_empty());
    assert_eq!(*file.0, *rig.bus.get(host).ram());
}

#[test]
fn data_is_published_before_what_announces_it() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    let mut file = File::new();
    rig.write_all(host, 0x08A2, &[0; 8]);
    rig.bus.get_mut(host).publish(|offset, byte| file.0[usize::from(offset)] = byte);
    assert_eq!(rig.transmit(other, 30, [0x40, 0x50], 0, &[9; 3]), COMPLETE);
    assert_eq!(rig.transmit(other, 30, [0x20, 0x20], 0, &[1, 0, 0, 0, 5]), COMPLETE);
    rig.read_datagram(host);
    let written = file.exchange(&mut rig, host, 1_000);
    let place = |offset| {
        written.iter().position(|&at| at == offset).unwrap_or_else(|| panic!("{offset:04X}h"))
    };
    assert!(place(0x09C2) < place(0x08A7), "datagram before command complete");
    assert!(place(0x0008) < place(0x0881), "request before tail pointer");
    assert!(place(0x0881) < place(0x08A3) && place(0x08A3) < place(0x08A2), "summary last");
}

#[test]
fn what_hands_over_is_read_first_and_acted_on_last() {
    let (mut rig, [host, _]) = Rig::started([30, 31]);
    rig.bus.get_mut(host).publish(|_, _| {});
    let mut order = Vec::new();
    let ram = *rig.bus.get(host).ram();
    rig.bus.get_mut(host).sync_with(|offset| {
        order.push(offset);
        // The host is in the middle of writing a command, and has not yet come to the status byte.
        if offset == 0x08C3 { 4 } else { ram[usize::from(offset)] }
    });
    assert_eq!(order[..3], [0x0880, 0x08C2, 0x0A48]);
    assert_eq!(order.len(), RAM_LEN);
    rig.bus.advance_by(SECOND_US);
    assert_eq!(rig.read(host, 0x08C2), 4, "no command was started");
}

#[test]
fn the_lockout_state_is_published_before_its_grant() {
    let (mut rig, [host]) = Rig::started([31]);
    let mut file = File::new();
    rig.write_all(host, 0x08A2, &[0; 8]);
    rig.bus.get_mut(host).publish(|offset, byte| file.0[usize::from(offset)] = byte);
    file.0[0x0A48] = 1;
    let written = file.exchange(&mut rig, host, 1_000);
    let place = |offset| written.iter().position(|&at| at == offset);
    assert!(place(0x0A49).is_some() && place(0x0A49) < place(0x08A9));
}
