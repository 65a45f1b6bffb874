//! What the recorder knows and does, whichever port asks: log, clock, configuration, recording
//! mode, and the commands that wait to be answered.
//!
//! Commands are answered in the order in which they came. Unsolicited output (print jobs, auto
//! report, auto print) is taken from the log itself when no command is waiting.

use core::num::NonZeroU8;

use chrono::NaiveDateTime;
use ser_proto::genius::ForceTable;
use ser_proto::{
    AutoReport, Capabilities, ClockReading, ClockSource, Code, Command, Configuration, Configure,
    EXTENSION_LEVEL, Entry, Filters, FrameError, Guard, Identity, InputFilter, Inputs,
    LastBroadcast, MAX_ENTRIES, MAX_FILTERS, Mark, Mode, Model, ParseError, ReadReply, RecorderId,
    Reply, TimeStamp,
};

use crate::arrival::{Arrival, Way};
use crate::calendar::date_time;
use crate::capture::CaptureReader;
use crate::changes::Changes;
use crate::clock::{Clock, Rtc, to_time_stamp};
use crate::counters::Counts;
use crate::debounce::Debounce;
use crate::diagnostics::{Diagnostics, count};
use crate::event_log::{Event, EventLog};
use crate::genius_port::GeniusDiagnostics;
use crate::history::{Bits, History};
use crate::keeper::Keeper;
use crate::kept::FILTERS;
use crate::owed::Owed;
use crate::print_line::PrintLine;
use crate::printer::Printer;
use crate::settings::Storage;
use crate::ticks::Ticks;
use crate::version::{FIRMWARE, VERSION};
use crate::waiting::{Pending, ReadClock, Request, Waiting};
use crate::work::Work;

/// What a recorder is made of.
pub struct NodeParts<'a, S, R> {
    /// Which recorder it is.
    pub model: Model,
    /// Memory of the event log: 2048 events for the full range of sizes.
    pub log: &'a mut [Event],
    /// Memory to work in.
    pub work: &'a mut Work,
    /// The main loop's end of the capture channel.
    pub capture: CaptureReader<'a>,
    /// Where the configuration is kept.
    pub storage: S,
    /// The battery-backed clock, or [`NoRtc`](crate::NoRtc).
    pub rtc: R,
    /// The number that tells this recorder from all others, if it has one.
    pub id: Option<RecorderId>,
}

/// Everything but the ports.
pub(crate) struct Recorder<'a, S, R> {
    model: Model,
    changes: Changes<'a>,
    log: EventLog<'a>,
    clock: Clock<'a>,
    recording: History<bool, Bits>,
    keeper: Keeper<'a, S>,
    rtc: R,
    waiting: Waiting,
    printer: Printer,
    /// Events to report, whichever port reports.
    to_report: Owed,
    last_broadcast: Option<LastBroadcast>,
    last_mark: Option<Mark>,
    id: Option<RecorderId>,
    /// What the Genius port has counted, if there is one.
    genius: Option<GeniusDiagnostics>,
    /// Commands that have arrived on any port; wraps.
    commands: u32,
    diagnostics: Diagnostics,
}

impl<'a, S: Storage, R: Rtc> Recorder<'a, S, R> {
    /// Loads the configuration and reads the clock. Recording is on.
    pub(crate) fn new(parts: NodeParts<'a, S, R>) -> Recorder<'a, S, R> {
        let NodeParts { model, log, work, capture, storage, mut rtc, id } = parts;
        let Work { waiting, offsets, chatter, record } = work;
        let now_ms = Ticks::new().extend(capture.tick_ms());
        let mut keeper = Keeper::power_up(storage, record);
        let mut log = EventLog::new(log);
        log.resize(keeper.configuration().size);
        keeper.set_configuration(Configuration { size: log.size(), ..*keeper.configuration() });
        Recorder {
            model,
            changes: Changes::new(capture, model.mask(), waiting, chatter),
            log,
            clock: Clock::new(now_ms, rtc.read(), offsets),
            recording: History::of_bits(true),
            keeper,
            rtc,
            waiting: Waiting::new(),
            printer: Printer::new(),
            to_report: Owed::ALL,
            last_broadcast: None,
            last_mark: None,
            id,
            genius: None,
            commands: 0,
            diagnostics: Diagnostics::default(),
        }
    }

    pub(crate) fn model(&self) -> Model {
        self.model
    }

    pub(crate) fn configuration(&self) -> &Configuration {
        self.keeper.configuration()
    }

    /// Puts the stored filters in force, before the first change is recorded.
    pub(crate) fn begin_filtering(&mut self) {
        if self.keeper.is_new()
            && let Some(filters) = self.keeper.filters()
        {
            self.changes.set_filters(filters);
        }
    }

    /// Stores that there was this power-up. A life that has been told of must never come again, so
    /// this comes before the first reply.
    pub(crate) fn keep_power_up(&mut self) {
        if self.keeper.is_new() {
            self.keep();
        }
    }

    /// Notes what the Genius port has counted.
    pub(crate) fn note_genius(&mut self, diagnostics: GeniusDiagnostics) {
        self.genius = Some(diagnostics);
    }

    /// The tick of the latest sample.
    pub(crate) fn tick_ms(&self) -> u32 {
        self.changes.capture().tick_ms()
    }

    /// The inputs that are on now, whether or not events are recorded.
    pub(crate) fn inputs(&self) -> Inputs {
        Inputs(self.changes.capture().state())
    }

    /// The inputs that chatter: their changes are counted and not recorded.
    pub(crate) fn chattering(&self) -> Inputs {
        self.changes.chatter().chattering()
    }

    /// How many changes of an input were left out as chatter since power-up.
    pub(crate) fn suppressed(&self, input: u8) -> u32 {
        self.changes.chatter().suppressed(input)
    }

    /// Whether changes are recorded now.
    pub(crate) fn is_recording(&self) -> bool {
        self.recording.latest()
    }

    /// Events recorded since power-up, erased ones included; wraps.
    pub(crate) fn events(&self) -> u32 {
        let [a, b, c, d, ..] = self.log.next_sequence().to_le_bytes();
        u32::from_le_bytes([a, b, c, d])
    }

    /// Commands that have arrived, refused ones included; wraps.
    pub(crate) fn commands(&self) -> u32 {
        self.commands
    }

    pub(crate) fn diagnostics(&self) -> Diagnostics {
        let capture = self.changes.capture();
        Diagnostics {
            edges_lost: capture.edges_lost(),
            samples_missed: capture.samples_missed(),
            ..self.diagnostics
        }
    }

    /// Counts a frame on the RS-232 line that was given up.
    pub(crate) fn count_frame_error(&mut self, error: FrameError) {
        self.diagnostics.count_frame_error(error);
    }

    /// Counts that many more bytes that the UART lost or misread.
    pub(crate) fn count_line_errors(&mut self, bytes: u32) {
        count(&mut self.diagnostics.line_errors, bytes.into());
    }

    /// Records all changes up to the sample of `tick_ms`.
    pub(crate) fn record_until(&mut self, tick_ms: u32) -> u64 {
        let Recorder { changes, log, clock, recording, .. } = self;
        let until_ms = changes.extend(tick_ms);
        changes.take_until(until_ms, |change| {
            if recording.at_sample(change.tick_ms) {
                let time_ms = clock.stamp_ms(change.tick_ms);
                log.append(Event { time_ms, changed: change.changed, state: change.state });
            }
        });
        until_ms
    }

    /// Holds back changes after this tick: a datagram that arrived then waits to be read and may
    /// set clock or mode.
    pub(crate) fn hold_after(&mut self, arrived_ms: Option<u32>) {
        self.changes.hold_after(arrived_ms);
    }

    /// The debounce times that capture has to take over, if it does not have them.
    pub(crate) fn debounce_change(&self) -> Option<Debounce> {
        self.changes.debounce_change()
    }

    /// Capture has taken these times over.
    pub(crate) fn debounce_changed(&mut self, debounce: Debounce) {
        self.changes.debounce_changed(debounce);
    }

    /// Whether another command from this way finds room to wait for its turn.
    pub(crate) fn has_room(&self, way: Way) -> bool {
        self.waiting.has_room(way)
    }

    /// Takes a command. Earlier changes are recorded first, by the clock and mode of their time.
    /// Clock and mode are then set at once, as of the command's tick. Everything else is done when
    /// the reply has its turn.
    pub(crate) fn arrived(&mut self, arrival: &Arrival) {
        let Arrival { command, at, is_seen, way } = *arrival;
        if !is_seen && matches!(command, Ok(Command::SetMode { .. })) {
            // The setting takes effect late, which is better than never. Changes after its arrival
            // have already been recorded by the old mode.
            count(&mut self.diagnostics.settings_late, 1);
        }
        // Bad input from the line is counted as bad input whether or not there is room.
        let needs_room = command.is_ok() || way != Way::Line;
        if needs_room && !self.waiting.has_room(way) {
            count(&mut self.diagnostics.commands_overrun, 1);
            return;
        }
        self.commands = self.commands.wrapping_add(1);
        let tick_ms = self.record_until(at.tick_ms);
        let pending = match command {
            Ok(command) => Some(self.begin(&command, arrival, tick_ms)),
            Err(error) => self.refuse(error),
        };
        if way == Way::Broadcast {
            self.finish_broadcast(command.ok(), pending, tick_ms);
        } else if let Some(pending) = pending
            && !self.waiting.push(way, pending)
        {
            count(&mut self.diagnostics.commands_overrun, 1);
        }
    }

    /// Takes a bus device's question for a force table. False when there is no room for it.
    pub(crate) fn forces_asked(&mut self, device: u8, table: ForceTable) -> bool {
        self.waiting.push_forces(device, table)
    }

    /// The reply for the RS-232 line whose turn it is.
    pub(crate) fn next_line_reply(&mut self) -> Option<Reply> {
        while let Some(pending) = self.waiting.next_from_line() {
            if let Some(reply) = self.reply(pending, MAX_ENTRIES) {
                return Some(reply);
            }
        }
        None
    }

    /// The request from the bus whose turn it is, and the bus address of the device that asks.
    pub(crate) fn next_bus_request(&mut self) -> Option<(u8, Request)> {
        self.waiting.next_from_bus()
    }

    /// Forgets the requests that wait for the bus; returns how many there were.
    pub(crate) fn forget_bus_requests(&mut self) -> usize {
        self.waiting.forget_bus()
    }

    /// Carries out what is still to be done and returns the reply, with at most `max_entries`
    /// entries. `None` when the command is refused, which the protocol does by silence.
    pub(crate) fn reply(&mut self, pending: Pending, max_entries: usize) -> Option<Reply> {
        Some(match pending {
            Pending::ClockSet => Reply::ClockSet,
            Pending::Mode { recording } => Reply::Mode(Mode { recording, version: VERSION }),
            Pending::Time(read) => Reply::Time(self.clock_reading(read)),
            Pending::To(command) => match command {
                Command::Configure(configure) => self.configure(&configure),
                Command::Erase => self.erase(),
                Command::Print { start, count } => return self.print(start, count),
                Command::Read { start, count } => {
                    let count = usize::from(count);
                    self.count_refused(
                        start == 0 || start > self.log.size() || count > max_entries,
                    );
                    Reply::Read(self.read(start, count.min(max_entries)))
                }
                Command::LastBroadcast => Reply::LastBroadcast(self.last_broadcast),
                Command::QueryConfiguration
                | Command::QueryMode
                | Command::SetMode { .. }
                | Command::Time { .. }
                | Command::SetClock(_) => Reply::Configuration(*self.configuration()),
                Command::Identify => Reply::Identity(self.identity()),
                Command::QueryFilters { first } => Reply::Filters(self.filters_from(first)),
                Command::SetFilter { input, filter } => self.set_filter(input, filter),
                Command::Diagnostics { first } => Reply::Diagnostics(self.counts().page(first)),
            },
        })
    }

    /// The existing entries from `start` on: at most `count`, and never across the end of the ring.
    pub(crate) fn read(&self, start: u16, count: usize) -> ReadReply {
        let entries = (start..=self.log.len())
            .map_while(|number| self.log.entry(number))
            .take(count.min(MAX_ENTRIES))
            .map(entry)
            .collect::<heapless::Vec<_, MAX_ENTRIES>>();
        ReadReply {
            start,
            total: self.log.total(),
            next_slot: self.log.next_slot(),
            model: (!entries.is_empty()).then_some(self.model),
            entries,
        }
    }

    /// The next line of a print job.
    pub(crate) fn next_ordered_line(&mut self) -> Option<PrintLine> {
        self.printer.next_ordered(&self.log)
    }

    /// The next auto report for the RS-232 line. Nobody acknowledges it.
    pub(crate) fn next_line_report(&mut self) -> Option<Reply> {
        if self.configuration().auto_report != AutoReport::Rs232 {
            return None;
        }
        let (first, report) = self.report(MAX_ENTRIES)?;
        self.reported(first, report.entries.len());
        Some(Reply::Read(report))
    }

    /// The next line of auto print.
    pub(crate) fn next_auto_line(&mut self) -> Option<PrintLine> {
        let edges_lost = self.changes.capture().edges_lost();
        if !self.configuration().auto_print {
            self.printer.is_off(edges_lost);
            return None;
        }
        self.printer.next_auto(&self.log, edges_lost, &mut self.diagnostics.events_unprinted)
    }

    /// The oldest events that auto report still owes to its receiver, and the sequence number of
    /// the first one.
    ///
    /// They stay owed until [`reported`](Self::reported). Those that the ring has overwritten
    /// meanwhile are counted.
    pub(crate) fn report(&mut self, max_entries: usize) -> Option<(u64, ReadReply)> {
        let overwritten = self.to_report.skip_overwritten(&self.log);
        count(&mut self.diagnostics.events_unreported, overwritten);
        let first = self.to_report.first();
        let start = self.log.entry_number(first)?;
        // In a ring that has wrapped, the slots behind the newest event hold the oldest ones.
        let owed = usize::try_from(self.log.next_sequence() - first).unwrap_or(usize::MAX);
        Some((first, self.read(start, owed.min(max_entries))))
    }

    /// Marks that many events from `first` on as delivered. Has no effect when other events are
    /// owed by now.
    pub(crate) fn reported(&mut self, first: u64, entries: usize) {
        self.to_report.told(first, entries);
    }

    /// Carries a command out if the moment of its arrival matters.
    fn begin(&mut self, command: &Command, arrival: &Arrival, tick_ms: u64) -> Pending {
        match *command {
            Command::SetClock(time) => {
                self.count_late(tick_ms);
                self.set_clock(time, arrival.way, tick_ms);
                Pending::ClockSet
            }
            Command::Time { token } => {
                let us = u64::from(arrival.at.us);
                // The clock may have been set over the other port since it arrived.
                let clock_us = self.clock.at_ms(tick_ms) * 1000;
                let (source, age_s) = self.clock.source_and_age_s(tick_ms);
                Pending::Time(ReadClock {
                    token,
                    clock_us: clock_us.saturating_add_unsigned(us),
                    source,
                    age_s,
                    tick_us: tick_ms.saturating_mul(1000).saturating_add(us),
                    life: self.keeper.life(),
                    events: self.log.events(),
                })
            }
            Command::SetMode { recording } => {
                self.count_late(tick_ms);
                self.recording.set(tick_ms, recording);
                self.mode()
            }
            Command::QueryMode => self.mode(),
            other => Pending::To(other),
        }
    }

    /// Counts a body that is no command. Some of these are answered nevertheless, with the values
    /// in force.
    fn refuse(&mut self, error: ParseError) -> Option<Pending> {
        self.diagnostics.count_parse_error(error);
        match error {
            ParseError::BadValue { code, .. } => match Code::from_byte(code)? {
                Code::Configure => Some(Pending::To(Command::QueryConfiguration)),
                Code::Mode => Some(self.mode()),
                _ => None,
            },
            _ => None,
        }
    }

    /// Carries out the rest of a command that was broadcast to all recorders. Reading and printing
    /// have no effect: they are requests of one host to one recorder.
    fn finish_broadcast(
        &mut self,
        command: Option<Command>,
        pending: Option<Pending>,
        tick_ms: u64,
    ) {
        match pending {
            Some(Pending::Time(ReadClock { token, clock_us, .. })) => {
                self.last_mark = Some(Mark { token, clock_us });
            }
            Some(
                pending @ Pending::To(
                    Command::Configure(_) | Command::Erase | Command::SetFilter { .. },
                ),
            ) => {
                self.reply(pending, 0);
            }
            _ => {}
        }
        let Some(command) = command else { return };
        // The time of reception, by the clock as it is now. After a broadcast that set the clock,
        // this is the time that was set.
        let time = to_time_stamp(self.clock.now_ms(tick_ms));
        self.last_broadcast = Some(LastBroadcast {
            code: command.code().byte(),
            hour: time.hour,
            minute: time.minute,
            second: time.second,
            millisecond: time.millisecond,
        });
    }

    fn configure(&mut self, configure: &Configure) -> Reply {
        if configure.size.is_some_and(|size| size > self.log.capacity()) {
            self.count_refused(true);
            return Reply::Configuration(*self.configuration());
        }
        let before = *self.configuration();
        let configuration = configure.apply_to(&before);
        self.log.resize(configuration.size);
        if configuration.auto_report != before.auto_report {
            // Auto report begins with the next event when it is switched on or moved to the other
            // port.
            self.to_report = Owed::none(&self.log);
        }
        if configuration.auto_print != before.auto_print {
            self.printer.auto_print_changed(&self.log);
        }
        self.keeper.set_configuration(configuration);
        // Also when nothing changes: the configuration may be in force without being stored, because
        // storing failed earlier.
        self.keep();
        Reply::Configuration(configuration)
    }

    /// Stores what is in force and is not stored.
    fn keep(&mut self) {
        count(&mut self.diagnostics.storage_errors, self.keeper.keep().is_err().into());
    }

    fn identity(&self) -> Identity {
        let served = Capabilities::TIME.with(Capabilities::FILTERS).with(Capabilities::DIAGNOSTICS);
        let counts_last = self.keeper.counts_last();
        Identity {
            level: EXTENSION_LEVEL,
            model: self.model,
            firmware: FIRMWARE,
            capabilities: if counts_last {
                served.with(Capabilities::LASTING_COUNTS)
            } else {
                served
            },
            id: self.id,
            power_ups: self.keeper.power_ups(),
            life: self.keeper.life(),
            log_capacity: self.log.capacity().max(1),
            guard: Guard::None,
        }
    }

    fn clock_reading(&self, read: ReadClock) -> ClockReading {
        let ReadClock { token, clock_us, source, age_s, tick_us, life, events } = read;
        ClockReading {
            token,
            clock_us,
            source,
            age_s,
            // Nothing disciplines the clock, so nobody knows.
            doubt_us: None,
            drift_ppb: None,
            tick_us,
            life,
            next_sequence: events.saturating_add(1),
            last_mark: self.last_mark,
        }
    }

    /// The filters in force at the inputs from `first` on.
    fn filters_from(&self, first: NonZeroU8) -> Filters {
        let inputs = first.get()..=self.model.inputs();
        Filters {
            first,
            filters: inputs.take(MAX_FILTERS).map(|input| self.filter(input)).collect(),
        }
    }

    /// The filter of an input. Until a host sets one, the board decides its debounce time.
    fn filter(&self, input: u8) -> InputFilter {
        let set = usize::from(input).checked_sub(1).zip(self.keeper.filters());
        let set = set.and_then(|(index, filters)| filters.get(index).copied());
        let debounce_ms = self.changes.capture().debounce().time_ms(input);
        set.unwrap_or(InputFilter { debounce_ms, chatter: None })
    }

    /// Sets the filter of one input, or of all.
    fn set_filter(&mut self, input: Option<NonZeroU8>, filter: InputFilter) -> Reply {
        let first = input.unwrap_or(NonZeroU8::MIN);
        let is_meant = |number: u8| input.is_none_or(|input| input.get() == number);
        self.count_refused(first.get() > self.model.inputs());
        let mut filters = [InputFilter::OFF; FILTERS];
        for (number, place) in (1..=self.model.inputs()).zip(&mut filters) {
            *place = if is_meant(number) { filter } else { self.filter(number) };
        }
        self.changes.set_filters(&filters);
        self.keeper.set_filters(filters);
        self.keep();
        Reply::Filters(self.filters_from(first))
    }

    fn counts(&self) -> Counts<'_> {
        Counts {
            recorder: self.diagnostics(),
            genius: self.genius.as_ref(),
            chatter: self.changes.chatter(),
            model: self.model,
        }
    }

    fn erase(&mut self) -> Reply {
        self.log.erase();
        self.keeper.begin_life();
        self.keep();
        // Erased events are no longer owed to anybody.
        self.to_report = Owed::none(&self.log);
        self.printer.erased(&self.log);
        Reply::Erased
    }

    fn print(&mut self, start: u16, entries: u16) -> Option<Reply> {
        if !self.printer.order(start, entries) {
            count(&mut self.diagnostics.commands_overrun, 1);
            return None;
        }
        self.count_refused(start == 0 || start > self.log.size());
        Some(Reply::PrintAccepted)
    }

    fn mode(&self) -> Pending {
        Pending::Mode { recording: self.recording.latest() }
    }

    /// Counts a setting that came too late for changes after its arrival.
    fn count_late(&mut self, tick_ms: u64) {
        if self.changes.is_past(tick_ms) {
            count(&mut self.diagnostics.settings_late, 1);
        }
    }

    fn count_refused(&mut self, refused: bool) {
        count(&mut self.diagnostics.parameters_refused, u64::from(refused));
    }

    fn set_clock(&mut self, time: TimeStamp, way: Way, tick_ms: u64) {
        let source = match way {
            Way::Line => ClockSource::HostOverRs232,
            Way::Bus(_) | Way::Broadcast => ClockSource::HostOverGenius,
        };
        // The parser lets no impossible date through.
        if let Ok(time) = NaiveDateTime::try_from(time) {
            self.clock.set(tick_ms, time, source);
            // The battery-backed clock starts at the value it is given, at the moment it is given.
            // It therefore gets the time of now, not of the command's arrival.
            let now_ms = self.changes.now_ms();
            self.rtc.write(date_time(self.clock.now_ms(now_ms)).unwrap_or(time));
        }
    }
}

fn entry(event: &Event) -> Entry {
    Entry {
        changed: Inputs(event.changed),
        state: Inputs(event.state),
        time: to_time_stamp(event.time_ms),
    }
}
