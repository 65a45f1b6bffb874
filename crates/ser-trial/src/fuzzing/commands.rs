//! Commands: bodies that come from a host.

use ser_proto::Command;

use super::body_rules::{Fault, Rules, above, assert_emitted, settings_fault, time_fault};
use super::extension_rules::{canonical_command, command_fault, command_has_length};

const RULES: Rules = Rules { has_length, fault };

/// `data` is the body.
///
/// - It is understood, or refused with the right cause, as the tables of `docs/protocol.md` say.
/// - A body that was understood is sent in its canonical form, with the same meaning.
///
/// # Panics
/// When one of these does not hold.
pub fn commands(data: &[u8]) {
    let parsed = Command::parse(data);
    RULES.assert_agree(data, &parsed);
    if let Ok(command) = parsed {
        assert_eq!(command.code().byte(), data[0]);
        assert_emitted(command.to_body(), &canonical(data));
        assert_eq!(Command::parse(&command.to_body()), Ok(command));
    }
}

fn has_length(code: u8, length: usize) -> bool {
    match code {
        b'C' => [1, 7].contains(&length),
        b'E' | b'L' => length == 1,
        b'M' => (1..=3).contains(&length),
        b'P' => [3, 5].contains(&length),
        b'R' => length == 4,
        b'S' => length == 9,
        _ => command_has_length(code, length),
    }
}

fn fault(body: &[u8]) -> Fault {
    match body {
        [b'C', _, ..] => settings_fault(body),
        [b'M', _, ..] => above(body, 1, &[1]),
        [b'S', ..] => time_fault(body, 1),
        _ => command_fault(body),
    }
}

/// The form that we use, where the same can be said in several ways.
fn canonical(body: &[u8]) -> Vec<u8> {
    match *body {
        [b'C', a, b, baud, 1, address, print] => vec![b'C', a, b, baud, 0, address, print],
        [b'M', mode] | [b'M', mode, _] => vec![b'M', mode, 0],
        [b'P', 0, start, 0, count] => vec![b'P', start, count],
        _ => canonical_command(body),
    }
}
