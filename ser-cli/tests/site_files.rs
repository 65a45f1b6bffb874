//! What is told of site files with mistakes, letter by letter: `tests/site/CASE.toml` is checked,
//! and `tests/site/CASE.txt` is what stands on standard error.
//!
//! After a change of the words, `SER_WRITE_EXPECTED=1 cargo test -p ser-cli --test site_files`
//! writes the expected texts anew, for a person to review.

mod common;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use common::ser_cli;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/site")
}

/// The names of all cases.
fn cases() -> BTreeSet<String> {
    let files = fs::read_dir(folder()).expect("a folder").map(|file| file.expect("a file").path());
    let cases = files.filter(|path| path.extension().is_some_and(|ending| ending == "toml"));
    cases.map(|path| path.file_stem().unwrap().to_string_lossy().into_owned()).collect()
}

fn check(file: &str) -> Output {
    ser_cli().current_dir(folder()).args(["site", "check", file]).output().expect("ser-cli runs")
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("UTF-8")
}

#[test]
fn every_mistake_is_told_with_its_line_and_with_what_would_be_right() {
    let is_written = std::env::var_os("SER_WRITE_EXPECTED").is_some();
    for case in cases() {
        let output = check(&format!("{case}.toml"));
        let told = text(&output.stderr);
        let expected = folder().join(format!("{case}.txt"));
        if is_written {
            fs::write(&expected, told).expect("a text");
        }
        assert_eq!(told, fs::read_to_string(&expected).unwrap_or_default(), "{case}");
        let is_warning = told.starts_with("warning");
        assert_eq!(output.status.code(), Some(i32::from(!is_warning)), "{case}");
        assert_eq!(output.stdout.is_empty(), !is_warning, "{case}");
    }
}

#[test]
fn every_check_in_the_manual_has_a_case() {
    let page = include_str!("../../docs/site-file.md");
    let table = page.split_once("| check | what it finds |").expect("the table").1;
    let names = table.lines().filter_map(|line| line.strip_prefix("| `")?.split_once('`'));
    // A case of four MiB would be a burden to everybody.
    let names: Vec<&str> =
        names.map(|(name, _)| name).filter(|name| *name != "too-large").collect();
    assert!(names.len() > 30, "{names:?}");
    for name in names {
        assert!(cases().contains(name), "no case for {name}");
        let expected = fs::read_to_string(folder().join(format!("{name}.txt"))).expect(name);
        assert!(expected.contains(&format!("[{name}]: ")), "{name}: {expected}");
    }
}

#[test]
fn a_good_file_is_ok_and_its_contents_are_counted() {
    let northfield = "../../../crates/ser-evidence/tests/northfield.toml";
    let output = check(northfield);
    assert_eq!(
        (output.status.code(), text(&output.stdout), text(&output.stderr)),
        (
            Some(0),
            "../../../crates/ser-evidence/tests/northfield.toml: ok, 2 recorders, 3 points, \
             1 group, 1 expectation, 1 observation, 1 shift\n",
            ""
        )
    );
}

#[test]
fn the_file_in_the_manual_is_a_good_one() {
    let page = include_str!("../../docs/site-file.md");
    let example = page.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next());
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("north.toml");
    fs::write(&file, example.expect("an example")).unwrap();
    let output = check(file.to_str().unwrap());
    assert_eq!(text(&output.stderr), "");
}

#[test]
fn what_is_no_site_file_at_all_is_told_in_a_line_or_two() {
    let folder = tempfile::tempdir().unwrap();
    let said = |name: &str, bytes: &[u8]| {
        let file = folder.path().join(name);
        fs::write(&file, bytes).unwrap();
        let output = check(file.to_str().unwrap());
        assert_eq!(output.status.code(), Some(1));
        text(&output.stderr).replace(&folder.path().display().to_string(), "")
    };
    assert_eq!(
        said("latin", b"site = \"A\"\n# caf\xE9\n"),
        "error: /latin is not UTF-8: see line 2\n\
         hint: save it as UTF-8 in your editor; the encoding is often in its dialogue Save As\n"
    );
    let large = said("large", "# é\n".repeat(1_000_000).as_bytes());
    assert!(large.contains("error[too-large]: a site file has at most 4 MiB"), "{large}");
    let missing = check("missing.toml");
    assert_eq!(
        text(&missing.stderr),
        "error: cannot read missing.toml: No such file or directory (os error 2)\n\
         hint: check its name and your rights to it\n\
         hint: ser-cli site new -o FILE writes a site file\n"
    );
}

#[test]
fn a_new_file_is_written_once_and_is_good() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("north.toml");
    let new = || ser_cli().args(["site", "new", "-o"]).arg(&file).output().expect("ser-cli runs");
    let first = new();
    assert_eq!((first.status.code(), text(&first.stdout)), (Some(0), ""));
    assert!(text(&first.stderr).contains("north.toml is written"));
    let written = fs::read_to_string(&file).unwrap();

    let second = new();
    assert_eq!(second.status.code(), Some(1));
    assert!(text(&second.stderr).contains("exists, and is not overwritten"));
    assert_eq!(fs::read_to_string(&file).unwrap(), written);

    assert_eq!(check(file.to_str().unwrap()).status.code(), Some(0));
    let shown = ser_cli().args(["site", "new"]).output().expect("ser-cli runs");
    assert_eq!(text(&shown.stdout), written);
}
