//! The promise about configurations: after a power cut at any moment, the recorder comes up with
//! the old one or the new one.
//!
//! The tests talk to a whole recorder over its RS-232 line, as a host would. The power fails at
//! every single write to the flash memory while it stores, during the erasing of sectors, and again
//! while it recovers.

mod flash;

use std::ops::Range;

use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
use flash::{Flash, PowerCut};
use ser_board::clock_chip::ClockHealth;
use ser_board::flash_log::{FlashHealth, FlashLog};
use ser_board::health::Health;
use ser_board::inputs::InputHealth;
use ser_node::{
    Capture, CaptureChannel, CopyNumber, Debounce, Event, NoRtc, Node, NodeParts, RECORD_LEN,
    Storage, Work,
};
use ser_proto::{
    AutoReport, Baud, Command, Configuration, Configure, Decoded, FrameDecoder, FrameEncoder,
    MAX_BODY_LEN, Model, Reply,
};

/// Sectors small enough to go through many erases. The layout does not depend on their size.
const SMALL: usize = 1024;
/// Sectors 0–3 of an STM32F407.
const REAL: usize = 16 * 1024;

/// The n-th of many configurations, each unlike its neighbours in every field.
fn configuration(number: u16) -> Configuration {
    Configuration {
        size: 1 + number % 2048,
        baud: Baud::from_code(1 + (number % 7) as u8).unwrap(),
        auto_report: [AutoReport::Off, AutoReport::Genius, AutoReport::Rs232]
            [usize::from(number % 3)],
        report_address: (number % 32) as u8,
        auto_print: number.is_multiple_of(2),
    }
}

/// RAM of a recorder that is on. Made once, because there are thousands of power-ups.
struct Ram {
    channel: CaptureChannel,
    log: Vec<Event>,
    work: Work,
}

impl Ram {
    fn new() -> Ram {
        Ram { channel: CaptureChannel::new(), log: vec![Event::EMPTY; 2048], work: Work::new() }
    }

    fn power_up<S: Storage>(&mut self, storage: S) -> Recorder<'_, S> {
        self.channel = CaptureChannel::new();
        let (mut capture, reader) = self.channel.split(Debounce::OFF);
        capture.sample(1, 0);
        let parts = NodeParts {
            model: Model::Ser320,
            log: &mut self.log,
            work: &mut self.work,
            capture: reader,
            storage,
            rtc: NoRtc,
            id: None,
        };
        Recorder { node: Node::new(parts), _capture: capture }
    }
}

struct Recorder<'a, S> {
    node: Node<'a, S, NoRtc>,
    _capture: Capture<'a>,
}

impl<S: Storage> Recorder<'_, S> {
    fn ask(&mut self, command: &Command) -> Configuration {
        for byte in FrameEncoder::new(command.to_body()) {
            self.node.serial_receive(byte, 1);
        }
        let mut decoder = FrameDecoder::<MAX_BODY_LEN>::new();
        let mut answer = None;
        while let Some(byte) = self.node.serial_transmit() {
            if let Some(Decoded::Frame(body)) = decoder.push(byte) {
                answer = Some(Reply::parse(body).unwrap());
            }
        }
        if let Some(baud) = self.node.baud_change() {
            self.node.baud_changed(baud);
        }
        match answer {
            Some(Reply::Configuration(configuration)) => configuration,
            other => panic!("{other:?} in answer to {command:?}"),
        }
    }

    fn configure(&mut self, configuration: &Configuration) {
        assert_eq!(self.ask(&Command::Configure(Configure::from(*configuration))), *configuration);
    }

    fn configuration(&mut self) -> Configuration {
        self.ask(&Command::QueryConfiguration)
    }
}

static HEALTH: FlashHealth = FlashHealth::new();

fn log<const SECTOR: usize, const WORD: usize>(
    flash: &Flash<SECTOR, WORD>,
) -> impl Storage + use<SECTOR, WORD> {
    FlashLog::new(flash.clone(), &HEALTH)
}

/// The wrong way to store: both copies in one sector, which is erased for every change and then
/// written anew.
struct OneSector(Flash<SMALL, 1>);

impl Storage for OneSector {
    type Error = PowerCut;

    fn read(&mut self, copy: CopyNumber, record: &mut [u8; RECORD_LEN]) -> Result<(), PowerCut> {
        self.0.read([0, 256][copy as usize], record)
    }

    fn write(&mut self, copy: CopyNumber, record: &[u8; RECORD_LEN]) -> Result<(), PowerCut> {
        let mut both = [0; 2 * RECORD_LEN];
        self.0.read(0, &mut both)?;
        both[copy as usize * RECORD_LEN..][..RECORD_LEN].copy_from_slice(record);
        self.0.erase(0, 1024)?;
        self.0.write(0, &both)
    }
}

/// Memory in which the configurations of a range have been stored, one after the other.
fn stored<const SECTOR: usize, const WORD: usize, S: Storage>(
    open: fn(&Flash<SECTOR, WORD>) -> S,
    numbers: Range<u16>,
) -> Flash<SECTOR, WORD> {
    let flash = Flash::new(4);
    let mut ram = Ram::new();
    let mut recorder = ram.power_up(open(&flash));
    for number in numbers {
        recorder.configure(&configuration(number));
    }
    assert_eq!(recorder.node.diagnostics().storage_errors, 0);
    flash
}

/// Stores configuration after configuration. Cuts the power at every step of each one and, after
/// each power-up, at some steps of the next one. Returns the number of cuts.
fn cut_everywhere<const SECTOR: usize, const WORD: usize, S: Storage>(
    open: fn(&Flash<SECTOR, WORD>) -> S,
    changes: Range<u16>,
) -> u64 {
    let mut ram = Ram::new();
    let flash = stored(open, 1..changes.start + 1);
    let mut cuts = 0;
    for number in changes {
        let (old, new) = (configuration(number), configuration(number + 1));
        for steps in 0.. {
            let flash = flash.copy();
            if !cut(&mut ram, &flash, open, steps, &old, &new) {
                break;
            }
            cuts += 1;
            cuts += cut_again(&mut ram, &flash, open, steps, number);
        }
        ram.power_up(open(&flash)).configure(&new);
        assert_eq!(ram.power_up(open(&flash)).configuration(), new);
    }
    cuts
}

/// Cuts the power that many steps into a change. False when the change is done before that.
fn cut<const SECTOR: usize, const WORD: usize, S: Storage>(
    ram: &mut Ram,
    flash: &Flash<SECTOR, WORD>,
    open: fn(&Flash<SECTOR, WORD>) -> S,
    steps: u64,
    old: &Configuration,
    new: &Configuration,
) -> bool {
    let mut recorder = ram.power_up(open(flash));
    assert_eq!(recorder.configuration(), *old, "before the change to {new:?}");
    let before = flash.steps();
    flash.cut_after(steps, steps);
    // The configuration is in force until the power goes, whether or not it could be stored.
    recorder.configure(new);
    let is_cut = flash.steps() - before == steps && recorder.node.diagnostics().storage_errors != 0;
    flash.power_up();
    let found = ram.power_up(open(flash)).configuration();
    assert!(
        found == *old || found == *new,
        "cut after {steps} steps: {found:?} is neither {old:?} nor {new:?}"
    );
    if !is_cut {
        assert_eq!(found, *new);
    }
    is_cut
}

/// Goes on with a memory that has seen a cut: the next changes are kept, and a second cut does no
/// more harm than the first.
fn cut_again<const SECTOR: usize, const WORD: usize, S: Storage>(
    ram: &mut Ram,
    flash: &Flash<SECTOR, WORD>,
    open: fn(&Flash<SECTOR, WORD>) -> S,
    seed: u64,
    number: u16,
) -> u64 {
    let found = ram.power_up(open(flash)).configuration();
    let next = configuration(number + 1000);
    let mut cuts = 0;
    // Not every step again, but a different stride after each first cut.
    for steps in (seed % 23..).step_by(23) {
        let flash = flash.copy();
        if !cut(ram, &flash, open, steps, &found, &next) {
            break;
        }
        cuts += 1;
    }
    ram.power_up(open(flash)).configure(&next);
    assert_eq!(ram.power_up(open(flash)).configuration(), next);
    cuts
}

#[test]
fn a_cut_at_any_write_leaves_the_old_or_the_new_configuration() {
    // Three records per sector: a sector in use is erased at the seventh change and at the eighth.
    let cuts = cut_everywhere(log::<SMALL, 1>, 6..8) + cut_everywhere(log::<SMALL, 4>, 1..10);
    assert!(cuts > 5_000, "{cuts}");
}

#[test]
fn a_cut_around_the_erase_of_a_real_sector_leaves_the_old_or_the_new_configuration() {
    // The changes that fill the two sectors, those that erase them, and those after.
    let cuts = cut_everywhere(log::<REAL, 4>, 125..128);
    assert!(cuts > 1000, "{cuts}");
}

/// Checks that the bench notices a lost configuration: this storage comes up with the default one.
#[test]
#[should_panic(expected = "is neither")]
fn copies_that_share_a_sector_would_not_pass() {
    cut_everywhere(|flash| OneSector(flash.clone()), 1..5);
}

#[test]
fn memory_that_held_something_else_is_as_good_as_new() {
    let mut ram = Ram::new();
    for seed in 0..200 {
        let flash = Flash::<SMALL, 1>::new(4);
        flash.fill_with_noise(seed);
        assert_eq!(ram.power_up(log(&flash)).configuration(), Configuration::default());
        for number in 1..20 {
            ram.power_up(log(&flash)).configure(&configuration(number));
            assert_eq!(
                ram.power_up(log(&flash)).configuration(),
                configuration(number),
                "seed {seed}"
            );
        }
    }
}

#[test]
fn what_an_earlier_firmware_stored_is_found_and_kept_until_something_newer_is() {
    // Three records of 16 bytes behind the marker of their time.
    let records = |sequence: u8, size: u8| {
        let mut record = vec![b'S', 1, sequence, 0, 0, 0, 0, size, 7, 1, 31, 1];
        let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&record);
        record.extend(crc.to_le_bytes());
        record
    };
    let mut flash = Flash::<SMALL, 4>::new(4);
    for (sector, sizes) in [(0, [10, 30, 50]), (1, [20, 40, 60])] {
        flash.erase(sector * 1024, (sector + 1) * 1024).unwrap();
        flash.write(sector * 1024, b"SER settings 1\r\n").unwrap();
        for (slot, size) in (1..).zip(sizes) {
            let at = sector * 1024 + slot * 16;
            flash.write(at, &records(size / 10, size)).unwrap();
        }
    }
    let mut ram = Ram::new();
    assert_eq!(ram.power_up(log(&flash)).configuration().size, 60);
    let erased = flash.erased();
    ram.power_up(log(&flash)).configure(&configuration(5));
    assert_eq!(ram.power_up(log(&flash)).configuration(), configuration(5));
    let erased_since: Vec<_> =
        flash.erased().iter().zip(&erased).map(|(now, before)| now - before).collect();
    assert_eq!(erased_since, [1, 0, 0, 0], "the newest of the old ones is still there");
}

#[test]
fn an_erase_is_as_rare_as_the_documentation_says() {
    assert_eq!(FlashLog::<Flash<REAL, 1>>::RECORDS_PER_SECTOR, 63);
    assert_eq!(FlashLog::<Flash<{ 128 * 1024 }, 1>>::RECORDS_PER_SECTOR, 511);
    // One erase prepares each sector; then the copies take turns.
    let changes =
        [(1, [1, 0]), (2, [1, 1]), (126, [1, 1]), (127, [2, 1]), (128, [2, 2]), (252, [2, 2])];
    for (last, [first, second]) in changes {
        let flash = stored(log::<REAL, 1>, 1..last + 1);
        assert_eq!(flash.erased(), [first, second, 0, 0], "after {last} changes");
    }
}

#[test]
fn the_log_says_how_many_records_are_left() {
    let flash = Flash::<SMALL, 1>::new(3);
    let mut log = FlashLog::new(flash.clone(), &HEALTH);
    assert_eq!(log.records_left(CopyNumber::First), Ok(0));
    for left in (0..3).rev() {
        log.write(CopyNumber::First, &[left; RECORD_LEN]).unwrap();
        assert_eq!(log.records_left(CopyNumber::First), Ok(left.into()));
    }
    assert_eq!(flash.erased(), [1, 0, 0]);
    log.write(CopyNumber::First, &[7; RECORD_LEN]).unwrap();
    assert_eq!((log.records_left(CopyNumber::First), flash.erased()), (Ok(2), vec![2, 0, 0]));
    flash.cut_after(0, 0);
    assert_eq!(log.records_left(CopyNumber::Second), Err(PowerCut));
}

#[test]
fn memory_that_fails_says_so_until_it_does_not() {
    let health = FlashHealth::new();
    let flash = Flash::<SMALL, 1>::new(2);
    let mut log = FlashLog::new(flash.clone(), &health);
    log.write(CopyNumber::First, &[1; RECORD_LEN]).unwrap();
    let (inputs, clock) = (InputHealth::new(), ClockHealth::new());
    let board = Health { inputs: &inputs, serialisers: None, clock: &clock, storage: &health };
    assert!(!health.is_failing() && !board.is_broken());
    flash.cut_after(0, 0);
    let mut record = [0; RECORD_LEN];
    assert_eq!(log.write(CopyNumber::First, &[2; RECORD_LEN]), Err(PowerCut));
    assert_eq!(log.read(CopyNumber::First, &mut record), Err(PowerCut));
    assert_eq!((health.is_failing(), board.is_broken(), health.failed.get()), (true, true, 2));
    flash.power_up();
    assert_eq!(log.read(CopyNumber::First, &mut record), Ok(()));
    assert_eq!((board.is_broken(), health.failed.get(), record), (false, 2, [1; RECORD_LEN]));
}

#[test]
fn writes_and_erases_are_counted() {
    let health = FlashHealth::new();
    let mut log = FlashLog::new(Flash::<SMALL, 4>::new(2), &health);
    for number in 0..4 {
        log.write(CopyNumber::Second, &[number; RECORD_LEN]).unwrap();
    }
    assert_eq!((health.writes.get(), health.erases.get()), (4, 2));
}
