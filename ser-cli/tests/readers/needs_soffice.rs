//! `LibreOffice`, as somebody who opens a file in it.

use std::fs;
use std::path::Path;
use std::process::Command;

use super::plant::{BEGIN_MS, Desk, Log, hostile_names};
use super::tables::Sheet;
use crate::common::bench::text;

/// The rows of a file as `LibreOffice` understands them, with its formulas evaluated. `filter` says
/// what a person sets when opening it: separator, quote, characters, first row, and language.
fn opened(csv: &Path, filter: &str) -> Sheet {
    let folder = csv.parent().expect("a folder");
    let profile = format!("-env:UserInstallation=file://{}", folder.join("profile").display());
    let output = Command::new("soffice")
        .args(["--headless", &profile, "--convert-to", "slk"])
        .arg(format!("--infilter=CSV:{filter}"))
        .arg("--outdir")
        .arg(folder)
        .arg(csv)
        .output()
        .expect("soffice runs: cargo xtask test --all installs it");
    let sheet = fs::read_to_string(csv.with_extension("slk"));
    Sheet::of(&sheet.unwrap_or_else(|_| panic!("{}", text(&output.stderr))))
}

/// Separator, quote, UTF-8, from row 1, English or German, special numbers are detected, formulas
/// are evaluated.
const ENGLISH: &str = "44,34,76,1,,1033,false,true,false,false,false,-1,true";
const GERMAN: &str = "59,34,76,1,,1031,false,true,false,false,false,-1,true";

/// A recorder whose every input moves, a second apart and to the millisecond.
fn hostile() -> Log {
    let mut log = Log::new("U1", &hostile_names());
    log.moves = (0..32).map(|input| (input * 1001, 1 << input)).collect();
    log.gap_after = Some(20);
    log
}

/// Days since the end of 1899, as spreadsheets count.
fn day(at_ms: i64) -> f64 {
    let ms = f64::from(i32::try_from(at_ms).expect("small"));
    let begin_s = f64::from(i32::try_from(BEGIN_MS / 1000).expect("small"));
    25_569.0 + (begin_s + ms / 1000.0) / 86_400.0
}

fn holds_everything(sheet: &Sheet, log: &Log) {
    let changes = sheet.rows().filter(|row| !row.text("state").is_empty());
    let changes: Vec<_> = changes.collect();
    assert_eq!(changes.len(), log.moves.len());
    for (row, &(at_ms, changed)) in changes.iter().zip(&log.moves) {
        let name = &log.points[changed.trailing_zeros() as usize].1;
        let shown = row.text("point");
        assert!(shown == *name || shown == format!("'{name}"), "{shown}");
        assert_eq!(row.text("input"), (changed.trailing_zeros() + 1).to_string());
        let time: f64 = row.text("time").parse().expect("a time is a number");
        assert!((time - day(at_ms)).abs() * 86_400_000.0 < 0.1, "{time} {}", day(at_ms));
    }
    let loss = sheet.rows().find(|row| row.text("state").is_empty()).expect("a loss");
    assert_eq!(loss.text("note"), "lost 3 (exactly) after 20: overwritten");
}

#[test]
#[ignore = "needs soffice: cargo xtask test"]
fn both_dialects_have_times_to_the_millisecond_and_every_name() {
    let log = hostile();
    let desk = Desk::of(&[&log]);
    for (dialect, filter) in [("rfc4180", ENGLISH), ("excel-de", GERMAN)] {
        let name = format!("{dialect}.csv");
        desk.export(&format!("--format csv --spreadsheet-safe --csv-dialect {dialect}"), &name);
        holds_everything(&opened(&desk.path(&name), filter), &log);
    }
}

#[test]
#[ignore = "needs soffice: cargo xtask test"]
fn a_name_that_is_a_formula_is_none_in_a_safe_file() {
    let desk = Desk::of(&[&hostile()]);
    let names = |option: &str| -> Vec<String> {
        desk.export(&format!("--format csv --force {option}"), "a.csv");
        let sheet = opened(&desk.path("a.csv"), ENGLISH);
        sheet.rows().map(|row| row.text("point")).collect()
    };
    // So that the test would see one.
    let unsafe_names = names("");
    assert!(!unsafe_names.contains(&"=1+1".to_owned()), "{unsafe_names:?}");
    let safe = names("--spreadsheet-safe");
    for name in ["'=1+1", "'@SUM(A1)", "'+49", "'-1", "'1234567890123456"] {
        assert!(safe.contains(&name.to_owned()), "{name}: {safe:?}");
    }
}
