//! The versions of the site file that an archive holds, and which was valid when.

use std::collections::BTreeMap;

use ser_archive::Archive;
use ser_evidence::record::Record;
use ser_evidence::site::{self, Site};
use ser_evidence::time::{Moment, Utc};

use crate::error::{Result, warn};

/// The versions of the site file, by the time from which on they were in use.
#[derive(Clone, Debug, Default)]
pub(crate) struct Versions {
    /// Microseconds of UTC, and the texts.
    by_time: BTreeMap<i64, String>,
}

impl Versions {
    /// All versions in an archive. Each is there for every recorder.
    pub(crate) fn of(archive: &mut Archive) -> Result<Versions> {
        let mut versions = Versions::default();
        archive.of_kind("site", &mut |_, record| {
            if let Record::Site(version) = record {
                versions.by_time.insert(version.at.utc.us(), version.text);
            }
            Ok(())
        })?;
        Ok(versions)
    }

    /// The site as it was known at a time: by the last version before it, else by the first one.
    /// One that cannot be read is told, and passed over.
    pub(crate) fn at(&self, time: Moment<Utc>) -> Option<Site> {
        let before = self.by_time.range(..=time.us()).rev();
        let after = self.by_time.range(time.us()..);
        before.chain(after).find_map(|(_, text)| {
            let site = site::inspect(text).site;
            if site.is_none() {
                warn("a version of the site file in the archive cannot be read any more");
            }
            site
        })
    }

    /// The newest.
    pub(crate) fn newest(&self) -> Option<Site> {
        self.at(Moment::from_us(i64::MAX))
    }
}
