//! From `--port` to an open connection to a recorder, and from the client's errors to messages for
//! the user.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use ser_client::{
    Diagnosis, Endpoint, GeniusError, LineRate, OpenError, Options, RequestError, TransportError,
    Unit,
};
use ser_proto::{Baud, Configuration};

use crate::audit;
use crate::error::{Failure, Result, advise, inform, warn};
use crate::interrupt::Caught;
use crate::site_file::Chosen;
use crate::unit_name::UnitName;
use crate::values;

/// How to reach the recorder. Accepted before and after the subcommand.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Connection")]
pub(crate) struct ConnectionArgs {
    /// Serial port of the recorder (/dev/ttyUSB0, COM3), tcp://HOST:PORT, or geni:FILE?node=N on a
    /// Genius bus.
    ///
    /// FILE is the window that this computer shares with its GENI board. N is the recorder's bus
    /// address. For a board in this computer, FILE is a memory device, and &offset=0x… says where
    /// the window begins in it.
    #[arg(
        short,
        long,
        global = true,
        env = "SER_PORT",
        hide_env_values = true,
        value_name = "PORT"
    )]
    pub(crate) port: Vec<String>,

    /// Rate of the serial port, 9600 if not given. Over TCP: rate of the terminal server's port,
    /// for `clock set` to allow for.
    #[arg(long, global = true, value_name = "RATE", value_parser = values::baud)]
    pub(crate) baud: Option<Baud>,

    /// How long the recorder may take to answer, in addition to the time on the line: 500ms, 2s.
    #[arg(long, global = true, value_name = "TIME", value_parser = values::duration)]
    pub(crate) timeout: Option<Duration>,

    /// How often a question is repeated when no valid answer comes.
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=100))]
    pub(crate) retries: Option<u32>,

    /// The site file: names of recorders and inputs (ser-cli site --help).
    ///
    /// Tables then show names and the texts of states, and a recorder in it can be named with
    /// --recorder.
    #[arg(long, global = true, env = "SER_SITE", hide_env_values = true, value_name = "FILE")]
    pub(crate) site: Option<PathBuf>,

    /// The recorder, by its name in the site file; its port is there, too.
    #[arg(long, global = true, value_name = "NAME")]
    pub(crate) recorder: Option<String>,

    /// What the site file says of the recorder, once it has been read.
    #[arg(skip)]
    pub(crate) chosen: Option<Arc<Chosen>>,

    /// Whether the port is from the environment. A recorder that is named wins over it.
    #[arg(skip)]
    pub(crate) port_is_from_environment: bool,

    /// The folder for state, if the user wants another than the system's: what is done to the
    /// recorder is written down there.
    #[arg(skip)]
    pub(crate) state_dir: Option<PathBuf>,
}

/// The user's name for the recorder.
pub(crate) fn port_text(connection: &ConnectionArgs) -> Result<&str> {
    match ports(connection).as_slice() {
        [] => Err(connection.chosen.as_ref().map_or_else(no_port, |chosen| chosen.which())),
        [port] => Ok(port),
        [first, second, ..] => Err(Failure::usage(format!(
            "one recorder at a time: --port is given twice, as {first} and as {second}"
        ))
        .hint("leave one out; only ser-cli site new takes several")),
    }
}

/// All ports that the user names.
pub(crate) fn ports(connection: &ConnectionArgs) -> Vec<&str> {
    connection.port.iter().map(|port| port.trim()).filter(|port| !port.is_empty()).collect()
}

/// How to reach the recorder at another port in the same way.
pub(crate) fn at_port(connection: &ConnectionArgs, port: &str) -> ConnectionArgs {
    ConnectionArgs { port: vec![port.to_owned()], ..connection.clone() }
}

/// What the port is.
pub(crate) fn endpoint(connection: &ConnectionArgs) -> Result<Endpoint> {
    use ser_client::EndpointError::{GeniFile, GeniNode, GeniOffset, GeniQuery};
    port_text(connection)?.parse().map_err(|error| {
        Failure::usage(format!("--port: {error}")).hint(match error {
            GeniFile | GeniNode | GeniOffset | GeniQuery => "ser-cli genius --help has examples",
            _ => "ser-cli ports lists the serial ports of this computer",
        })
    })
}

/// The recorder's name, independent of the working directory and of the user's spelling.
pub(crate) fn unit_name(connection: &ConnectionArgs) -> Result<UnitName> {
    Ok(UnitName::of(port_text(connection)?, &endpoint(connection)?))
}

/// The recorder's name in records.
pub(crate) fn recorder_name(connection: &ConnectionArgs) -> Result<String> {
    let chosen = connection.chosen.as_deref().and_then(|chosen| chosen.recorder());
    match chosen {
        Some(recorder) => Ok(recorder.name.clone()),
        None => Ok(unit_name(connection)?.name),
    }
}

/// Opens the line to the recorder. Nothing is sent yet.
pub(crate) fn open(connection: &ConnectionArgs) -> Result<Unit> {
    let endpoint = endpoint(connection)?;
    let (baud_rate, options) = (baud(connection).bits_per_second(), options(connection));
    let mut unit = match endpoint {
        Endpoint::Geni { .. } => {
            unless_interrupted(|stop| Unit::open_unless(&endpoint, baud_rate, options, stop))?
        }
        _ => Unit::open(&endpoint, baud_rate, options).map_err(|error| open_failure(&error))?,
    };
    // A terminal server does not report its port's rate, so the user may state it.
    if let (false, Some(baud)) = (endpoint.has_baud(), connection.baud) {
        unit.set_line_rate(LineRate::BitsPerSecond(baud.bits_per_second()));
    }
    audit::of_recorder(&mut unit, audited(connection));
    Ok(unit)
}

/// The way to the recorder of a connection on a bus that is open.
#[cfg(unix)]
pub(crate) fn on_bus(host: &ser_client::GeniHost, node: u8, connection: &ConnectionArgs) -> Unit {
    let mut unit = host.unit(node, options(connection));
    audit::of_recorder(&mut unit, audited(connection));
    unit
}

/// Where what is done over this connection is written down.
fn audited(connection: &ConnectionArgs) -> audit::Place {
    let peer = port_text(connection).unwrap_or_default().to_owned();
    let recorder = recorder_name(connection).unwrap_or_else(|_| peer.clone());
    audit::Place { directory: connection.state_dir.clone(), recorder, peer }
}

/// The rate of the line; by default the one that recorders are delivered with.
fn baud(connection: &ConnectionArgs) -> Baud {
    connection.baud.unwrap_or_default()
}

/// The timeout and the number of retries that the user asks for.
pub(crate) fn options(connection: &ConnectionArgs) -> Options {
    let mut options = Options::default();
    options.timeout = connection.timeout.unwrap_or(options.timeout);
    options.retries = connection.retries.unwrap_or(options.retries);
    options
}

/// The connection to a recorder on the bus of this connection.
#[cfg(unix)]
pub(crate) fn to_node(connection: &ConnectionArgs, node: u8) -> Result<ConnectionArgs> {
    let Endpoint::Geni { window, .. } = endpoint(connection)? else {
        return Ok(connection.clone());
    };
    Ok(at_port(connection, &Endpoint::Geni { window, node: Some(node) }.to_string()))
}

/// Opens the Genius bus, whichever recorder on it is named.
#[cfg(unix)]
pub(crate) fn open_bus(connection: &ConnectionArgs) -> Result<ser_client::GeniHost> {
    let Endpoint::Geni { window, .. } = endpoint(connection)? else {
        return Err(Failure::usage(format!("{} is not a Genius bus", port_text(connection)?))
            .hint("name the window of this host's GENI board, as in --port geni:/dev/shm/host")
            .hint("no board at hand? ser-cli sim --genius /dev/shm/host --node 5"));
    };
    let patience = options(connection).timeout;
    let bus = Endpoint::Geni { window: window.clone(), node: None }.to_string();
    let host =
        unless_interrupted(|stop| ser_client::GeniHost::open_unless(window, patience, stop))?;
    let place =
        audit::Place { directory: connection.state_dir.clone(), recorder: bus.clone(), peer: bus };
    audit::of_bus(&host, place);
    Ok(host)
}

/// Opens the window to a bus. An interrupt has to wait until the bytes written there are put back,
/// because the window may turn out to be something else.
fn unless_interrupted<T>(
    open: impl FnOnce(&Arc<AtomicBool>) -> std::result::Result<T, OpenError>,
) -> Result<T> {
    let caught = Caught::for_now()?;
    let opened = open(caught.flag()).map_err(|error| open_failure(&error))?;
    // The interrupt may have come at the last moment, after opening last looked for it.
    if caught.ends_interrupted() { Err(GeniusError::Interrupted.into()) } else { Ok(opened) }
}

fn no_port() -> Failure {
    let failure = Failure::usage("which recorder? No --port is given and SER_PORT is not set");
    let failure = match &ser_client::ports()[..] {
        [only] => {
            failure.hint(format!("this computer has one serial port: try --port {}", only.path))
        }
        _ => {
            failure.hint("name a serial port, as in --port /dev/ttyUSB0; ser-cli ports lists them")
        }
    };
    failure
        .hint("name a terminal server, as in --port tcp://10.0.0.7:4000")
        .hint("no recorder at hand? ser-cli demo")
}

fn open_failure(error: &OpenError) -> Failure {
    let failure = match error {
        OpenError::NoNode { .. } => Failure::usage(error),
        _ => Failure::new(error),
    };
    if let OpenError::NoSuchPort { .. } = error {
        return failure.hint(
            "ser-cli ports lists the serial ports of this computer; is the adapter plugged in?",
        );
    }
    let failure = failure.hint(error.hint());
    match error {
        OpenError::NotSerial { .. } => failure.hint("ser-cli ports lists the serial ports"),
        OpenError::Genius { error: GeniusError::NotOnBus { .. }, path }
        | OpenError::NoNode { path } => failure.hint(format!(
            "ser-cli genius devices --port geni:{path} lists the devices that are there"
        )),
        _ => failure,
    }
}

impl From<RequestError> for Failure {
    fn from(error: RequestError) -> Failure {
        let hint =
            error.hint().unwrap_or("try again; ser-cli status shows whether the recorder works");
        let failure = Failure::new(&error).hint(hint);
        match error {
            // A recorder at another rate cannot read the question, and stays silent.
            RequestError::NoReply {
                diagnosis: Diagnosis::Silent | Diagnosis::Garbage { .. } | Diagnosis::Damaged { .. },
                ..
            } => failure.unanswered(),
            RequestError::NoReply {
                diagnosis: Diagnosis::SilentOnBus { .. } | Diagnosis::Unacknowledged { .. },
                ..
            } => failure.passing(true),
            RequestError::Transport(TransportError::Genius(error)) => {
                failure.passing(error.may_pass())
            }
            _ => failure,
        }
    }
}

/// If nothing was understood at the rate of the port, looks for the recorder at other rates.
pub(crate) fn explain_silence(failure: Failure, connection: &ConnectionArgs) -> Failure {
    if !failure.is_unanswered() {
        return failure;
    }
    if !endpoint(connection).is_ok_and(|endpoint| endpoint.has_baud()) {
        return failure.hint(
            "a recorder also stays silent when a terminal server talks to it at the wrong rate",
        );
    }
    inform("no answer: looking for the recorder at other rates …");
    // If the search itself fails, the failure that led to it is reported.
    match open(connection).ok().and_then(|mut unit| unit.find_baud().ok()) {
        Some(Some(found)) => {
            let (asked, found) = (baud(connection).bits_per_second(), found.bits_per_second());
            Failure::new(format!("no answer at {asked} baud; the recorder answers at {found}"))
                .hint(format!("add --baud {found}"))
        }
        Some(None) => failure.hint("the recorder does not answer at any other rate either"),
        None => failure,
    }
}

/// The failure of a Genius bus, with advice.
impl From<GeniusError> for Failure {
    fn from(error: GeniusError) -> Failure {
        let failure = Failure::new(error).hint(error.hint()).passing(error.may_pass());
        match error {
            GeniusError::NotOnBus { .. } => {
                failure.hint("ser-cli genius devices lists the devices that are there")
            }
            _ => failure,
        }
    }
}

/// Asks for the settings. `None` from an original recorder, which does not know the question and
/// stays silent.
///
/// A read, which every recorder answers, goes first. An absent recorder is thus recognised, and
/// waited for only once. An original one need not be asked for anything else beyond the manual.
pub(crate) fn settings(unit: &mut Unit) -> Result<Option<Configuration>> {
    unit.log_position()?;
    let settings = unless_unanswered(unit.configuration())?;
    if settings.is_none() {
        unit.take_for_original();
    }
    Ok(settings)
}

/// `None` if a recorder that is there does not answer.
pub(crate) fn unless_unanswered<T>(
    answer: std::result::Result<T, RequestError>,
) -> Result<Option<T>> {
    use Diagnosis::{Ignored, Silent, SilentOnBus};
    match answer {
        Ok(answer) => Ok(Some(answer)),
        Err(RequestError::NoReply {
            diagnosis: Silent | SilentOnBus { .. } | Ignored { .. },
            ..
        }) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// The failure of a command that needs the settings and cannot get them.
pub(crate) fn settings_unknown() -> Failure {
    Failure::new(
        "the recorder does not report its settings: original recorders (HE660SER160, HE660SER320) \
         never answer this query",
    )
}

/// How many entries the recorder's log holds: as the user says, else as the recorder says, else as
/// remembered from the last time.
pub(crate) fn log_size(
    unit: &mut Unit,
    given: Option<u16>,
    remembered: Option<u16>,
) -> Result<u16> {
    match given {
        Some(size) => Ok(size),
        None => settings(unit)?
            .map(|settings| settings.size)
            .or(remembered)
            .ok_or_else(log_size_unknown),
    }
}

/// The failure of a command that needs the size of the log and cannot get it.
pub(crate) fn log_size_unknown() -> Failure {
    settings_unknown()
        .hint("say with --log-size N how many entries its log has (2048 as delivered)")
}

/// Tells the user the recorder's new rate, where the rate of the port is ours to change.
pub(crate) fn tell_new_baud(connection: &ConnectionArgs, now: &Configuration) -> Result<()> {
    if baud(connection) != now.baud && endpoint(connection)?.has_baud() {
        let rate = now.baud.bits_per_second();
        warn(format_args!("the recorder's RS-232 port runs at {rate} baud from now on"));
        advise(format_args!("add --baud {rate} from now on"));
    }
    Ok(())
}

/// The longest single wait where an interrupt must be noticed soon.
pub(crate) const HEARTBEAT: Duration = Duration::from_millis(100);

#[cfg(test)]
mod tests {

    use super::*;

    fn opened(port: Option<&str>) -> Failure {
        let connection = ConnectionArgs {
            port: port.map(str::to_string).into_iter().collect(),
            baud: Some(Baud::B9600),
            ..ConnectionArgs::default()
        };
        open(&connection).err().expect("there is no such unit")
    }

    #[test]
    fn without_a_port_the_ways_to_name_one_are_listed() {
        for port in [None, Some(""), Some("  ")] {
            let failure = opened(port);
            let text = failure.text();
            assert!(
                failure.is_usage() && text.contains("--port") && text.contains("hint: "),
                "{text}"
            );
        }
    }

    #[test]
    fn two_ports_are_one_too_many() {
        let port = ["a", "b"].map(str::to_owned).to_vec();
        let connection = ConnectionArgs { port, ..ConnectionArgs::default() };
        let failure = open(&connection).err().expect("one at a time");
        assert!(failure.is_usage() && failure.text().contains("as a and as b"));
    }

    #[test]
    fn a_port_that_cannot_be_is_a_mistake_and_one_that_is_not_there_a_failure() {
        assert!(opened(Some("tcp://somewhere")).is_usage());
        let missing = opened(Some("/dev/no-such-port"));
        assert!(!missing.is_usage() && missing.text().contains("hint: "), "{}", missing.text());
    }
}
