//! A recorder on a bench: contacts, a virtual millisecond and both ends of the line.
#![allow(dead_code, reason = "each test uses some of it")]

use std::cell::RefCell;
use std::rc::Rc;

use chrono::NaiveDateTime;
use ser_node::{
    Capture, CaptureChannel, CopyNumber, Debounce, DebounceTimes, Diagnostics, Event, Node,
    NodeParts, RECORD_LEN, Rtc, Storage, Work,
};
use ser_proto::{
    Command, Configuration, Configure, Decoded, FrameDecoder, FrameEncoder, MAX_BODY_LEN, Model,
    ReadReply, RecorderId, Reply, TimeStamp,
};

/// Non-volatile memory and battery-backed clock that outlive the recorder.
#[derive(Clone)]
pub(crate) struct Survivors {
    pub(crate) copies: Rc<RefCell<[[u8; RECORD_LEN]; 2]>>,
    pub(crate) clock: Rc<RefCell<Option<NaiveDateTime>>>,
    /// The number of the recorder.
    pub(crate) id: Option<RecorderId>,
    /// Whether the memory refuses to be written.
    pub(crate) write_protected: Rc<RefCell<bool>>,
}

impl Default for Survivors {
    fn default() -> Survivors {
        Survivors {
            copies: Rc::new(RefCell::new([[0; RECORD_LEN]; 2])),
            clock: Rc::default(),
            id: None,
            write_protected: Rc::default(),
        }
    }
}

impl Storage for Survivors {
    type Error = ();

    fn read(&mut self, copy: CopyNumber, record: &mut [u8; RECORD_LEN]) -> Result<(), ()> {
        *record = self.copies.borrow()[copy as usize];
        Ok(())
    }

    fn write(&mut self, copy: CopyNumber, record: &[u8; RECORD_LEN]) -> Result<(), ()> {
        if *self.write_protected.borrow() {
            return Err(());
        }
        self.copies.borrow_mut()[copy as usize] = *record;
        Ok(())
    }
}

impl Rtc for Survivors {
    fn read(&mut self) -> Option<NaiveDateTime> {
        *self.clock.borrow()
    }

    fn write(&mut self, now: NaiveDateTime) {
        *self.clock.borrow_mut() = Some(now);
    }
}

/// A recorder on the bench: contacts, a virtual millisecond and both ends of the line.
pub(crate) struct Bench {
    pub(crate) node: Node<'static, Survivors, Survivors>,
    pub(crate) capture: Capture<'static>,
    pub(crate) tick_ms: u32,
    pub(crate) inputs: u32,
}

impl Bench {
    pub(crate) fn new(model: Model) -> Bench {
        Bench::with(model, Debounce::OFF, 2048, Survivors::default())
    }

    pub(crate) fn with(
        model: Model,
        debounce: Debounce,
        log_len: usize,
        survivors: Survivors,
    ) -> Bench {
        Bench::powered_up(model, debounce, log_len, survivors, 0)
    }

    /// A recorder that finds its contacts in this state at power-up.
    pub(crate) fn powered_up(
        model: Model,
        debounce: Debounce,
        log_len: usize,
        survivors: Survivors,
        inputs: u32,
    ) -> Bench {
        let channel = Box::leak(Box::new(CaptureChannel::new()));
        let (capture, reader) = channel.split(debounce);
        let node = Node::new(NodeParts {
            model,
            log: vec![Event::EMPTY; log_len].leak(),
            work: Box::leak(Box::new(Work::new())),
            capture: reader,
            id: survivors.id,
            storage: survivors.clone(),
            rtc: survivors,
        });
        let mut bench = Bench { node, capture, tick_ms: 0, inputs };
        bench.pass_ms(1);
        bench
    }

    /// Lets time pass without any contact moving.
    pub(crate) fn pass_ms(&mut self, ms: u32) {
        for _ in 0..ms {
            self.tick_ms += 1;
            self.capture.sample(self.tick_ms, self.inputs);
            self.node.poll(self.tick_ms);
            // As a board does.
            if let Some(debounce) = self.node.debounce_change()
                && self.capture.take_times(&DebounceTimes::new(&debounce))
            {
                self.node.debounce_changed(debounce);
            }
        }
    }

    /// Contacts change in the next millisecond.
    pub(crate) fn contacts(&mut self, inputs: u32) {
        self.inputs = inputs;
        self.pass_ms(1);
    }

    /// Makes that many events, one per millisecond, on input 1.
    pub(crate) fn events(&mut self, count: u32) {
        for _ in 0..count {
            self.contacts(self.inputs ^ 1);
        }
    }

    pub(crate) fn send(&mut self, bytes: impl IntoIterator<Item = u8>) {
        for byte in bytes {
            self.node.serial_receive(byte, self.tick_ms);
        }
    }

    pub(crate) fn line(&mut self) -> Vec<u8> {
        std::iter::from_fn(|| self.node.serial_transmit()).collect()
    }

    /// Sends a command and returns everything that comes back.
    pub(crate) fn ask(&mut self, command: &Command) -> Vec<Reply> {
        self.send(FrameEncoder::new(command.to_body()));
        replies(&self.line())
    }

    pub(crate) fn read(&mut self, start: u16, count: u8) -> ReadReply {
        match self.ask(&Command::Read { start, count }).as_slice() {
            [Reply::Read(reply)] => reply.clone(),
            other => panic!("not one read reply: {other:?}"),
        }
    }

    pub(crate) fn configure(&mut self, change: impl FnOnce(&mut Configuration)) -> Configuration {
        let [Reply::Configuration(mut wanted)] = self.ask(&Command::QueryConfiguration)[..] else {
            panic!("no configuration")
        };
        change(&mut wanted);
        self.configure_with(wanted.into())
    }

    pub(crate) fn configure_with(&mut self, configure: Configure) -> Configuration {
        match self.ask(&Command::Configure(configure))[..] {
            [Reply::Configuration(in_force)] => in_force,
            ref other => panic!("not one configuration: {other:?}"),
        }
    }

    pub(crate) fn diagnostics(&self) -> Diagnostics {
        self.node.diagnostics()
    }
}

/// The messages in what the recorder sent; text lines are not expected.
pub(crate) fn replies(bytes: &[u8]) -> Vec<Reply> {
    let mut decoder = FrameDecoder::<MAX_BODY_LEN>::new();
    bytes
        .iter()
        .filter_map(|&byte| match decoder.push(byte)? {
            Decoded::Frame(body) => {
                Some(Reply::parse(body).expect("a recorder sends what can be parsed"))
            }
            other => panic!("the recorder sent {other:?}"),
        })
        .collect()
}

pub(crate) fn changes(reply: &ReadReply) -> Vec<(u32, u32, String)> {
    reply
        .entries
        .iter()
        .map(|entry| (entry.changed.0, entry.state.0, entry.time.to_string()))
        .collect()
}

pub(crate) const TEN_O_CLOCK: TimeStamp =
    TimeStamp { year: 26, month: 11, day: 22, hour: 10, minute: 0, second: 0, millisecond: 0 };
