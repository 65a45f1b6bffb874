//! The simulated recorders of the demo, and a folder for everything that would be the user's.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use ser_evidence::timeline::Timeline;
use ser_files::merged;
use ser_proto::{Baud, Configure};
use ser_sim::{LineRate, Port, Scenario, SimOptions, Simulator};
use tempfile::TempDir;

use super::plant::{self, RECORDERS, Recorder};
use crate::commands::clock::{self, Set};
use crate::commands::sim;
use crate::connection::{self, ConnectionArgs};
use crate::error::{Failure, Result};
use crate::gather::{self, Gathered, SourceArgs};
use crate::keeper::StateArgs;
use crate::output::PROGRAM;
use crate::site_file;

/// Scenarios last less than a second, but an emulator on a busy computer may run slower than its
/// clock.
const PATIENCE: Duration = Duration::from_secs(60);

/// How long a scenario is laid out ahead, so that both recorders have it in time.
const LEAD: Duration = Duration::from_millis(100);

/// Both recorders under power, and the site file.
pub(super) struct Bench {
    folder: TempDir,
    simulators: [Simulator; 2],
}

impl Bench {
    /// Switches the recorders on; the first one may be an image in the emulator.
    pub(super) fn switch_on(image: Option<&Path>) -> Result<Bench> {
        let [first, second] = &RECORDERS;
        let simulators = [start(first, image)?, start(second, None)?];
        let folder = TempDir::with_prefix("ser-demo-")
            .map_err(|error| Failure::writing("a temporary folder", &error))?;
        let bench = Bench { folder, simulators };
        let site = plant::site_file(bench.ports());
        let path = bench.site();
        fs::write(&path, site).map_err(|error| Failure::writing(path.display(), &error))?;
        Ok(bench)
    }

    /// The site file.
    pub(super) fn site_text(&self) -> String {
        plant::site_file(self.ports())
    }

    fn ports(&self) -> [&str; 2] {
        let [first, second] = &self.simulators;
        [first.port(), second.port()]
    }

    fn site(&self) -> PathBuf {
        self.folder.path().join("north.toml")
    }

    fn first_look(&self) -> PathBuf {
        self.folder.path().join("first.jsonl")
    }

    fn state(&self) -> StateArgs {
        StateArgs::in_directory(self.state_folder())
    }

    fn state_folder(&self) -> PathBuf {
        self.folder.path().join("state")
    }

    /// The connection of somebody who names the site, and perhaps a recorder of it.
    fn connection(&self, recorder: Option<&Recorder>) -> Result<ConnectionArgs> {
        let named = ConnectionArgs {
            site: Some(self.site()),
            recorder: recorder.map(|recorder| recorder.name.to_owned()),
            timeout: Some(Duration::from_secs(5)),
            // What is done to the demo's recorders is nobody's business afterwards.
            state_dir: Some(self.state_folder()),
            ..ConnectionArgs::default()
        };
        site_file::choose(&named, false)
    }

    /// Brings the plant into its healthy state, and gives each recorder an empty log of its size
    /// and the rate of the line.
    pub(super) fn set_up(&self) -> Result<()> {
        self.play(Recorder::healthy)?;
        for recorder in &RECORDERS {
            let mut unit = connection::open(&self.connection(Some(recorder))?)?;
            let now = unit.configuration()?;
            unit.configure(Configure {
                size: Some(recorder.log_size),
                baud: Some(Baud::B19200),
                ..now.into()
            })?;
            unit.erase()?;
        }
        Ok(())
    }

    /// Sets the clock of a recorder, as the site file says.
    pub(super) fn set_clock(&self, recorder: &Recorder) -> Result<Set> {
        clock::set_and_remember(None, &self.state(), &self.connection(Some(recorder))?)
            .map_err(|not_set| not_set.failure)
    }

    /// Lets both recorders see their part of something that happens, at the same time.
    pub(super) fn play(&self, part: fn(&Recorder) -> Scenario) -> Result<()> {
        let at = Instant::now() + LEAD;
        for (simulator, recorder) in self.simulators.iter().zip(&RECORDERS) {
            simulator.play_at(at, part(recorder))?;
        }
        for simulator in &self.simulators {
            simulator.wait_played(PATIENCE)?;
        }
        Ok(())
    }

    /// Saves everything that is in the logs now.
    pub(super) fn take_first_look(&self) -> Result<()> {
        let gathered = self.gather(Vec::new())?;
        let path = self.first_look();
        let failure = |error| Failure::writing(path.display(), &error);
        let mut file = BufWriter::new(File::create(&path).map_err(failure)?);
        let timeline = Timeline::new(&gathered.site, &gathered.history);
        merged::write_jsonl(&mut file, &timeline, PROGRAM).map_err(failure)?;
        file.flush().map_err(failure)
    }

    /// What was saved, and what is in the logs now.
    pub(super) fn gather_all(&self) -> Result<Gathered> {
        self.gather(vec![self.first_look()])
    }

    fn gather(&self, files: Vec<PathBuf>) -> Result<Gathered> {
        gather::gather(
            &SourceArgs::live_and(files, self.state()),
            &self.connection(None)?,
            gather::EVERYTHING,
        )
    }

    /// Switches the recorders off.
    pub(super) fn switch_off(self) -> Result<()> {
        for simulator in self.simulators {
            simulator.stop()?;
        }
        Ok(())
    }
}

fn start(recorder: &Recorder, image: Option<&Path>) -> Result<Simulator> {
    let options = SimOptions {
        backend: sim::backend(image, None, LineRate::Real)?,
        ..SimOptions::new(recorder.model, Port::tcp("127.0.0.1:0"))
    };
    Ok(Simulator::start(options)?)
}
