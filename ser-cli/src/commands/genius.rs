//! `genius`: the bus as a whole.

mod broadcast;
mod check;
mod decode;
mod devices;
mod dip;
mod forces;
mod globals;
mod mark;

use clap::ValueEnum;
use ser_client::Recognition;
use ser_proto::genius::{BusAddress, DipSwitches, ForceTable};

use crate::connection::{self, ConnectionArgs};
use crate::error::{Failure, Result};
use crate::keeper::StateArgs;
use crate::values::{self, BusRateName};

const EXAMPLES: &str = "\
Examples:
  ser-cli genius devices --port geni:/dev/shm/host
  ser-cli genius globals --port geni:/dev/shm/host
  ser-cli genius globals --follow
  ser-cli genius globals --model-number 4
  ser-cli genius forces --node 5 --table input-values
  ser-cli genius broadcast clock
  ser-cli genius broadcast mark
  ser-cli genius broadcast erase --yes
  ser-cli genius decode 20 1E 04 00 01 00
  ser-cli genius dip 10100111

The port is the window of this host's GENI board, without a node.";

const GLOBALS_EXAMPLES: &str = "\
Examples:
  ser-cli genius globals
  ser-cli genius globals --follow
  ser-cli genius globals --site north.toml  names in place of numbers

With --follow the bus is read ten times a second, and the times are this computer's. Changes that \
come and go in between are not seen; ser-cli watch shows every event, stamped by the recorder.";

const FORCES_EXAMPLES: &str = "\
Examples:
  ser-cli genius forces --node 5 --table input-enable
  ser-cli genius forces --node 5 --table output-values";

const BROADCAST_EXAMPLES: &str = "\
Examples:
  ser-cli genius broadcast clock
  ser-cli genius broadcast clock --at 2026-11-22T10:00:00.250
  ser-cli genius broadcast mark
  ser-cli genius broadcast mark --format jsonl >> marks.jsonl
  ser-cli genius broadcast erase --yes

A clock that was set, and what the clocks showed at a mark, is remembered in the state directory, \
so that a report can compare the times of the recorders of a bus to the millisecond.";

const DECODE_EXAMPLES: &str = "\
Examples:
  ser-cli genius decode 20 00                   the bus's own: Read ID
  ser-cli genius decode 20 1E 04 00 01 00       Read Device
  ser-cli genius decode 40 50 45                the recorder's: erase";

const DIP_EXAMPLES: &str = "\
Examples:
  ser-cli genius dip 10100111                   what do these switches say?
  ser-cli genius dip --address 5 --rate 38.4K   how are they to be set?";

/// Look at a Genius bus as a whole, and send commands to all its recorders at once.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    #[command(subcommand)]
    what: What,
}

impl Args {
    /// Whether the command needs no bus and only prints.
    pub(crate) fn is_offline(&self) -> bool {
        matches!(self.what, What::Decode { .. } | What::Dip { .. })
    }
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// List the devices that are logged in.
    Devices {
        #[command(flatten)]
        who: Who,
    },
    /// Show the live inputs of every recorder, all from the same bus scan. The exit code is 1 when
    /// there is no recorder.
    #[command(after_help = GLOBALS_EXAMPLES)]
    Globals {
        /// Continue until Ctrl-C, and show each recorder again when its inputs have changed.
        #[arg(long)]
        follow: bool,
        #[command(flatten)]
        who: Who,
    },
    /// Show which inputs or outputs of a device are forced, and to what.
    #[command(after_help = FORCES_EXAMPLES)]
    Forces {
        /// The device's bus address, 0-31.
        #[arg(long, value_name = "N", value_parser = values::bus_address)]
        node: BusAddress,
        /// Which table.
        #[arg(long)]
        table: TableName,
    },
    /// Send a command to all recorders, and check by their last broadcast that each has received
    /// it.
    ///
    /// Recorders do not answer a broadcast, so every recorder that is logged in is asked before and
    /// after it. The exit code is 0 when all of them are known to have received it, and 1
    /// otherwise, also when there is none.
    #[command(after_help = BROADCAST_EXAMPLES)]
    Broadcast {
        #[command(subcommand)]
        what: broadcast::What,
        #[command(flatten)]
        who: Who,
        #[command(flatten)]
        state: StateArgs,
    },
    /// Explain what a datagram means. No bus is needed.
    #[command(after_help = DECODE_EXAMPLES)]
    Decode {
        /// Function code, subfunction code and data, in hexadecimal.
        #[arg(required = true, value_name = "HEX")]
        bytes: Vec<String>,
    },
    /// Show what a recorder's DIP switches mean, or how to set them. No bus is needed.
    #[command(after_help = DIP_EXAMPLES)]
    Dip {
        /// Switches 1 to 8 as eight digits: 1 is open, 0 is closed.
        #[arg(
            value_name = "SWITCHES",
            value_parser = dip::switches,
            conflicts_with_all = ["address", "rate"]
        )]
        switches: Option<DipSwitches>,
        /// The bus address that the recorder is to have, 0-31.
        #[arg(long, value_name = "N", value_parser = values::bus_address)]
        address: Option<BusAddress>,
        /// The rate of the bus.
        #[arg(long, value_name = "RATE", default_value = "153.6K", ignore_case = true)]
        rate: BusRateName,
    },
}

/// Which devices are taken for recorders.
#[derive(Clone, Copy, Debug, clap::Args)]
struct Who {
    /// Take the devices with this model number for recorders, and ask none. Without it, every
    /// device that sends as many bytes of global data as a recorder is asked.
    #[arg(long, value_name = "N", global = true)]
    model_number: Option<u8>,
}

impl Who {
    fn recognition(self, connection: &ConnectionArgs) -> Recognition {
        match self.model_number {
            Some(model) => Recognition::ModelNumber(model),
            None => Recognition::Asking(connection::options(connection)),
        }
    }
}

/// One of the four tables of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum TableName {
    /// Which inputs are forced.
    InputEnable,
    /// Which outputs are forced.
    OutputEnable,
    /// What the inputs are forced to.
    InputValues,
    /// What the outputs are forced to.
    OutputValues,
}

impl From<TableName> for ForceTable {
    fn from(name: TableName) -> ForceTable {
        match name {
            TableName::InputEnable => ForceTable::InputEnable,
            TableName::OutputEnable => ForceTable::OutputEnable,
            TableName::InputValues => ForceTable::InputValues,
            TableName::OutputValues => ForceTable::OutputValues,
        }
    }
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    match args.what {
        What::Decode { ref bytes } => decode::run(bytes),
        What::Dip { switches, address, rate } => dip::run(switches, address, rate),
        What::Devices { who } => devices::run(connection, who.recognition(connection)),
        What::Globals { follow, who } => {
            globals::run(connection, follow, who.recognition(connection))
        }
        What::Forces { node, table } => forces::run(connection, node.number(), table.into()),
        What::Broadcast { what, who, ref state } => {
            broadcast::run(connection, what, who.recognition(connection), state)
        }
    }
}

/// The devices that might be recorders and do not answer as such, in words; `None` if there are
/// none.
fn silent_candidates(silent: &[u8]) -> Option<String> {
    let numbers: Vec<_> = silent.iter().map(u8::to_string).collect();
    let numbers = Some(numbers.join(", ")).filter(|numbers| !numbers.is_empty())?;
    Some(format!("no answer from device {numbers}: no recorder, or one that hangs"))
}

fn no_recorder() -> Failure {
    Failure::new("no recorder is logged in")
        .hint("ser-cli genius devices lists the devices; check bus addresses and bus rate")
        .hint("--model-number N takes a device for a recorder even if it cannot answer")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_does_not_answer_is_named() {
        assert_eq!(silent_candidates(&[]), None);
        let said = silent_candidates(&[7, 12]).expect("two of them");
        assert_eq!(said, "no answer from device 7, 12: no recorder, or one that hangs");
    }
}
