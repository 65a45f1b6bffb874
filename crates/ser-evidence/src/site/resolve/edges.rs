//! Expectations, and the changes of points that they name.

use std::collections::BTreeMap;

use toml::Spanned;

use super::names::Names;
use crate::site::checks::{bad_edge, duplicate_name, same_edge};
use crate::site::diagnostic::{Findings, Span};
use crate::site::file::{EdgeText, ExpectTable, SiteTable};
use crate::site::model::{Edge, Expectation};

/// All expectations that could be understood.
pub(super) fn expectations(
    table: &SiteTable,
    names: &Names<'_>,
    findings: &mut Findings,
) -> Vec<Expectation> {
    let mut taken = BTreeMap::<&str, Span>::new();
    let mut expectations = Vec::new();
    for expect in &table.expectations {
        if let Some(name) = &expect.name {
            match taken.get(name.get_ref().as_str()) {
                Some(first) => {
                    let twice = (name.span(), name.get_ref().as_str());
                    duplicate_name::found(findings, twice, "expectations", first.clone());
                }
                None => drop(taken.insert(name.get_ref(), name.span())),
            }
        }
        expectations.extend(expectation(expect, table, names, findings));
    }
    expectations
}

fn expectation(
    expect: &ExpectTable,
    table: &SiteTable,
    names: &Names<'_>,
    findings: &mut Findings,
) -> Option<Expectation> {
    let mut edge_of =
        |text: &Option<EdgeText>| text.as_ref().and_then(|text| edge(text, table, names, findings));
    // Both are looked at before either is given up.
    let (after, then) = (edge_of(&expect.after), edge_of(&expect.then));
    let (after, then) = (after?, then?);
    if after == then {
        let span = |text: &Option<EdgeText>| {
            text.as_ref().map(|text| text.text.span()).unwrap_or_default()
        };
        same_edge::found(findings, span(&expect.then), span(&expect.after));
    }
    let name = expect.name.as_ref()?.get_ref().clone();
    Some(Expectation { name, after, then, within_us: expect.within_us? })
}

fn edge(
    EdgeText { key, text }: &EdgeText,
    table: &SiteTable,
    names: &Names<'_>,
    findings: &mut Findings,
) -> Option<Edge> {
    let (point, on) = match text.get_ref().rsplit_once(char::is_whitespace) {
        Some((point, "on")) => (point, true),
        Some((point, "off")) => (point, false),
        _ => {
            let meant = meant(text.get_ref(), table, findings);
            bad_edge::found(findings, (text.span(), text.get_ref()), key, meant);
            return None;
        }
    };
    let point = names.point(text.span(), point.trim(), findings)?;
    Some(Edge { point, on })
}

/// The edge that was probably meant: with another case, or by the text of the state.
fn meant(text: &str, table: &SiteTable, findings: &mut Findings) -> Option<String> {
    if let Some((point, last)) = text.rsplit_once(char::is_whitespace)
        && ["on", "off"].contains(&last.to_ascii_lowercase().as_str())
    {
        return Some(format!("{} {}", point.trim(), last.to_ascii_lowercase()));
    }
    if !findings.may_compare(table.points.len()) {
        return None;
    }
    table.points.iter().find_map(|point| {
        let name: &Spanned<String> = point.name.as_ref()?;
        // The name of a recorder may stand before it.
        let (before, state) = text.split_once(name.get_ref().as_str())?;
        let says = |state_text: &Option<String>| state_text.as_deref() == Some(state.trim());
        let word = match (says(&point.on), says(&point.off)) {
            (true, _) => "on",
            (_, true) => "off",
            _ => return None,
        };
        Some(format!("{before}{} {word}", name.get_ref()))
    })
}
