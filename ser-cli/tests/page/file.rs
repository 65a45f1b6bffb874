//! What is in the file, before any browser shows it.

use std::fs;

use super::incident::{HOSTILE, Incident};

fn page_of(incident: &Incident) -> String {
    fs::read_to_string(incident.page()).expect("UTF-8")
}

#[test]
fn the_page_needs_nothing_but_itself() {
    let page = page_of(&Incident::trip());
    for outside in ["http://", "https://", "src=", "url(\"", "@import", "<link", "<iframe"] {
        // The name of SVG's name space is no address that anybody asks.
        let page = page.replace("http://www.w3.org/2000/svg", "").replace("img src=x", "");
        assert!(!page.contains(outside), "{outside}");
    }
    let [script] = page.matches("<script").collect::<Vec<_>>()[..] else { panic!("one script") };
    assert_eq!(script, "<script");
    assert!(page.starts_with("<!DOCTYPE html><html lang=\"en\">"), "{}", &page[..100]);
}

#[test]
fn names_are_text_and_never_markup() {
    let page = page_of(&Incident::trip());
    for name in HOSTILE.iter().filter(|name| name.contains('<')) {
        assert!(!page.contains(name), "{name}");
        let escaped = name.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
        assert!(page.contains(&escaped.replace('"', "&quot;")), "{name}");
    }
    assert!(page.contains("<h1>Northfield &lt;1&gt;</h1>"));
}

#[test]
fn the_picture_and_the_table_are_there_without_script() {
    let page = page_of(&Incident::trip());
    for part in ["scope=\"col\">Δ first</th>", ">100 ms</text>", "chatter ×15, last +140.0 ms"] {
        assert!(page.contains(part), "{part}");
    }
    assert_eq!(page.matches("<tr class=\"remark loss\">").count(), 1, "the entry that is missing");
    assert!(page.contains("1 entry missing"));
}

#[test]
fn a_page_that_nobody_could_read_is_refused() {
    let output = Incident::of(20_001).report("-o trip.html");
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(told.contains("a page shows up to 20000 changes, and these are 20001"), "{told}");
    assert!(told.contains("--since and --until"), "{told}");
}

#[test]
fn a_file_is_written_as_a_whole_and_over_nothing() {
    let incident = Incident::trip();
    let page = incident.page();
    let output = incident.report("-o trip.html");
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("exists, and is not overwritten"));
    for (name, beginning) in [("a.txt", "Northfield"), ("a.json", "{"), ("a.HTM", "<!DOCTYPE")] {
        let output = incident.report(&format!("-o {name}"));
        assert_eq!(output.status.code(), Some(0), "{output:?}");
        let text = fs::read_to_string(page.with_file_name(name)).expect("a file");
        assert!(text.starts_with(beginning), "{name}: {text}");
    }
    let output = incident.report("-o trip.pdf");
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("name it .html, .txt or .json"));
}
