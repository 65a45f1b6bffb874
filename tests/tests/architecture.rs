//! The table of crates in `docs/architecture.md` stays true: it names every crate of the workspace,
//! and for each the crates that it uses.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use ser_tests::pages;
use serde_json::Value;

type Uses = BTreeMap<String, BTreeSet<String>>;

/// What cargo says: each crate of the workspace, and the crates that it is built with.
fn uses_by_cargo() -> Uses {
    let arguments = ["metadata", "--no-deps", "--offline", "--locked", "--format-version", "1"];
    let output = Command::new(env!("CARGO")).args(arguments).output().expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let packages = metadata["packages"].as_array().expect("packages");
    let name = |package: &Value| package["name"].as_str().expect("a name").to_owned();
    let ours: BTreeSet<String> = packages.iter().map(name).collect();
    let used = |package: &Value| {
        let dependencies = package["dependencies"].as_array().expect("dependencies");
        let built_with = dependencies.iter().filter(|dependency| dependency["kind"].is_null());
        built_with.map(name).filter(|name| ours.contains(name)).collect()
    };
    packages.iter().map(|package| (name(package), used(package))).collect()
}

/// What the page says.
fn uses_by_page(page: &str) -> Uses {
    let names = |cell: &str| -> BTreeSet<String> {
        cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
    };
    let rows = pages::rows(page, "crate");
    let of_row = |row: &pages::Row<'_>| {
        let crates = names(row.first);
        let uses = names(row.cells.get(2).copied().unwrap_or_default());
        crates.into_iter().map(move |name| (name, uses.clone())).collect::<Vec<_>>()
    };
    rows.iter().flat_map(of_row).collect()
}

#[test]
fn the_page_names_every_crate_and_what_it_uses() {
    let page = pages::file("docs/architecture.md").expect("docs/architecture.md");
    assert_eq!(uses_by_page(&page), uses_by_cargo());
}

#[test]
fn a_row_is_read_as_it_is_meant() {
    let page = "| crate | what it is | uses |\n|---|---|---|\n| `a` | with `code` | `b`, `c` \
     |\n| `b` | | – |\n";
    let uses = uses_by_page(page);
    assert_eq!(uses["a"], BTreeSet::from(["b".to_owned(), "c".to_owned()]));
    assert!(uses["b"].is_empty());
}

#[test]
fn no_crate_leads_back_to_itself() {
    let uses = uses_by_cargo();
    for (name, used) in &uses {
        let mut reached = BTreeSet::new();
        let mut open: Vec<&String> = used.iter().collect();
        while let Some(next) = open.pop() {
            if reached.insert(next) {
                open.extend(&uses[next]);
            }
        }
        assert!(!reached.contains(name), "{name} uses itself");
    }
}
