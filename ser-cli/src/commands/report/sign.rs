//! Signing a report: a signature in a file of its own beside it.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use minisign::{PublicKey, SecretKey};
use ser_console::Harmless;

use super::keys;
use crate::error::{Failure, Result, inform};
use crate::new_files::NewFiles;
use crate::output::PROGRAM;

/// What minisign programs show before anything is verified; anybody could have written it.
const UNTRUSTED: &str = "signature of a report";

/// The longest name in a comment, in characters.
const LONGEST_NAME: usize = 200;

/// What a signature says of a report, besides that it is the one.
pub(super) struct About<'a> {
    pub(super) site: &'a str,
    pub(super) site_digest: Option<&'a str>,
    pub(super) entries_digest: &'a [u8; 32],
}

/// A key that is ready, and the file for the signature.
pub(super) struct Signer {
    key: SecretKey,
    report: PathBuf,
    out: File,
}

impl Signer {
    /// Asks for the password of the key, if it has one, and begins the file of the signature.
    pub(super) fn new(key: &Path, report: &Path, files: &mut NewFiles) -> Result<Signer> {
        let key = keys::secret(key)?;
        let out = files.create(&signature_of(report))?;
        Ok(Signer { key, report: report.to_owned(), out })
    }

    /// Signs what is in `file` from its beginning on.
    pub(super) fn sign(mut self, file: &mut File, about: &About<'_>) -> Result<()> {
        let path = signature_of(&self.report);
        let failed = |error: &io::Error| Failure::writing(path.display(), error);
        file.seek(SeekFrom::Start(0)).map_err(|error| failed(&error))?;
        let comment = comment(&self.report, about, SystemTime::now());
        let signature = PublicKey::from_secret_key(&self.key).and_then(|public| {
            // What the key has signed is verified, so that a damaged key is noticed here.
            minisign::sign(Some(&public), &self.key, file, Some(&comment), Some(UNTRUSTED))
        });
        let signature = signature.map_err(|error| {
            Failure::new(format!("cannot sign {}: {error}", self.report.display()))
                .hint("nothing is written; without --sign the report is")
        })?;
        let text = signature.into_string();
        self.out.write_all(text.as_bytes()).map_err(|error| failed(&error))?;
        inform(format_args!(
            "signed with key {} in {}",
            keys::number(self.key.keynum()),
            path.display()
        ));
        Ok(())
    }
}

/// The file of the signature of a report.
pub(super) fn signature_of(report: &Path) -> PathBuf {
    let mut name = report.as_os_str().to_owned();
    name.push(".minisig");
    PathBuf::from(name)
}

/// Fields as minisign writes them, separated by tabs: it is signed as well.
fn comment(report: &Path, about: &About<'_>, now: SystemTime) -> String {
    let seconds = now.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs();
    let name = report.file_name().unwrap_or_default().to_string_lossy();
    let mut fields = vec![
        format!("timestamp:{seconds}"),
        format!("file:{}", field(&name)),
        "hashed".to_owned(),
        format!("program:{PROGRAM}"),
        format!("site:{}", field(about.site)),
    ];
    fields.extend(about.site_digest.map(|digest| format!("site_sha256:{digest}")));
    let entries: String = about.entries_digest.iter().map(|byte| format!("{byte:02x}")).collect();
    fields.push(format!("entries_sha256:{entries}"));
    fields.join("\t")
}

/// A name without anything that ends a field or a line.
fn field(name: &str) -> String {
    Harmless(name).line().chars().take(LONGEST_NAME).collect()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_comment_is_one_line_of_fields_whatever_names_hold() {
        let about = About {
            site: "North\tfield\nsite:other",
            site_digest: Some("ab"),
            entries_digest: &[0xCD; 32],
        };
        let at = SystemTime::UNIX_EPOCH + Duration::from_secs(1_796_000_000);
        let comment = comment(Path::new("folder/trip.html"), &about, at);
        let fields: Vec<&str> = comment.split('\t').collect();
        let entries = format!("entries_sha256:{}", "cd".repeat(32));
        assert_eq!(
            fields,
            [
                "timestamp:1796000000",
                "file:trip.html",
                "hashed",
                concat!("program:ser-cli ", env!("CARGO_PKG_VERSION")),
                r"site:North\tfield\nsite:other",
                "site_sha256:ab",
                entries.as_str(),
            ]
        );
        assert_eq!(comment.lines().count(), 1);
    }
}
