//! Which recorders are original ones, which cannot be asked anything beyond the manual.
//!
//! An original recorder stays silent to a question that it does not know, and each silence is
//! waited for. So it is asked once who it is, and what came of it is kept in a file beside its
//! state file. It is asked again after thirty days, in case the recorder behind the port is another
//! one by then, and by `ser-cli time`, which a user runs to learn what a recorder can tell.

use std::io;
use std::path::PathBuf;

use ser_client::{RequestError, Unit};
use ser_observer::host_reading;
use ser_proto::Identity;
use serde::{Deserialize, Serialize};

use crate::connection::{self, ConnectionArgs};
use crate::error::Result;
use crate::keeper::StateArgs;
use crate::state::{StateFile, read_ours, write_anew};

/// For how long a recorder is taken for an original one without being asked.
const BELIEVED_FOR_S: i64 = 30 * 86_400;

/// The layout of the file.
const VERSION: u32 = 1;

/// What is remembered of whether a recorder is an original one.
#[derive(Debug)]
pub(crate) struct Originals {
    path: PathBuf,
    unit: String,
    /// Whether the site file says so.
    is_said: bool,
}

/// The file's content.
#[derive(Debug, Serialize, Deserialize)]
struct Content {
    version: u32,
    /// The recorder's name, for people who read the file.
    unit: String,
    /// Whether it said who it is.
    answers: bool,
    /// When it was asked, in seconds since 1970, UTC.
    asked_utc_s: i64,
}

impl Originals {
    /// For the recorder of a connection.
    pub(crate) fn of(state: &StateArgs, connection: &ConnectionArgs) -> Result<Originals> {
        let unit = connection::unit_name(connection)?;
        let (path, _) = StateFile::of_unit(&unit, state.directory())?.beside("original");
        let recorder = connection.chosen.as_deref().and_then(|chosen| chosen.recorder());
        let is_said = recorder.is_some_and(|recorder| recorder.is_original);
        Ok(Originals { path, unit: unit.name, is_said })
    }

    /// The same for a recorder that is original by the site file, or is not.
    pub(crate) fn said(self, is_said: bool) -> Originals {
        Originals { is_said, ..self }
    }

    /// Who the recorder is; `None` for an original one. One that is known to be original is not
    /// asked.
    pub(crate) fn identity(
        &self,
        unit: &mut Unit,
    ) -> std::result::Result<Option<Identity>, RequestError> {
        if self.is_known(now_s()) {
            unit.take_for_original();
            return Ok(None);
        }
        self.ask(unit)
    }

    /// The same, whatever is remembered. One that is original by the site file is not asked.
    pub(crate) fn ask(
        &self,
        unit: &mut Unit,
    ) -> std::result::Result<Option<Identity>, RequestError> {
        if self.is_said {
            unit.take_for_original();
            return Ok(None);
        }
        let identity = unit.identity()?;
        if identity.is_none() {
            // On a line that has failed meanwhile, every recorder is silent.
            unit.log_position()?;
        }
        self.remember(identity.is_some(), now_s());
        Ok(identity)
    }

    fn is_known(&self, now_s: i64) -> bool {
        let is_recent = |content: &Content| {
            (0..BELIEVED_FOR_S).contains(&now_s.saturating_sub(content.asked_utc_s))
        };
        self.load().filter(|content| !content.answers).is_some_and(|content| is_recent(&content))
    }

    fn load(&self) -> Option<Content> {
        let text = read_ours(&self.path).ok()??;
        serde_json::from_slice(&text).ok().filter(|content: &Content| content.version == VERSION)
    }

    /// That it answers needs to be known only where the contrary was. If it cannot be written, the
    /// recorder is asked again.
    fn remember(&self, answers: bool, asked_utc_s: i64) {
        let known = self.load();
        if known.as_ref().map_or(answers, |known| known.answers && answers) {
            return;
        }
        let is_free = known.is_some() || matches!(read_ours(&self.path), Ok(None));
        if is_free {
            let content =
                Content { version: VERSION, unit: self.unit.clone(), answers, asked_utc_s };
            let _ = self.write(&content);
        }
    }

    fn write(&self, content: &Content) -> io::Result<()> {
        if let Some(directory) = self.path.parent() {
            std::fs::create_dir_all(directory)?;
        }
        let text = serde_json::to_string(content)? + "\n";
        write_anew(&self.path, text.as_bytes())
    }
}

fn now_s() -> i64 {
    host_reading::now().utc.us() / 1_000_000
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn originals(folder: &tempfile::TempDir) -> Originals {
        let path = folder.path().join("new").join("port-x.original");
        Originals { path, unit: "x".to_owned(), is_said: false }
    }

    #[test]
    fn an_original_recorder_is_believed_to_be_one_for_thirty_days() {
        let folder = tempfile::tempdir().unwrap();
        let originals = originals(&folder);
        assert!(!originals.is_known(1000));
        originals.remember(false, 1000);
        for (now_s, is_known) in [
            (1000, true),
            (999, false),
            (1000 + BELIEVED_FOR_S - 1, true),
            (1000 + BELIEVED_FOR_S, false),
        ] {
            assert_eq!(originals.is_known(now_s), is_known, "{now_s}");
        }
        originals.remember(true, 2000);
        assert!(!originals.is_known(2000), "another recorder is behind that port now");
        originals.remember(false, 3000);
        assert!(originals.is_known(3000));
    }

    #[test]
    fn a_time_that_cannot_be_is_no_reason_to_believe_it() {
        let folder = tempfile::tempdir().unwrap();
        let originals = originals(&folder);
        for asked_utc_s in [i64::MIN, i64::MAX] {
            originals.remember(false, 1000);
            let content = Content { asked_utc_s, ..originals.load().unwrap() };
            originals.write(&content).unwrap();
            assert!(!originals.is_known(2000), "{asked_utc_s}");
        }
    }

    #[test]
    fn of_a_recorder_that_answers_nothing_is_written() {
        let folder = tempfile::tempdir().unwrap();
        originals(&folder).remember(true, 1000);
        assert!(!folder.path().join("new").exists());
    }

    #[test]
    fn a_file_that_is_not_ours_is_left_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let originals = originals(&folder);
        originals.remember(false, 1000);
        for content in ["a letter", "{\"version\":2}"] {
            fs::write(&originals.path, content).unwrap();
            assert!(!originals.is_known(1000));
            originals.remember(false, 1000);
            assert_eq!(fs::read_to_string(&originals.path).unwrap(), content);
        }
    }
}
