//! The pages for people: nothing is left of a merge, and what they link to is there.

use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// All pages at the top and in `docs`, with their text.
fn pages() -> Vec<(PathBuf, String)> {
    let folders = [root(), root().join("docs")];
    let files = folders.iter().flat_map(|folder| fs::read_dir(folder).expect("a folder"));
    let paths = files.map(|file| file.expect("a file").path());
    let is_page = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "md");
    let read = |path: PathBuf| (path.clone(), fs::read_to_string(path).expect("UTF-8"));
    paths.filter(is_page).map(read).collect()
}

/// Lines that git leaves where two versions did not fit together.
fn leftovers(text: &str) -> Vec<usize> {
    let is_left = |line: &str| {
        line == "=======" || line.starts_with("<<<<<<< ") || line.starts_with(">>>>>>> ")
    };
    let numbered = text.lines().enumerate();
    numbered.filter(|(_, line)| is_left(line)).map(|(number, _)| number + 1).collect()
}

/// The files that a page links to or shows.
fn links(text: &str) -> Vec<&str> {
    let targets = text.split("](").skip(1).filter_map(|rest| rest.split([')', ' ']).next());
    let files = targets.map(|target| target.split('#').next().unwrap_or_default());
    files.filter(|file| !file.is_empty() && !file.contains("://")).collect()
}

#[test]
fn nothing_is_left_of_a_merge() {
    assert_eq!(leftovers("a\n<<<<<<< HEAD\nb\n=======\nc\n>>>>>>> other\n"), [2, 4, 6]);
    for (path, text) in pages() {
        assert_eq!(leftovers(&text), Vec::<usize>::new(), "{}", path.display());
    }
}

#[test]
fn what_a_page_links_to_is_there() {
    assert_eq!(links("[a](b.md#c) ![d](e.png) [f](https://g) [h](#i)"), ["b.md", "e.png"]);
    for (path, text) in pages() {
        let folder = path.parent().expect("a folder");
        for link in links(&text) {
            assert!(folder.join(link).exists(), "{}: {link}", path.display());
        }
    }
}
