//! The loop that serves a simulated recorder. It carries bytes between the machine and its line,
//! and moves contacts.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::contacts::player::Played;
use crate::contacts::scenario::Scenario;
use crate::contacts::source::Arrived;
use crate::error::SimError;
use crate::line::wire::Wire;
use crate::line::{Line, garble, rates_agree};
use crate::machine::Machine;
use crate::options::Notice;

/// How late contacts of the emulated board must move before the user is told. They move when this
/// computer has time.
const NOTICEABLE_MS: u64 = 3;

/// How many steps may wait for their time before the stream that brings them has to wait, too. A
/// stream may bring steps faster than time passes, and without end. At 32 steps a millisecond,
/// which is every contact, they last two seconds.
const MAX_WAITING_STEPS: usize = 65_536;

/// What the owner of a simulator wants from it.
pub(crate) enum Request {
    /// Play this, at once or from a moment on. The answer is the millisecond in which it begins.
    Play(Scenario, Option<Instant>, Sender<u64>),
    /// Switch the recorder off and on. The answer comes when the recorder answers again.
    PowerCycle(Sender<()>),
}

/// What the owner of a simulator can see.
#[derive(Default)]
pub(crate) struct Shared {
    pub(crate) stop: AtomicBool,
    status: Mutex<Status>,
    changed: Condvar,
}

/// How far the simulator is.
#[derive(Default)]
pub(crate) struct Status {
    pub(crate) ended: bool,
    /// Whether no contact is going to move.
    pub(crate) idle: bool,
    pub(crate) played: Vec<Played>,
}

impl Shared {
    pub(crate) fn status(&self) -> MutexGuard<'_, Status> {
        self.status.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn update(&self, change: impl FnOnce(&mut Status)) {
        change(&mut self.status());
        self.changed.notify_all();
    }

    /// Waits until `done` or until the time is over. Returns the status at that moment.
    pub(crate) fn wait(
        &self,
        timeout: Duration,
        done: impl Fn(&Status) -> bool,
    ) -> MutexGuard<'_, Status> {
        let waited =
            self.changed.wait_timeout_while(self.status(), timeout, |status| !done(status));
        waited.unwrap_or_else(PoisonError::into_inner).0
    }
}

/// Why serving ended.
pub(crate) enum Outcome {
    Stopped,
    PowerCycle(Sender<()>),
}

/// Everything around the machine.
pub(crate) struct Service {
    pub(crate) line: Box<dyn Line>,
    pub(crate) wire: Wire,
    pub(crate) requests: Receiver<Request>,
    pub(crate) stream: Option<Receiver<Arrived>>,
    pub(crate) notice: Option<Notice>,
    /// Whether to keep what has moved, which grows without end.
    pub(crate) keeps_played: bool,
    pub(crate) shared: Arc<Shared>,
}

impl Service {
    /// Serves until told to stop.
    pub(crate) fn serve(&mut self, machine: &mut dyn Machine) -> Result<Outcome, SimError> {
        let mut buffer = [0; 1024];
        while !self.shared.stop.load(Ordering::Relaxed) {
            machine.advance()?;
            self.take_stream(machine)?;
            if let Some(outcome) = self.answer_requests(machine) {
                return Ok(outcome);
            }
            self.report(machine);
            self.carry(machine, &mut buffer).map_err(SimError::io("use the serial line"))?;
            self.wait(machine)?;
        }
        Ok(Outcome::Stopped)
    }

    fn take_stream(&mut self, machine: &mut dyn Machine) -> Result<(), SimError> {
        while let Some(stream) = &self.stream {
            if machine.waiting_steps() >= MAX_WAITING_STEPS {
                return Ok(());
            }
            match stream.try_recv() {
                Ok(arrived) => {
                    if let Some(late_ms) = machine.stream(&arrived?) {
                        self.notify(&format!(
                            "contacts came {late_ms} ms after their time and moved late"
                        ));
                    }
                }
                Err(TryRecvError::Empty) => return Ok(()),
                Err(TryRecvError::Disconnected) => self.stream = None,
            }
        }
        Ok(())
    }

    fn notify(&self, text: &str) {
        if let Some(notice) = &self.notice {
            (notice.0)(text);
        }
    }

    fn answer_requests(&mut self, machine: &mut dyn Machine) -> Option<Outcome> {
        while let Ok(request) = self.requests.try_recv() {
            match request {
                Request::Play(scenario, at, reply) => {
                    let wait_ms = at.map_or(0, |at| machine.ms_until(at).saturating_sub(1));
                    let start_ms = machine.play(&scenario.later(wait_ms));
                    self.report(machine);
                    // The owner who asked may have gone away.
                    let _ = reply.send(start_ms);
                }
                Request::PowerCycle(reply) => return Some(Outcome::PowerCycle(reply)),
            }
        }
        None
    }

    /// Tells the owner how far the contacts are, and what is wrong.
    pub(crate) fn report(&self, machine: &mut dyn Machine) {
        machine.take_complaints().iter().for_each(|complaint| self.notify(complaint));
        let mut played = machine.take_played();
        if !self.keeps_played {
            played.clear();
        }
        let idle = machine.is_idle() && self.stream.is_none();
        let newly_idle = idle && !self.shared.status().idle;
        if newly_idle && let late_ms @ NOTICEABLE_MS.. = machine.take_lateness_ms() {
            self.notify(&format!("contacts moved up to {late_ms} ms late: this computer is busy"));
        }
        if !played.is_empty() || self.shared.status().idle != idle {
            self.shared.update(|status| {
                status.played.extend(played);
                status.idle = idle;
            });
        }
    }

    /// Carries as many bytes both ways as go without waiting.
    fn carry(&mut self, machine: &mut dyn Machine, buffer: &mut [u8]) -> io::Result<()> {
        let room = self.wire.room().min(buffer.len());
        if room > 0 {
            let received = self.line.read(&mut buffer[..room])?;
            self.line.take_notices().iter().for_each(|notice| self.notify(notice));
            let received = &mut buffer[..received];
            let host_rate = self.line.host_bits_per_second();
            if !rates_agree(host_rate, machine.baud()) {
                garble(received);
            }
            if self.line.take_host_change() {
                let stale = machine.output().len();
                machine.taken(stale);
            }
            let rate = host_rate.or_else(|| machine.paced_rate());
            self.wire.send(Instant::now(), received, rate);
        }
        self.deliver(machine);
        loop {
            let baud = machine.baud();
            let output = machine.output();
            if output.is_empty() {
                return Ok(());
            }
            let written = if rates_agree(self.line.host_bits_per_second(), baud) {
                self.line.write(output)?
            } else {
                let mut garbled = output.to_vec();
                garble(&mut garbled);
                self.line.write(&garbled)?
            };
            if written == 0 {
                return Ok(());
            }
            machine.taken(written);
        }
    }

    /// Gives the machine what has arrived, as far as it has room.
    fn deliver(&mut self, machine: &mut dyn Machine) {
        let now = Instant::now();
        for _ in 0..machine.room().min(self.wire.waiting()) {
            let Some(byte) = self.wire.receive(now) else { break };
            machine.receive(&[byte]);
        }
    }

    /// How long nothing can happen, apart from bytes that come and go.
    fn patience(&self, machine: &dyn Machine) -> Duration {
        let on_the_wire = self.wire.next_arrival_in(Instant::now());
        on_the_wire.map_or(machine.patience(), |arrival| arrival.min(machine.patience()))
    }

    /// Waits until bytes come or the time is over.
    #[cfg(unix)]
    fn wait(&self, machine: &mut dyn Machine) -> Result<(), SimError> {
        use rustix::event::{PollFd, PollFlags, Timespec, poll};

        let patience = self.patience(machine);
        let sending = !machine.output().is_empty();
        let host = self.line.descriptors();
        let board = machine.descriptors();
        // A host that sends faster than the wire takes bytes is no reason to wake up.
        let listened_to = if self.wire.room() > 0 { &host[..] } else { &[] };
        let mut waiting: Vec<PollFd<'_>> =
            listened_to.iter().chain(&board).map(|fd| PollFd::new(fd, PollFlags::IN)).collect();
        if let (true, Some(host)) = (sending, host.first()) {
            waiting.push(PollFd::new(host, PollFlags::OUT));
        }
        let timeout = Timespec::try_from(patience).unwrap_or_default();
        match poll(&mut waiting, Some(&timeout)) {
            Ok(_) | Err(rustix::io::Errno::INTR) => Ok(()),
            Err(error) => Err(SimError::io("wait for the serial line")(error.into())),
        }
    }

    /// Waits as long as the machine can be left alone, without watching the line.
    #[cfg(not(unix))]
    #[expect(clippy::unnecessary_wraps, reason = "waiting can fail elsewhere")]
    fn wait(&self, machine: &mut dyn Machine) -> Result<(), SimError> {
        std::thread::sleep(self.patience(machine).min(Duration::from_millis(1)));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use ser_proto::{AutoReport, Baud, Command, Configure, FrameEncoder, Model};

    use super::*;
    use crate::machine::native::Native;
    use crate::machine::pace::Pace;
    use crate::machine::sim_node::{Ram, SimNode, SimNodeOptions};

    /// A line whose host is the test.
    #[derive(Default)]
    struct Desk {
        to_node: Vec<u8>,
        from_node: Vec<u8>,
        bits_per_second: u32,
        /// How many bytes the host takes at once.
        takes: usize,
        host_changed: bool,
    }

    struct DeskLine(Arc<Mutex<Desk>>);

    impl Line for DeskLine {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            let mut desk = self.0.lock().unwrap();
            let count = desk.to_node.len().min(buffer.len());
            buffer[..count].copy_from_slice(&desk.to_node[..count]);
            desk.to_node.drain(..count);
            Ok(count)
        }

        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let mut desk = self.0.lock().unwrap();
            let count = desk.takes.min(bytes.len());
            desk.takes -= count;
            desk.from_node.extend(&bytes[..count]);
            Ok(count)
        }

        fn host_bits_per_second(&self) -> Option<u32> {
            Some(self.0.lock().unwrap().bits_per_second)
        }

        fn take_host_change(&mut self) -> bool {
            std::mem::take(&mut self.0.lock().unwrap().host_changed)
        }

        fn publish(&mut self) -> Result<(), SimError> {
            Ok(())
        }

        fn name(&self) -> String {
            "desk".to_owned()
        }

        #[cfg(unix)]
        fn descriptors(&self) -> Vec<std::os::fd::BorrowedFd<'_>> {
            Vec::new()
        }
    }

    fn frame(command: &Command) -> Vec<u8> {
        FrameEncoder::new(command.to_body()).collect()
    }

    /// Runs a node, and passes a function that sends bytes to it at a rate and returns what comes
    /// back at that rate.
    fn with_node(talk: impl FnOnce(&mut dyn FnMut(u32, &[u8]) -> Vec<u8>, &Mutex<Desk>)) {
        let desk = Arc::new(Mutex::new(Desk { takes: usize::MAX, ..Desk::default() }));
        let mut service = Service {
            line: Box::new(DeskLine(Arc::clone(&desk))),
            wire: Wire::without_delay(),
            requests: channel().1,
            stream: None,
            notice: None,
            keeps_played: false,
            shared: Arc::default(),
        };
        let mut ram = Ram::new();
        let node = SimNode::new(SimNodeOptions::new(Model::Ser160), &mut ram);
        let mut native = Native { node, pace: Pace::new() };
        let mut send = |bits_per_second, bytes: &[u8]| {
            {
                let mut desk = desk.lock().unwrap();
                desk.bits_per_second = bits_per_second;
                desk.to_node.extend(bytes);
            }
            service.carry(&mut native, &mut [0; 64]).unwrap();
            std::mem::take(&mut desk.lock().unwrap().from_node)
        };
        talk(&mut send, &desk);
    }

    #[test]
    fn at_another_rate_neither_side_understands_the_other() {
        with_node(|send, _| {
            let question = frame(&Command::QueryMode);
            assert!(send(9600, &question).starts_with(b"\x1B034D01"));
            assert_eq!(send(19_200, &question), []);
            assert_eq!(send(4800, &question), []);
            assert!(send(9600, &question).starts_with(b"\x1B034D01"));
        });
    }

    #[test]
    fn the_reply_to_a_change_of_rate_still_comes_at_the_old_one() {
        with_node(|send, _| {
            let configure = Command::Configure(Configure {
                size: None,
                baud: Some(Baud::B1200),
                auto_report: AutoReport::Off,
                report_address: 0,
                auto_print: false,
            });
            assert!(send(9600, &frame(&configure)).starts_with(b"\x1B0743080003"));
            assert_eq!(send(9600, &frame(&Command::QueryMode)), []);
            assert!(send(1200, &frame(&Command::QueryMode)).starts_with(b"\x1B034D01"));
        });
    }

    #[test]
    fn what_one_host_did_not_take_is_not_for_the_next() {
        with_node(|send, desk| {
            desk.lock().unwrap().takes = 3;
            assert_eq!(send(9600, &frame(&Command::QueryMode)), b"\x1B03");
            desk.lock().unwrap().takes = usize::MAX;
            desk.lock().unwrap().host_changed = true;
            assert!(send(9600, &frame(&Command::LastBroadcast)).starts_with(b"\x1B074C00"));
        });
    }
}
