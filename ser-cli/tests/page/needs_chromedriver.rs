//! What a browser makes of the page: Debian's Chromium, without a window.

use std::fs;
use std::path::PathBuf;

use serde_json::Value;

use super::browser::Browser;
use super::incident::{CHATTER, HOSTILE, Incident};

/// A screen, and a small telephone.
const SIZES: [(u32, u32); 2] = [(1300, 900), (360, 800)];

/// The names of the times on the axis of the first chart.
const LABELS: &str = "return [...document.querySelector('figure.picture svg')\
     .querySelectorAll('.ticks text')].map(text => text.textContent)";

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
fn charts_are_zoomed_together() {
    let (incident, browser) = (Incident::crowded(), Browser::start());
    browser.show_as(SIZES[0], "light");
    browser.open(&incident.page());
    let axes = "return [...document.querySelector('figure.picture').querySelectorAll('svg')].map(\
         svg => [...svg.querySelectorAll('.ticks text')].map(text => text.textContent).join())";
    let drawn = strings(&browser.eval(axes));
    assert!(drawn.len() > 3 && drawn.iter().all(|axis| *axis == drawn[0]), "{drawn:?}");
    press(&browser, "first 100 ms");
    let early = strings(&browser.eval(axes));
    assert!(early.iter().all(|axis| axis == "0,20 ms,40 ms,60 ms,80 ms,100 ms"), "{early:?}");
    press(&browser, "whole");
    assert_eq!(strings(&browser.eval(axes)), drawn);
    assert_eq!(browser.console(), Vec::<String>::new());
}

#[test]
#[ignore = "needs chromedriver: cargo xtask test"]
fn only_tables_and_pictures_are_wider_than_a_telephone() {
    let browser = Browser::start();
    for incident in [Incident::trip(), Incident::crowded()] {
        browser.show_as(SIZES[1], "light");
        browser.open(&incident.page());
        let width = browser.eval("return document.documentElement.scrollWidth");
        assert_eq!(width, SIZES[1].0);
        let card = browser
            .eval("return document.querySelector('.first-out').getBoundingClientRect().height");
        let height = card.as_f64().expect("a number");
        assert!(height < f64::from(SIZES[1].1) / 2.0, "the first-out is {height} px high");
        let seen = browser.eval(
            "return [...document.querySelectorAll('.sequence th[scope=col]')].filter(head => \
             head.offsetWidth > 1 && head.getBoundingClientRect().left + 40 < innerWidth)\
             .map(head => head.textContent)",
        );
        let seen = strings(&seen);
        assert!(
            ["Time", "Recorder", "Point", "State"]
                .iter()
                .all(|head| seen.iter().any(|seen| seen == head)),
            "{seen:?}"
        );
    }
}

#[test]
#[ignore = "needs chromedriver: cargo xtask test"]
fn colour_is_never_all_that_says_not_normal() {
    let (incident, browser) = (Incident::trip(), Browser::start());
    browser.open(&incident.page());
    let states = browser.eval(
        "return [...document.querySelectorAll('td.abnormal')].map(state => state.textContent)",
    );
    assert_eq!(strings(&states), ["OPEN not normal"]);
    let drawn = browser.eval(
        "return [...document.querySelectorAll('.lane .abnormal')].map(bar => \
         getComputedStyle(bar).fill.replaceAll('\"', '') + ' ' + bar.textContent)",
    );
    let drawn = strings(&drawn);
    assert!(!drawn.is_empty());
    assert!(drawn.iter().all(|bar| bar == "url(#striped) off, not normal"), "{drawn:?}");
    let legend = browser.eval("return document.querySelector('.legend').textContent");
    let legend = legend.as_str().expect("text");
    for (part, is_there) in [
        ("not normal", true),
        ("something is missing", true),
        ("took, and was not in time", true),
        ("took, in time", false),
        ("nobody knows how far", false),
    ] {
        assert_eq!(legend.contains(part), is_there, "{part}: {legend}");
    }
}

#[test]
#[ignore = "needs chromedriver: cargo xtask test"]
fn the_longest_page_opens_and_is_searched() {
    let incident = Incident::of(20_000);
    let page = incident.page();
    let bytes = fs::metadata(&page).expect("a file").len();
    assert!((5_000_000..20_000_000).contains(&bytes), "{bytes} bytes");
    let browser = Browser::start();
    browser.open(&page);
    let rows = browser.eval("return document.querySelectorAll('tbody tr[data-lane]').length");
    assert_eq!(rows, 20_000);
    // What the browser's own search finds: the last row but one. The head names the last one.
    assert_eq!(browser.eval("return window.find('10:13:19.921')"), true);
    let selected =
        browser.eval("return getSelection().anchorNode.parentElement.closest('tr').rowIndex");
    assert_eq!(selected, 19_999);
    press(&browser, "first 100 ms");
    assert_eq!(strings(&browser.eval(LABELS)), ["0", "20 ms", "40 ms", "60 ms", "80 ms", "100 ms"]);
    assert_eq!(browser.console(), Vec::<String>::new());
}

mod needs_pdftotext {
    use std::io::Write as _;
    use std::process::{Command, Stdio};

    use super::*;

    /// The papers of both worlds, in centimetres, and one that lies on its side.
    const PAPERS: [(&str, (f64, f64)); 3] =
        [("a4", (21.0, 29.7)), ("letter", (21.59, 27.94)), ("across", (29.7, 21.0))];

    /// The text of each page.
    fn pages(pdf: &[u8]) -> Vec<String> {
        let mut command = Command::new("pdftotext");
        command.args(["-layout", "-", "-"]).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut reader = command.spawn().expect("pdftotext runs: cargo xtask test --all");
        reader.stdin.take().expect("piped").write_all(pdf).expect("it reads");
        let output = reader.wait_with_output().expect("it ends");
        assert!(output.status.success(), "{output:?}");
        let text = String::from_utf8(output.stdout).expect("UTF-8");
        text.trim_end_matches('\u{c}').split('\u{c}').map(str::to_owned).collect()
    }

    #[test]
    #[ignore = "needs pdftotext: cargo xtask test"]
    fn paper_has_all_of_it_and_no_chart_is_cut() {
        let (incident, browser) = (Incident::crowded(), Browser::start());
        browser.open(&incident.page());
        let headings = browser.eval(
            "return [...document.querySelectorAll('h2, figcaption')].map(heading => \
             heading.firstChild.textContent.trim())",
        );
        let headings = strings(&headings);
        let charts = browser.eval("return document.querySelectorAll('svg.chart').length");
        for (name, paper) in PAPERS {
            let pdf = browser.pdf(paper);
            fs::write(shown_in().join(format!("{name}.pdf")), &pdf).expect("a file");
            let pages = pages(&pdf);
            let count = |page: &str, text: &str| page.matches(text).count();
            let mut drawn = 0;
            for page in &pages {
                let (axes, ends) = (count(page, "after the first change"), count(page, "lanes "));
                assert_eq!(axes, ends, "{name}: each chart has its axis and its end: {page}");
                drawn += axes;
                let last = page.lines().rfind(|line| !line.trim().is_empty()).unwrap_or_default();
                assert!(!headings.iter().any(|heading| heading == last.trim()), "{name}: {page}");
            }
            assert_eq!(charts, drawn, "{name}");
            let last = pages.last().map_or("", String::as_str);
            let lines = last.lines().filter(|line| !line.trim().is_empty()).count();
            assert!(lines > 5, "{name}: the last page has {lines} lines: {last}");
            let all = pages.concat();
            assert!(pages.len() < 20, "{name}: {} pages, for a name that is long", pages.len());
            for change in 1..=CHATTER {
                let ms = 491 + 10 * change;
                let time = format!("10:00:00.{ms}");
                assert_eq!(count(&all, &time), if change == 1 { 4 } else { 2 }, "{name}: {time}");
            }
        }
        // It is folded again afterwards.
        let open = browser.eval("return document.querySelectorAll('details[open]').length");
        assert_eq!(open, 0);
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
        let browser = Browser::start();
        for (incident, page) in [("trip", Incident::trip()), ("crowded", Incident::crowded())] {
            for size in SIZES {
                for scheme in ["light", "dark"] {
                    browser.show_as(size, scheme);
                    browser.open(&page.page());
                    let name = format!("{incident}-{scheme}-{}.png", size.0);
                    fs::write(shown_in().join(name), browser.picture()).expect("a file");
                    assert_eq!(faults(&browser, &axe), Vec::<String>::new(), "{scheme} {size:?}");
                }
            }
        }
        // What is long is no other page, so once is enough.
        browser.open(&Incident::of(2_000).page());
        assert_eq!(faults(&browser, &axe), Vec::<String>::new());
    }

    /// What axe finds, each with its elements.
    fn faults(browser: &Browser, axe: &str) -> Vec<String> {
        browser.eval(axe);
        let found = browser.eval_later(
            "const done = arguments[0]; axe.run().then(found => done(found.violations\
             .map(found => found.impact + ': ' + found.id + ' ' + \
             found.nodes.map(node => node.html).join(' '))))",
        );
        strings(&found)
    }
}
