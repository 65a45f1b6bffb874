//! `comm-req`: the word blocks with which a PLC program talks to a recorder, and the reverse.

mod parse;
mod table;
mod values;

use std::io::{self, Write};
use std::num::NonZeroU16;

use ser_proto::genius::{
    Address, BusAddress, CommReq, Datagram, DequeueDatagram, PlcReference, SendDatagram,
};

use super::encode::Message;
use crate::error::Result;

const EXAMPLES: &str = "\
Examples:
  ser-cli comm-req send --to 5 read --from 1 --count 10
  ser-cli comm-req send --to all set-clock 2026-11-22T10:00:00
  ser-cli comm-req dequeue --from 5 --into %R200
  ser-cli comm-req parse 8 0 8 99 0 0 14 5 64 80 0 1 69
  ser-cli comm-req parse --data 0045h";

const SEND_EXAMPLES: &str = "\
Examples:
  ser-cli comm-req send --to 5 read --from 1 --count 10
  ser-cli comm-req send --to 5 --status %R300 last-broadcast
  ser-cli comm-req send --to all --priority high erase
  ser-cli comm-req send --to 5 --line start";

const DEQUEUE_EXAMPLES: &str = "\
Examples:
  ser-cli comm-req dequeue --from 5
  ser-cli comm-req dequeue --from 5 --into %R200 --max-words 70 --line";

const PARSE_EXAMPLES: &str = "\
Examples:
  ser-cli comm-req parse 8 0 8 99 0 0 14 5 64 80 0 1 69
  ser-cli comm-req parse 7 0 8 99 0 0 13 70 8 199 0040h 0050h 5
  ser-cli comm-req parse --data 014Dh 007Dh --bytes 3";

/// Show the `COMM_REQ` blocks with which a PLC sends a message to a recorder or fetches its answer;
/// nothing is sent.
///
/// Words are shown in decimal and hex, ready to be typed into a PLC. In the other direction, words
/// are turned into a message.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// The block that sends a message to a recorder (`COMM_REQ` 14).
    #[command(after_help = SEND_EXAMPLES)]
    Send(SendArgs),
    /// The block that fetches what a recorder has sent (`COMM_REQ` 13).
    #[command(after_help = DEQUEUE_EXAMPLES)]
    Dequeue(DequeueArgs),
    /// The meaning of a block's words, or of fetched data.
    #[command(after_help = PARSE_EXAMPLES)]
    Parse(parse::Args),
}

#[derive(Debug, clap::Args)]
struct SendArgs {
    /// Bus address of the recorder, 0-31, or `all` for a broadcast, which is carried out but not
    /// answered.
    #[arg(long, value_name = "N", value_parser = values::address)]
    to: Address,

    /// Where the PLC puts the outcome: %R100, %AI1, %AQ1, %I1, %Q1, %W1.
    #[arg(long, value_name = "PLACE", default_value = "%R100", value_parser = values::reference)]
    status: PlcReference,

    /// Whether the datagram waits for a bus scan in which no other device sends one.
    #[arg(long, value_name = "PRIORITY", default_value = "normal")]
    priority: values::PriorityName,

    /// Print only the words, in decimal, on one line.
    #[arg(long)]
    line: bool,

    #[command(subcommand)]
    message: Message,
}

#[derive(Debug, clap::Args)]
struct DequeueArgs {
    /// Bus address of the recorder, 0-31.
    #[arg(long, value_name = "N", value_parser = crate::values::bus_address)]
    from: BusAddress,

    /// Where the PLC puts the first word.
    #[arg(long, value_name = "PLACE", default_value = "%R200", value_parser = values::reference)]
    into: PlcReference,

    /// How many words there is room for.
    #[arg(long, value_name = "N", default_value = "70")]
    max_words: NonZeroU16,

    /// Where the PLC puts the outcome.
    #[arg(long, value_name = "PLACE", default_value = "%R100", value_parser = values::reference)]
    status: PlcReference,

    /// Print only the words, in decimal, on one line.
    #[arg(long)]
    line: bool,
}

pub(crate) fn run(args: &Args) -> Result<()> {
    let mut out = io::stdout().lock();
    match &args.what {
        What::Send(send) => write(&mut out, &send.block(), send.line)?,
        What::Dequeue(dequeue) => write(&mut out, &dequeue.block(), dequeue.line)?,
        What::Parse(words) => parse::run(words, &mut out)?,
    }
    out.flush()?;
    Ok(())
}

fn write(out: &mut dyn Write, block: &CommReq, line: bool) -> io::Result<()> {
    if line { table::write_line(out, block) } else { table::write(out, block) }
}

impl SendArgs {
    fn block(&self) -> CommReq {
        // A block does not name its sender, which is the PLC's bus controller, whatever its
        // address.
        let datagram = Datagram::from_command(SOMEBODY, self.to, &self.message.command());
        CommReq::Send(SendDatagram {
            priority: self.priority.into(),
            ..SendDatagram::new(datagram, self.status)
        })
    }
}

impl DequeueArgs {
    fn block(&self) -> CommReq {
        let (sender, max_words) = (self.from.into(), self.max_words.get());
        CommReq::Dequeue(DequeueDatagram::from_recorder(sender, max_words, self.into, self.status))
    }
}

const SOMEBODY: BusAddress = match BusAddress::new(0) {
    Some(device) => device,
    None => unreachable!(),
};

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        args: Args,
    }

    fn output(line: &str) -> String {
        let words = std::iter::once("comm-req").chain(line.split_whitespace());
        let args =
            Line::try_parse_from(words).unwrap_or_else(|error| panic!("{line}: {error}")).args;
        let mut out = Vec::new();
        match &args.what {
            What::Send(send) => write(&mut out, &send.block(), send.line).unwrap(),
            What::Dequeue(dequeue) => write(&mut out, &dequeue.block(), dequeue.line).unwrap(),
            What::Parse(words) => parse::run(words, &mut out).unwrap(),
        }
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn a_read_command_becomes_the_words_of_a_send_block() {
        assert_eq!(
            output("send --to 5 read --from 1 --count 10"),
            "send to 5: SER message, 4 bytes, normal priority, status in %R100\n\
             read 10 entries from entry 1\n\
             \n\
             word  decimal    hex  meaning\n\
             \u{20}  0        9  0009h  command length\n\
             \u{20}  1        0  0000h  do not wait\n\
             \u{20}  2        8  0008h  status in %R100: memory type\n\
             \u{20}  3       99  0063h  status in %R100: number - 1\n\
             \u{20}  4        0  0000h  idle timeout\n\
             \u{20}  5        0  0000h  time limit\n\
             \u{20}  6       14  000Eh  command: send datagram\n\
             \u{20}  7        5  0005h  target\n\
             \u{20}  8       64  0040h  function\n\
             \u{20}  9       80  0050h  subfunction\n\
             \u{20} 10        0  0000h  priority\n\
             \u{20} 11        4  0004h  bytes of data\n\
             \u{20} 12       82  0052h  data\n\
             \u{20} 13     2561  0A01h  data\n"
        );
    }

    #[test]
    fn a_broadcast_goes_to_255_and_may_be_urgent() {
        assert_eq!(
            output("send --to all --priority high --status %AI7 --line erase"),
            "8 0 10 6 0 0 14 255 64 80 1 1 69\n"
        );
    }

    #[test]
    fn a_dequeue_block_names_both_places() {
        assert_eq!(
            output("dequeue --from 5 --into %R200"),
            "fetch SER message from 5, at most 70 words into %R200, status in %R100\n\
             \n\
             word  decimal    hex  meaning\n\
             \u{20}  0        7  0007h  command length\n\
             \u{20}  1        0  0000h  do not wait\n\
             \u{20}  2        8  0008h  status in %R100: memory type\n\
             \u{20}  3       99  0063h  status in %R100: number - 1\n\
             \u{20}  4        0  0000h  idle timeout\n\
             \u{20}  5        0  0000h  time limit\n\
             \u{20}  6       13  000Dh  command: dequeue datagram\n\
             \u{20}  7       70  0046h  most words\n\
             \u{20}  8        8  0008h  data into %R200: memory type\n\
             \u{20}  9      199  00C7h  data into %R200: number - 1\n\
             \u{20} 10       64  0040h  function\n\
             \u{20} 11       80  0050h  subfunction\n\
             \u{20} 12        5  0005h  sender\n"
        );
    }

    #[test]
    fn words_become_a_message_again() {
        let block = output("send --to 5 --line read --from 1 --count 10");
        assert_eq!(
            output(&format!("parse {block}")),
            "send to 5: SER message, 4 bytes, normal priority, status in %R100\n\
             read 10 entries from entry 1\n"
        );
        assert_eq!(
            output("parse 0007h 0 8 99 0 0 0x0D 70 8 199 40h 50h FFh"),
            "fetch SER message from all, at most 70 words into %R200, status in %R100\n"
        );
    }

    #[test]
    fn fetched_data_become_a_message_from_the_unit() {
        assert_eq!(output("parse --data 014Dh 007Dh --bytes 3"), "recording, version 1.25\n");
        // The PLC does not say how many bytes there are; the last word may contain only one.
        assert_eq!(output("parse --data 014Dh 007Dh"), "recording, version 1.25\n");
        assert_eq!(
            output("parse --data -32699"),
            "not a message: message E never has 2 bytes (45 80)\n"
        );
    }

    #[test]
    fn every_message_survives_its_block() {
        for message in [
            "query-config",
            "config --size 1024 --auto-report genius --report-to 3",
            "erase",
            "last-broadcast",
            "query-mode",
            "start",
            "stop",
            "print --from 1 --count 100",
            "read --from 2048 --count 1",
            "set-clock 2026-11-22T10:00:00.250",
        ] {
            let block = output(&format!("send --to 31 --line {message}"));
            let text = output(&format!("parse {block}"));
            assert!(!text.contains("not a message"), "{message}: {text}");
        }
    }
}
