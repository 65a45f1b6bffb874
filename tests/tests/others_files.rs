//! Programs touch no file that they have not made, and do not panic when nobody reads what they
//! print. Every call in the source that could do so is listed here, with the reason why it does
//! not. A new call has to be judged, and a line added.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Calls that create, write, follow links, replace or remove files, and calls that panic on a
/// closed pipe.
const CALLS: [&str; 27] = [
    "File::create(",
    "File::create_buffered(",
    "fs::write(",
    "fs::copy(",
    "fs::rename(",
    "fs::hard_link(",
    "truncate(true)",
    ".write(true)",
    "append(true)",
    "OFlags::WRONLY",
    "OFlags::RDWR",
    "set_len(",
    "ftruncate(",
    "set_permissions(",
    "remove_file(",
    "remove_dir_all(",
    "unlinkat(",
    "symlink(",
    "renameat(",
    "remove_dir(",
    "map_raw(",
    "map_mut(",
    "open_with_flags(",
    // Another program opens what it is told by name.
    "Process::new(",
    ".persist(",
    // This also finds what ends with it, such as `eprintln!`.
    "println!(",
    "print!(",
];

/// File, call, how often, and why that is right.
const JUDGED: [(&str, &str, usize, &str); 44] = [
    (
        "crates/ser-archive/src/sqlite.rs",
        "open_with_flags(",
        1,
        "a database that says that it is ours, an empty one that the user names, or a copy that was \
         made a moment before; of any other, nothing is written",
    ),
    (
        "crates/geni-board/src/mapped_ram.rs",
        "map_raw(",
        1,
        "what the caller has opened; the client puts back what it writes there before a board \
         answers",
    ),
    ("ser-cli/src/closed_stdout.rs", "OFlags::RDWR", 1, "compared, and nothing is opened with it"),
    (
        "ser-cli/src/commands/demo/bench.rs",
        "File::create(",
        1,
        "in a folder that it has just made for itself",
    ),
    (
        "ser-cli/src/commands/demo/bench.rs",
        "fs::write(",
        1,
        "in a folder that it has just made for itself",
    ),
    (
        "ser-cli/src/new_files.rs",
        ".persist(",
        2,
        "only with --force, over a file that was looked at; or what was replaced, put back",
    ),
    (
        "ser-cli/src/new_files.rs",
        "remove_file(",
        2,
        "what it has given its name a moment before, or has made and not given its name",
    ),
    (
        "ser-cli/src/new_files.rs",
        "fs::hard_link(",
        1,
        "only with --force, what is replaced, under a name that nothing has",
    ),
    (
        "ser-cli/src/new_files.rs",
        "fs::rename(",
        1,
        "only with --force, what is replaced, under a name that nothing has",
    ),
    (
        "ser-cli/src/appending.rs",
        ".write(true)",
        1,
        "the lock, which is never written to; no link is followed",
    ),
    (
        "ser-cli/src/audit/file.rs",
        "append(true)",
        1,
        "makes the file, or opens one that was read as ours just before; no link is followed",
    ),
    (
        "ser-cli/src/audit/file.rs",
        "fs::rename(",
        1,
        "a file that was opened as ours just before, to a number that no file has, under the lock",
    ),
    (
        "ser-cli/src/kept.rs",
        "append(true)",
        1,
        "makes the file, or opens one that was read as ours just before; no link is followed",
    ),
    (
        "ser-cli/src/output/rows.rs",
        "set_len(",
        1,
        "what was just written to standard output, if nobody has written after it",
    ),
    (
        "ser-cli/src/state.rs",
        ".persist(",
        1,
        "over a state file, or records that are kept beside it, which it was read as just before",
    ),
    (
        "ser-cli/src/state.rs",
        ".write(true)",
        1,
        "the lock, which is never written to; no link is followed",
    ),
    ("ser-cli/src/state.rs", "remove_file(", 1, "a state file, which it was read as just before"),
    (
        "crates/image-check/src/independent/images.rs",
        "println!(",
        1,
        "in a test, which cargo reads",
    ),
    (
        "crates/ser-client/src/genius/window.rs",
        ".write(true)",
        1,
        "what the user names as a window; before a board answers, what is written is put back",
    ),
    (
        "crates/ser-sim/src/claim/mod.rs",
        "OFlags::RDWR",
        1,
        "the claim's record, in a directory as below; no link",
    ),
    (
        "crates/ser-sim/src/claim/mod.rs",
        "remove_file(",
        2,
        "what the claim's record says is ours, or what was just made",
    ),
    (
        "crates/ser-sim/src/claim/mod.rs",
        "set_len(",
        1,
        "the claim's record, in a directory that nobody else can write to",
    ),
    (
        "crates/ser-sim/src/claim/mod.rs",
        "unlinkat(",
        1,
        "the claim's record, by its open directory, while it is locked",
    ),
    (
        "crates/ser-sim/src/qemu/emulator.rs",
        "File::create(",
        1,
        "in a temporary directory of its own",
    ),
    (
        "crates/ser-sim/src/qemu/emulator.rs",
        "Process::new(",
        1,
        "what QEMU writes it inherits open; see emulator_files.rs",
    ),
    (
        "crates/ser-sim/src/qemu/emulator_files.rs",
        "OFlags::WRONLY",
        1,
        "looked at after opening: a pipe, a terminal or the null device",
    ),
    (
        "crates/ser-sim/src/qemu/emulator_files.rs",
        "append(true)",
        1,
        "makes the file, and fails where anything is",
    ),
    (
        "crates/ser-sim/src/qemu/external_bus.rs",
        ".write(true)",
        2,
        "makes the file, or opens one with our mark and no link, looked at after opening",
    ),
    ("crates/ser-sim/src/qemu/external_bus.rs", "map_raw(", 1, "one of these two"),
    (
        "crates/ser-sim/src/qemu/external_bus.rs",
        "set_len(",
        1,
        "a file that was just made, and by nobody else",
    ),
    (
        "crates/ser-sim/src/genius_bench/host_window.rs",
        ".write(true)",
        1,
        "makes the file, and fails where anything is",
    ),
    (
        "crates/image-bench/src/lockstep.rs",
        "File::create(",
        1,
        "in a temporary directory of its own",
    ),
    (
        "crates/image-bench/src/lockstep.rs",
        "Process::new(",
        1,
        "as in emulator.rs; sockets are in a temporary directory, and the plugin is read",
    ),
    (
        "crates/ser-sim/src/line/pty.rs",
        ".persist(",
        1,
        "over a link that the claim's record says is ours",
    ),
    (
        "crates/ser-sim/src/line/pty.rs",
        "OFlags::RDWR",
        1,
        "a pseudo-terminal that was just made, by its own name",
    ),
    ("crates/ser-sim/src/line/pty.rs", "symlink(", 3, "makes a link, and fails where anything is"),
    (
        "crates/image-bench/plugin/src/lib.rs",
        "println!(",
        1,
        "in QEMU, whose standard error is a file of the bench",
    ),
    (
        "crates/ser-trial/examples/fuzzing.rs",
        ".write(true)",
        1,
        "makes the file, and fails where anything is",
    ),
    ("xtask/src/evidence_mistakes/copy.rs", "fs::copy(", 2, "into the build folder"),
    ("xtask/src/evidence_mistakes/copy.rs", "fs::write(", 3, "in the build folder"),
    ("xtask/src/evidence_mistakes/copy.rs", "remove_dir_all(", 1, "in the build folder"),
    ("xtask/src/setup/apt.rs", "File::create(", 1, "in the build folder"),
    ("xtask/src/setup/programs.rs", "fs::write(", 1, "in the build folder"),
    (
        "xtask/src/setup/apt.rs",
        "append(true)",
        1,
        "the file that was just made in the build folder",
    ),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Finds the sources of programs and libraries, without those of tests.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in
        fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path())
    {
        let name = entry.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let is_test = name == "tests" || name == "tests.rs";
        if entry.is_dir() && !is_test {
            sources(&entry, found);
        } else if name.ends_with(".rs") && !is_test {
            found.push(entry);
        }
    }
}

/// Where the tests at the end of a source begin. A module of tests in another file does not count.
fn end_of_code(source: &str) -> usize {
    let is_body = |at: usize| {
        let mut lines = source[at..].lines().skip(1);
        lines.next().is_some_and(|line| line.starts_with("mod ") && line.ends_with('{'))
    };
    let marks = source.match_indices("\n#[cfg(").map(|(at, _)| at + 1);
    let is_of_tests = |at: usize| {
        let mark = source[at..].lines().next().unwrap_or_default();
        mark == "#[cfg(test)]" || mark.starts_with("#[cfg(all(test")
    };
    marks.into_iter().find(|&at| is_of_tests(at) && is_body(at)).unwrap_or(source.len())
}

/// How often each call occurs in a source, without comments and without the tests at its end.
fn calls(source: &str) -> BTreeMap<&'static str, usize> {
    let code = &source[..end_of_code(source)];
    let lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
    let code: String = lines.flat_map(|line| [line, "\n"]).collect();
    // `is_symlink` only looks, so a call may not follow an underscore.
    let is_call = |&(at, _): &(usize, &str)| !code[..at].ends_with('_');
    let counts = CALLS.map(|call| (call, code.match_indices(call).filter(is_call).count()));
    counts.into_iter().filter(|(_, count)| *count > 0).collect()
}

#[test]
fn every_call_that_could_touch_a_file_of_others_has_been_judged() {
    let mut files = Vec::new();
    let mut packages = Vec::new();
    for folder in [root(), root().join("crates"), root().join("crates/image-bench")] {
        let entries =
            fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
        packages.extend(entries.filter(|entry| entry.join("Cargo.toml").exists()));
    }
    for package in packages {
        for folder in ["src", "examples"].map(|folder| package.join(folder)) {
            if folder.is_dir() {
                sources(&folder, &mut files);
            }
        }
    }
    assert!(files.len() > 200, "{}", files.len());
    let mut found = BTreeMap::new();
    for file in files {
        let name =
            file.strip_prefix(root()).expect("below the root").to_string_lossy().into_owned();
        for (call, count) in calls(&fs::read_to_string(&file).expect("a source")) {
            found.insert((name.clone(), call), count);
        }
    }
    let judged = JUDGED.iter().map(|&(file, call, count, _)| ((file.to_owned(), call), count));
    assert_eq!(found, judged.collect());
}

#[test]
fn calls_in_comments_and_tests_are_none() {
    let source = "fs::write(a);\n  // fs::copy(a)\nfs::write(b);\na.is_symlink()\n\
                  #[cfg(test)]\nmod tests {\nfs::rename(a)\n}";
    assert_eq!(calls(source), BTreeMap::from([("fs::write(", 2)]));
}

#[test]
fn a_module_of_tests_in_another_file_ends_nothing() {
    let source =
        "#[cfg(test)]\nmod mutants;\nfs::write(a);\n\n#[cfg(test)]\nmod tests {\nfs::write(a)\n}";
    for mark in ["#[cfg(test)]", "#[cfg(all(test, unix))]"] {
        let source = source.replace("#[cfg(test)]", mark);
        assert_eq!(calls(&source), BTreeMap::from([("fs::write(", 1)]), "{mark}");
    }
}
