//! Files of keys in minisign's format, and the passwords of those that are secret.
//!
//! A secret key is a file of two lines that only its owner reads, encrypted by a password. A public
//! one is for everybody. Both are known by the same number of 16 hexadecimal digits.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use base64::Engine;
use minisign::{PublicKey, PublicKeyBox, SecretKey, SecretKeyBox};

use crate::error::{Failure, Result, inform};

/// Where a password may be given without a terminal.
pub(super) const PASSWORD: &str = "SER_SIGN_PASSWORD";

/// The longest file of a key or of a signature, in bytes; ours have a few hundred.
const MAX_LEN: u64 = 16_384;

/// How the second line of a secret key begins and how long it is: with a password, and without.
const ENCRYPTED: &str = "RWRTY0Iy";
const PLAIN: &str = "RWQAAEIy";
const SECRET_LEN: usize = 212;

/// Its last bytes.
const CHECKSUM_LEN: usize = 32;

/// A small file of text.
pub(super) fn read_text(path: &Path) -> Result<String> {
    let failed = |error: &io::Error| Failure::reading(path.display(), error);
    let mut text = Vec::new();
    let file = File::open(path).map_err(|error| failed(&error))?;
    file.take(MAX_LEN + 1).read_to_end(&mut text).map_err(|error| failed(&error))?;
    let is_short = u64::try_from(text.len()).is_ok_and(|len| len <= MAX_LEN);
    match String::from_utf8(text) {
        Ok(text) if is_short => Ok(text),
        _ => Err(Failure::new(format!("{} is no file of minisign's format", path.display()))
            .hint("name the file of a key, or the signature that ends in .minisig")),
    }
}

/// The secret key in a file. Its password is asked for if it has one.
pub(super) fn secret(path: &Path) -> Result<SecretKey> {
    let text = read_text(path)?;
    let line = text.lines().nth(1).unwrap_or_default().trim_end();
    let is_encrypted = line.starts_with(ENCRYPTED);
    if line.len() != SECRET_LEN || !(is_encrypted || line.starts_with(PLAIN)) {
        return Err(Failure::new(format!("{} is not a secret key", path.display()))
            .hint("ser-cli report key makes one; minisign -G does, too"));
    }
    let boxed = SecretKeyBox::from(text.clone());
    let key = match is_encrypted {
        true => SecretKey::from_box(boxed, Some(password_of(path)?)),
        false => SecretKey::from_unencrypted_box(boxed)
            .or_else(|error| without_checksum(line).ok_or(error)),
    };
    key.map_err(|error| {
        let failure = Failure::new(format!("{} cannot be used: {error}", path.display()));
        match is_encrypted {
            true => failure.hint(format!("the password is asked for, unless {PASSWORD} is set")),
            false => failure.hint("the file is damaged: use a copy of it"),
        }
    })
}

/// A secret key that minisign has made without a password: it writes no checksum into such a file,
/// and the library demands one. That the key is whole is seen when it has signed.
fn without_checksum(line: &str) -> Option<SecretKey> {
    let bytes = base64::engine::general_purpose::STANDARD.decode(line).ok()?;
    let checksum = bytes.get(bytes.len().checked_sub(CHECKSUM_LEN)?..)?;
    if checksum.iter().any(|&byte| byte != 0) {
        return None;
    }
    SecretKey::from_bytes(&bytes).ok()
}

/// The public key in a file.
pub(super) fn public(path: &Path) -> Result<PublicKey> {
    let text = read_text(path)?;
    PublicKey::from_box(PublicKeyBox::from(text)).map_err(|error| {
        Failure::new(format!("{} is not a public key: {error}", path.display()))
            .hint("the public key is the file that ends in .pub")
    })
}

/// The number that a key pair and its signatures share, as minisign writes it.
pub(super) fn number(keynum: &[u8]) -> String {
    keynum.iter().rev().map(|byte| format!("{byte:02X}")).collect()
}

fn password_of(path: &Path) -> Result<String> {
    if let Some(given) = given()? {
        return Ok(given);
    }
    ask(&format!("Password of {}: ", ser_console::Harmless(path.display()).line()))
}

/// A password for a new key; `None` for a key without.
pub(super) fn new_password(without: bool) -> Result<Option<String>> {
    if without {
        return Ok(None);
    }
    if let Some(given) = given()? {
        return Ok(Some(given));
    }
    let first = ask("Password of the new key: ")?;
    if first.is_empty() {
        return Err(Failure::usage("a key without a password is for whoever has its file")
            .hint("if that is wanted, say so with --no-password"));
    }
    if ask("The same again: ")? != first {
        return Err(Failure::new("these were two different passwords").hint("try again"));
    }
    Ok(Some(first))
}

/// The password of the environment, if there is one.
fn given() -> Result<Option<String>> {
    match std::env::var(PASSWORD) {
        Ok(given) if given.is_empty() => Ok(None),
        Ok(given) => Ok(Some(given)),
        Err(std::env::VarError::NotPresent) => Ok(None),
        Err(std::env::VarError::NotUnicode(_)) => {
            Err(Failure::usage(format!("{PASSWORD} is no text")).hint("passwords are UTF-8"))
        }
    }
}

fn ask(question: &str) -> Result<String> {
    rpassword::prompt_password(question).map_err(|error| {
        Failure::new(format!("no terminal to ask for the password: {error}"))
            .hint(format!("without a terminal, give it in the variable {PASSWORD}"))
    })
}

/// Says that a key is worked out of its password, which takes a second on purpose.
pub(super) fn tell_slow() {
    inform("working out the key of this password …");
}
