//! A block as a list of words.

use std::io::{self, Write};

use ser_proto::genius::CommReq;

use super::parse::message;

/// Says what the block does, and lists its words with their meaning.
pub(super) fn write(out: &mut dyn Write, block: &CommReq) -> io::Result<()> {
    writeln!(out, "{block}")?;
    if let Some(message) = message(block) {
        writeln!(out, "{message}")?;
    }
    writeln!(out, "\nword  decimal    hex  meaning")?;
    for (index, word) in block.to_words().iter().enumerate() {
        writeln!(out, "{index:>4}  {word:>7}  {word:04X}h  {}", meaning(block, index))?;
    }
    Ok(())
}

/// The words alone.
pub(super) fn write_line(out: &mut dyn Write, block: &CommReq) -> io::Result<()> {
    let words: Vec<_> = block.to_words().iter().map(u16::to_string).collect();
    writeln!(out, "{}", words.join(" "))
}

fn meaning(block: &CommReq, index: usize) -> String {
    let status = match block {
        CommReq::Send(send) => send.status,
        CommReq::Dequeue(dequeue) => dequeue.status,
    };
    match (block, index) {
        (_, 0) => "command length".to_string(),
        (_, 1) => "do not wait".to_string(),
        (_, 2) => format!("status in {status}: memory type"),
        (_, 3) => format!("status in {status}: number - 1"),
        (_, 4) => "idle timeout".to_string(),
        (_, 5) => "time limit".to_string(),
        (CommReq::Send(_), index) => in_send(index).to_string(),
        (CommReq::Dequeue(dequeue), 8) => format!("data into {}: memory type", dequeue.into),
        (CommReq::Dequeue(dequeue), 9) => format!("data into {}: number - 1", dequeue.into),
        (CommReq::Dequeue(_), index) => in_dequeue(index).to_string(),
    }
}

fn in_send(index: usize) -> &'static str {
    match index {
        6 => "command: send datagram",
        7 => "target",
        8 => "function",
        9 => "subfunction",
        10 => "priority",
        11 => "bytes of data",
        _ => "data",
    }
}

fn in_dequeue(index: usize) -> &'static str {
    match index {
        6 => "command: dequeue datagram",
        7 => "most words",
        10 => "function",
        11 => "subfunction",
        _ => "sender",
    }
}
