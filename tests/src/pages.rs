//! Pages of the documentation that name tests, and whether these tests exist.
//!
//! Such a page has a table of prefixes, each with the folder that it stands for, and tables whose
//! rows name tests as `prefix/file.rs::function`.

use std::collections::BTreeMap;
use std::path::Path;

/// How the reason ends for which tests are ignored that `cargo xtask test` runs.
const RUN_BY_XTASK: &str = ": cargo xtask test\"]";

/// Macros that make a test of each name between their braces.
const MAKE_TESTS: [&str; 1] = ["targets! {"];

/// Macros that make two tests of each function named between their braces.
const MAKE_TESTS_OF_FUNCTIONS: [&str; 1] = ["with_both_kinds! {"];

/// The text of a file of the project.
#[must_use]
pub fn file(path: &str) -> Option<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    std::fs::read_to_string(root.join(path)).ok()
}

/// A row of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row<'a> {
    /// The first cell.
    pub first: &'a str,
    /// All cells, the first one included.
    pub cells: Vec<&'a str>,
}

/// The cells of a row. The bar at its end may be missing, as in any Markdown.
fn cells(line: &str) -> Option<Vec<&str>> {
    let row = line.trim().strip_prefix('|')?;
    Some(row.strip_suffix('|').unwrap_or(row).split('|').map(str::trim).collect())
}

/// The rows of all tables whose first column has this heading.
#[must_use]
pub fn rows<'a>(page: &'a str, heading: &str) -> Vec<Row<'a>> {
    let mut in_table = false;
    let mut rows = Vec::new();
    for line in page.lines() {
        let cells = cells(line).unwrap_or_default();
        match cells.first() {
            None => in_table = false,
            Some(&first) if first == heading => in_table = true,
            Some(first) if first.starts_with("---") => {}
            Some(&first) if in_table => rows.push(Row { first, cells }),
            Some(_) => {}
        }
    }
    rows
}

/// The prefixes of file names, and the folders that they stand for.
#[must_use]
pub fn prefixes(page: &str) -> BTreeMap<&str, &str> {
    let rows = page.lines().filter_map(cells);
    let folders = rows.filter_map(|cells| Some((code(cells[0])?, code(cells.get(1)?)?)));
    folders.filter(|(prefix, folder)| prefix.ends_with('/') && folder.ends_with('/')).collect()
}

/// A cell that is nothing but `this`.
fn code(cell: &str) -> Option<&str> {
    cell.strip_prefix('`')?.strip_suffix('`')
}

/// Whether a source file has a test of this name, and the test is run.
fn has_test(source: &str, name: &str) -> bool {
    let head = format!("fn {name}(");
    let lines: Vec<&str> = source.lines().map(str::trim).collect();
    let marked =
        lines.iter().enumerate().filter(|(_, line)| line.starts_with(&head)).any(|(at, _)| {
            let above = lines[..at]
                .iter()
                .rev()
                .take_while(|line| line.starts_with("#[") || line.starts_with("//"));
            let above: Vec<_> = above.collect();
            let is_run =
                |line: &&&str| !line.starts_with("#[ignore") || line.ends_with(RUN_BY_XTASK);
            above.contains(&&"#[test]") && above.iter().all(is_run)
        });
    let is_function = lines.iter().any(|line| line.starts_with(&head));
    let listed = |macros: &[&str]| macros.iter().any(|opening| is_listed(source, opening, name));
    marked || listed(&MAKE_TESTS) || is_function && listed(&MAKE_TESTS_OF_FUNCTIONS)
}

/// Whether a name stands between the braces of a macro that is called with names only.
fn is_listed(source: &str, opening: &str, name: &str) -> bool {
    let mut calls = source.lines().scan(false, |inside, line| {
        let list = if *inside { Some(line) } else { line.strip_prefix(opening) };
        *inside = list.is_some_and(|list| !list.contains('}'));
        Some(list.unwrap_or_default().split('}').next().unwrap_or_default())
    });
    calls.any(|names| names.split([',', ' ']).any(|listed| listed == name))
}

/// What is wrong with the name of a test; `None` if nothing is.
fn wrong_with(
    test: &str,
    prefixes: &BTreeMap<&str, &str>,
    source_of: &impl Fn(&str) -> Option<String>,
) -> Option<String> {
    let Some((file, name)) = code(test).and_then(|test| test.split_once("::")) else {
        return Some(format!("\"{test}\" is not a test, `file::name`"));
    };
    let Some((prefix, folder)) = prefixes.iter().find(|(prefix, _)| file.starts_with(**prefix))
    else {
        return Some(format!("{file} does not begin with a prefix of the page's first table"));
    };
    let path = format!("{folder}{}", &file[prefix.len()..]);
    match source_of(&path) {
        None => Some(format!("there is no file {path}")),
        Some(source) if !has_test(&source, name) => Some(format!("{path} has no test {name}")),
        Some(_) => None,
    }
}

/// What is wrong with a list of tests separated by commas.
#[must_use]
pub fn wrong_with_tests(
    tests: &str,
    prefixes: &BTreeMap<&str, &str>,
    source_of: &impl Fn(&str) -> Option<String>,
) -> Vec<String> {
    tests.split(',').filter_map(|test| wrong_with(test.trim(), prefixes, source_of)).collect()
}

#[cfg(test)]
mod tests {
    use super::has_test;

    #[test]
    fn a_test_is_run_or_ignored_for_a_reason_that_has_it_run_elsewhere() {
        let test = |ignored: &str| has_test(&format!("#[test]\n{ignored}fn trips() {{"), "trips");
        assert!(
            test("")
                && test("#[ignore = \"needs the emulator and the image: cargo xtask test\"]\n")
        );
        assert!(test("#[ignore = \"takes minutes: cargo xtask test\"]\n"));
        assert!(!test("#[ignore]\n") && !test("#[ignore = \"takes minutes\"]\n"));
        assert!(!has_test("fn trips() {", "trips"));
    }

    #[test]
    fn macros_make_tests_of_the_names_in_their_calls() {
        let targets =
            "macro_rules! targets {\n    ($name:ident) => {\n}\n\ntargets! { frames node }\n";
        assert!(has_test(targets, "node") && has_test(targets, "frames"));
        assert!(!has_test(targets, "nod") && !has_test(targets, "ident"));
        let both = "fn trips(kind: Kind) {}\nwith_both_kinds! {\n    trips,\n    missing,\n}\n";
        assert!(has_test(both, "trips") && !has_test(both, "missing"));
    }
}
