//! The promises in `docs/guarantees.md` stay honest: each has a test, and every test that the page
//! names exists.

use std::collections::BTreeSet;

use ser_tests::pages::{self, Row};

/// What the numbers of promises begin with: order, stamps, losses, recovery, archives, evidence.
const PARTS: [&str; 6] = ["O", "S", "L", "R", "A", "E"];

fn wrong_with_promise(row: &Row<'_>) -> Vec<String> {
    let [number, promise] = row.cells[..] else {
        return vec![format!("{} cells instead of 2", row.cells.len())];
    };
    let mut wrong = Vec::new();
    let is_number = number.split_once('.').is_some_and(|(part, place)| {
        PARTS.contains(&part)
            && !place.is_empty()
            && place.bytes().all(|byte| byte.is_ascii_digit())
    });
    if !is_number {
        wrong.push("this is not the number of a promise".to_string());
    }
    if promise.is_empty() {
        wrong.push("nothing is promised".to_string());
    }
    wrong
}

/// Everything that is wrong with the page. `source_of` returns the text of a file.
fn mistakes(page: &str, source_of: impl Fn(&str) -> Option<String>) -> Vec<String> {
    let prefixes = pages::prefixes(page);
    let (promises, tests) = (pages::rows(page, "no."), pages::rows(page, "promise"));
    let mut mistakes = Vec::new();
    let mut tell = |number: &str, wrong: Vec<String>| {
        mistakes.extend(wrong.into_iter().map(|wrong| format!("{number}: {wrong}")));
    };
    promises.iter().for_each(|row| tell(row.first, wrong_with_promise(row)));
    for row in &tests {
        let list = row.cells.get(1).copied().unwrap_or_default();
        tell(row.first, pages::wrong_with_tests(list, &prefixes, &source_of));
    }
    let promised: Vec<&str> = promises.iter().map(|row| row.first).collect();
    let tested: Vec<&str> = tests.iter().map(|row| row.first).collect();
    for (these, others, wrong) in
        [(&promised, &tested, "has no test"), (&tested, &promised, "is tested and not promised")]
    {
        let lonely = these.iter().filter(|number| !others.contains(number));
        mistakes.extend(lonely.map(|number| format!("{number} {wrong}")));
    }
    for (numbers, what) in [(&promised, "promised"), (&tested, "tested")] {
        let twice: BTreeSet<_> = numbers
            .iter()
            .filter(|number| numbers.iter().filter(|n| n == number).count() > 1)
            .collect();
        mistakes.extend(twice.iter().map(|number| format!("{number} is {what} twice")));
    }
    mistakes
}

#[test]
fn every_promise_has_a_test_that_exists() {
    let page = pages::file("docs/guarantees.md").expect("docs/guarantees.md");
    let mistakes = mistakes(&page, pages::file);
    assert!(mistakes.is_empty(), "docs/guarantees.md:\n{}", mistakes.join("\n"));
    let promises = pages::rows(&page, "no.");
    for part in PARTS {
        let has_part = promises.iter().any(|row| row.first.starts_with(part));
        assert!(has_part, "no promises {part}.1 and so on");
    }
}

#[test]
fn each_mistake_is_named_with_its_promise() {
    let page = |promises: &str, tests: &str| {
        format!(
            "| no. | promise |\n|---|---|\n{promises}\n\n| prefix | folder |\n|---|---|\n| `a/` \
             | `crate/a/` |\n\n\
             | promise | shown by |\n|---|---|\n{tests}\n"
        )
    };
    let source_of =
        |path: &str| (path == "crate/a/b.rs").then(|| "#[test]\nfn good() {}\n".to_string());
    let (so, shown) = ("| O.1 | It is so. |", "| O.1 | `a/b.rs::good` |");
    for (promises, tests, wrong) in [
        (so, shown, &[][..]),
        (so, "", &["O.1 has no test"]),
        ("", shown, &["O.1 is tested and not promised"]),
        (so, "| O.1 | `a/b.rs::gone` |", &["O.1: crate/a/b.rs has no test gone"]),
        (so, "| O.1 | |", &["O.1: \"\" is not a test, `file::name`"]),
        ("| O.1 | |", shown, &["O.1: nothing is promised"]),
        (
            "| X.1 | So. |",
            "| X.1 | `a/b.rs::good` |",
            &["X.1: this is not the number of a promise"],
        ),
        ("| O.1 | So. |\n| O.1 | So. |", shown, &["O.1 is promised twice"]),
    ] {
        assert_eq!(mistakes(&page(promises, tests), source_of), wrong, "{promises} {tests}");
    }
}
