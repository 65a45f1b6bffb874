//! The driver: takes one board from reset to traffic, and back there after a failure.
//!
//! Each file here handles one concern and is polled in turn; none of them waits.

mod arrivals;
mod board;
mod commander;
mod device_watch;
mod global_data;
mod heart;
mod locker;
mod request_server;
mod status_watch;

use crate::counters::{Counters, count};
use crate::datagram::{Completion, ReceivedDatagram, Transmission, TransmitError};
use crate::device_table::{Device, write_outputs_disabled};
use crate::elapsed::elapsed_ms;
use crate::event::{CommandError, ConfigurationOutcome, Event, Failure, Identity};
use crate::interrupts::Interrupts;
use crate::io_tables::{TableError, Tables, input_buffer, output_buffer, present_device};
use crate::map;
use crate::options::{Options, Start};
use crate::ram::SharedRam;
use crate::request_queue::{AnswerError, RequestAnswer};
use crate::setup_table::{BoardSwitches, Configuration};
use crate::status_table::Status;
use crate::timing;

use arrivals::Arrivals;
use board::Phase;
use commander::{Commander, Done};
use device_watch::DeviceWatch;
use global_data::GlobalData;
use heart::Heart;
use locker::Locker;
use request_server::RequestServer;
use status_watch::StatusWatch;

/// The tasks on a running board, in turn. A task that returns an event goes to the end of the
/// queue.
const TASKS: [Task; 6] =
    [Task::Flags, Task::Commands, Task::Requests, Task::Status, Task::Devices, Task::Tables];

#[derive(Clone, Copy, Debug)]
enum Task {
    Flags,
    Commands,
    Requests,
    Status,
    Devices,
    Tables,
}

/// Drives one GENI board through its shared RAM.
///
/// # What the host has to do
///
/// - Call [`poll`](Driver::poll) in every turn of its main loop. The board tolerates slow hosts,
///   but holds no more than 15 datagrams and 15 memory requests for them. Answers come only as fast
///   as `poll` is called.
/// - After each call, hold the reset line low if [`reset_held`](Driver::reset_held) says so, and
///   release it otherwise.
/// - Call [`interrupt`](Driver::interrupt) with the tick of each pulse of the interrupt line, if
///   the line is connected.
///
/// # When a datagram arrived
///
/// Every poll checks the board's flags, whatever command is in progress. A datagram is handed out
/// with the tick at which its flag was seen:
/// [`ReceivedDatagram::arrived_ms`](crate::ReceivedDatagram::arrived_ms). That is later than the
/// flag by no more than the time between two polls.
///
/// Some hosts need the tick to the millisecond although their main loop may be away. They connect
/// the interrupt line and enable only [`Interrupts::RECEIVE_QUEUE`]. A datagram then has the tick
/// of its pulse.
///
/// # Sequence
///
/// The driver goes through reset, 1.7 s without access, the OK flag, configuration, 1.5 s off the
/// bus, and [`Event::Ready`]. Traffic follows until [`Event::Failed`], and then the sequence starts
/// again. The pauses between futile attempts grow up to a minute.
///
/// # Heartbeat and commands
///
/// The manual wants the OK flag checked before each command. The driver clears that flag to watch
/// the heartbeat, so it checks the heartbeat instead: a board whose heartbeat is overdue gets no
/// command.
#[derive(Debug)]
pub struct Driver<R> {
    ram: R,
    options: Options,
    phase: Phase,
    /// Number of failed starts in a row.
    futile_starts: u32,
    /// The configuration that the board has confirmed.
    in_force: Configuration,
    configure_due: bool,
    heart: Heart,
    commander: Commander,
    arrivals: Arrivals,
    locker: Locker,
    requests: RequestServer,
    devices: DeviceWatch,
    status: StatusWatch,
    global: GlobalData,
    tables_wanted: bool,
    /// A datagram that was lost in the board's failure and must still be reported.
    lost: Option<Completion>,
    interrupted: bool,
    /// Whether a turn of the board must still be reported.
    outputs_sent: bool,
    flags_taken_ms: u32,
    safety_ms: u32,
    next_task: usize,
    counters: Counters,
}

impl<R: SharedRam> Driver<R> {
    /// A driver for the board that shares `ram`. Nothing is read or written before the first call
    /// of [`poll`](Driver::poll).
    pub fn new(ram: R, options: Options) -> Driver<R> {
        Driver {
            ram,
            options,
            phase: Phase::Begin,
            futile_starts: 0,
            in_force: Configuration::DEFAULT,
            configure_due: false,
            heart: Heart::new(),
            commander: Commander::new(options.patience_ms()),
            arrivals: Arrivals::new(),
            locker: Locker::new(options.patience_ms()),
            requests: RequestServer::new(),
            devices: DeviceWatch::new(),
            status: StatusWatch::new(),
            global: GlobalData::new(),
            tables_wanted: false,
            lost: None,
            interrupted: false,
            outputs_sent: false,
            flags_taken_ms: 0,
            safety_ms: 0,
            next_task: 0,
            counters: Counters::default(),
        }
    }

    /// Does a bounded amount of the work that is due, and returns at most one event.
    ///
    /// `now_ms` counts milliseconds from any start and may wrap.
    pub fn poll(&mut self, now_ms: u32) -> Option<Event> {
        if let Some(completion) = self.lost.take() {
            return Some(match completion {
                Completion::Reply { .. } => Event::Replied(Err(CommandError::BoardFailed)),
                Completion::Taken | Completion::Acknowledged => {
                    Event::Sent(Err(CommandError::BoardFailed))
                }
            });
        }
        match self.step(now_ms) {
            Ok(event) => event,
            Err(failure) => {
                self.fail(now_ms);
                Some(Event::Failed(failure))
            }
        }
    }

    /// Whether the reset line must be held low until the next call of [`poll`](Driver::poll).
    pub fn reset_held(&self) -> bool {
        match self.phase {
            Phase::Begin => {
                self.options.reset_line && matches!(self.options.start, Start::Reset { .. })
            }
            Phase::Reset { .. } => true,
            _ => false,
        }
    }

    /// Takes note of a pulse of the interrupt line at `tick_ms`, by the count of
    /// [`poll`](Driver::poll). The next poll checks the flags. If only
    /// [`Interrupts::RECEIVE_QUEUE`] is enabled, a datagram arrived at that tick. Pulses must be
    /// handed in in their order.
    pub fn interrupt(&mut self, tick_ms: u32) {
        self.interrupted = true;
        if self.options.interrupts == Interrupts::RECEIVE_QUEUE {
            self.arrivals.pulsed(tick_ms);
        }
    }

    /// The arrival of the oldest datagram that waits to be read, as far as it is known.
    pub fn oldest_arrival_ms(&self) -> Option<u32> {
        if self.is_ready() { self.arrivals.oldest() } else { None }
    }

    /// Whether datagrams are accepted and tables can be locked.
    pub fn is_ready(&self) -> bool {
        matches!(self.phase, Phase::Running)
    }

    /// The configuration that the board has confirmed last.
    pub fn configuration(&self) -> Configuration {
        self.in_force
    }

    /// Changes the configuration, now or as soon as the board is ready for it.
    /// [`Event::Configured`] and [`Event::Ready`] follow. If it is not the one in force, all
    /// devices are logged out for 1.5 s.
    pub fn configure(&mut self, configuration: Configuration) {
        self.options.configuration = configuration;
        self.configure_due = true;
    }

    /// Sends a datagram. Exactly one [`Event::Sent`] follows in any case, or one [`Event::Replied`]
    /// if a reply is wanted.
    ///
    /// # Errors
    ///
    /// When the board is not ready, when the last datagram is still in progress, or when the board
    /// would refuse this one.
    pub fn transmit(&mut self, transmission: Transmission) -> Result<(), TransmitError> {
        transmission.check()?;
        if !self.is_ready() {
            return Err(TransmitError::NotReady);
        }
        self.commander.put(transmission)
    }

    /// Whether the last datagram is done and the board is ready.
    pub fn can_transmit(&self) -> bool {
        self.is_ready() && self.commander.can_transmit()
    }

    /// Has the receive queue read until it is empty. The driver does so by itself when the board
    /// signals an arrival. This is for a host that must know that nothing is left: see
    /// [`receive_queue_is_empty`](Driver::receive_queue_is_empty).
    pub fn check_receive_queue(&mut self) {
        self.commander.read_due();
    }

    /// Whether a Read Datagram has found the queue empty that was started after the last
    /// [`check_receive_queue`](Driver::check_receive_queue) and after the board's last sign of an
    /// arrival. Everything that was in the queue then has become [`Event::Received`].
    /// [`Event::Received`].
    pub fn receive_queue_is_empty(&self) -> bool {
        self.is_ready() && self.commander.queue_is_empty()
    }

    /// Sets the global data for every bus scan, from the next scan on that allows it. They survive
    /// a failure of the board.
    ///
    /// It may be called as often as the host likes; at most one version per bus scan is sent.
    ///
    /// # Errors
    ///
    /// When the data are not exactly as long as configured.
    pub fn set_global_data(&mut self, data: &[u8]) -> Result<(), TableError> {
        let expected = self.options.configuration.broadcast_len();
        if data.len() != usize::from(expected) {
            return Err(TableError::WrongLength { expected });
        }
        self.global.set(data);
        Ok(())
    }

    /// Asks for the tables. [`Event::TablesLocked`] follows; if the board fails first, the request
    /// is forgotten.
    pub fn request_tables(&mut self) {
        self.tables_wanted = true;
    }

    /// The input and output tables, from [`Event::TablesLocked`] to the next call of
    /// [`poll`](Driver::poll). Until then the board neither takes new inputs nor sends new outputs.
    ///
    /// # Errors
    ///
    /// When they are not locked.
    pub fn tables(&mut self) -> Result<Tables<'_, R>, TableError> {
        if !self.locker.is_held() {
            return Err(TableError::NotLocked);
        }
        Ok(Tables::new(&mut self.ram, self.in_force.buffer_len(), self.in_force.directed_len()))
    }

    /// The inputs of a device with at most one byte of them. They need no lock.
    ///
    /// # Errors
    ///
    /// When the board is not ready, or the device is not logged in or has more inputs, or none.
    pub fn input_byte(&self, device_number: u8) -> Result<u8, TableError> {
        let device = self.present(device_number)?;
        if device.input_len != 1 {
            return Err(TableError::WrongLength { expected: device.input_len });
        }
        Ok(self.ram.read(input_buffer(device_number, self.in_force.buffer_len()).start))
    }

    /// Sets the outputs of a device with at most one byte of them. They need no lock.
    ///
    /// # Errors
    ///
    /// When the board is not ready, or the device is not logged in or has more outputs, or none.
    pub fn set_output_byte(&mut self, device_number: u8, outputs: u8) -> Result<(), TableError> {
        let device = self.present(device_number)?;
        if device.output_len != 1 {
            return Err(TableError::WrongLength { expected: device.output_len });
        }
        self.ram.write(output_buffer(device_number, self.in_force.buffer_len()).start, outputs);
        Ok(())
    }

    /// Enables or disables outputs to a device.
    ///
    /// # Errors
    ///
    /// When the board is not ready, or the bus address is above 31. The device need not be logged
    /// in.
    pub fn enable_outputs(&mut self, device_number: u8, enabled: bool) -> Result<(), TableError> {
        if !self.is_ready() {
            return Err(TableError::NotReady);
        }
        if device_number >= map::DEVICE_COUNT {
            return Err(TableError::NotPresent);
        }
        write_outputs_disabled(&mut self.ram, device_number, !enabled);
        Ok(())
    }

    /// The device that is logged in at this bus address.
    ///
    /// # Errors
    ///
    /// When the board is not ready or the device is not logged in.
    pub fn device(&self, device_number: u8) -> Result<Device, TableError> {
        self.present(device_number)
    }

    /// Answers [`Event::Request`].
    ///
    /// # Errors
    ///
    /// When no request waits any more, or when the request asks for another number of bytes.
    pub fn answer_request(&mut self, answer: RequestAnswer<'_>) -> Result<(), AnswerError> {
        self.requests.answer(&mut self.ram, answer)
    }

    /// The status table as last seen; `None` if it was not seen since the board was started.
    pub fn status(&self) -> Option<Status> {
        self.status.last()
    }

    /// Counters of what was lost, refused or out of order.
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// The shared RAM.
    pub fn ram(&self) -> &R {
        &self.ram
    }

    /// The shared RAM, for the owner of what is behind it.
    pub fn ram_mut(&mut self) -> &mut R {
        &mut self.ram
    }

    fn present(&self, device_number: u8) -> Result<Device, TableError> {
        if !self.is_ready() {
            return Err(TableError::NotReady);
        }
        present_device(&self.ram, device_number, self.in_force.buffer_len())
    }

    /// Takes one step with a board that is on the bus.
    fn serve(&mut self, now_ms: u32) -> Result<Option<Event>, Failure> {
        if elapsed_ms(now_ms, self.safety_ms) >= timing::SAFETY_PERIOD_MS {
            self.look_at_everything(now_ms);
        }
        let first = self.next_task;
        for step in 1..=TASKS.len() {
            self.next_task = (first + step) % TASKS.len();
            let Some(&task) = TASKS.get(self.next_task) else { continue };
            if let Some(event) = self.run(task, now_ms)? {
                return Ok(Some(event));
            }
            if !self.is_ready() {
                break;
            }
        }
        Ok(None)
    }

    fn run(&mut self, task: Task, now_ms: u32) -> Result<Option<Event>, Failure> {
        match task {
            Task::Flags => {
                Ok(core::mem::take(&mut self.outputs_sent).then_some(Event::OutputsSent))
            }
            Task::Commands => self.command(now_ms),
            Task::Requests => Ok(self.requests.poll(
                &mut self.ram,
                now_ms,
                self.options.requests,
                &mut self.counters,
            )),
            Task::Status => self.status.poll(&self.ram, self.in_force, &mut self.counters),
            Task::Devices => {
                Ok(self.devices.poll(&self.ram, self.in_force.buffer_len(), &mut self.counters))
            }
            Task::Tables => self.exchange(now_ms),
        }
    }

    /// Has everything checked from time to time without a flag, so a lost flag loses no data.
    fn look_at_everything(&mut self, now_ms: u32) {
        self.safety_ms = now_ms;
        self.commander.read_due();
        self.requests.due();
        self.status.due();
        self.devices.due();
        self.locker.due();
    }

    /// Checks the board's flags, if one of them may be set.
    fn look(&mut self, now_ms: u32) {
        let due = self.interrupted
            || Interrupts::any(&self.ram)
            || elapsed_ms(now_ms, self.flags_taken_ms) >= timing::FLAGS_PERIOD_MS;
        if !due {
            return;
        }
        self.interrupted = false;
        self.flags_taken_ms = now_ms;
        let flags = Interrupts::take(&mut self.ram);
        if flags.contains(Interrupts::REQUEST_QUEUE) {
            self.requests.due();
        }
        if flags.contains(Interrupts::STATUS) {
            self.status.due();
        }
        if flags.contains(Interrupts::DEVICE) {
            self.devices.due();
        }
        let received = flags.contains(Interrupts::RECEIVE_QUEUE);
        self.arrivals.looked(received, now_ms);
        if received {
            self.commander.read_due();
        }
        // The commander and the locker see a finished command and a granted lockout without flags.
        let outputs_sent = Interrupts::OUTPUTS_SENT;
        self.outputs_sent |=
            flags.contains(outputs_sent) && self.options.interrupts.contains(outputs_sent);
    }

    fn command(&mut self, now_ms: u32) -> Result<Option<Event>, Failure> {
        if let Some(done) =
            self.commander.poll(&self.ram, now_ms, self.in_force, &mut self.counters)?
        {
            return Ok(self.report(done, now_ms));
        }
        if self.commander.is_idle() {
            if self.configure_due {
                if self.locker.is_free() {
                    self.phase = Phase::Configuring { window_since_ms: None, futile: 0 };
                }
            } else {
                let scan_ms = self.status.scan_ms();
                self.commander.start_next(&mut self.ram, now_ms, scan_ms, &mut self.counters);
                if self.commander.is_reading() {
                    self.arrivals.read_started();
                }
            }
        }
        Ok(None)
    }

    fn report(&mut self, done: Done, now_ms: u32) -> Option<Event> {
        match done {
            Done::Read(received) => {
                // The datagram may have come after the latest look at the flags. Its flag is set by
                // now, because the command has finished.
                self.look(now_ms);
                let arrived_ms = self.arrivals.read();
                let received = ReceivedDatagram { arrived_ms, ..received? };
                let own_number = BoardSwitches::read(&self.ram).device_number;
                if received.broadcast && received.source == own_number {
                    count(&mut self.counters.own_broadcasts);
                    return None;
                }
                Some(Event::Received(received))
            }
            Done::Sent(result) => Some(Event::Sent(result)),
            Done::Replied(result) => Some(Event::Replied(result)),
            Done::QueueEmpty => {
                self.arrivals.found_empty();
                None
            }
            Done::NothingRead | Done::Configured(_) => None,
        }
    }

    fn exchange(&mut self, now_ms: u32) -> Result<Option<Event>, Failure> {
        let len = self.in_force.broadcast_len();
        if len <= 1 {
            // A single byte cannot be torn.
            self.global.write(&mut self.ram, len);
        }
        let wanted = self.tables_wanted || self.global.is_due();
        let gap_ms = self.status.scan_ms();
        if !self.locker.poll(&mut self.ram, now_ms, wanted, gap_ms, &mut self.counters)? {
            return Ok(None);
        }
        self.global.write(&mut self.ram, len);
        if self.tables_wanted {
            self.tables_wanted = false;
            return Ok(Some(Event::TablesLocked));
        }
        self.locker.end_hold(&mut self.ram, now_ms, &mut self.counters);
        Ok(None)
    }

    fn ready(&mut self, now_ms: u32) -> Event {
        self.phase = Phase::Running;
        self.futile_starts = 0;
        self.flags_taken_ms = now_ms;
        self.look_at_everything(now_ms);
        // The board may have cleared its table since.
        self.global.due();
        Event::Ready(Identity {
            revision: Status::read(&self.ram).revision,
            switches: BoardSwitches::read(&self.ram),
            configuration: self.in_force,
        })
    }

    fn configured(&mut self, outcome: ConfigurationOutcome) -> Event {
        if let ConfigurationOutcome::Refused(_) = outcome {
            count(&mut self.counters.configurations_refused);
        }
        Event::Configured(outcome)
    }

    fn fail(&mut self, now_ms: u32) {
        count(&mut self.counters.failures);
        self.lost = self.commander.abandon();
        self.arrivals = Arrivals::new();
        self.locker = Locker::new(self.options.patience_ms());
        self.requests = RequestServer::new();
        self.devices = DeviceWatch::new();
        self.status = StatusWatch::new();
        self.tables_wanted = false;
        self.configure_due = false;
        let mut pause_ms = board::pause_ms(self.futile_starts);
        if !self.options.reset_line {
            // The board may be restarting by itself and must be left alone meanwhile.
            pause_ms = pause_ms.max(timing::START_UP_MS);
        }
        self.phase = Phase::Failed { since_ms: now_ms, pause_ms };
        self.futile_starts = self.futile_starts.saturating_add(1);
    }
}
