//! The host's side of a GENI board: the devices on the bus, and the messages from and to them.
//!
//! [`GeniHost`] is a handle that can be cloned. Behind it, `Host` owns the driver of the board. The
//! driver never waits, so `Host` polls the board until what it waits for has happened. It sorts
//! what arrives meanwhile: messages into the inbox of their sender, log-ins into the list of
//! devices.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use geni_board::{
    Completion, Configuration, Data, Destination, Device, DeviceChange, Driver, Event, Failure,
    Identity, MAX_DEVICE_NUMBER, Options, ReceivedDatagram, SharedRam, Start, Status, TableError,
    Transmission, TransmitError, TransmitPriority, map,
};
use ser_proto::Command;
use ser_proto::genius::{
    Datagram, FUNCTION_GENIUS, FUNCTION_HORNER, ForceTable, IoForces, Message, SUBFUNCTION_SER,
    Subfunction,
};

use super::answers::Answers;
use super::inboxes::Inboxes;
use super::window::Window;
use crate::session::change::{Change, ChangeHook, Outcome, Stage};
use crate::transport::clock::{Clock, RealTime};
use crate::transport::endpoint::GeniWindow;
use crate::transport::genius_error::GeniusError;
use crate::transport::open_error::OpenError;

/// How often the window is checked, because nothing signals a change of a file.
pub(super) const PACE: Duration = Duration::from_millis(1);

/// The most events that are handled in one look at the board; the others wait for the next look.
const EVENTS_PER_LOOK: usize = 16;

/// How long a set-clock datagram itself takes: the host's board takes it over and sends it, and the
/// recorder's board raises its flag at once. Measured with the models of both boards.
const HANDOVER: Duration = Duration::from_millis(2);

/// A board's heartbeat comes five times a second. A board that runs in the time of a busy computer
/// is given longer.
const HEARTBEAT_PATIENCE: Duration = Duration::from_secs(3);

/// The least time from the heartbeat to the bus: the board starts up, or has just been configured.
const BUS_PATIENCE: Duration = Duration::from_secs(5);

/// A device on the bus is logged in within a few scans, of at most 400 ms each.
const LOG_IN_PATIENCE: Duration = Duration::from_secs(2);

/// All devices are known when none has logged in or out for this many scans.
const QUIET_SCANS: u32 = 10;

/// The driver ends every datagram before that, unless its own patience is longer.
const DATAGRAM_PATIENCE: Duration = Duration::from_secs(20);

/// A device that is logged in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BusDevice {
    /// Its bus address.
    pub number: u8,
    /// The board's device table entry for it.
    pub device: Device,
    /// Its inputs or global data.
    pub inputs: Vec<u8>,
}

/// A host on a Genius bus. Clones are the same host, and each can serve another
/// [`Unit`](crate::Unit).
#[derive(Clone)]
pub struct GeniHost {
    shared: Arc<Mutex<Host>>,
    pub(super) clock: Arc<dyn Clock>,
    /// Is told of everything that changes all recorders.
    on_change: Arc<Mutex<Option<ChangeHook>>>,
}

impl GeniHost {
    /// Opens a window and waits until the board in it is on the bus. `patience` is how long the
    /// board may stall, at least three seconds. Messages that recorders sent before the window was
    /// opened are discarded.
    ///
    /// # Errors
    /// When there is no such window, or when the board does not join the bus.
    pub fn open(window: impl Into<GeniWindow>, patience: Duration) -> Result<GeniHost, OpenError> {
        GeniHost::open_in(Arc::new(RealTime::new()), window, patience)
    }

    /// The same, but gives up when `stop` is set.
    ///
    /// # Errors
    /// As [`open`](Self::open), and [`GeniusError::Interrupted`].
    pub fn open_unless(
        window: impl Into<GeniWindow>,
        patience: Duration,
        stop: &Arc<AtomicBool>,
    ) -> Result<GeniHost, OpenError> {
        GeniHost::open_in_unless(Arc::new(RealTime::new()), window, patience, stop)
    }

    /// The same for a host that shares the clock of a simulated board and bus.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_in(
        clock: Arc<dyn Clock>,
        window: impl Into<GeniWindow>,
        patience: Duration,
    ) -> Result<GeniHost, OpenError> {
        GeniHost::open_in_unless(clock, window, patience, &Arc::default())
    }

    /// The same, until `stop` is set, for a host that shares the clock of a simulated board and
    /// bus.
    ///
    /// # Errors
    /// As [`open_unless`](Self::open_unless).
    pub fn open_in_unless(
        clock: Arc<dyn Clock>,
        window: impl Into<GeniWindow>,
        patience: Duration,
        stop: &Arc<AtomicBool>,
    ) -> Result<GeniHost, OpenError> {
        GeniHost::open_and(clock, window.into(), patience, stop, |_| Ok(()))
    }

    /// The same, but also waits until the device `node` is logged in.
    pub(crate) fn open_with_node(
        window: GeniWindow,
        patience: Duration,
        stop: &Arc<AtomicBool>,
        node: u8,
    ) -> Result<GeniHost, OpenError> {
        let find = |host: &mut Host| host.find(node).map(drop);
        GeniHost::open_and(Arc::new(RealTime::new()), window, patience, stop, find)
    }

    fn open_and(
        clock: Arc<dyn Clock>,
        place: GeniWindow,
        patience: Duration,
        stop: &Arc<AtomicBool>,
        then: impl FnOnce(&mut Host) -> Result<(), GeniusError>,
    ) -> Result<GeniHost, OpenError> {
        let patience = patience.max(HEARTBEAT_PATIENCE);
        let mut host = Host::new(Window::open(&place)?, Arc::clone(&clock), patience);
        host.stop = Some(Arc::clone(stop));
        let begun = host.begin().and_then(|()| then(&mut host));
        begun.map_err(|error| OpenError::Genius { path: place.file, error })?;
        host.stop = None;
        Ok(GeniHost { shared: Arc::new(Mutex::new(host)), clock, on_change: Arc::default() })
    }

    /// The host's own bus address.
    #[must_use]
    pub fn number(&self) -> u8 {
        self.lock().number()
    }

    /// The revision and settings of the host's board.
    #[must_use]
    pub fn identity(&self) -> Option<Identity> {
        self.lock().identity
    }

    /// How long a bus scan takes.
    #[must_use]
    pub fn scan_time(&self) -> Option<Duration> {
        self.lock().scan_time()
    }

    /// The state of board and bus as the board reports it; `None` before its first report.
    #[must_use]
    pub fn status(&self) -> Option<Status> {
        self.lock().driver.status()
    }

    /// Waits until a device is logged in, as long as that takes for a device that is there.
    /// # Errors
    /// When the device is not there, or the board fails.
    pub fn find(&self, node: u8) -> Result<Device, GeniusError> {
        self.lock().find(node)
    }

    /// All devices that are logged in, with their inputs from the same bus scan. While devices come
    /// and go, for example after a start of the bus, this waits for at most two seconds.
    ///
    /// # Errors
    /// When the board fails.
    pub fn devices(&self) -> Result<Vec<BusDevice>, GeniusError> {
        self.lock().devices()
    }

    /// Sends a command to all recorders. They carry it out, do not answer it, and remember it as
    /// the last broadcast.
    ///
    /// # Errors
    /// When the board cannot send it.
    pub fn broadcast(&self, command: &Command) -> Result<(), GeniusError> {
        // One broadcast at a time, so that the two that are told of one follow each other.
        let mut hook = self.on_change.lock().unwrap_or_else(PoisonError::into_inner);
        let mut told = hook.as_mut().zip(Change::of(command));
        if let Some((hook, change)) = &mut told {
            hook(change, Stage::Begins);
        }
        let message = ser_message(Destination::Broadcast, command);
        let sent = message.and_then(|message| self.lock().deliver(message));
        let sent = sent.map_err(|error| match error {
            GeniusError::Undelivered(error) => GeniusError::BroadcastFailed(error),
            other => other,
        });
        if let Some((hook, change)) = &mut told {
            hook(change, Stage::Ended(&broadcast_outcome(sent.as_ref().err())));
        }
        sent
    }

    /// Has every change of all recorders by a [broadcast](Self::broadcast) of this host, or of its
    /// clones, told to `hook`: before it is sent, and with what came of it. Changes of one recorder
    /// are told by [`Unit::on_change`](crate::Unit::on_change).
    pub fn on_change(&self, hook: ChangeHook) {
        *self.on_change.lock().unwrap_or_else(PoisonError::into_inner) = Some(hook);
    }

    /// Asks a device for one of its force tables.
    ///
    /// # Errors
    /// When the device is not there or does not answer.
    pub fn read_forces(&self, node: u8, table: ForceTable) -> Result<IoForces, GeniusError> {
        self.lock().read_forces(node, table)
    }

    /// How long a short datagram that is sent now takes to arrive, on average. The host's next turn
    /// is half a scan away. A busy bus takes longer, because all devices together send one datagram
    /// per scan.
    #[must_use]
    pub fn delay(&self) -> Duration {
        PACE + self.scan_time().unwrap_or_default() / 2 + HANDOVER
    }

    /// Datagrams that were not a recorder's message to this host, and messages that were dropped
    /// because nobody took them. The latter include those from before this host.
    #[must_use]
    pub fn lost(&self) -> (u64, u64) {
        self.lock().inboxes.lost()
    }

    /// Begins to send a message to a recorder.
    pub(crate) fn send(&self, node: u8, command: &Command) -> Result<(), GeniusError> {
        let mut host = self.lock();
        host.find(node)?;
        host.transmit(ser_message(Destination::Device(node), command)?)
    }

    /// Whether the datagram that was sent last is known not to have arrived.
    pub(crate) fn is_undelivered(&self) -> bool {
        matches!(self.lock().sent, Some(Err(_)))
    }

    /// The messages that a recorder has sent before now. The board keeps datagrams until they are
    /// read, so one look at it is not enough.
    pub(crate) fn take_waiting(&self, node: u8) -> Result<Vec<ReceivedDatagram>, GeniusError> {
        let mut host = self.lock();
        host.empty_receive_queue()?;
        Ok(std::iter::from_fn(|| host.inboxes.take(node)).collect())
    }

    /// Waits for messages from a recorder.
    pub(crate) fn receive(
        &self,
        node: u8,
        timeout: Duration,
    ) -> Result<Vec<ReceivedDatagram>, GeniusError> {
        let until = self.clock.now() + timeout;
        loop {
            let mut host = self.lock();
            host.look()?;
            let received: Vec<_> = std::iter::from_fn(|| host.inboxes.take(node)).collect();
            drop(host);
            if !received.is_empty() || self.clock.now() >= until {
                return Ok(received);
            }
            // The lock is not held here, so other recorders can be asked meanwhile.
            self.clock.wait(PACE);
        }
    }

    /// The time that this host goes by, from any start.
    #[must_use]
    pub fn now(&self) -> Duration {
        self.clock.now()
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, Host> {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for GeniHost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GeniHost").field("number", &self.number()).finish_non_exhaustive()
    }
}

/// A message in a datagram with acknowledgement. The reply comes as a datagram of its own. A board
/// that is told to wait for a reply does nothing else meanwhile, and would take an auto report for
/// the reply.
pub(super) fn ser_message(
    destination: Destination,
    command: &Command,
) -> Result<Transmission, GeniusError> {
    let data = Data::from_slice(&command.to_body());
    Ok(Transmission {
        destination,
        function: FUNCTION_HORNER,
        subfunction: SUBFUNCTION_SER,
        priority: TransmitPriority::Normal,
        completion: Completion::Acknowledged,
        // No command is longer than a datagram's data.
        data: data.map_err(|_| GeniusError::BoardBusy)?,
    })
}

/// What came of a broadcast, which nobody answers. A board that fails may have sent it.
fn broadcast_outcome(error: Option<&GeniusError>) -> Outcome {
    match error {
        None => Outcome::Sent,
        Some(error @ GeniusError::BroadcastFailed(_)) => Outcome::NotSent(error.to_string()),
        Some(error) => Outcome::NotAnswered(error.to_string()),
    }
}

/// A received datagram in the protocol's form.
fn bus_datagram(received: &ReceivedDatagram, own_number: u8) -> Option<Datagram> {
    let source = ser_proto::genius::BusAddress::new(received.source)?;
    let own_number = ser_proto::genius::BusAddress::new(own_number)?;
    Datagram::new(
        source,
        own_number.into(),
        received.function,
        received.subfunction,
        &received.data,
    )
    .ok()
}

const fn bit(number: u8) -> u32 {
    1 << (number & MAX_DEVICE_NUMBER)
}

/// The board, and what has come from it.
pub(super) struct Host {
    driver: Driver<Window>,
    clock: Arc<dyn Clock>,
    patience: Duration,
    /// Set when the caller no longer wants to wait; checked while the window is opened.
    stop: Option<Arc<AtomicBool>>,
    identity: Option<Identity>,
    failure: Option<Failure>,
    pub(super) inboxes: Inboxes,
    pub(super) answers: Answers,
    sent: Option<Result<(), geni_board::CommandError>>,
    replied: Option<Result<ReceivedDatagram, geni_board::CommandError>>,
    tables: Option<Vec<BusDevice>>,
    /// The devices that the driver reports as logged in, one bit for each.
    known: u32,
    /// When that changed last.
    devices_changed: Duration,
}

impl Host {
    fn new(ram: Window, clock: Arc<dyn Clock>, patience: Duration) -> Host {
        // The tables of a board that is starting up may hold anything, but then this flag has
        // another value.
        let is_set_up = ram.read(map::STATUS_OK) <= 1;
        // The board also serves other programs, one after the other, so its configuration stays
        // unchanged.
        let configuration = Configuration::new(
            ram.read_word(map::SETUP_REFERENCE),
            ram.read(map::SETUP_BROADCAST_LEN),
            ram.read(map::SETUP_DIRECTED_LEN),
            ram.read(map::SETUP_BUFFER_LEN),
        );
        let options = Options {
            start: Start::Running,
            reset_line: false,
            heartbeat_timeout_ms: u32::try_from(patience.as_millis()).unwrap_or(u32::MAX),
            ..Options::new(
                configuration.ok().filter(|_| is_set_up).unwrap_or(Configuration::DEFAULT),
            )
        };
        Host {
            driver: Driver::new(ram, options),
            known: 0,
            devices_changed: clock.now(),
            clock,
            patience,
            stop: None,
            identity: None,
            failure: None,
            inboxes: Inboxes::default(),
            answers: Answers::default(),
            sent: None,
            replied: None,
            tables: None,
        }
    }

    fn number(&self) -> u8 {
        self.identity.map_or(MAX_DEVICE_NUMBER, |identity| identity.switches.device_number)
    }

    fn scan_time(&self) -> Option<Duration> {
        self.driver.status()?.scan_ms.map(|ms| Duration::from_millis(ms.into()))
    }

    /// Waits until the board is on the bus.
    fn start(&mut self) -> Result<(), GeniusError> {
        if !self.wait(self.patience + PACE, |host| host.driver.is_ready())? {
            return Err(GeniusError::BoardSilent);
        }
        if self.wait(BUS_PATIENCE.max(self.patience), |host| host.scan_time().is_some())? {
            Ok(())
        } else {
            Err(GeniusError::OffBus)
        }
    }

    /// Starts the board for the first time. Auto reports may have come while no program ran, and
    /// the recorder's log may have been erased since, so they are neither news nor answers.
    fn begin(&mut self) -> Result<(), GeniusError> {
        self.start()?;
        self.empty_receive_queue()?;
        self.inboxes.throw_away();
        Ok(())
    }

    /// Takes everything that the board has received so far.
    fn empty_receive_queue(&mut self) -> Result<(), GeniusError> {
        self.start()?;
        self.driver.check_receive_queue();
        match self.wait(self.datagram_patience(), |host| host.driver.receive_queue_is_empty())? {
            true => Ok(()),
            false => Err(GeniusError::BoardBusy),
        }
    }

    /// The driver may need its patience once for the datagram before and once for this one, and
    /// ends both within that time.
    fn datagram_patience(&self) -> Duration {
        DATAGRAM_PATIENCE.max(self.patience.saturating_mul(2))
    }

    fn find(&mut self, node: u8) -> Result<Device, GeniusError> {
        self.start()?;
        if node == self.number() {
            return Err(GeniusError::OwnNumber { node });
        }
        let not_there = GeniusError::NotOnBus { node };
        if self.wait(LOG_IN_PATIENCE, |host| host.driver.device(node).is_ok())? {
            self.driver.device(node).map_err(|_| not_there)
        } else {
            Err(not_there)
        }
    }

    fn devices(&mut self) -> Result<Vec<BusDevice>, GeniusError> {
        self.start()?;
        let until = self.clock.now() + LOG_IN_PATIENCE;
        loop {
            let left = until.saturating_sub(self.clock.now());
            self.wait(left, Host::knows_everybody)?;
            self.tables = None;
            self.driver.request_tables();
            self.wait(self.datagram_patience(), |host| host.tables.is_some())?;
            let devices = self.tables.take().ok_or(GeniusError::BoardBusy)?;
            // A device may have logged in meanwhile, and others with it.
            if self.knows_everybody() || left.is_zero() {
                return Ok(devices);
            }
        }
    }

    fn knows_everybody(&self) -> bool {
        let quiet = self.clock.now().saturating_sub(self.devices_changed);
        self.scan_time().is_some_and(|scan| quiet >= scan * QUIET_SCANS)
    }

    fn read_forces(&mut self, node: u8, table: ForceTable) -> Result<IoForces, GeniusError> {
        self.find(node)?;
        let reply = Subfunction::ReadIoForcesReply;
        let question = Transmission {
            destination: Destination::Device(node),
            function: FUNCTION_GENIUS,
            subfunction: Subfunction::ReadIoForces.code(),
            priority: TransmitPriority::Normal,
            completion: Completion::Reply { subfunction: reply.code() },
            data: Data::from_slice(&[table.code()]).unwrap_or_default(),
        };
        self.replied = None;
        self.transmit(question)?;
        self.wait(self.datagram_patience(), |host| host.replied.is_some())?;
        let received =
            self.replied.take().ok_or(GeniusError::BoardBusy)?.map_err(GeniusError::Undelivered)?;
        let datagram = bus_datagram(&received, self.number());
        match datagram.as_ref().map(Message::parse) {
            Some(Ok(Message::ReadIoForcesReply(forces))) if forces.table == table => Ok(forces),
            _ => Err(GeniusError::OddReply { node }),
        }
    }

    /// Sends a datagram and waits until it is sent.
    pub(super) fn deliver(&mut self, transmission: Transmission) -> Result<(), GeniusError> {
        self.start()?;
        self.transmit(transmission)?;
        self.wait(self.datagram_patience(), |host| host.sent.is_some())?;
        self.sent.take().ok_or(GeniusError::BoardBusy)?.map_err(GeniusError::Undelivered)
    }

    /// Hands a datagram to the board as soon as the last one is done.
    fn transmit(&mut self, transmission: Transmission) -> Result<(), GeniusError> {
        if !self.wait(self.datagram_patience(), |host| host.driver.can_transmit())? {
            return Err(GeniusError::BoardBusy);
        }
        self.sent = None;
        self.driver.transmit(transmission).map_err(|error| match error {
            TransmitError::NoSuchDevice(node) => GeniusError::NotOnBus { node },
            _ => GeniusError::BoardBusy,
        })
    }

    /// Polls the board until `done`, or until the time is over. A failure of the board ends the
    /// wait.
    fn wait(
        &mut self,
        timeout: Duration,
        done: impl Fn(&Host) -> bool,
    ) -> Result<bool, GeniusError> {
        let until = self.clock.now() + timeout;
        loop {
            self.look()?;
            if done(self) {
                return Ok(true);
            }
            if self.clock.now() >= until {
                return Ok(false);
            }
            if self.stop.as_ref().is_some_and(|stop| stop.load(Ordering::Relaxed)) {
                return Err(GeniusError::Interrupted);
            }
            self.clock.wait(PACE);
        }
    }

    pub(super) fn look(&mut self) -> Result<(), GeniusError> {
        for _ in 0..EVENTS_PER_LOOK {
            let now_ms = self.clock.now().as_millis();
            #[expect(clippy::cast_possible_truncation, reason = "the count wraps")]
            let Some(event) = self.driver.poll(now_ms as u32) else { break };
            self.take(event);
        }
        if let Some(kind) = self.driver.ram().take_error() {
            return Err(GeniusError::Window(kind));
        }
        match self.failure.take() {
            None => Ok(()),
            Some(Failure::NoHeartbeat) => Err(GeniusError::BoardSilent),
            Some(failure) => Err(GeniusError::BoardFailed(failure)),
        }
    }

    fn take(&mut self, event: Event) {
        match event {
            Event::Ready(identity) => {
                self.identity = Some(identity);
                self.answers.forget_all();
                self.know(0);
            }
            Event::Device { number, change } => {
                self.answers.forget(number);
                let others = self.known & !bit(number);
                self.know(if change == DeviceChange::LoggedOut {
                    others
                } else {
                    others | bit(number)
                });
            }
            Event::Failed(failure) => self.failure = Some(failure),
            Event::Received(received) => self.inboxes.put(received),
            Event::Sent(result) => self.sent = Some(result),
            Event::Replied(result) => self.replied = Some(result),
            Event::TablesLocked => self.tables = self.read_tables().ok(),
            // The driver keeps these itself, or has already handled them.
            Event::Configured(_)
            | Event::StatusChanged(_)
            | Event::Request(_)
            | Event::RequestRefused(_)
            | Event::OutputsSent => {}
        }
    }

    fn know(&mut self, devices: u32) {
        self.known = devices;
        self.devices_changed = self.clock.now();
    }

    fn read_tables(&mut self) -> Result<Vec<BusDevice>, TableError> {
        let own_number = self.number();
        let numbers = (0..=MAX_DEVICE_NUMBER).filter(|&number| number != own_number);
        let present: Vec<_> =
            numbers.filter_map(|number| Some((number, self.driver.device(number).ok()?))).collect();
        if present.iter().fold(0, |devices, (number, _)| devices | bit(*number)) != self.known {
            // The driver is about to report the device.
            self.devices_changed = self.clock.now();
        }
        let tables = self.driver.tables()?;
        let mut buffer = [0; 128];
        let read = present.into_iter().filter_map(|(number, device)| {
            let len = tables.inputs(number, &mut buffer).ok()?;
            Some(BusDevice { number, device, inputs: buffer.get(..len)?.to_vec() })
        });
        Ok(read.collect())
    }
}
