//! Programs touch no file that they have not made, and do not panic when nobody reads what they
//! print: every call in the source that could is here, with the reason why it does not. A new one
//! has to be judged, and a line added.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// What makes room for itself, follows links, replaces or removes; what panics on a closed pipe.
const CALLS: [&str; 13] = [
    "File::create(",
    "File::create_buffered(",
    "fs::write(",
    "fs::copy(",
    "fs::rename(",
    "fs::hard_link(",
    "truncate(true)",
    "set_len(",
    "remove_file(",
    "remove_dir_all(",
    ".persist(",
    // And what ends with it: `eprintln!`.
    "println!(",
    "print!(",
];

/// File, call, how often, and why that is right.
const JUDGED: [(&str, &str, usize, &str); 12] = [
    (
        "ser-cli/src/output/rows.rs",
        "set_len(",
        1,
        "what was just written to standard output, if nobody has written after it",
    ),
    ("ser-cli/src/state.rs", ".persist(", 1, "over a state file, which it was read as just before"),
    ("ser-cli/src/state.rs", "remove_file(", 1, "a state file, which it was read as just before"),
    (
        "crates/ser-sim/src/claim.rs",
        "remove_file(",
        2,
        "what the claim's record says is ours, or what was just made",
    ),
    (
        "crates/ser-sim/src/claim.rs",
        "set_len(",
        1,
        "the claim's record, in a directory that nobody else can write to",
    ),
    ("crates/ser-sim/src/emulator.rs", "File::create(", 1, "in a temporary directory of its own"),
    ("crates/ser-sim/src/external_bus.rs", "set_len(", 1, "a file that was just made, and by nobody else"),
    ("crates/ser-sim/src/lockstep.rs", "File::create(", 1, "in a temporary directory of its own"),
    ("crates/ser-sim/src/pty.rs", "fs::rename(", 1, "over a link that the claim's record says is ours"),
    ("crates/ser-sim/src/pty.rs", "remove_file(", 1, "a link that was just made"),
    (
        "crates/ser-qemu-plugin/src/lib.rs",
        "println!(",
        1,
        "in QEMU, whose standard error is a file of the bench",
    ),
    ("xtask/src/setup/apt.rs", "File::create(", 1, "in the build folder"),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The source of programs and libraries, without that of tests.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path()) {
        let name = entry.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let is_test = name == "tests" || name == "tests.rs";
        if entry.is_dir() && !is_test {
            sources(&entry, found);
        } else if name.ends_with(".rs") && !is_test {
            found.push(entry);
        }
    }
}

/// How often each call stands in a source, comments and its tests at the end apart.
fn calls(source: &str) -> BTreeMap<&'static str, usize> {
    let end =
        source.find("#[cfg(test)]\nmod ").or_else(|| source.find("#[cfg(all(test")).unwrap_or(source.len());
    let lines = source[..end].lines().filter(|line| !line.trim_start().starts_with("//"));
    let code: String = lines.flat_map(|line| [line, "\n"]).collect();
    let counts = CALLS.map(|call| (call, code.matches(call).count()));
    counts.into_iter().filter(|(_, count)| *count > 0).collect()
}

#[test]
fn every_call_that_could_touch_a_file_of_others_has_been_judged() {
    let mut files = Vec::new();
    let entries = |folder: PathBuf| {
        fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path())
    };
    for package in entries(root()).chain(entries(root().join("crates"))) {
        for folder in ["src", "examples"].map(|folder| package.join(folder)) {
            if package.join("Cargo.toml").exists() && folder.is_dir() {
                sources(&folder, &mut files);
            }
        }
    }
    assert!(files.len() > 200, "{}", files.len());
    let mut found = BTreeMap::new();
    for file in files {
        let name = file.strip_prefix(root()).expect("below the root").to_string_lossy().into_owned();
        for (call, count) in calls(&fs::read_to_string(&file).expect("a source")) {
            found.insert((name.clone(), call), count);
        }
    }
    let judged = JUDGED.iter().map(|&(file, call, count, _)| ((file.to_owned(), call), count));
    assert_eq!(found, judged.collect());
}

#[test]
fn calls_in_comments_and_tests_are_none() {
    let source =
        "fs::write(a);\n  // fs::copy(a)\nfs::write(b);\n#[cfg(test)]\nmod tests {\nfs::rename(a)\n}";
    assert_eq!(calls(source), BTreeMap::from([("fs::write(", 2)]));
}
