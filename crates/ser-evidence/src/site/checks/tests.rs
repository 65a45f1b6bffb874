//! The examples in the documentation of the checks are what they say.

use std::collections::BTreeSet;

use crate::site::{inspect, read};

/// Every check: its file's name and text.
const CHECKS: &[(&str, &str)] = &[
    ("ambiguous_point", include_str!("ambiguous_point.rs")),
    ("backward_shift", include_str!("backward_shift.rs")),
    ("bad_baud", include_str!("bad_baud.rs")),
    ("bad_clock", include_str!("bad_clock.rs")),
    ("bad_edge", include_str!("bad_edge.rs")),
    ("bad_time", include_str!("bad_time.rs")),
    ("duplicate_input", include_str!("duplicate_input.rs")),
    ("duplicate_name", include_str!("duplicate_name.rs")),
    ("duplicate_port", include_str!("duplicate_port.rs")),
    ("empty_group", include_str!("empty_group.rs")),
    ("empty_text", include_str!("empty_text.rs")),
    ("few_changes", include_str!("few_changes.rs")),
    ("hidden_character", include_str!("hidden_character.rs")),
    ("input_beyond_model", include_str!("input_beyond_model.rs")),
    ("long_text", include_str!("long_text.rs")),
    ("missing_key", include_str!("missing_key.rs")),
    ("no_recorder", include_str!("no_recorder.rs")),
    ("out_of_range", include_str!("out_of_range.rs")),
    ("overlapping_shifts", include_str!("overlapping_shifts.rs")),
    ("padded_text", include_str!("padded_text.rs")),
    ("same_as", include_str!("same_as.rs")),
    ("same_edge", include_str!("same_edge.rs")),
    ("same_texts", include_str!("same_texts.rs")),
    ("slash_in_recorder", include_str!("slash_in_recorder.rs")),
    ("syntax", include_str!("syntax.rs")),
    ("too_fine", include_str!("too_fine.rs")),
    ("too_large", include_str!("too_large.rs")),
    ("unknown_group", include_str!("unknown_group.rs")),
    ("unknown_key", include_str!("unknown_key.rs")),
    ("unknown_point", include_str!("unknown_point.rs")),
    ("unknown_recorder", include_str!("unknown_recorder.rs")),
    ("unknown_word", include_str!("unknown_word.rs")),
    ("unknown_zone", include_str!("unknown_zone.rs")),
    ("upside_down", include_str!("upside_down.rs")),
    ("wrong_type", include_str!("wrong_type.rs")),
];

/// The example below "Bad:" or "Good:" in a file's documentation.
fn example<'t>(source: &'t str, title: &str) -> Vec<&'t str> {
    let below = source.split_once(&format!("//! {title}\n//! ```toml\n")).expect("an example").1;
    let lines = below.lines().take_while(|line| *line != "//! ```");
    lines.map(|line| line.trim_start_matches("//!").trim_start_matches(' ')).collect()
}

/// The file that an example is a part of.
fn whole(lines: &[&str]) -> String {
    let head = match lines.iter().any(|line| line.starts_with("site =")) {
        true => "",
        false => "site = \"Northfield\"\ntime_zone = \"Europe/Berlin\"\n",
    };
    format!("{head}{}\n", lines.join("\n"))
}

fn found(text: &str) -> BTreeSet<String> {
    inspect(text).diagnostics.iter().map(|found| found.check.replace('-', "_")).collect()
}

#[test]
fn every_bad_example_is_found_by_its_check_and_by_no_other() {
    for (name, source) in CHECKS {
        let text = match *name {
            "too_large" => "#".repeat((4 << 20) + 1),
            "long_text" => whole(&example(source, "Bad:")).replace("and so on", &"x".repeat(200)),
            _ => whole(&example(source, "Bad:")),
        };
        assert_eq!(found(&text), BTreeSet::from([(*name).to_owned()]), "{name}: {text:.999}");
    }
}

#[test]
fn every_good_example_is_good() {
    for (name, source) in CHECKS {
        let text = whole(&example(source, "Good:"));
        assert_eq!(found(&text), BTreeSet::new(), "{name}");
        assert!(read(&text).is_ok(), "{name}");
    }
}

#[test]
fn every_check_is_in_the_manual() {
    let page = include_str!("../../../../../docs/site-file.md");
    for (name, _) in CHECKS {
        let row = format!("| `{}` |", name.replace('_', "-"));
        assert!(page.contains(&row), "{row} is missing in docs/site-file.md");
    }
}
