//! The list of rules in `docs/geni-rules.md` stays honest: every test that it names exists, and
//! every rule has a test or a reason why it has none.

use std::collections::{BTreeMap, BTreeSet};

use ser_tests::pages::{self, Row};

/// Who can keep a rule.
const KEEPERS: [&str; 5] = ["board", "bus", "driver", "port", "host"];

/// What the last cell of a rule without a test begins with. The reason follows.
const NOT_MODELLED: &str = "not modelled: ";

/// The chapters that the page must have, by the beginnings of their rules' numbers.
const CHAPTERS: [&str; 15] =
    ["2", "3", "4", "5", "6", "7", "8", "9", "10", "11", "12", "13", "B", "F", "S"];

/// `13.4`, `B.1`: a chapter of the page and a place in it.
fn is_number(cell: &str) -> bool {
    cell.split_once('.').is_some_and(|(chapter, place)| {
        CHAPTERS.contains(&chapter)
            && !place.is_empty()
            && place.bytes().all(|byte| byte.is_ascii_digit())
    })
}

fn wrong_with_rule(
    rule: &Row<'_>,
    prefixes: &BTreeMap<&str, &str>,
    source_of: &impl Fn(&str) -> Option<String>,
) -> Vec<String> {
    let [_, text, section, kept_by, tests] = rule.cells[..] else {
        return vec![format!("{} cells instead of 5", rule.cells.len())];
    };
    let mut wrong = Vec::new();
    if !is_number(rule.first) {
        wrong.push("this is not the number of a rule".to_string());
    }
    if text.is_empty() || section.is_empty() {
        wrong.push("the rule or its section is missing".to_string());
    }
    for keeper in kept_by.split(',').map(str::trim).filter(|keeper| !KEEPERS.contains(keeper)) {
        wrong.push(format!("kept by \"{keeper}\", which is none of {}", KEEPERS.join(", ")));
    }
    if tests.is_empty() || tests == NOT_MODELLED.trim() {
        wrong.push("neither a test nor a reason".to_string());
    } else if !tests.starts_with(NOT_MODELLED) {
        wrong.extend(pages::wrong_with_tests(tests, prefixes, source_of));
    }
    wrong
}

/// Everything that is wrong with the page. `source_of` returns the text of a file.
fn mistakes(page: &str, source_of: impl Fn(&str) -> Option<String>) -> Vec<String> {
    let prefixes = pages::prefixes(page);
    let mut seen = BTreeSet::new();
    let mut mistakes = Vec::new();
    for rule in pages::rows(page, "no.") {
        let twice = (!seen.insert(rule.first)).then(|| "this number is there twice".to_string());
        let wrong = wrong_with_rule(&rule, &prefixes, &source_of);
        mistakes.extend(
            twice.into_iter().chain(wrong).map(|wrong| format!("rule {}: {wrong}", rule.first)),
        );
    }
    let has_rules =
        |chapter: &&str| seen.iter().any(|number| number.split('.').next() == Some(chapter));
    let empty = CHAPTERS.iter().filter(|chapter| !has_rules(chapter));
    mistakes.extend(empty.map(|chapter| format!("no rules numbered {chapter}.1 and so on")));
    mistakes
}

#[test]
fn every_rule_has_a_test_that_exists_or_a_reason() {
    let page = pages::file("docs/geni-rules.md").expect("docs/geni-rules.md");
    let mistakes = mistakes(&page, pages::file);
    assert!(mistakes.is_empty(), "docs/geni-rules.md:\n{}", mistakes.join("\n"));
}

/// A page with one good rule in each of these chapters, and additional rows.
fn page_of(chapters: &[&str], rows: &str) -> String {
    let good =
        |chapter| format!("| {chapter}.1 | It is so. | Heading | board | `a/b.rs::good` |\n");
    let good: String = chapters.iter().map(good).collect();
    let folders = "| prefix | folder |\n|---|---|\n| `a/` | `crate/a/` |";
    let head = "| no. | rule | section | kept by | tests |\n|---|---|---|---|---|";
    format!("{folders}\n\n{head}\n{good}{rows}\n")
}

fn page(rows: &str) -> String {
    page_of(&CHAPTERS, rows)
}

fn source_of(path: &str) -> Option<String> {
    let source = "#[test]\n/// Says more.\nfn good() {}\n\nfn helper() {}\n\n#[test]\n#[ignore = \
     \"slow\"]\nfn idle() {}\n\n\
                  with_both_kinds! {\n    both,\n}\n\nfn both(kind: Kind) {}\n";
    (path == "crate/a/b.rs").then(|| source.to_string())
}

#[test]
fn a_page_without_mistakes_passes() {
    let rows = "| 3.2 | It is so. | Heading | board, host | `a/b.rs::good`, `a/b.rs::both` |\n\
                | 3.3 | It is so. | Heading | port | not modelled: electrical |\n\n\
                | where | another | table |";
    assert_eq!(mistakes(&page(rows), source_of), Vec::<String>::new());
}

#[test]
fn each_mistake_is_named_with_its_rule() {
    for (row, message) in [
        (
            "| 3.1 | Twice. | Heading | board | `a/b.rs::good` |",
            "rule 3.1: this number is there twice",
        ),
        (
            "| 14.1 | Which? | Heading | board | `a/b.rs::good` |",
            "rule 14.1: this is not the number of a rule",
        ),
        (
            "| | Which? | Heading | board | `a/b.rs::good` |",
            "rule : this is not the number of a rule",
        ),
        (
            "| 3.2 | No bar. | Heading | board | `a/b.rs::goo` ",
            "rule 3.2: crate/a/b.rs has no test goo",
        ),
        ("| 3.2 | Short. | board | `a/b.rs::good` |", "rule 3.2: 4 cells instead of 5"),
        (
            "| 3.2 | | Heading | board | `a/b.rs::good` |",
            "rule 3.2: the rule or its section is missing",
        ),
        (
            "| 3.2 | Whose? | Heading | nobody | `a/b.rs::good` |",
            "rule 3.2: kept by \"nobody\", which is none of board, bus, driver, port, host",
        ),
        ("| 3.2 | Why? | Heading | board | |", "rule 3.2: neither a test nor a reason"),
        (
            "| 3.2 | Why? | Heading | board | not modelled: |",
            "rule 3.2: neither a test nor a reason",
        ),
        (
            "| 3.2 | How? | Heading | board | by hand |",
            "rule 3.2: \"by hand\" is not a test, `file::name`",
        ),
        (
            "| 3.2 | Where? | Heading | board | `x/b.rs::good` |",
            "rule 3.2: x/b.rs does not begin with a prefix of the page's first table",
        ),
        (
            "| 3.2 | Gone. | Heading | board | `a/c.rs::good` |",
            "rule 3.2: there is no file crate/a/c.rs",
        ),
        (
            "| 3.2 | Gone. | Heading | board | `a/b.rs::goo` |",
            "rule 3.2: crate/a/b.rs has no test goo",
        ),
        (
            "| 3.2 | No test. | Heading | board | `a/b.rs::helper` |",
            "rule 3.2: crate/a/b.rs has no test helper",
        ),
        (
            "| 3.2 | Not run. | Heading | board | `a/b.rs::idle` |",
            "rule 3.2: crate/a/b.rs has no test idle",
        ),
    ] {
        assert_eq!(mistakes(&page(row), source_of), [message], "{row}");
    }
    let without: Vec<_> = CHAPTERS.into_iter().filter(|chapter| *chapter != "12").collect();
    assert_eq!(mistakes(&page_of(&without, ""), source_of), ["no rules numbered 12.1 and so on"]);
}
