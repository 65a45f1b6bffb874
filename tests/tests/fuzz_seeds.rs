//! Everything that fuzzing checks, run on the seeds that are kept. The fuzzer itself is `cargo
//! xtask fuzz`.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use proptest::prelude::*;
use ser_trial::fuzzing::{self, TARGETS, seeds};

/// Makes a test of each target.
macro_rules! targets {
    ($($name:ident)*) => {
        $(#[test]
        fn $name() {
            replay(stringify!($name));
        })*

        const TESTED: &[&str] = &[$(stringify!($name)),*];
    };
}

targets! { frames commands replies datagrams comm_req geni_driver node client cli_files captures state_files records foreign_lists site_files }

fn replay(name: &str) {
    let target = TARGETS.iter().find(|target| target.name == name).expect("a target");
    let seeds = seeds::of(name).unwrap_or_else(|error| panic!("{error}"));
    assert!(!seeds.is_empty(), "{name} has no seeds");
    for seed in seeds {
        // Printed only when the test fails.
        println!("{name}/{}", seed.name);
        (target.run)(&seed.bytes);
    }
}

/// The names in a folder, without what follows the dot.
fn names(folder: &Path) -> BTreeSet<String> {
    let files =
        fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let stem = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    files.map(|file| stem(&file.expect("a file").path())).collect()
}

#[test]
fn every_target_has_a_program_seeds_and_a_test() {
    let targets: BTreeSet<String> = TARGETS.iter().map(|target| target.name.to_owned()).collect();
    assert_eq!(names(&seeds::folder()), targets);
    assert_eq!(names(&seeds::folder().with_file_name("fuzz_targets")), targets);
    assert_eq!(TESTED.iter().map(|&name| name.to_owned()).collect::<BTreeSet<_>>(), targets);
}

/// A byte as fields of few bits have it, or any.
fn field() -> impl Strategy<Value = u8> {
    prop_oneof![2 => 0..3_u8, 2 => 0..40_u8, 1 => any::<u8>(), 1 => Just(0xFF), 1 => Just(0x80)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4096))]

    #[test]
    fn bodies_like_those_of_the_extension_are_judged_as_the_tables_say(
        code in prop::sample::select(b"ITFD".to_vec()),
        fields in prop_oneof![
            prop::collection::vec(field(), 0..10),
            prop::collection::vec(field(), 0..140),
        ],
        inputs in prop::sample::select(vec![16, 32]),
    ) {
        let mut body = [&[code][..], &fields].concat();
        if let [b'I', _, found, ..] = &mut body[..] {
            // Otherwise hardly any identity has a whole front.
            *found = inputs;
        }
        fuzzing::commands(&body);
        fuzzing::replies(&body);
    }
}
