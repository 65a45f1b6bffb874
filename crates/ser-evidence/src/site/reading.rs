//! From the text of a site file to the site, in stages: text, a document that keeps its places,
//! plain structs, the resolved site. Each stage goes on after an error, so that all errors are told
//! at once.

use toml::Spanned;
use toml::de::{DeTable, Error};

use super::checks::{
    ambiguous_point, bad_edge, missing_key, no_recorder, same_as, same_edge, syntax, too_large,
    unknown_group, unknown_point, unknown_recorder, wrong_type,
};
use super::diagnostic::{Diagnostic, Findings, Span};
use super::digest::SiteDigest;
use super::file::SiteTable;
use super::model::{RecorderId, Site};
use super::resolve::resolve;

/// What a site file says, and what is to be said about it.
#[derive(Clone, Debug)]
pub struct Reading {
    /// The site; `None` if there are errors.
    pub site: Option<Site>,
    /// Errors and warnings, in the order of the text.
    pub diagnostics: Vec<Diagnostic>,
    /// Where the ports are, for a check by those who know what a port is.
    pub ports: Vec<PortPlace>,
}

/// A port of the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PortPlace {
    /// The recorder that is reached by it.
    pub recorder: RecorderId,
    /// The port as it is written.
    pub port: String,
    /// Where it is written.
    pub span: Span,
}

/// Reads a site file.
///
/// # Errors
/// All of them, and the warnings, in the order of the text.
///
/// ```
/// let site = "site = \"Northfield\"\ntime_zone = \"Europe/Berlin\"\n";
/// assert_eq!(ser_evidence::site::read(site).unwrap().name, "Northfield");
///
/// let wrong = ser_evidence::site::read(&site.replace("time_zone", "timezone")).unwrap_err();
/// assert_eq!(wrong[1].phrase, "unknown key `timezone` in the site");
/// ```
pub fn read(text: &str) -> Result<Site, Vec<Diagnostic>> {
    let reading = inspect(text);
    reading.site.ok_or(reading.diagnostics)
}

/// Reads a site file, and tells the warnings of a good one, too.
#[must_use]
pub fn inspect(text: &str) -> Reading {
    let mut findings = Findings::default();
    if !too_large::passes(&mut findings, text) {
        return Reading { site: None, diagnostics: findings.into_list(), ports: Vec::new() };
    }
    let (document, errors) = parse(text);
    let table = SiteTable::read(&document, &mut findings);
    let site = resolve(&table, SiteDigest::of(text), &mut findings);
    tell_syntax(text, &errors, &mut findings);
    let site = site.filter(|_| errors.is_empty());
    Reading { site, diagnostics: findings.into_list(), ports: ports(&table) }
}

/// The document, and what is not TOML. Each such place takes memory, so of a very large text only
/// the first is told.
fn parse(text: &str) -> (Spanned<DeTable<'_>>, Vec<Error>) {
    const LARGE: usize = 1 << 20;
    if text.len() <= LARGE {
        return DeTable::parse_recoverable(text);
    }
    match DeTable::parse(text) {
        Ok(document) => (document, Vec::new()),
        Err(error) => (Spanned::new(0..0, DeTable::new()), vec![error]),
    }
}

fn ports(table: &SiteTable) -> Vec<PortPlace> {
    let place = |(index, table): (usize, &super::file::RecorderTable)| {
        let port = table.port.as_ref()?;
        let recorder = RecorderId(index);
        Some(PortPlace { recorder, port: port.get_ref().clone(), span: port.span() })
    };
    table.recorders.iter().enumerate().filter_map(place).collect()
}

/// Tells what is not TOML. What was found in the rest is told only where a text that was not
/// understood could not have made it right.
fn tell_syntax(text: &str, errors: &[Error], findings: &mut Findings) {
    const MAY_BE_RIGHT: [&str; 10] = [
        ambiguous_point::NAME,
        bad_edge::NAME,
        missing_key::NAME,
        no_recorder::NAME,
        same_as::NAME,
        same_edge::NAME,
        unknown_group::NAME,
        unknown_point::NAME,
        unknown_recorder::NAME,
        wrong_type::NAME,
    ];
    if errors.is_empty() {
        return;
    }
    let starts: Vec<usize> = errors.iter().filter_map(Error::span).map(|span| span.start).collect();
    let lines: Vec<Span> = starts.iter().take(1000).map(|&at| line_around(text, at)).collect();
    findings.retain(|found| {
        let is_beside = |line: &Span| found.span.start <= line.end && line.start <= found.span.end;
        !MAY_BE_RIGHT.contains(&found.check) && !lines.iter().any(is_beside)
    });
    errors.iter().for_each(|error| syntax::told(findings, text, error));
}

/// The line that a place is in.
fn line_around(text: &str, at: usize) -> Span {
    let (before, after) = text.split_at_checked(at).unwrap_or((text, ""));
    let start = before.rfind('\n').map_or(0, |end| end + 1);
    start..at + after.find('\n').unwrap_or(after.len())
}
