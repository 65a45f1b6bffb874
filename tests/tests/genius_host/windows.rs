//! What can be opened as a window, and what cannot.

use std::fs::{self, File};
use std::os::fd::AsRawFd;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread;

use ser_client::{Delivery, GeniWindow, GeniusError, OpenError};
use ser_proto::Model;
use ser_sim::genius::{Fault, RAM_LEN};

use crate::desk::{Desk, unit};

const ONE: [(u8, Model); 1] = [(5, Model::Ser160)];

fn window(path: &Path) -> GeniWindow {
    GeniWindow::from(path.to_str().expect("text"))
}

/// A file of zeros.
fn file(path: &Path, len: u64) -> GeniWindow {
    File::create(path).and_then(|file| file.set_len(len)).expect("a file");
    window(path)
}

#[test]
fn what_is_no_window_is_told_apart_and_left_alone() {
    let desk = Desk::new(&ONE);
    let open = |window: &GeniWindow| desk.open(window.clone()).expect_err("no window");

    assert!(matches!(open(&window(&desk.path("none"))), OpenError::NoSuchWindow { .. }));
    assert!(matches!(open(&window(&desk.path(""))), OpenError::NotAWindow { .. }));
    assert!(matches!(open(&GeniWindow::from("/dev/null")), OpenError::NoMemory { .. }));
    for len in [0, RAM_LEN as u64 - 1, RAM_LEN as u64 + 1] {
        let window = file(&desk.path("other"), len);
        match open(&window) {
            OpenError::WindowSize { len: found, .. } => assert_eq!(found, len),
            other => panic!("{other}"),
        }
        let far = GeniWindow { offset: Some(u64::MAX), ..window };
        assert!(matches!(open(&far), OpenError::WindowSize { .. }));
        let bytes = fs::read(desk.path("other")).expect("the file is there");
        assert_eq!(bytes, vec![0; usize::try_from(len).expect("short")]);
    }
}

#[test]
fn a_window_without_a_board_behind_it_is_silent() {
    let desk = Desk::new(&ONE);
    let zeros = file(&desk.path("zeros"), RAM_LEN as u64);
    let ones = desk.path("ones");
    fs::write(&ones, [0xFF; RAM_LEN]).expect("written");
    let photo = desk.path("photo");
    fs::write(&photo, [0xA5; RAM_LEN]).expect("written");
    for window in [zeros, window(&ones), window(&photo), GeniWindow::from("/dev/zero")] {
        let began_ms = desk.now_ms();
        match desk.open(window).err() {
            Some(OpenError::Genius { error: GeniusError::BoardSilent, .. }) => {}
            other => panic!("{other:?}"),
        }
        assert!(desk.now_ms() - began_ms <= 3_010, "{} ms", desk.now_ms() - began_ms);
    }
    // A file that was named by mistake is unchanged.
    assert!(fs::read(&photo).expect("read").iter().all(|&byte| byte == 0xA5));
}

/// A file of the user's that looks like the window of a board that has stopped.
fn like_a_window(path: &Path, offset: usize) -> Vec<u8> {
    let mut bytes = vec![0xA5; offset + RAM_LEN + 7];
    bytes[offset + 0x0893] = 1;
    fs::write(path, &bytes).expect("written");
    bytes
}

#[test]
fn a_place_in_a_file_that_was_named_by_mistake_is_what_it_was() {
    let desk = Desk::new(&ONE);
    let path = desk.path("photo");
    for offset in [0, 0x1234] {
        let bytes = like_a_window(&path, offset);
        let window = GeniWindow { offset: Some(offset as u64), ..window(&path) };
        match desk.open(window).err() {
            Some(OpenError::Genius { error: GeniusError::BoardSilent, .. }) => {}
            other => panic!("{other:?}"),
        }
        assert!(fs::read(&path).expect("read") == bytes, "{offset}");
    }
}

#[test]
fn opening_ends_when_it_is_told_to() {
    let desk = Desk::new(&ONE);
    let path = desk.path("photo");
    let bytes = like_a_window(&path, 0);
    let window = GeniWindow { offset: Some(0), ..window(&path) };
    let began_ms = desk.now_ms();
    let stop = Arc::new(AtomicBool::new(true));
    match desk.open_unless(window, &stop).err() {
        Some(OpenError::Genius { error: GeniusError::Interrupted, .. }) => {}
        other => panic!("{other:?}"),
    }
    assert!(desk.now_ms() - began_ms <= 10, "at once");
    assert!(fs::read(&path).expect("read") == bytes);
}

#[test]
fn a_window_belongs_to_one_host() {
    let desk = Desk::new(&ONE);
    let first = desk.host();
    assert!(matches!(desk.open(desk.window()), Err(OpenError::WindowInUse { .. })));
    unit(&first, 5).mode().expect("the first host is not disturbed");
    drop(first);
    unit(&desk.host(), 5).mode().expect("the window is free again");
}

#[test]
fn devices_that_are_just_logging_in_are_waited_for() {
    const COUNT: u8 = 12;
    let crowd: Vec<_> = (1..=COUNT).map(|number| (number, Model::Ser160)).collect();
    let desk = Desk::new(&crowd);
    let host = desk.host();
    desk.with(|bench| {
        let mut bus = bench.world.bus.borrow_mut();
        let at_us = bus.now_us();
        for recorder in &bench.world.recorders {
            let device = recorder.board.id();
            bus.schedule(at_us, Fault::Disconnect { device, for_us: 5_000_000 });
        }
    });
    desk.run(4_000);
    assert_eq!(host.devices().expect("the board is well"), []);
    let began_ms = desk.now_ms();
    let seen = loop {
        let devices = host.devices().expect("the board is well");
        if !devices.is_empty() {
            break devices.len();
        }
        assert!(desk.now_ms() < began_ms + 60_000, "nobody comes back");
    };
    assert_eq!(seen, usize::from(COUNT), "all at once");
}

#[test]
fn one_host_reads_two_recorders_at_once() {
    const EVENTS: usize = 30;
    let desk = Desk::new(&[(5, Model::Ser160), (9, Model::Ser320)]);
    for event in 0..EVENTS {
        for recorder in [0, 1] {
            desk.contact(recorder, event % 2 == 0);
        }
        desk.run(2);
    }
    let host = desk.host();
    let readings = [5, 9].map(|number| {
        let mut unit = unit(&host, number);
        thread::spawn(move || {
            let mut entries = Vec::new();
            unit.read_new(&mut None, 2048, &mut |delivery| entries.push(delivery))
                .expect("the log is read");
            entries
        })
    });
    for reading in readings {
        let entries = reading.join().expect("a reading");
        assert!(entries.iter().all(|delivery| matches!(delivery, Delivery::Event { .. })));
        assert_eq!(entries.len(), EVENTS);
    }
}

#[test]
fn a_window_may_be_a_mapped_part_of_a_file_or_a_file_without_a_name() {
    let desk = Desk::new(&ONE);
    let mapped = GeniWindow { offset: Some(0), ..desk.window() };
    let host = desk.open(mapped).unwrap_or_else(|error| panic!("{error}"));
    unit(&host, 5).mode().expect("a reply");
    assert!(matches!(desk.open(desk.window()), Err(OpenError::WindowInUse { .. })));
    drop(host);

    let open_file = File::options().read(true).write(true).open(desk.path("host")).expect("a file");
    let nameless = GeniWindow::from(&*format!("/proc/self/fd/{}", open_file.as_raw_fd()));
    let host = desk.open(nameless).unwrap_or_else(|error| panic!("{error}"));
    unit(&host, 5).mode().expect("a reply");
}

#[test]
fn a_window_that_gets_shorter_is_an_error_of_the_window() {
    let desk = Desk::new(&ONE);
    let host = desk.host();
    let mut unit = unit(&host, 5);
    unit.mode().expect("a reply");
    let file = File::options().write(true).open(desk.path("host")).expect("a file");
    file.set_len(0x1000).expect("cut");
    let error = host.devices().expect_err("half a window");
    assert!(matches!(error, GeniusError::Window(_)), "{error}");
    let error = unit.mode().expect_err("half a window");
    assert!(error.to_string().contains("the window of the GENI board cannot be used"), "{error}");
}
