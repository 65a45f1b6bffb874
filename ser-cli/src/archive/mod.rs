//! Archives as commands use them: opening one, and what its errors mean for the user.

mod amounts;
mod incidents;
mod sites;
mod zone;

use std::ffi::OsStr;

use clap::builder::{StringValueParser, TypedValueParser};
use ser_archive::{Access, Archive, Error, Place};
use ser_console::Harmless;
use ser_files::report::ArchiveHead;

use crate::error::{Failure, Result};
use crate::output::PROGRAM;

pub(crate) use amounts::{parse_keep, parse_size};
pub(crate) use incidents::{IncidentName, NamedEntry};
pub(crate) use sites::Versions;
pub(crate) use zone::{given_site, utc_text};

/// The archive that a command is about.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct ArchiveArgs {
    /// The archive: a file, or `postgres://USER@HOST/DATABASE`.
    ///
    /// The password of a database comes from ~/.pgpass, or from PGPASSWORD.
    #[arg(
        long,
        env = "SER_ARCHIVE",
        hide_env_values = true,
        value_name = "PLACE",
        value_parser = PlaceParser
    )]
    archive: Option<Place>,
}

/// Understands where an archive is. An address that is refused may hold a password, and is not
/// repeated.
#[derive(Clone)]
pub(crate) struct PlaceParser;

impl TypedValueParser for PlaceParser {
    type Value = Place;

    fn parse_ref(
        &self,
        command: &clap::Command,
        argument: Option<&clap::Arg>,
        value: &OsStr,
    ) -> std::result::Result<Place, clap::Error> {
        let text = StringValueParser::new().parse_ref(command, argument, value)?;
        text.parse().map_err(|error| {
            let message = format!("--archive: {error}\n");
            clap::Error::raw(clap::error::ErrorKind::ValueValidation, message).with_cmd(command)
        })
    }
}

/// Whether this program can use such an archive.
pub(crate) fn available(place: &Place) -> Result<()> {
    match place {
        Place::Postgres(_) if !cfg!(feature = "postgres") => {
            Err(Failure::usage(format!("{place}: this program was built without PostgreSQL"))
                .hint("cargo install --path ser-cli --features postgres builds one with it"))
        }
        _ => Ok(()),
    }
}

impl ArchiveArgs {
    /// Where it is, if anybody says so.
    pub(crate) fn named(&self) -> Option<&Place> {
        self.archive.as_ref()
    }

    /// Where it is.
    pub(crate) fn place(&self) -> Result<&Place> {
        self.archive.as_ref().ok_or_else(|| {
            Failure::usage("which archive? Neither --archive nor SER_ARCHIVE names one")
                .hint("name it, as in --archive plant.db")
        })
    }

    /// Opens it to read.
    pub(crate) fn read(&self) -> Result<Archive> {
        read(self.place()?)
    }

    /// Opens one that is there to write to it.
    pub(crate) fn write(&self) -> Result<Archive> {
        let place = self.place()?;
        // Only who collects makes archives: a name that is misspelled is no new one.
        read(place)?;
        Ok(Archive::open(place, Access::Write { program: PROGRAM })?)
    }
}

/// Opens an archive to read.
pub(crate) fn read(place: &Place) -> Result<Archive> {
    available(place)?;
    Ok(Archive::open(place, Access::Read)?)
}

/// Where the chains of an archive end.
pub(crate) fn heads(archive: &mut Archive) -> Result<Vec<ArchiveHead>> {
    let heads = archive.heads()?.into_iter().map(|head| ArchiveHead {
        recorder: head.recorder,
        collector: head.collector,
        digest: hex(&head.digest),
    });
    Ok(heads.collect())
}

/// A digest as 64 hexadecimal digits.
pub(crate) fn hex(digest: &[u8; 32]) -> String {
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

impl From<Error> for Failure {
    fn from(error: Error) -> Failure {
        let failure = Failure::new(Harmless(&error).line()).passing(error.may_pass());
        match error {
            Error::Missing { .. } => failure.hint(
                "check its name, and that its folder is there; ser-cli collect makes archives",
            ),
            Error::NotOurs { .. } => {
                failure.hint("files that read or watch wrote are given with --input")
            }
            Error::Newer { .. } => failure.hint("use that program, or a later one"),
            Error::Busy { .. } => failure.hint("try again, or end the other program first"),
            Error::Lost { .. } => {
                failure.hint("check the network and the server, and run the command again")
            }
            Error::KeepsTooLittle { .. } => failure.hint("keep more than that"),
            Error::Full { .. } => failure.hint("make room on the disk, or keep less"),
            Error::Damaged { .. } => failure
                .hint("ser-cli archive verify says up to where it is as it was written")
                .hint("go on with a backup, or with the archive of another collector"),
            Error::NoPlace { .. } => failure
                .hint("read --new and watch name lives and sequences; entries by number have none"),
            Error::Database { .. } | Error::WriterGone => {
                failure.hint("check the archive's name, your rights to it, and the server's log")
            }
        }
    }
}
