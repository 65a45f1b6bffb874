//! The promises in `docs/guarantees.md` stay honest: each has a test, and every test that the page names exists.

use std::collections::{BTreeMap, BTreeSet};

use ser_tests::pages::{self, Row};

/// What the numbers of promises begin with: order, stamps, losses, recovery.
const PARTS: [&str; 4] = ["O", "S", "L", "R"];

fn wrong_with_promise(row: &Row<'_>, prefixes: &BTreeMap<&str, &str>) -> Vec<String> {
    let [number, promise, tests] = row.cells[..] else {
        return vec![format!("{} cells instead of 3", row.cells.len())];
    };
    let mut wrong = pages::wrong_with_tests(tests, prefixes, &pages::file);
    let is_number = number.split_once('.').is_some_and(|(part, place)| {
        PARTS.contains(&part) && !place.is_empty() && place.bytes().all(|byte| byte.is_ascii_digit())
    });
    if !is_number {
        wrong.push("this is no number of a promise".to_string());
    }
    if promise.is_empty() {
        wrong.push("nothing is promised".to_string());
    }
    wrong
}

#[test]
fn every_promise_has_a_test_that_exists() {
    let page = pages::file("docs/guarantees.md").expect("docs/guarantees.md");
    let prefixes = pages::prefixes(&page);
    let promises = pages::rows(&page, "no.");
    let mistakes: Vec<String> = promises
        .iter()
        .flat_map(|row| wrong_with_promise(row, &prefixes).into_iter().map(|w| format!("{}: {w}", row.first)))
        .collect();
    assert!(mistakes.is_empty(), "docs/guarantees.md:\n{}", mistakes.join("\n"));

    let numbers: BTreeSet<&str> = promises.iter().map(|row| row.first).collect();
    assert_eq!(numbers.len(), promises.len(), "a number is there twice");
    for part in PARTS {
        assert!(numbers.iter().any(|number| number.starts_with(part)), "no promises {part}.1 and so on");
    }
}
