//! Recorders on a Genius bus, in virtual time that keeps pace with real time, and a host in another
//! process.

mod bus_machine;
mod host_window;
mod recorder;
mod shared_board;

use ser_node::{GeniusOptions as PortOptions, GeniusPort};

use crate::error::SimError;
use crate::genius::{Board, BoardOptions, Bus, Handle};
use crate::genius_options::GeniusOptions;
use crate::machine::non_volatile::NonVolatile;
use crate::machine::pace::Pace;
use crate::machine::sim_node::{PoweredOff, Ram, SimNodeOptions};
use crate::qemu::emulator::Emulator;

use bus_machine::BusMachine;
use host_window::HostWindow;
use recorder::Recorder;
use shared_board::{BoardRam, SharedBoard};

/// A bus, its boards, and recorders that have no power.
pub(crate) struct GeniusBench {
    bus: Bus,
    host: Handle<Board>,
    window: HostWindow,
    /// The image that plays the first recorder, if the built-in node does not.
    image: Option<Emulator>,
    stations: Vec<Station>,
    pace: Pace,
    now_ms: u64,
}

/// A recorder's place on the bus.
struct Station {
    number: u8,
    board: SharedBoard,
    options: SimNodeOptions,
    /// The built-in node while it has no power; `None` for the image.
    off: Option<PoweredOff>,
}

impl GeniusBench {
    /// Connects everything. The first recorder is the image, or else the built-in node as `options`
    /// say. The others differ from it in their model, and each has memory of its own.
    pub(crate) fn new(
        options: &SimNodeOptions,
        image: Option<Emulator>,
        genius: &GeniusOptions,
    ) -> Result<GeniusBench, SimError> {
        let window = HostWindow::create(&genius.window)?;
        let mut bus = Bus::with_noise(genius.rate, genius.noise);
        let board = |number| BoardOptions::at(number).rate(genius.rate);
        let host = bus.connect(Board::powered(board(genius.host_number)));
        let mut stations = Vec::new();
        for (index, &(number, model)) in genius.nodes.iter().enumerate() {
            let mut options = SimNodeOptions { model, ..options.clone() };
            if index > 0 {
                options.non_volatile = NonVolatile::new();
            }
            let board = SharedBoard::new(Board::powered(board(number)));
            bus.connect(board.clone());
            let built_in = index > 0 || image.is_none();
            let off = built_in.then(|| PoweredOff::new(options.clone()));
            stations.push(Station { number, board, off, options });
        }
        Ok(GeniusBench { bus, host, window, image, stations, pace: Pace::new(), now_ms: 0 })
    }

    /// Memory for each recorder.
    pub(crate) fn rams(&self) -> Vec<Ram> {
        self.stations.iter().map(|_| Ram::new()).collect()
    }

    /// Switches all recorders on.
    pub(crate) fn power_up<'a>(
        &'a mut self,
        rams: &'a mut [Ram],
    ) -> Result<BusMachine<'a>, SimError> {
        let mut image = self.image.as_mut();
        let mut recorders = Vec::new();
        for (station, ram) in self.stations.iter_mut().zip(rams) {
            let board = station.board.clone();
            if let Some(off) = station.off.take() {
                let port = port(&board, &station.options);
                let node = off.power_up(ram);
                recorders.push(Recorder::new(station.number, board, node, port, &mut station.off));
            } else if let Some(emulator) = image.take() {
                emulator.switch_on()?;
                recorders.push(Recorder::with_image(station.number, board, emulator));
            }
        }
        Ok(BusMachine {
            recorders,
            bus: &mut self.bus,
            host: self.host,
            window: &mut self.window,
            pace: &mut self.pace,
            now_ms: &mut self.now_ms,
            stream_start_ms: None,
        })
    }
}

fn port(board: &SharedBoard, options: &SimNodeOptions) -> GeniusPort<BoardRam> {
    let options =
        PortOptions { start: geni_board::Start::Released, ..PortOptions::new(options.model) };
    GeniusPort::new(BoardRam(board.clone()), options)
}
