//! Turns words back into a block, and data back into a message.

use std::io::Write;

use ser_proto::genius::{CommReq, FUNCTION_HORNER, SUBFUNCTION_SER, bytes_of_words};

use super::values;
use crate::decoding::{Explanation, Side, explain};
use crate::error::{Failure, Result};

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The words: decimal, or hex like 0045h or 0x45.
    #[arg(required = true, value_name = "WORD", value_parser = values::word, allow_negative_numbers = true)]
    words: Vec<u16>,

    /// The words are data that a PLC has fetched from a recorder, not a block.
    #[arg(long)]
    data: bool,

    /// How many bytes of data there are; without it, as many as make sense.
    #[arg(long, value_name = "N", requires = "data")]
    bytes: Option<usize>,
}

pub(super) fn run(args: &Args, out: &mut dyn Write) -> Result<()> {
    if args.data {
        return write(out, &fetched(&args.words, args.bytes));
    }
    let block = CommReq::parse(&args.words).map_err(|error| {
        Failure::usage(error)
            .hint(
                "words count from 0; word 6 is 14 in a block that sends and 13 in one that fetches",
            )
            .hint("for data that a PLC has fetched, add --data")
    })?;
    writeln!(out, "{block}")?;
    match &block {
        CommReq::Send(send) if is_for_a_recorder(send.function, send.subfunction) => {
            write(out, &explain(&send.data, Some(Side::Host)))
        }
        _ => Ok(()),
    }
}

/// The message that a block sends to a recorder, in words.
pub(super) fn message(block: &CommReq) -> Option<String> {
    match block {
        CommReq::Send(send) if is_for_a_recorder(send.function, send.subfunction) => {
            Some(explain(&send.data, Some(Side::Host)).text)
        }
        _ => None,
    }
}

fn is_for_a_recorder(function: u8, subfunction: u8) -> bool {
    (function, subfunction) == (FUNCTION_HORNER, SUBFUNCTION_SER)
}

/// If the number of bytes is not given, the high half of the last word may not be data.
fn fetched(words: &[u16], bytes: Option<usize>) -> Explanation {
    let explained =
        |count| explain(&bytes_of_words(words, count).collect::<Vec<_>>(), Some(Side::Recorder));
    match bytes {
        Some(bytes) => explained(bytes),
        None => {
            let whole = explained(2 * words.len());
            let padded = words.last().is_some_and(|&last| last <= 0xFF);
            if padded && whole.is_damage() { explained(2 * words.len() - 1) } else { whole }
        }
    }
}

fn write(out: &mut dyn Write, explanation: &Explanation) -> Result<()> {
    writeln!(out, "{}", explanation.text)?;
    for detail in &explanation.details {
        writeln!(out, "  {detail}")?;
    }
    Ok(())
}
