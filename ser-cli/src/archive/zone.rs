//! The site that an archive is shown with, and times in its zone.

use ser_archive::Archive;
use ser_evidence::site::Site;
use ser_evidence::time::{Moment, Utc};
use ser_files::report::Clock;

use super::Versions;
use crate::connection::ConnectionArgs;
use crate::error::Result;
use crate::gather;
use crate::site_file;

/// The site of the command line, else the newest one in the archive, else one of which only the zone
/// of this computer is known.
pub(crate) fn site_of(connection: &ConnectionArgs, archive: &mut Archive) -> Result<Site> {
    if let Some(path) = &connection.site {
        return site_file::load(path);
    }
    Ok(Versions::of(archive)?.newest().unwrap_or_else(gather::nameless_site))
}

/// A time as people of the site read it, to the millisecond, with its offset from UTC.
pub(crate) fn utc_text(site: &Site, at: Moment<Utc>) -> String {
    Clock::in_zone(site.time_zone.clone()).date_and_time_with_offset(at.us())
}
