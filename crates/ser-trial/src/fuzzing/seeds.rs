//! Seeds: inputs that are kept, each in a file whose name says what it is.
//!
//! A file whose name ends with `.hex` is text: pairs of hexadecimal digits, `HH*COUNT` for a
//! repeated byte, `"text"` for its ASCII characters, and `#` for a comment up to the end of the
//! line. Any other file is taken byte for byte.

use std::fs;
use std::path::{Path, PathBuf};

/// One input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Seed {
    /// The name of the file, without `.hex`.
    pub name: String,
    /// The input.
    pub bytes: Vec<u8>,
}

/// The folder that has a folder of seeds for each target.
#[must_use]
pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fuzz/seeds")
}

/// The seeds of a target, by name.
///
/// # Errors
/// A file that cannot be read, or is no hex text although its name says so.
pub fn of(target: &str) -> Result<Vec<Seed>, String> {
    let folder = folder().join(target);
    let cannot_read = |error| format!("cannot read {}: {error}", folder.display());
    let mut seeds = Vec::new();
    for file in fs::read_dir(&folder).map_err(cannot_read)? {
        seeds.push(read(&file.map_err(cannot_read)?.path())?);
    }
    seeds.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(seeds)
}

/// The seed in a file.
///
/// # Errors
/// As for [`of`].
pub fn read(path: &Path) -> Result<Seed, String> {
    let bytes =
        fs::read(path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    let is_hex = path.extension().is_some_and(|extension| extension == "hex");
    let name = if is_hex { path.file_stem() } else { path.file_name() };
    let name = name.unwrap_or_default().to_string_lossy().into_owned();
    if !is_hex {
        return Ok(Seed { name, bytes });
    }
    let mut seed = Seed { name, bytes: Vec::new() };
    for (number, line) in String::from_utf8_lossy(&bytes).lines().enumerate() {
        let line = line_bytes(line)
            .map_err(|why| format!("{}, line {}: {why}", path.display(), number + 1))?;
        seed.bytes.extend(line);
    }
    Ok(seed)
}

fn line_bytes(line: &str) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    let mut rest = line.trim();
    while !rest.is_empty() && !rest.starts_with('#') {
        if let Some(quoted) = rest.strip_prefix('"') {
            let (text, behind) = quoted.split_once('"').ok_or("a text without its second \"")?;
            bytes.extend(text.bytes());
            rest = behind.trim_start();
            continue;
        }
        let (word, behind) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
        bytes.extend(
            word_bytes(word)
                .ok_or_else(|| format!("{word:?} is neither hex digits nor HH*COUNT"))?,
        );
        rest = behind.trim_start();
    }
    Ok(bytes)
}

fn word_bytes(word: &str) -> Option<Vec<u8>> {
    let (digits, count) = match word.split_once('*') {
        Some((digits, count)) => (digits, count.parse().ok()?),
        None => (word, 1),
    };
    let is_hex = !digits.is_empty()
        && digits.len().is_multiple_of(2)
        && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    if !is_hex {
        return None;
    }
    let bytes = (0..digits.len()).step_by(2).map(|at| u8::from_str_radix(&digits[at..at + 2], 16));
    Some(bytes.collect::<Result<Vec<u8>, _>>().ok()?.repeat(count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hex_text_is_digits_repeats_text_and_comments() {
        assert_eq!(
            line_bytes(r#"1B "01#" 0A0d*2 # the rest"#),
            Ok(b"\x1B01#\x0A\x0D\x0A\x0D".to_vec())
        );
        assert_eq!(line_bytes("  # nothing"), Ok(Vec::new()));
        for wrong in ["1", "1G", "*3", "00*x", "1B\"01\"", "\"open"] {
            assert!(line_bytes(wrong).is_err(), "{wrong}");
        }
    }
}
