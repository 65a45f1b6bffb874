//! The report as a page: one file that needs no network, reads without script, and prints.
//!
//! `tables` has the sections of words, `picture` the lanes. Style and script stand in the page; its
//! content policy allows just these two, by their digests, so that no name of a point can ever
//! become a script.

mod picture;
mod tables;

use std::fmt;
use std::io::{self, Write};

use maud::{DOCTYPE, Markup, PreEscaped, html};

use self::picture::Lanes;
use super::verdict::{self, Lists};
use super::{Clock, Document, outcome};

/// The most changes that a page shows. Beyond that nobody reads a page.
pub const MAX_ROWS: usize = 20_000;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// A first-out of more characters has smaller letters, and a line of its own.
const LONG: usize = 160;

/// What the page may do: nothing but use its own style and its own script.
const POLICY: &str = "default-src 'none'; base-uri 'none'; form-action 'none'; \
     style-src 'sha256-VhXaICZPYha/XRsjiq0LjFt/fdzcj6/O5MmmdMfhCJg='; \
     script-src 'sha256-B4nPhYYeaKp6dp+bY1Oygmy7txrcnNgi52xFwK6tjtE='";

/// Why there is no page.
#[derive(Debug)]
pub enum PageError {
    /// There are more changes than [`MAX_ROWS`].
    TooManyRows(usize),
    /// The page could not be written.
    Io(io::Error),
}

impl fmt::Display for PageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            PageError::TooManyRows(rows) => {
                write!(f, "a page shows up to {MAX_ROWS} changes, and these are {rows}")
            }
            PageError::Io(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for PageError {}

impl From<io::Error> for PageError {
    fn from(error: io::Error) -> PageError {
        PageError::Io(error)
    }
}

/// Writes a report as an HTML file.
///
/// # Errors
/// If there are too many rows, or if `out` does not take it.
pub fn write(out: &mut dyn Write, document: &Document<'_>) -> Result<(), PageError> {
    let rows = document.report.rows.len();
    if rows > MAX_ROWS {
        return Err(PageError::TooManyRows(rows));
    }
    let clock = outcome::clock(document);
    out.write_all(page(document, &clock).into_string().as_bytes())?;
    Ok(())
}

fn page(document: &Document<'_>, clock: &Clock) -> Markup {
    let (title, window) = (outcome::title(document), outcome::window(document, clock));
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                meta name="generator" content=(document.program);
                title { (title) " " (window) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                (content(document, clock))
                script { (PreEscaped(SCRIPT)) }
            }
        }
    }
}

/// Everything that is to be read.
fn content(document: &Document<'_>, clock: &Clock) -> Markup {
    let lanes = Lanes::new(document, clock);
    html! {
        header {
            h1 { (outcome::title(document)) }
            p.when { (outcome::window(document, clock)) }
        }
        main {
            (verdict(document, clock))
            (tables::made_from(document, clock))
            (tables::sequence(document, lanes.as_ref(), clock))
            (tables::timeless(document))
            @if let Some(lanes) = &lanes {
                section #picture aria-labelledby="picture-title" {
                    h2 #picture-title { "Picture" }
                    (picture::section(document, lanes, clock))
                }
            }
            (tables::groups(document, clock))
            (tables::steps(document))
            (tables::breakers(document))
            (tables::not_normal(document))
            (tables::missing(document))
        }
        footer {
            p { (super::sources::entries(document)) }
            @for head in super::sources::archive_heads(document) { p { (head) } }
            p { (super::sources::made_by(document)) }
        }
    }
}

/// The three lines that answer.
fn verdict(document: &Document<'_>, clock: &Clock) -> Markup {
    let Document { timeline, report, .. } = *document;
    let first = verdict::first_out(timeline, report, (&report.first_out, Lists::Short), clock);
    let operated = verdict::all_operated(document, Lists::Short);
    let wrong = verdict::wrong(document, Lists::Short);
    let items = |items: &[String], none: &str| match items {
        [] => html! { p { (none) } },
        [only] => html! { p { (only) } },
        several => html! { ul { @for item in several { li { (item) } } } },
    };
    let is_known = report.first_out.known().is_some();
    let is_long = first.chars().count() > LONG;
    html! {
        section.verdict.long[is_long] aria-label="Verdict" {
            div.first-out.doubtful[!is_known] { h2 { "First-out" } p { (first) } }
            div { h2 { "Operated" } (items(&operated, "no breaker")) }
            div.wrong[!wrong.is_empty()] { h2 { "Wrong" } (items(&wrong, "nothing")) }
        }
    }
}

#[cfg(test)]
mod tests {
    use base64::prelude::{BASE64_STANDARD, Engine as _};
    use sha2::{Digest, Sha256};

    use super::*;

    #[test]
    fn the_policy_allows_this_style_and_this_script() {
        let digest = |text: &str| BASE64_STANDARD.encode(Sha256::digest(text.as_bytes()));
        assert_eq!(
            POLICY,
            format!(
                "default-src 'none'; base-uri 'none'; form-action 'none'; style-src 'sha256-{}'; \
                 script-src 'sha256-{}'",
                digest(STYLE),
                digest(SCRIPT)
            )
        );
    }
}
