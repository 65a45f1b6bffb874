//! What a browser makes of the page: Debian's Chromium, without a window.

use std::fs;
use std::path::PathBuf;

use serde_json::Value;

use super::browser::Browser;
use super::incident::{HOSTILE, Incident};

/// A screen and a telephone.
const SIZES: [(u32, u32); 2] = [(1300, 900), (420, 800)];

/// The names of the times on the axis of the first picture.
const LABELS: &str = "return [...document.querySelector('figure.picture').querySelectorAll('.ticks \
     text')].map(text => text.textContent)";

fn strings(value: &Value) -> Vec<String> {
    let texts = value.as_array().expect("a list").iter();
    texts.map(|text| text.as_str().expect("a text").to_owned()).collect()
}

/// Presses the button with this text in the first picture.
fn press(browser: &Browser, text: &str) {
    browser.eval(&format!(
        "[...document.querySelector('figure.picture').querySelectorAll('button')]\
         .find(button => button.textContent === '{text}').click()"
    ));
}

#[test]
#[ignore = "needs chromedriver: cargo xtask test"]
fn names_are_shown_letter_by_letter_and_nothing_runs() {
    let (incident, browser) = (Incident::trip(), Browser::start());
    browser.open(&incident.page());
    let shown =
        browser.eval("return [...document.querySelectorAll('td a')].map(a => a.textContent)");
    let shown = strings(&shown);
    for name in HOSTILE {
        assert!(shown.contains(&name.to_owned()), "{name}: {shown:?}");
    }
    let title = browser.eval("return document.title");
    assert!(title.as_str().is_some_and(|title| title.starts_with("Northfield <1> ")), "{title}");
    assert_eq!(browser.eval("return document.querySelectorAll('img, b, iframe').length"), 0);
    assert_eq!(browser.console(), Vec::<String>::new());
}

#[test]
#[ignore = "needs chromedriver: cargo xtask test"]
fn the_picture_can_be_zoomed_and_is_drawn_as_the_program_drew_it() {
    let (incident, browser) = (Incident::trip(), Browser::start());
    browser.show_as(SIZES[0], "light");
    browser.open(&incident.page());
    let drawn = strings(&browser.eval(LABELS));
    assert_eq!(drawn[..3], ["0", "100 ms", "200 ms"], "{drawn:?}");
    let places = "return [...document.querySelectorAll('#lane-0 [data-a]')].map(e => \
         Math.round(Number(e.getAttribute('x') ?? e.getAttribute('x1'))))";
    let before = browser.eval(places);
    press(&browser, "first 100 ms");
    let early = strings(&browser.eval(LABELS));
    assert_eq!(early, ["0", "20 ms", "40 ms", "60 ms", "80 ms", "100 ms"]);
    press(&browser, "whole");
    assert_eq!(strings(&browser.eval(LABELS)), drawn, "script and program agree on the axis");
    assert_eq!(browser.eval(places), before, "and on where things are");

    browser.keys("figure.picture .scroll", "+");
    let closer = strings(&browser.eval(LABELS));
    assert_ne!(closer, drawn);
    browser.keys("figure.picture .scroll", "0");
    assert_eq!(strings(&browser.eval(LABELS)), drawn);

    let place = browser.eval(
        "document.querySelector('figure.picture').scrollIntoView({block: 'center', behavior: \
         'instant'}); const place = document.querySelector('figure.picture svg')\
         .getBoundingClientRect(); return [place.x + place.width * 0.3, place.y + place.height / 2, \
         place.x + place.width * 0.4].map(Math.round)",
    );
    let place = |index: usize| place[index].as_i64().expect("a number");
    browser.drag((place(0), place(1)), (place(2), place(1)));
    let marked = strings(&browser.eval(LABELS));
    assert_ne!(marked, drawn, "what was marked is shown");
    assert_eq!(browser.eval("return document.querySelectorAll('.picked').length"), 0);
    assert_eq!(browser.console(), Vec::<String>::new());
}

#[test]
#[ignore = "needs chromedriver: cargo xtask test"]
fn a_row_shows_its_lane_and_chatter_unfolds() {
    let (incident, browser) = (Incident::trip(), Browser::start());
    browser.show_as((1300, 3000), "light");
    browser.open(&incident.page());
    browser.click("tr[data-lane='2'] td.time");
    let lit =
        browser.eval("return [...document.querySelectorAll('.lane.lit')].map(lane => lane.id)");
    assert_eq!(strings(&lit)[0], "lane-2");
    let open = "return [...document.querySelectorAll('details')].map(details => details.open)";
    assert_eq!(browser.eval(open), serde_json::json!([false]));
    browser.click("details summary");
    assert_eq!(browser.eval(open), serde_json::json!([true]));
    assert_eq!(browser.eval("return document.querySelectorAll('details li').length"), 15);
}

#[test]
#[ignore = "needs chromedriver: cargo xtask test"]
fn two_thousand_rows_are_a_page_that_still_zooms() {
    let (incident, browser) = (Incident::of(2_000), Browser::start());
    browser.open(&incident.page());
    assert_eq!(
        browser.eval("return document.querySelectorAll('tbody tr[data-lane]').length"),
        2_000
    );
    press(&browser, "first 100 ms");
    assert_eq!(strings(&browser.eval(LABELS)), ["0", "20 ms", "40 ms", "60 ms", "80 ms", "100 ms"]);
    assert_eq!(browser.console(), Vec::<String>::new());
}

#[test]
#[ignore = "needs chromedriver: cargo xtask test"]
fn it_prints_on_the_papers_of_both_worlds() {
    let (incident, browser) = (Incident::trip(), Browser::start());
    browser.open(&incident.page());
    for (name, paper) in [("a4", (21.0, 29.7)), ("letter", (21.59, 27.94))] {
        let pdf = browser.pdf(paper);
        assert!(pdf.starts_with(b"%PDF-") && pdf.len() > 20_000, "{name}: {}", pdf.len());
        fs::write(shown_in().join(format!("{name}.pdf")), pdf).expect("a file");
    }
}

/// Where pictures of pages are left, for people to look at.
fn shown_in() -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("pages");
    fs::create_dir_all(&folder).expect("a folder");
    folder
}

mod needs_axe_core {
    use super::*;

    #[test]
    #[ignore = "needs axe-core: cargo xtask test"]
    fn nothing_keeps_anybody_from_reading_it() {
        let axe = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
        let axe = axe.parent().expect("a folder").join("axe/node_modules/axe-core/axe.min.js");
        let axe = fs::read_to_string(axe).expect("cargo xtask test installs axe-core");
        let (incident, browser) = (Incident::trip(), Browser::start());
        for size in SIZES {
            for scheme in ["light", "dark"] {
                browser.show_as(size, scheme);
                browser.open(&incident.page());
                let name = format!("{scheme}-{}.png", size.0);
                fs::write(shown_in().join(name), browser.picture()).expect("a file");
                browser.eval(&axe);
                let found = browser.eval_later(
                    "const done = arguments[0]; axe.run().then(found => done(found.violations\
                     .map(found => found.impact + ': ' + found.id + ' ' + \
                     found.nodes.map(node => node.html).join(' '))))",
                );
                assert_eq!(strings(&found), Vec::<String>::new(), "{scheme} {size:?}");
            }
        }
    }
}
