//! A bus with its recorders as a machine that keeps pace with real time.

use std::os::fd::BorrowedFd;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use chrono::Local;
use ser_node::GeniusPort;
use ser_proto::{Baud, Command, FrameEncoder, TimeStamp};

use super::host_window::HostWindow;
use super::shared_board::{BoardRam, SharedBoard};
use crate::error::SimError;
use crate::genius::{Board, Bus, Handle};
use crate::machine::Machine;
use crate::pace::Pace;
use crate::player::{Played, STREAM_LEAD_MS};
use crate::scenario::Scenario;
use crate::scenario_lines::Item;
use crate::sim_node::{PoweredOff, SimNode};

/// How soon the host's board sees what the host has written.
const PATIENCE: Duration = Duration::from_millis(1);

/// By then a host may as well see for itself who is on the bus.
const LOG_IN_PATIENCE: Duration = Duration::from_secs(60);

/// How often it is looked whether all are logged in.
const LOOK_EVERY_MS: u32 = 50;

/// Where a board has whether a device is logged in: the third of eight bytes per device.
const DEVICE_TABLE: usize = 0x1E00;

/// A recorder under power, and its board.
pub(super) struct Recorder<'a> {
    number: u8,
    node: SimNode<'a>,
    port: GeniusPort<BoardRam>,
    board: SharedBoard,
    in_reset: bool,
    off: &'a mut Option<PoweredOff>,
}

impl<'a> Recorder<'a> {
    pub(super) fn new(
        number: u8,
        node: SimNode<'a>,
        port: GeniusPort<BoardRam>,
        board: SharedBoard,
        off: &'a mut Option<PoweredOff>,
    ) -> Recorder<'a> {
        Recorder { number, node, port, board, in_reset: false, off }
    }

    fn advance_to(&mut self, ms: u64) {
        self.node.advance_to(ms);
        let tick = self.node.tick_at(ms);
        if self.board.lock().take_interrupt() {
            self.port.interrupt();
        }
        self.port.poll(self.node.node_mut(), tick);
        let held = self.port.reset_held();
        if held != self.in_reset {
            self.in_reset = held;
            let mut board = self.board.lock();
            if held { board.hold_reset() } else { board.release_reset() }
        }
    }
}

/// The bus while its recorders are under power. The first of them has the serial line.
pub(crate) struct BusMachine<'a> {
    pub(super) recorders: Vec<Recorder<'a>>,
    pub(super) bus: &'a mut Bus,
    pub(super) host: Handle<Board>,
    pub(super) window: &'a mut HostWindow,
    pub(super) pace: &'a mut Pace,
    pub(super) now_ms: &'a mut u64,
    /// Where the stream's scenario begins, while that is not complete.
    pub(super) stream_start_ms: Option<u64>,
}

impl BusMachine<'_> {
    /// Lets time run ahead until the host's board has logged all recorders in, so that nobody has to wait for self-tests,
    /// and for boards that ask each other who they are. False when it was cut short.
    pub(crate) fn come_up(&mut self, stop: &AtomicBool) -> Result<bool, SimError> {
        let until = Instant::now() + LOG_IN_PATIENCE;
        while !self.all_logged_in() && Instant::now() < until {
            if stop.load(Ordering::Relaxed) {
                return Ok(false);
            }
            (0..LOOK_EVERY_MS).for_each(|_| self.pass_ms());
        }
        *self.pace = Pace::from(Instant::now(), *self.now_ms);
        self.set_clocks();
        self.advance()?;
        Ok(true)
    }

    /// What ran ahead are also the recorders' clocks: they are set, as one would do it on their serial lines.
    fn set_clocks(&mut self) {
        let Ok(now) = TimeStamp::try_from(Local::now().naive_local()) else { return };
        let command: Vec<u8> = FrameEncoder::new(Command::SetClock(now).to_body()).collect();
        for recorder in &mut self.recorders {
            recorder.node.receive(&command);
        }
        self.pass_ms();
        for recorder in &mut self.recorders {
            recorder.node.take_output();
        }
    }

    /// Cuts the power of all recorders; their boards start anew with them.
    pub(crate) fn power_off(self) {
        for recorder in self.recorders {
            let mut board = recorder.board.lock();
            board.hold_reset();
            board.release_reset();
            drop(board);
            *recorder.off = Some(recorder.node.power_off());
        }
    }

    fn all_logged_in(&self) -> bool {
        let ram = self.bus.get(self.host).ram();
        // A board that starts up has patterns there, and never a plain 1.
        self.recorders.iter().all(|recorder| ram[DEVICE_TABLE + 8 * usize::from(recorder.number) + 2] == 1)
    }

    fn pass_ms(&mut self) {
        *self.now_ms += 1;
        for recorder in &mut self.recorders {
            recorder.advance_to(*self.now_ms);
        }
        self.bus.advance_to(*self.now_ms * 1000);
    }

    /// Where scenarios of all recorders begin together.
    fn align(&mut self) -> u64 {
        let free = self.recorders.iter_mut().map(|recorder| recorder.node.player_mut().free_from_ms());
        let free_from_ms = free.max().unwrap_or(0);
        for recorder in &mut self.recorders {
            recorder.node.player_mut().reserve_until(free_from_ms);
        }
        free_from_ms
    }

    /// Plays lines of one scenario of a stream.
    fn stream_part(&mut self, items: &[Item]) -> Option<u64> {
        let free_from_ms = self.align();
        if items.iter().any(|item| *item != Item::End) {
            let complete = items.contains(&Item::End);
            let lead_ms = if complete { 1 } else { STREAM_LEAD_MS };
            let start_ms = *self.stream_start_ms.get_or_insert(free_from_ms.max(*self.now_ms + lead_ms));
            for recorder in &mut self.recorders {
                recorder.node.player_mut().begin_stream(start_ms);
            }
        }
        if items.contains(&Item::End) {
            self.stream_start_ms = None;
        }
        let mut late_ms = None;
        for (index, recorder) in self.recorders.iter_mut().enumerate() {
            let own: Vec<Item> = items
                .iter()
                .copied()
                .filter(|item| match *item {
                    Item::End => true,
                    Item::Step(_) => index == 0,
                    Item::NodeStep(node, _) => node == recorder.number,
                })
                .collect();
            late_ms = late_ms.max(recorder.node.stream(&own));
        }
        late_ms
    }
}

impl Machine for BusMachine<'_> {
    fn advance(&mut self) -> Result<(), SimError> {
        let board = self.bus.get_mut(self.host);
        self.window.read_into(board).map_err(SimError::io("read the GENI window"))?;
        let present_ms = self.pace.now_ms();
        while *self.now_ms < present_ms {
            self.pass_ms();
        }
        let board = self.bus.get_mut(self.host);
        self.window.write_from(board).map_err(SimError::io("write the GENI window"))
    }

    fn room(&self) -> usize {
        usize::MAX
    }

    fn receive(&mut self, bytes: &[u8]) {
        if let Some(first) = self.recorders.first_mut() {
            first.node.receive(bytes);
        }
    }

    fn output(&mut self) -> &[u8] {
        self.recorders.first_mut().map_or(&[], |first| first.node.output())
    }

    fn taken(&mut self, count: usize) {
        if let Some(first) = self.recorders.first_mut() {
            first.node.taken(count);
        }
    }

    fn baud(&self) -> Baud {
        self.recorders.first().map_or(Baud::default(), |first| first.node.baud())
    }

    fn play(&mut self, scenario: &Scenario) -> u64 {
        self.align();
        let starts = self
            .recorders
            .iter_mut()
            .enumerate()
            .map(|(index, recorder)| recorder.node.play(&scenario.for_node(recorder.number, index == 0)));
        starts.max().unwrap_or(0)
    }

    fn stream(&mut self, items: &[Item]) -> Option<u64> {
        let scenarios = items.split_inclusive(|item| *item == Item::End);
        scenarios.fold(None, |late_ms, items| late_ms.max(self.stream_part(items)))
    }

    fn is_idle(&self) -> bool {
        self.recorders.iter().all(|recorder| recorder.node.is_idle())
    }

    fn take_played(&mut self) -> Vec<Played> {
        self.recorders.iter_mut().flat_map(|recorder| recorder.node.take_played()).collect()
    }

    fn take_lateness_ms(&mut self) -> u64 {
        // Virtual time waits for no host, and no host for it.
        0
    }

    fn bus_ports(&self) -> Vec<String> {
        let window = self.window.path().display();
        self.recorders.iter().map(|recorder| format!("geni:{window}?node={}", recorder.number)).collect()
    }

    fn patience(&self) -> Duration {
        PATIENCE
    }

    fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        Vec::new()
    }
}
