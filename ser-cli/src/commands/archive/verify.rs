//! Whether anybody has changed an archive.

use std::io::{self, Write};

use ser_archive::{Broken, ChainHead};
use ser_console::Harmless;
use serde_json::{Value, json};

use super::{Format, LookArgs, SCHEMA};
use crate::archive::hex;
use crate::error::{Failure, Result, warn};
use crate::output::{Grid, PROGRAM, Palette, json_to};

/// The digest of a head, as it is shown: 64 hexadecimal digits.
pub(super) fn parse_head(text: &str) -> std::result::Result<[u8; 32], String> {
    let wrong = "not a digest of 64 hexadecimal digits";
    let digit =
        |byte: &u8| char::from(*byte).to_digit(16).and_then(|digit| u8::try_from(digit).ok());
    let digits: Option<Vec<u8>> = text.trim().as_bytes().iter().map(digit).collect();
    let bytes: Vec<u8> = digits
        .ok_or(wrong)?
        .chunks(2)
        .map(|pair| pair.iter().fold(0, |byte, digit| byte << 4 | digit))
        .collect();
    if text.trim().len() != 64 {
        return Err(wrong.to_owned());
    }
    bytes.try_into().map_err(|_| wrong.to_owned())
}

pub(super) fn run(look: &LookArgs, known: &[[u8; 32]]) -> Result<()> {
    let mut archive = look.archive.read()?;
    let (heads, broken) = archive.verify()?;
    let mut gone = Vec::new();
    for head in known {
        if !archive.has_head(head)? {
            gone.push(hex(head));
        }
    }
    let mut out = io::stdout().lock();
    match look.format {
        Format::Text => write_text(&mut out, &heads)?,
        Format::Json => json_to(&mut out, &as_json(&heads, &broken, &gone))?,
    }
    for found in &broken {
        warn(text_of(found));
    }
    for head in &gone {
        warn(format_args!("no chain has the head {head} in it"));
    }
    if broken.is_empty() && gone.is_empty() {
        return Ok(());
    }
    let failure = match broken.is_empty() {
        false => Failure::new("the archive is not as it was written"),
        true => Failure::new("what a head stood for was taken away, or made anew"),
    };
    let has_expired = heads.iter().any(|head| head.expired_to.is_some());
    Err(match has_expired && broken.is_empty() {
        true => failure.hint(
            "or retention has let it go: compare with a head that was written down after that",
        ),
        false => failure.hint(
            "keep the file as it is, and compare with a backup, or another collector's archive",
        ),
    })
}

/// What is broken, in a sentence.
fn text_of(found: &Broken) -> String {
    let whose = Harmless(format!("{} of {}", found.recorder, found.collector)).line();
    let good_to = found.good_to;
    match found.until {
        Some(until) => format!(
            "{whose}: something after position {good_to} and up to {until} was changed, removed or \
             added"
        ),
        None => format!("{whose}: rows behind position {good_to} were added by somebody else"),
    }
}

fn write_text(out: &mut dyn Write, heads: &[ChainHead]) -> io::Result<()> {
    if heads.is_empty() {
        return writeln!(out, "nothing was archived yet");
    }
    let row = |head: &ChainHead| {
        vec![
            Harmless(&head.recorder).line(),
            Harmless(&head.collector).line(),
            head.rows.to_string(),
            head.position.to_string(),
            head.expired_to.map(|position| position.to_string()).unwrap_or_default(),
            hex(&head.digest),
        ]
    };
    let grid = Grid {
        title: None,
        columns: vec!["recorder", "collector", "rows", "position", "let go to", "head"],
        rows: heads.iter().map(row).collect(),
    };
    grid.write(out, Palette::of_stdout())
}

fn as_json(heads: &[ChainHead], broken: &[Broken], gone: &[String]) -> Value {
    let head = |head: &ChainHead| {
        json!({
            "recorder": head.recorder,
            "collector": head.collector,
            "rows": head.rows,
            "position": head.position,
            "expired_to": head.expired_to,
            "head": hex(&head.digest),
        })
    };
    let fault = |found: &Broken| {
        json!({
            "recorder": found.recorder,
            "collector": found.collector,
            "good_to": found.good_to,
            "until": found.until,
        })
    };
    json!({
        "schema": SCHEMA,
        "program": PROGRAM,
        "is_sound": broken.is_empty() && gone.is_empty(),
        "heads": heads.iter().map(head).collect::<Vec<_>>(),
        "broken": broken.iter().map(fault).collect::<Vec<_>>(),
        "heads_gone": gone,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_head_is_read_as_it_is_shown() {
        let digest: [u8; 32] = std::array::from_fn(|index| u8::try_from(index * 7).unwrap());
        assert_eq!(parse_head(&hex(&digest)), Ok(digest));
        for wrong in ["", "5f", &"0".repeat(63), &"0".repeat(65), &"g".repeat(64), &"é".repeat(32)]
        {
            assert!(parse_head(wrong).is_err(), "{wrong}");
        }
    }
}
