//! Whether all recorders answer, before anybody relies on it.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread;

use ser_client::{Diagnosis, RequestError};
use ser_evidence::site::Recorder;

use crate::options::Options;
use crate::ports::Ports;
use crate::trouble::Trouble;

/// A recorder that answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Met {
    /// Whether it cannot be asked anything beyond the manual.
    pub is_original: bool,
    /// How many entries its log holds.
    pub size: u16,
}

/// Meets all recorders of the site that have a port, all at once, and changes nothing. Each comes
/// with its name, in the order of the site file.
#[must_use]
pub fn meet_all(options: &Options, stop: &Arc<AtomicBool>) -> Vec<(String, Result<Met, Trouble>)> {
    let ports = Ports::default();
    let recorders = options.site.recorders.iter().filter(|recorder| recorder.port.is_some());
    thread::scope(|scope| {
        let meetings: Vec<_> = recorders
            .map(|recorder| {
                let ports = &ports;
                (recorder, scope.spawn(move || meet(recorder, ports, options, stop)))
            })
            .collect();
        let met = |(recorder, meeting): (&Recorder, thread::ScopedJoinHandle<'_, _>)| {
            let met = meeting.join().unwrap_or(Err(Trouble::Stopped));
            (recorder.name.clone(), met)
        };
        meetings.into_iter().map(met).collect()
    })
}

fn meet(
    recorder: &Recorder,
    ports: &Ports,
    options: &Options,
    stop: &Arc<AtomicBool>,
) -> Result<Met, Trouble> {
    let mut unit = ports.open(recorder, options.line, stop)?;
    unit.log_position()?;
    if recorder.is_original {
        unit.take_for_original();
    }
    let is_original = unit.identity()?.is_none();
    let said = recorder.log_size.filter(|_| recorder.is_original);
    let size = match said {
        Some(size) => size,
        None => settings(&mut unit)?
            .map(|found| found.size)
            .or(recorder.log_size)
            .ok_or(Trouble::SizeUnknown)?,
    };
    Ok(Met { is_original, size })
}

/// Asks for the settings. `None` from an original recorder, which does not know the question and
/// stays silent.
pub(crate) fn settings(
    unit: &mut ser_client::Unit,
) -> Result<Option<ser_proto::Configuration>, RequestError> {
    use Diagnosis::{Ignored, Silent, SilentOnBus};
    match unit.configuration() {
        Ok(found) => Ok(Some(found)),
        Err(RequestError::NoReply {
            diagnosis: Silent | SilentOnBus { .. } | Ignored { .. },
            ..
        }) => Ok(None),
        Err(error) => Err(error),
    }
}
