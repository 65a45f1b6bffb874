//! A key that this table does not have.
//!
//! Why: a misspelled key would leave its default in force, and nobody would notice.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! drift_pmm = 20
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! drift_ppm = 20
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span, quoted, quoted_list};
use crate::site::nearest::nearest;

/// The name of this check.
pub(in crate::site) const NAME: &str = "unknown-key";

/// A key that `table` does not have; `elsewhere` are the tables that do have it.
pub(in crate::site) fn found(
    findings: &mut Findings,
    (span, key): (Span, &str),
    (table, keys): (&str, &[&str]),
    elsewhere: &[&str],
) {
    let diagnostic =
        Diagnostic::error(NAME, span, format!("unknown key {} in {table}", quoted(key)));
    let help = match (nearest(key, keys.iter().copied(), findings), elsewhere) {
        (Some(near), _) => format!("did you mean `{near}`?"),
        (None, []) => format!("{table} has {}", quoted_list(keys.iter().copied(), "and")),
        (None, others) => format!("`{key}` belongs to {}", others.join(" or ")),
    };
    findings.add(diagnostic.help(help));
}
