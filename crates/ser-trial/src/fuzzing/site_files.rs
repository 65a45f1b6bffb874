//! The site file, as people write it.

use ser_console::Harmless;
use ser_evidence::site::{Diagnostic, Reading, Site, SiteDigest, Span, inspect, read};

/// Of texts up to this length each line is left out in turn, in bytes.
const SHORT: usize = 4000;

/// `data` is a site file, in any encoding. It is read or refused. What is told of it lies in it, can
/// be shown to anybody, and is the same at every reading. What is read leads nowhere outside itself. A
/// comment at the end changes nothing. All of that holds also if any line is missing.
///
/// # Panics
/// When this does not hold.
pub fn site_files(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    check(&text);
    if text.len() > SHORT {
        return;
    }
    let lines: Vec<&str> = text.split_inclusive('\n').collect();
    for left_out in 0..lines.len() {
        let others = lines.iter().enumerate().filter(|&(line, _)| line != left_out);
        check(&others.map(|(_, line)| *line).collect::<String>());
    }
}

fn check(text: &str) {
    let reading = inspect(text);
    let again = inspect(text);
    assert_eq!(again.diagnostics, reading.diagnostics);
    assert_eq!(content(&again), content(&reading));
    for diagnostic in &reading.diagnostics {
        check_diagnostic(diagnostic, text);
    }
    let starts = reading.diagnostics.iter().map(|diagnostic| diagnostic.span.start);
    assert!(starts.is_sorted(), "in the order of the text");
    assert!(reading.ports.iter().all(|port| is_in(&port.span, text)));
    let has_errors = reading.diagnostics.iter().any(Diagnostic::is_error);
    assert_eq!(reading.site.is_none(), has_errors, "{:?}", reading.diagnostics);
    match (read(text), &reading.site) {
        (Ok(_), Some(site)) => check_site(site, text),
        (Err(told), None) => assert_eq!(told, reading.diagnostics),
        (read, inspected) => panic!("{read:?}, but {inspected:?}"),
    }
    if reading.site.is_some() && text.len() <= SHORT {
        let commented = inspect(&format!("{text}\n# That was all.\n"));
        assert_eq!(content(&commented), content(&reading));
    }
}

fn check_diagnostic(diagnostic: &Diagnostic, text: &str) {
    let Diagnostic { check, span, phrase, label, helps, related, .. } = diagnostic;
    assert!(!check.is_empty() && !phrase.is_empty(), "{diagnostic:?}");
    let others = related.iter().map(|related| &related.span);
    assert!(others.chain([span]).all(|span| is_in(span, text)), "{diagnostic:?}");
    let labels = related.iter().map(|related| &related.label);
    for line in [phrase, label].into_iter().chain(labels) {
        assert_eq!(Harmless(line).line(), *line, "{diagnostic:?}");
    }
    // Help may show several lines to copy.
    for help in helps.iter().flat_map(|help| help.split('\n')) {
        assert_eq!(Harmless(help).line(), help, "{diagnostic:?}");
    }
}

/// Whether a place lies in the text, between two characters at either end.
fn is_in(span: &Span, text: &str) -> bool {
    text.get(span.clone()).is_some()
}

fn check_site(site: &Site, text: &str) {
    assert_eq!(site.digest, Some(SiteDigest::of(text)));
    let recorders = site.recorders.len();
    for (index, recorder) in site.recorders.iter().enumerate() {
        assert_eq!(site.recorder(&recorder.name).map(|found| found.0), Some(index));
        let delays = recorder.delays;
        assert!([delays.closing_us, delays.opening_us].iter().all(|(least, most)| least <= most));
    }
    for (index, point) in site.points.iter().enumerate() {
        assert!(point.recorder.0 < recorders, "{point:?}");
        assert!((1..=32).contains(&point.input), "{point:?}");
        assert_eq!(site.point_at(point.recorder, point.input).map(|found| found.0), Some(index));
        assert!(point.group.is_none_or(|group| group.0 < site.groups.len()), "{point:?}");
        if let Some(same) = point.same_as {
            let partner = &site.points[same.0];
            assert_eq!(partner.same_as.map(|back| back.0), Some(index), "{partner:?}");
            assert_ne!(partner.recorder, point.recorder, "{partner:?}");
        }
    }
    for expected in &site.expectations {
        let edges = [expected.after, expected.then];
        assert!(edges.iter().all(|edge| edge.point.0 < site.points.len()), "{expected:?}");
        assert!(expected.within_us.0 <= expected.within_us.1, "{expected:?}");
    }
    assert!(site.observations.iter().all(|seen| seen.recorder.0 < recorders));
    for shift in &site.shifts {
        assert!(shift.recorder.0 < recorders && shift.from <= shift.to, "{shift:?}");
    }
}

/// What was read, without the digest of the text.
fn content(reading: &Reading) -> Option<String> {
    let site = reading.site.clone().map(|site| Site { digest: None, ..site })?;
    Some(format!("{site:?}"))
}
