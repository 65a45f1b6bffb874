//! `report verify`: whether a report is the one that somebody has signed.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use minisign::{PublicKey, SignatureBones, SignatureBox};
use ser_console::Harmless;

use super::{keys, sign};
use crate::error::{Failure, Result};
use crate::gather::here;

const EXAMPLES: &str = "\
Examples:
  ser-cli report verify trip.html --key anna.pub

The signature is in trip.html.minisig beside the report. The output says with which key it was signed, \
when, and what else its comment says. The time is that of the computer that signed. Exit code 1: it is \
not what was signed, or it was signed with another key.
Any program of minisign verifies it as well: minisign -Vm trip.html -p anna.pub";

/// Whoever sends a public key with a report proves nothing.
const WHOSE: &str = "get the public key from whoever signed, and not together with the report";

/// The last line of a signature: 64 bytes in Base64.
const LAST_LEN: usize = 88;

/// Check that a report is what somebody has signed.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// The report.
    #[arg(value_name = "FILE")]
    report: PathBuf,

    /// The public key of who is said to have signed it.
    #[arg(long, value_name = "KEY.pub")]
    key: PathBuf,

    /// The signature, if it is not in FILE.minisig.
    #[arg(long, value_name = "FILE")]
    signature: Option<PathBuf>,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let key = keys::public(&args.key)?;
    let path = args.signature.clone().unwrap_or_else(|| sign::signature_of(&args.report));
    let signature = signature(&path)?;
    let report = Harmless(args.report.display()).line();
    check(&args.report, &report, (&key, &args.key), &signature)?;
    let comment = signature.trusted_comment().unwrap_or_default();
    let mut out = io::stdout().lock();
    writeln!(out, "{report} is what was signed")?;
    let key_file = Harmless(args.key.display()).line();
    writeln!(out, "{:<16}{} ({key_file})", "key", keys::number(key.keynum()))?;
    for field in comment.split('\t') {
        let (name, value) = told(field);
        writeln!(out, "{name:<16}{value}")?;
    }
    Ok(out.flush()?)
}

/// The signature in a file.
fn signature(path: &Path) -> Result<SignatureBox> {
    let text = keys::read_text(path)?;
    let damaged = |why: &dyn std::fmt::Display| {
        Failure::new(format!("{} is not a signature: {why}", path.display()))
            .hint("the signature is the file that ends in .minisig, with four lines")
    };
    // The library would look for bytes in it that are not there.
    let last = text.lines().nth(3).unwrap_or_default().trim();
    if last.len() != LAST_LEN || !last.ends_with("==") {
        return Err(damaged(&"its fourth line is not whole"));
    }
    SignatureBox::from_string(&text).map_err(|error| damaged(&error))
}

/// Checks the key, then the report, then the comment, each with words of its own.
fn check(
    path: &Path,
    report: &str,
    (key, key_file): (&PublicKey, &Path),
    signature: &SignatureBox,
) -> Result<()> {
    if key.keynum() != signature.keynum() {
        return Err(Failure::new(format!(
            "{report} was signed with another key: {}, and {} is {}",
            keys::number(signature.keynum()),
            key_file.display(),
            keys::number(key.keynum())
        ))
        .hint(WHOSE));
    }
    let mut file = File::open(path).map_err(|error| Failure::reading(report, &error))?;
    let of_content = SignatureBox::from(SignatureBones::from(signature.clone()));
    if minisign::verify(key, &of_content, &mut file, true, false, true).is_err() {
        return Err(Failure::new(format!(
            "{report} is not what was signed: it was changed, or the signature is of another file"
        ))
        .hint("get report and signature once more from whoever signed; do not rely on this one"));
    }
    file.seek(SeekFrom::Start(0)).map_err(|error| Failure::reading(report, &error))?;
    minisign::verify(key, signature, &mut file, true, false, true).map_err(|_| {
        Failure::new(format!(
            "{report} is what was signed, but the comment of its signature is not: it was changed, \
             so nobody knows when it was signed and of which site it is"
        ))
        .hint("get the signature once more from whoever signed")
    })
}

/// A field of a comment for people.
fn told(field: &str) -> (String, String) {
    let field = Harmless(field).line();
    match field.split_once(':') {
        Some(("timestamp", seconds)) => ("signed".to_owned(), time(seconds)),
        Some((name, value)) => (name.replace('_', " "), value.to_owned()),
        // Another program's comment, or what minisign says of the way it signs.
        None => ("comment".to_owned(), field),
    }
}

fn time(seconds: &str) -> String {
    let time = seconds.parse().ok().and_then(|seconds| jiff::Timestamp::from_second(seconds).ok());
    time.map_or_else(
        || seconds.to_owned(),
        |time| time.to_zoned_datetime(here()).strftime("%Y-%m-%d %H:%M:%S%:z").to_string(),
    )
}
