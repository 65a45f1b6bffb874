//! Python's own reader of files of `SQLite`.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use crate::common::Home;
use crate::of_every_kind;

/// What the program says of the chains of a file.
fn judged(path: &Path) -> String {
    let python = Path::new(env!("CARGO_TARGET_TMPDIR")).join("../readers/bin/python");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/judge/chain.py");
    let output = Command::new(python).arg(script).arg(path).output();
    let output = output.expect("the readers are there: cargo xtask test --all");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
#[ignore = "needs python-readers: cargo xtask test"]
fn a_program_of_somebody_else_reckons_the_same_chain() {
    let home = Home::new();
    let (heads, _) = of_every_kind(&home).verify().unwrap();
    let head = &heads[0];
    let mut digest = String::new();
    head.digest.iter().for_each(|byte| write!(digest, "{byte:02x}").unwrap());
    let (collector, recorder, rows) = (&head.collector, &head.recorder, head.rows);
    assert_eq!(judged(&home.path()), format!("{collector}\t{recorder}\t{rows}\t{digest}\n"));
    assert!(head.expired_to.is_some(), "something was let go before");
    for change in [
        "UPDATE entry SET state = state + 1 WHERE sequence = 5",
        "UPDATE conflict SET changed = changed + 1",
        "UPDATE evidence SET line = line || ' ' WHERE position = 1",
        "UPDATE checkpoint SET entries = entries + 1",
        "DELETE FROM entry WHERE sequence = 12",
    ] {
        let home = Home::new();
        _ = of_every_kind(&home);
        home.sql(change);
        let said = judged(&home.path());
        assert!(said.contains("broken"), "{change}: {said}");
        assert_eq!(home.open().verify().unwrap().1.len(), 1, "{change}");
    }
}
