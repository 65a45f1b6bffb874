//! `genius decode`: explains a datagram's codes and data.

use std::io::{self, Write};

use ser_proto::genius::{
    Data, FUNCTION_GENIUS, FUNCTION_HORNER, MAX_DATA, Message, PointMask, SUBFUNCTION_SER,
    WritePoint,
};

use crate::decoding::{HexText, HexToken, explain, hex_text};
use crate::error::{Failure, Result};

pub(super) fn run(words: &[String]) -> Result<()> {
    let lines = lines_of(&bytes_of(words)?)?;
    let mut out = io::stdout().lock();
    writeln!(out, "{}", lines.join("\n"))?;
    out.flush()?;
    Ok(())
}

/// The bytes of words such as `20`, `0x20`, `20h` or `201E0001`, with blanks or commas between them.
fn bytes_of(words: &[String]) -> Result<Vec<u8>> {
    let parts = words.iter().flat_map(|word| word.split([' ', ',', '\t', '\n']));
    let mut bytes = Vec::new();
    for part in parts.filter(|part| !part.is_empty()) {
        let of_part = bytes_of_word(part.strip_suffix(['h', 'H']).unwrap_or(part));
        bytes.extend(of_part.filter(|of_part| !of_part.is_empty()).ok_or_else(|| {
            Failure::usage(format!("{part:?} is not a hexadecimal byte"))
                .hint("every byte has two digits: ser-cli genius decode 20 00")
        })?);
    }
    Ok(bytes)
}

/// `None` when there is anything but whole bytes.
fn bytes_of_word(word: &str) -> Option<Vec<u8>> {
    let mut hex = HexText::new();
    let mut tokens: Vec<_> = word.bytes().flat_map(|byte| hex.push(byte)).flatten().collect();
    tokens.extend(hex.finish());
    let byte = |token: &HexToken| match token {
        HexToken::Byte(byte, _) => Some(*byte),
        HexToken::Junk(..) | HexToken::Half(..) | HexToken::LineEnd => None,
    };
    tokens.iter().map(byte).collect()
}

/// What a datagram means, and its content.
fn lines_of(bytes: &[u8]) -> Result<Vec<String>> {
    let &[function, subfunction, ref data @ ..] = bytes else {
        return Err(Failure::usage("a datagram begins with its function and its subfunction code")
            .hint("a Read ID: ser-cli genius decode 20 00"));
    };
    let Ok(carried) = Data::from_slice(data) else {
        return Err(Failure::usage(format!(
            "{} bytes of data are too many: a datagram carries up to {MAX_DATA}",
            data.len()
        )));
    };
    match (function, subfunction) {
        (FUNCTION_GENIUS, _) => of_the_bus(subfunction, &carried),
        (FUNCTION_HORNER, SUBFUNCTION_SER) => {
            let message = explain(data, None);
            match message.is_damage() {
                true => Err(Failure::usage(message.text)
                    .hint("after 40 50 comes the message: ser-cli genius decode 40 50 45")),
                false => Ok(std::iter::once(message.text).chain(message.details).collect()),
            }
        }
        _ => Ok(vec![format!(
            "function {function:02X}h, subfunction {subfunction:02X}h: {}",
            shown(data)
        )]),
    }
}

fn of_the_bus(subfunction: u8, data: &Data) -> Result<Vec<String>> {
    let message = Message::from_data(subfunction, data).map_err(|error| {
        Failure::usage(error).hint("docs/genius.md has the layout of every datagram")
    })?;
    let details = match &message {
        Message::ReadIoForcesReply(forces) if !forces.contents.is_empty() => {
            vec![shown(&forces.contents)]
        }
        Message::ReadDeviceReply(piece) | Message::WriteDevice(piece) => {
            vec![shown(&piece.contents)]
        }
        Message::WritePoint(write) => changes(write),
        Message::Unknown { data, .. } if !data.is_empty() => vec![shown(data)],
        _ => Vec::new(),
    };
    let details = details.iter().map(|detail| format!("  {detail}"));
    Ok(std::iter::once(message.to_string()).chain(details).collect())
}

/// The bits that a Write Point changes, one byte per line.
fn changes(write: &WritePoint) -> Vec<String> {
    let bits = |mask: u8| {
        let bits: Vec<_> =
            (0..8).filter(|bit| mask >> bit & 1 != 0).map(|bit: u8| bit.to_string()).collect();
        if bits.is_empty() { "none".to_owned() } else { bits.join(" ") }
    };
    let line = |(offset, mask): (usize, &PointMask)| {
        format!(
            "byte {offset}: sets bits {}, clears bits {}",
            bits(mask.or),
            bits(!mask.and & !mask.or)
        )
    };
    write.masks.iter().enumerate().map(line).collect()
}

fn shown(data: &[u8]) -> String {
    if data.is_empty() { "no data".to_owned() } else { hex_text(data) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(words: &str) -> String {
        let words: Vec<String> = words.split(' ').map(str::to_owned).collect();
        match bytes_of(&words).and_then(|bytes| lines_of(&bytes)) {
            Ok(lines) => lines.join("\n"),
            Err(failure) => failure.text(),
        }
    }

    #[test]
    fn every_kind_of_datagram_is_told_in_words() {
        for (words, text) in [
            ("20 00", "Read ID"),
            ("20 40 02", "Read I/O Forces: input values"),
            ("20 1E 04 00 01 00", "Read Device 4 bytes at 000100h"),
            ("20 20 02 00 01 00 AB CD", "Write Device 2 bytes at 000100h\n  AB CD"),
            (
                "200B 04 000100 FE 01 FF 00",
                "Write Point at 000100h\n  byte 0: sets bits 0, clears bits none\n  \
                 byte 1: sets bits none, clears bits none",
            ),
            ("20 0F 01 02", "Report Fault, 2 bytes\n  01 02"),
            ("20 33", "datagram 33h, no data"),
            ("40 50 45", "host: erase the event buffer | recorder: event buffer erased"),
            ("0x33 0X01 FFh", "function 33h, subfunction 01h: FF"),
            ("20,41,02", "Read I/O Forces reply: input values, no data"),
        ] {
            assert_eq!(decoded(words), text, "{words}");
        }
        assert!(decoded("20 01 05").contains("Read ID reply"), "{}", decoded("20 01 05"));
    }

    #[test]
    fn what_is_no_datagram_is_refused_with_what_to_do() {
        for (words, what) in [
            ("20", "begins with its function"),
            ("2", "not a hexadecimal byte"),
            ("20 0g", "not a hexadecimal byte"),
            ("20 1E 04", "1"),
            ("40 50 FF", "not a message"),
        ] {
            assert!(decoded(words).contains(what), "{words}: {}", decoded(words));
        }
        let long = format!("20 0F {}", "00".repeat(MAX_DATA + 1));
        assert!(decoded(&long).contains("too many"), "{}", decoded(&long));
    }
}
