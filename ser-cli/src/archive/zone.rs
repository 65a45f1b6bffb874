//! The site that an archive is shown with, and times in its zone.

use ser_evidence::site::Site;
use ser_evidence::time::{Moment, Utc};
use ser_files::report::Clock;

use crate::connection::ConnectionArgs;
use crate::error::Result;
use crate::site_file;

/// The site of the command line.
pub(crate) fn given_site(connection: &ConnectionArgs) -> Result<Option<Site>> {
    connection.site.as_deref().map(site_file::load).transpose()
}

/// A time as people of the site read it, to the millisecond, with its offset from UTC.
pub(crate) fn utc_text(site: &Site, at: Moment<Utc>) -> String {
    Clock::in_zone(site.time_zone.clone()).date_and_time_with_offset(at.us())
}
