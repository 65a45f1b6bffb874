//! A time zone that is not in the time zone database.
//!
//! Why: local times could not be shown.
//!
//! Bad:
//! ```toml
//! site = "Northfield"
//! time_zone = "Europe/Berln"
//! ```
//! Good:
//! ```toml
//! site = "Northfield"
//! time_zone = "Europe/Berlin"
//! ```

use jiff::tz::TimeZone;

use crate::site::diagnostic::{Diagnostic, Findings, Span, quoted};
use crate::site::nearest::nearest;

/// The name of this check.
pub(in crate::site) const NAME: &str = "unknown-zone";

/// The zone called `name`.
pub(in crate::site) fn zone(
    findings: &mut Findings,
    (span, name): (Span, &str),
) -> Option<TimeZone> {
    if let Ok(zone) = TimeZone::get(name) {
        return Some(zone);
    }
    let names: Vec<_> = jiff::tz::db().available().map(|name| name.to_string()).collect();
    let near = nearest(name, names.iter().map(String::as_str), findings).or_else(|| {
        // `Berlin`, or `CET/Berlin`.
        let city = name.rsplit('/').next().filter(|city| !city.is_empty())?.replace(' ', "_");
        let is_city = |name: &&String| {
            name.rsplit('/').next().is_some_and(|last| last.eq_ignore_ascii_case(&city))
        };
        names.iter().find(is_city).map(String::as_str)
    });
    let phrase = format!("no time zone is called {}", quoted(name));
    let help = match near {
        Some(near) => format!("did you mean {}?", quoted(near)),
        None => "zones are called as in `Europe/Berlin`, `America/New_York` or `UTC`".to_owned(),
    };
    findings.add(Diagnostic::error(NAME, span, phrase).help(help));
    None
}
