//! The arguments of the command line: those common to all subcommands, and the list of subcommands.

use std::path::PathBuf;

use clap::parser::ValueSource;
use clap::{ArgMatches, Args as _, CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::closed_stdout;
use crate::commands;
use crate::connection::{self, ConnectionArgs};
use crate::error;
use crate::gather::SourceArgs;
use crate::site_file;

const EXAMPLES: &str = "\
Examples:
  ser-cli demo                          see it work, no recorder needed
  ser-cli ports                         list the serial ports
  ser-cli -p /dev/ttyUSB0 status        is the recorder there, and recording?
  ser-cli -p /dev/ttyUSB0 read          all events as a table
  ser-cli -p tcp://10.0.0.7:4000 watch  events as they happen
  export SER_PORT=/dev/ttyUSB0          say the port once

Exit codes: 0 done, 1 the recorder did not answer or something else failed, 2 the command line \
makes no sense. \
Only data goes to standard output; everything else goes to standard error.";

/// Subcommands that talk to no recorder. They accept the options that say how to reach one, but do
/// not list them in their help.
const OFFLINE: &[&str] = &[
    "ports",
    "decode",
    "encode",
    "comm-req",
    "audit",
    "import",
    "sim",
    "demo",
    "completions",
    #[cfg(feature = "archive")]
    "events",
    #[cfg(feature = "archive")]
    "incident",
    #[cfg(feature = "archive")]
    "archive",
];

/// Some of these options mean something to a few of them as well: the command, the option, its
/// help.
const MEANT: &[(&str, &str, &str)] = &[
    ("import", "recorder", "The recorder's name in the records; the name of the file if not given"),
    (
        "import",
        "site",
        "The site file: its points may be named in a --map, and its recorders that are read get no list",
    ),
    ("audit", "recorder", "Only what was done to this recorder, by its name or its port"),
    (
        "audit",
        "site",
        "The site file: its time zone is used, and its recorders are known by their ports",
    ),
    #[cfg(feature = "archive")]
    ("events", "recorder", "Only the events of this recorder"),
    #[cfg(feature = "archive")]
    ("events", "site", SITE_OF_ARCHIVE),
    #[cfg(feature = "archive")]
    ("incident", "site", SITE_OF_ARCHIVE),
];

#[cfg(feature = "archive")]
const SITE_OF_ARCHIVE: &str =
    "The site file: names of recorders and inputs; that in the archive if not given";

/// Reads, configures, watches and simulates sequential event recorders (HE660SER160, HE660SER320).
#[derive(Debug, Parser)]
#[command(name = "ser-cli", bin_name = "ser-cli", version, after_help = EXAMPLES, max_term_width = 110)]
pub(crate) struct Cli {
    #[command(flatten)]
    pub(crate) connection: ConnectionArgs,

    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Ports(commands::ports::Args),
    Status(commands::status::Args),
    Config(commands::config::Args),
    Filter(commands::filter::Args),
    Diagnostics(commands::diagnostics::Args),
    Clock(commands::clock::Args),
    Time(commands::time::Args),
    Start(commands::recording::StartArgs),
    Stop(commands::recording::StopArgs),
    Erase(commands::erase::Args),
    LastBroadcast(commands::last_broadcast::Args),
    Audit(commands::audit::Args),
    Read(commands::read::Args),
    Print(commands::print::Args),
    Watch(commands::watch::Args),
    #[cfg(feature = "archive")]
    Collect(commands::collect::Args),
    #[cfg(unix)]
    Genius(commands::genius::Args),
    Decode(commands::decode::Args),
    Encode(commands::encode::Args),
    CommReq(commands::comm_req::Args),
    Site(commands::site::Args),
    Report(commands::report::Args),
    Merge(commands::merge::Args),
    Export(commands::export::Args),
    Import(commands::import::Args),
    Sim(commands::sim::Args),
    Demo(commands::demo::Args),
    #[cfg(feature = "archive")]
    Events(commands::events::Args),
    #[cfg(feature = "archive")]
    Incident(commands::incident::Args),
    #[cfg(feature = "archive")]
    Archive(commands::archive::Args),
    Completions(commands::completions::Args),
}

impl Command {
    /// Whether the command only prints.
    fn is_for_its_output(&self) -> bool {
        use Command::{
            Audit, CommReq, Completions, Decode, Encode, Merge, Print, Read, Time, Watch,
        };
        match self {
            Read(_) | Print(_) | Watch(_) | Merge(_) | Time(_) | Audit(_) => true,
            Decode(_) | Encode(_) | CommReq(_) | Completions(_) => true,
            #[cfg(feature = "archive")]
            Command::Events(_) => true,
            Command::Export(args) => args.prints(),
            Command::Import(args) => args.prints(),
            Command::Report(args) => args.prints(),
            #[cfg(unix)]
            Command::Genius(args) => args.is_offline(),
            // Their exit code alone is informative: is the recorder there?
            _ => false,
        }
    }
}

impl Command {
    /// Whether the command talks to recorders that the site file may name.
    fn reaches_a_recorder(&self) -> bool {
        use Command::{
            Audit, CommReq, Completions, Decode, Demo, Encode, Import, Ports, Sim, Site,
        };
        match self {
            Ports(_) | Decode(_) | Encode(_) | CommReq(_) | Sim(_) | Demo(_) => false,
            Completions(_) | Site(_) | Import(_) | Audit(_) => false,
            #[cfg(feature = "archive")]
            Command::Events(_) | Command::Incident(_) | Command::Archive(_) => false,
            Command::Report(args) => !args.is_of_signatures(),
            #[cfg(unix)]
            Command::Genius(args) => !args.is_offline(),
            _ => true,
        }
    }

    /// Where entries come from, if the command takes files of them.
    const fn sources(&self) -> Option<&SourceArgs> {
        match self {
            Command::Report(args) if args.is_of_signatures() => None,
            Command::Report(args) => Some(args.sources()),
            Command::Merge(args) => Some(args.sources()),
            Command::Export(args) => Some(args.sources()),
            _ => None,
        }
    }

    /// Whether the command is for all recorders of a bus.
    fn reaches_a_bus(&self) -> bool {
        #[cfg(unix)]
        if let Command::Genius(_) = self {
            return true;
        }
        false
    }
}

impl Cli {
    /// The definition of all arguments.
    pub(crate) fn definition() -> clap::Command {
        let connection = ConnectionArgs::augment_args(clap::Command::new("connection"));
        let whole = Cli::command();
        // How to reach a recorder is of no use where a signature is looked at.
        #[cfg(feature = "sign")]
        let whole = whole.mut_subcommand("report", |report| {
            let hidden = || connection.get_arguments().map(|arg| arg.clone().hide(true));
            ["verify", "key"].into_iter().fold(report, |report, name| {
                report.mut_subcommand(name, |subcommand| subcommand.args(hidden()))
            })
        });
        OFFLINE.iter().fold(whole, |definition, name| {
            definition.mut_subcommand(name, |subcommand| {
                subcommand.args(connection.get_arguments().map(|arg| {
                    let meant =
                        |(of, id, _): &&(&str, &str, &str)| of == name && arg.get_id() == id;
                    match MEANT.iter().find(meant) {
                        Some((.., help)) => arg.clone().help(*help).long_help(*help),
                        None => arg.clone().hide(true),
                    }
                }))
            })
        })
    }

    /// Reads the command line. A request for help is returned as an error, too.
    pub(crate) fn from_command_line() -> Result<Cli, clap::Error> {
        Cli::try_from_words(std::env::args_os())
    }

    fn try_from_words<W>(words: impl IntoIterator<Item = W>) -> Result<Cli, clap::Error>
    where
        W: Into<std::ffi::OsString> + Clone,
    {
        let mut definition = Cli::definition();
        let matches = definition.try_get_matches_from_mut(words)?;
        let cli = Cli::from_arg_matches(&matches);
        let mut cli = cli.map_err(|error| error.format(&mut definition))?;
        cli.connection.port_is_from_environment =
            matches.value_source("port") == Some(ValueSource::EnvVariable);
        cli.connection.state_dir = state_dir(&matches);
        Ok(cli)
    }

    /// Does what the command line asks for.
    pub(crate) fn run(&self) -> error::Result<()> {
        if let Some(sources) = self.command.sources() {
            sources.fit(&self.connection)?;
        }
        let connection = match self.command.reaches_a_recorder() {
            true => &site_file::choose(&self.connection, self.command.reaches_a_bus())?,
            false => &self.connection,
        };
        self.run_command(connection).map_err(|failure| match self.command {
            // The demo's recorder is not the one behind `--port`.
            Command::Demo(_) => failure,
            _ => connection::explain_silence(failure, connection),
        })
    }

    fn run_command(&self, connection: &ConnectionArgs) -> error::Result<()> {
        if self.command.is_for_its_output() {
            closed_stdout::check()?;
        }
        match &self.command {
            Command::Ports(args) => commands::ports::run(args),
            Command::Status(args) => commands::status::run(args, connection),
            Command::Config(args) => commands::config::run(args, connection),
            Command::Filter(args) => commands::filter::run(args, connection),
            Command::Diagnostics(args) => commands::diagnostics::run(args, connection),
            Command::Clock(args) => commands::clock::run(args, connection),
            Command::Time(args) => commands::time::run(args, connection),
            Command::Start(args) => commands::recording::start(args, connection),
            Command::Stop(args) => commands::recording::stop(args, connection),
            Command::Erase(args) => commands::erase::run(args, connection),
            Command::LastBroadcast(args) => commands::last_broadcast::run(args, connection),
            Command::Audit(args) => commands::audit::run(args, connection),
            Command::Read(args) => commands::read::run(args, connection),
            Command::Print(args) => commands::print::run(args, connection),
            Command::Watch(args) => commands::watch::run(args, connection),
            #[cfg(feature = "archive")]
            Command::Collect(args) => commands::collect::run(args, connection),
            #[cfg(unix)]
            Command::Genius(args) => commands::genius::run(args, connection),
            Command::Decode(args) => commands::decode::run(args),
            Command::Encode(args) => commands::encode::run(args),
            Command::CommReq(args) => commands::comm_req::run(args),
            Command::Site(args) => commands::site::run(args, connection),
            Command::Report(args) => commands::report::run(args, connection),
            Command::Merge(args) => commands::merge::run(args, connection),
            Command::Export(args) => commands::export::run(args, connection),
            Command::Import(args) => commands::import::run(args, connection),
            Command::Sim(args) => commands::sim::run(args),
            Command::Demo(args) => commands::demo::run(args),
            #[cfg(feature = "archive")]
            Command::Events(args) => commands::events::run(args, connection),
            #[cfg(feature = "archive")]
            Command::Incident(args) => commands::incident::run(args, connection),
            #[cfg(feature = "archive")]
            Command::Archive(args) => commands::archive::run(args),
            Command::Completions(args) => commands::completions::run(args, &mut Cli::definition()),
        }
    }
}

/// What `--state-dir` or its variable says, whichever subcommand has it. One that has not, because
/// it changes nothing, is given that of the variable, so that nothing is ever kept elsewhere.
fn state_dir(matches: &ArgMatches) -> Option<PathBuf> {
    let mut deeper = Some(matches);
    while let Some(matches) = deeper {
        if let Ok(Some(given)) = matches.try_get_one::<PathBuf>("state_dir") {
            return Some(given.clone());
        }
        deeper = matches.subcommand().map(|(_, matches)| matches);
    }
    std::env::var_os("SER_STATE_DIR").filter(|given| !given.is_empty()).map(PathBuf::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_of_the_arguments_is_sound() {
        Cli::definition().debug_assert();
    }

    #[test]
    fn the_help_of_every_subcommand_has_an_example_that_is_accepted() {
        for command in Cli::definition().get_subcommands_mut() {
            let name = command.get_name().to_string();
            let help = command.render_long_help().to_string();
            let examples: Vec<_> = example_lines(&help).collect();
            assert!(!examples.is_empty(), "{name} has no example");
            assert!(examples.iter().any(|line| line.contains(&name)), "{name}: {examples:?}");
            for line in examples {
                assert!(line.chars().count() <= 76, "too long for 80 columns: {line}");
                accepts(line);
            }
        }
    }

    #[test]
    fn the_examples_of_the_whole_are_accepted() {
        let help = Cli::definition().render_long_help().to_string();
        assert!(example_lines(&help).map(accepts).count() >= 4);
    }

    /// The lines below "Examples:" that run the program.
    fn example_lines(help: &str) -> impl Iterator<Item = &str> {
        let below = help.split_once("Examples:\n").map_or("", |(_, below)| below);
        below.lines().map(str::trim).filter(|line| line.starts_with("ser-cli "))
    }

    /// Checks the words of an example, up to a redirection, a pipe or the explanation after two
    /// blanks.
    fn accepts(line: &str) {
        let command = line.split("  ").next().unwrap_or(line);
        let words = command.split(' ').take_while(|word| !["|", ">", ">>", "&"].contains(word));
        if let Err(error) = Cli::try_from_words(words) {
            assert!(!error.use_stderr(), "`{command}`: {error}");
        }
    }

    #[test]
    fn impossible_arguments_are_refused() {
        for line in [
            "read --from 0 --count 1",
            "read --from 1 --count 2049",
            "read --from 1",
            "read --count 1",
            "read --all --new",
            "read --new --from 1 --count 1",
            "read --format xml",
            "--baud 115200 status",
            "--timeout 0 status",
            "config --size 0",
            "config --size 2049",
            "config --report-to 32",
            "config --auto-print maybe",
            "filter set",
            "filter set --input 3",
            "filter set --debounce 5ms",
            "filter set --input 33 --debounce 5ms",
            "filter set --input 0 --debounce 5ms",
            "filter set --input 3 --debounce 256ms",
            "filter set --input 3 --chatter 4/1s",
            "filter set --input 3 --chatter 33/1s",
            "filter set --input 3 --chatter 32/7001ms",
            "filter set --input 3 --rearm 66s",
            "filter clear",
            "filter --format xml",
            "diagnostics --every 0",
            "diagnostics --format csv",
            "clock set --at yesterday",
            "print --from 1",
            "encode read --from 1 --count 11",
            "encode set-clock 2026-02-29T00:00:00",
            "comm-req send --to 32 erase",
            "comm-req send --to 5 --status %M1 erase",
            "comm-req dequeue --from 5 --max-words 0",
            "comm-req parse 65536",
            "comm-req parse",
            "genius forces --node 32 --table input-values",
            "genius forces --node 5",
            "genius broadcast",
            "site",
            "site show a.toml --format xml",
            "site new -o a.toml b.toml",
            "import",
            "import a.txt --format xml",
            "import a.txt --zone Middle/Earth",
            "import a.txt --dates ydm",
            "import a.txt --epoch 1985",
            "import a.txt --doubt-ms -1",
            "import a.txt --force",
            "sim --model ser640",
            "sim --genius /tmp/host",
            "sim --node 5",
            "sim --genius /tmp/host --node 32",
            "sim --genius /tmp/host --node 5:ser640",
            "sim --genius /tmp/host --node 5 --bus-rate 19200",
            "sim --genius /tmp/host --node 5 --host-number 32",
            "sim --genius /tmp/host --node 5 --bus-noise 101",
            "sim --genius /tmp/host --node 5 --bus-noise -1",
            "sim --genius /tmp/host --node 5 --bus-noise nan",
            "sim --genius /tmp/host --node 5 --seed 1",
            "sim --bus-rate 38.4K",
            "sim --tcp 127.0.0.1:0 --tcp-idle 0",
            "sim --tcp 127.0.0.1:0 --tcp-idle sometimes",
            "sim --host-number 1",
            "sim --bus-noise 1",
            "",
        ] {
            let words = std::iter::once("ser-cli").chain(line.split_whitespace());
            let error = Cli::try_from_words(words).expect_err(line);
            assert_eq!(error.exit_code(), 2, "{line}");
        }
    }

    #[test]
    fn the_port_may_stand_on_either_side() {
        for words in [["ser-cli", "-p", "COM3", "status"], ["ser-cli", "status", "--port", "COM3"]]
        {
            assert_eq!(Cli::try_from_words(words).unwrap().connection.port, ["COM3"]);
        }
    }

    #[test]
    fn how_to_reach_a_unit_is_not_mentioned_where_none_is_reached() {
        let mut definition = Cli::definition();
        definition.build();
        for command in
            definition.get_subcommands_mut().filter(|command| command.get_name() != "help")
        {
            let (name, help) =
                (command.get_name().to_string(), command.render_long_help().to_string());
            assert_eq!(help.contains("--retries"), !OFFLINE.contains(&&*name), "{name}");
        }
        #[cfg(feature = "sign")]
        for name in ["verify", "key"] {
            let report = definition.find_subcommand_mut("report").expect("there");
            let help = report.find_subcommand_mut(name).expect("there").render_long_help();
            assert!(!help.to_string().contains("--retries"), "{name}");
        }
        assert!(Cli::try_from_words(["ser-cli", "-p", "COM3", "demo"]).is_ok());
    }
}
