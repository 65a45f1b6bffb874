//! `report key`: a key pair to sign reports with.

use std::io::Write;
use std::path::{Path, PathBuf};

use minisign::KeyPair;

use super::keys;
use crate::error::{Failure, Result, inform};
use crate::new_files::NewFiles;

const EXAMPLES: &str = "\
Examples:
  ser-cli report key -o anna                 anna.key, and anna.pub for others
  ser-cli report --site a.toml -o t.html --sign anna.key
  ser-cli report verify t.html --key anna.pub

Whoever has NAME.key and its password signs in your name: keep it to yourself, and a copy in a safe \
place, because nobody can make it again. Give NAME.pub to everybody who is to check your signatures. \
The password is asked for on the terminal; SER_SIGN_PASSWORD gives it to scripts.
minisign can use both files, and keys made by minisign -G can be used here.";

/// Make a key pair to sign reports with. Existing files are never overwritten.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// The name of both files, without .key and .pub.
    #[arg(short, long, value_name = "NAME")]
    output: PathBuf,

    /// Make a key that needs no password, for whoever has the file.
    #[arg(long)]
    no_password: bool,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let (secret_path, public_path) = (with(&args.output, ".key"), with(&args.output, ".pub"));
    let mut files = NewFiles::new(false);
    let mut secret_file = files.create_private(&secret_path)?;
    let mut public_file = files.create(&public_path)?;
    let failed = |error: minisign::PError| {
        Failure::new(format!("no key could be made: {error}")).hint("try again")
    };
    let pair = match keys::new_password(args.no_password)? {
        None => KeyPair::generate_unencrypted_keypair(),
        Some(password) => {
            keys::tell_slow();
            KeyPair::generate_encrypted_keypair(Some(password))
        }
    };
    let pair = pair.map_err(failed)?;
    let number = keys::number(pair.pk.keynum());
    let comment = format!("secret key {number} for reports");
    let secret = pair.sk.to_box(Some(&comment)).map_err(failed)?.into_string();
    let public = pair.pk.to_box().map_err(failed)?.into_string();
    secret_file
        .write_all(secret.as_bytes())
        .map_err(|error| Failure::writing(secret_path.display(), &error))?;
    public_file
        .write_all(public.as_bytes())
        .map_err(|error| Failure::writing(public_path.display(), &error))?;
    files.finish()?;
    inform(format_args!(
        "key {number}: {} is yours alone, {} is for everybody",
        secret_path.display(),
        public_path.display()
    ));
    Ok(())
}

/// A name with this ending.
fn with(name: &Path, ending: &str) -> PathBuf {
    let mut name = name.as_os_str().to_owned();
    name.push(ending);
    PathBuf::from(name)
}
