//! A bus with its recorders as a machine that keeps pace with real time.

use std::os::fd::BorrowedFd;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use chrono::Local;
use ser_proto::{Baud, Command, FrameEncoder, TimeStamp};

use super::host_window::HostWindow;
use super::recorder::{Recorder, as_seen_from_afar};
use crate::contacts::player::{Played, STREAM_LEAD_MS};
use crate::contacts::scenario::Scenario;
use crate::contacts::scenario_lines::Item;
use crate::error::SimError;
use crate::genius::{Board, Bus, Handle};
use crate::machine::Machine;
use crate::machine::pace::Pace;
use crate::machine::sim_node::SimNode;

/// How soon the host's board sees what the host has written.
const PATIENCE: Duration = Duration::from_millis(1);

/// How long the bus may take to come up. After that a host can see for itself who is on the bus.
const LOG_IN_PATIENCE: Duration = Duration::from_secs(60);

/// How often the bus checks whether all recorders are logged in.
const LOOK_EVERY_MS: u32 = 50;

/// The bus while its recorders are under power. The first of them has the serial line.
pub(crate) struct BusMachine<'a> {
    pub(super) recorders: Vec<Recorder<'a>>,
    pub(super) bus: &'a mut Bus,
    pub(super) host: Handle<Board>,
    pub(super) window: &'a mut HostWindow,
    pub(super) pace: &'a mut Pace,
    pub(super) now_ms: &'a mut u64,
    /// Where the stream's scenario begins, while that scenario is not complete.
    pub(super) stream_start_ms: Option<u64>,
}

impl<'a> BusMachine<'a> {
    /// Returns when the host's board has logged in all recorders, or should have. False when it was
    /// cut short.
    pub(crate) fn come_up(&mut self, stop: &AtomicBool) -> Result<bool, SimError> {
        let cut_short = if self.built_in_nodes().count() == self.recorders.len() {
            self.run_ahead(stop)
        } else {
            self.wait_for_image(stop)?
        };
        if cut_short {
            return Ok(false);
        }
        self.keep_pace(Pace::from(Instant::now(), *self.now_ms));
        self.set_clocks();
        self.advance()?;
        Ok(true)
    }

    /// Lets time run ahead of real time, to skip the self-tests and the boards' first questions to
    /// each other. True when it was cut short.
    fn run_ahead(&mut self, stop: &AtomicBool) -> bool {
        let until = Instant::now() + LOG_IN_PATIENCE;
        while !self.all_logged_in() && Instant::now() < until {
            if stop.load(Ordering::Relaxed) {
                return true;
            }
            (0..LOOK_EVERY_MS).for_each(|_| self.pass_ms());
        }
        false
    }

    /// Waits for the image, because an emulated processor runs in real time only. True when it was
    /// cut short.
    fn wait_for_image(&mut self, stop: &AtomicBool) -> Result<bool, SimError> {
        self.keep_pace(Pace::from(Instant::now(), *self.now_ms));
        let mut log_in_by = None;
        let patience_ends = || Instant::now() + LOG_IN_PATIENCE;
        loop {
            if stop.load(Ordering::Relaxed) {
                return Ok(true);
            }
            let mut up = true;
            for recorder in &mut self.recorders {
                up &= recorder.is_up()?;
            }
            self.advance()?;
            if up
                && (self.all_logged_in()
                    || *log_in_by.get_or_insert_with(patience_ends) < Instant::now())
            {
                return Ok(false);
            }
            self.recorders.iter().for_each(Recorder::pause);
        }
    }

    fn keep_pace(&mut self, pace: Pace) {
        *self.pace = pace;
        for recorder in &mut self.recorders {
            recorder.keep_pace(pace);
        }
    }

    /// Sets the recorders' clocks, which ran ahead as well, as one would do it on their serial
    /// lines.
    fn set_clocks(&mut self) {
        let Ok(now) = TimeStamp::try_from(Local::now().naive_local()) else { return };
        let command: Vec<u8> = FrameEncoder::new(Command::SetClock(now).to_body()).collect();
        self.built_in_nodes().for_each(|node| node.receive(&command));
        self.pass_ms();
        self.built_in_nodes().for_each(|node| drop(node.take_output()));
    }

    fn built_in_nodes(&mut self) -> impl Iterator<Item = &mut SimNode<'a>> {
        self.recorders.iter_mut().filter_map(Recorder::built_in_node)
    }

    /// Cuts the power of all recorders; their boards start anew with them.
    pub(crate) fn power_off(self) {
        self.recorders.into_iter().for_each(Recorder::power_off);
    }

    fn all_logged_in(&self) -> bool {
        let host = self.bus.get(self.host);
        self.recorders.iter().all(|recorder| host.has_logged_in(recorder.number()))
    }

    fn pass_ms(&mut self) {
        *self.now_ms += 1;
        for recorder in &mut self.recorders {
            recorder.advance_to(*self.now_ms);
        }
        self.bus.advance_to(*self.now_ms * 1000);
        self.recorders.iter_mut().for_each(Recorder::bus_advanced);
    }

    /// The millisecond at which scenarios of all recorders begin together.
    fn align(&mut self) -> u64 {
        let free = self.recorders.iter_mut().map(|recorder| recorder.player_mut().free_from_ms());
        let free_from_ms = free.max().unwrap_or(0);
        for recorder in &mut self.recorders {
            recorder.player_mut().reserve_until(free_from_ms);
        }
        free_from_ms
    }

    /// Plays lines of one scenario of a stream.
    fn stream_part(&mut self, items: &[Item]) -> Option<u64> {
        let free_from_ms = self.align();
        if items.iter().any(|item| *item != Item::End) {
            let complete = items.contains(&Item::End);
            let lead_ms = if complete { 1 } else { STREAM_LEAD_MS };
            let start_ms =
                *self.stream_start_ms.get_or_insert(free_from_ms.max(*self.now_ms + lead_ms));
            for recorder in &mut self.recorders {
                recorder.player_mut().begin_stream(start_ms);
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
                    Item::NodeStep(node, _) => node == recorder.number(),
                })
                .collect();
            late_ms = late_ms.max(recorder.unit_mut().stream(&own));
        }
        late_ms
    }
}

impl Machine for BusMachine<'_> {
    fn advance(&mut self) -> Result<(), SimError> {
        for recorder in &mut self.recorders {
            recorder.look_after()?;
        }
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
        self.recorders.first().map_or(usize::MAX, |first| first.unit().room())
    }

    fn receive(&mut self, bytes: &[u8]) {
        if let Some(first) = self.recorders.first_mut() {
            first.unit_mut().receive(bytes);
        }
    }

    fn output(&mut self) -> &[u8] {
        self.recorders.first_mut().map_or(&[], |first| first.unit_mut().output())
    }

    fn taken(&mut self, count: usize) {
        if let Some(first) = self.recorders.first_mut() {
            first.unit_mut().taken(count);
        }
    }

    fn baud(&self) -> Baud {
        self.recorders.first().map_or(Baud::default(), |first| first.unit().baud())
    }

    fn play(&mut self, scenario: &Scenario) -> u64 {
        self.align();
        let starts = self.recorders.iter_mut().enumerate().map(|(index, recorder)| {
            let scenario = scenario.for_node(recorder.number(), index == 0);
            recorder.unit_mut().play(&scenario)
        });
        starts.max().unwrap_or(0)
    }

    fn stream(&mut self, items: &[Item]) -> Option<u64> {
        let scenarios = items.split_inclusive(|item| *item == Item::End);
        scenarios.fold(None, |late_ms, items| late_ms.max(self.stream_part(items)))
    }

    fn waiting_steps(&self) -> usize {
        self.recorders.iter().map(|recorder| recorder.unit().waiting_steps()).sum()
    }

    fn is_idle(&self) -> bool {
        self.recorders.iter().all(|recorder| recorder.unit().is_idle())
    }

    fn take_played(&mut self) -> Vec<Played> {
        self.recorders.iter_mut().flat_map(|recorder| recorder.unit_mut().take_played()).collect()
    }

    fn take_lateness_ms(&mut self) -> u64 {
        self.recorders
            .iter_mut()
            .map(|recorder| recorder.unit_mut().take_lateness_ms())
            .max()
            .unwrap_or(0)
    }

    fn bus_ports(&self) -> Vec<String> {
        let window = self.window.path().display();
        self.recorders
            .iter()
            .map(|recorder| format!("geni:{window}?node={}", recorder.number()))
            .collect()
    }

    fn take_complaints(&mut self) -> Vec<String> {
        let by_host = as_seen_from_afar(self.bus.get_mut(self.host).take_new_violations());
        let by_host = by_host
            .iter()
            .map(|broken| format!("the host breaks a rule of its GENI board: {broken}"));
        let mut complaints: Vec<String> = by_host.collect();
        for recorder in &mut self.recorders {
            let number = recorder.number();
            for broken in recorder.take_violations() {
                complaints.push(format!("node {number} breaks a rule of its GENI board: {broken}"));
            }
        }
        complaints
    }

    fn patience(&self) -> Duration {
        self.recorders
            .iter()
            .map(|recorder| recorder.unit().patience())
            .fold(PATIENCE, Duration::min)
    }

    fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        self.recorders.iter().flat_map(|recorder| recorder.unit().descriptors()).collect()
    }
}
