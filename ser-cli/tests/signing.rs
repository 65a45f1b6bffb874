//! Reports that are signed, and signatures that are checked, also by minisign itself.
#![cfg(all(unix, feature = "sign"))]

mod common;

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::Output;

use common::bench::text;
use common::ser_cli;
use tempfile::TempDir;

const LOG: &str = "entry,time,input,state,sequence,life,note\n\
                   1,2026-11-22T10:00:00.250,3,1,1,9f3c5a7e21b04d68,\n\
                   2,2026-11-22T10:00:00.263,5,1,2,9f3c5a7e21b04d68,\n";

const SITE: &str = "site = \"Northfield\"\ntime_zone = \"Europe/Berlin\"\n\
                    [[recorder]]\nname = \"u1\"\n";

/// A folder with a log, a site and keys of Anna and of Ben.
struct Desk(TempDir);

impl Desk {
    fn new() -> Desk {
        let desk = Desk(tempfile::tempdir().expect("a folder"));
        fs::write(desk.path("u1.csv"), LOG).expect("written");
        fs::write(desk.path("site.toml"), SITE).expect("written");
        for name in ["anna", "ben"] {
            desk.ok(&format!("report key -o {name}"));
        }
        desk
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn run_with(&self, password: &str, arguments: &str) -> Output {
        let mut command = ser_cli();
        command
            .current_dir(self.0.path())
            .env("SER_STATE_DIR", self.path("state"))
            .env("SER_SIGN_PASSWORD", password);
        command.args(arguments.split_whitespace()).output().expect("ser-cli runs")
    }

    fn run(&self, arguments: &str) -> Output {
        self.run_with("a good one", arguments)
    }

    fn ok(&self, arguments: &str) -> String {
        let output = self.run(arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments}: {}", text(&output.stderr));
        text(&output.stdout)
    }

    /// What is told by a command that must fail, with its exit code, and print nothing.
    fn fails(&self, code: i32, arguments: &str) -> String {
        let output = self.run(arguments);
        let told = text(&output.stderr);
        assert_eq!(
            (output.status.code(), text(&output.stdout)),
            (Some(code), String::new()),
            "{told}"
        );
        told
    }

    fn sign(&self, name: &str) {
        self.ok(&format!(
            "report --last --input u1.csv --site site.toml -o {name} --sign anna.key"
        ));
    }

    /// The names of all files, without those that it began with.
    fn reports(&self) -> Vec<String> {
        let names = fs::read_dir(self.0.path()).expect("a folder");
        let mut names: Vec<String> = names
            .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
            .filter(|name| name.starts_with('t') || name.starts_with('.'))
            .collect();
        names.sort();
        names
    }

    fn edit(&self, name: &str, edit: impl FnOnce(String) -> String) {
        let before = fs::read_to_string(self.path(name)).expect("text");
        let after = edit(before.clone());
        assert_ne!(before, after, "nothing to edit in {name}");
        fs::write(self.path(name), after).expect("written");
    }
}

#[test]
fn a_signed_report_is_verified_and_its_comment_says_of_what_it_is() {
    let desk = Desk::new();
    for name in ["trip.html", "trip.txt", "trip.json"] {
        desk.sign(name);
        let told = desk.ok(&format!("report verify {name} --key anna.pub"));
        assert!(told.starts_with(&format!("{name} is what was signed\nkey ")), "{told}");
        for line in [format!("file            {name}"), "site            Northfield".to_owned()] {
            assert!(told.lines().any(|told| told == line), "{line}: {told}");
        }
        assert!(told.contains("\nsigned          20"), "{told}");
    }
    let json: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(desk.path("trip.json")).unwrap()).unwrap();
    let digest = json["source"]["entries_sha256"].as_str().or(json["entries_sha256"].as_str());
    let told = desk.ok("report verify trip.json --key anna.pub");
    let line = format!("entries sha256  {}", digest.expect("a digest"));
    assert!(told.lines().any(|told| told == line), "{line}: {told}");
}

#[test]
fn another_key_a_changed_byte_and_a_changed_comment_are_told_apart() {
    let desk = Desk::new();
    desk.sign("trip.html");
    let verify = "report verify trip.html --key";
    let another = desk.fails(1, &format!("{verify} ben.pub"));
    assert!(another.contains("was signed with another key"), "{another}");
    assert!(another.contains("hint: get the public key from whoever signed"), "{another}");

    desk.edit("trip.html.minisig", |text| text.replace("site:Northfield", "site:Southfield"));
    let comment = desk.fails(1, &format!("{verify} anna.pub"));
    assert!(comment.contains("but the comment of its signature is not"), "{comment}");
    desk.edit("trip.html.minisig", |text| text.replace("site:Southfield", "site:Northfield"));
    desk.ok(&format!("{verify} anna.pub"));

    desk.edit("trip.html", |text| text.replacen("10:00", "10:01", 1).replacen("11:00", "11:01", 1));
    let changed = desk.fails(1, &format!("{verify} anna.pub"));
    assert!(changed.contains("is not what was signed"), "{changed}");

    // A key of the same number is not the same key.
    let own = |name: &str| fs::read_to_string(desk.path(name)).unwrap();
    let (anna, ben) = (own("anna.pub"), own("ben.pub"));
    let key = |text: &str| text.lines().nth(1).unwrap().to_owned();
    // Fourteen signs are the algorithm and the number, but for a part of the last one.
    let forged = format!("untrusted comment: x\n{}{}\n", &key(&anna)[..14], &key(&ben)[14..]);
    fs::write(desk.path("forged.pub"), forged).unwrap();
    assert!(!desk.run(&format!("{verify} forged.pub")).status.success());
}

#[test]
fn whatever_a_file_of_signature_or_key_holds_it_is_refused_in_words() {
    let desk = Desk::new();
    desk.sign("trip.html");
    let whole = fs::read_to_string(desk.path("trip.html.minisig")).unwrap();
    let lines: Vec<&str> = whole.lines().collect();
    let short = |line: &str| line[..line.len() / 2 / 4 * 4].to_owned();
    let texts = [
        String::new(),
        "a letter".to_owned(),
        lines[..3].join("\n"),
        [lines[0], lines[1], lines[2], &short(lines[3])].join("\n"),
        [lines[0], &short(lines[1]), lines[2], lines[3]].join("\n"),
        [lines[0], lines[1], "trusted", lines[3]].join("\n"),
        ["", lines[1], lines[2], lines[3]].join("\n"),
        [lines[0], lines[1], lines[2], &"=".repeat(88)].join("\n"),
        "é".repeat(20_000),
    ];
    for bad in texts {
        fs::write(desk.path("trip.html.minisig"), &bad).unwrap();
        let told = desk.fails(1, "report verify trip.html --key anna.pub");
        assert!(told.contains("error: ") && told.contains("hint: "), "{bad}: {told}");
        fs::write(desk.path("bad.pub"), &bad).unwrap();
        let told = desk.fails(1, "report verify trip.html --key bad.pub");
        assert!(told.contains("error: ") && told.contains("hint: "), "{bad}: {told}");
        fs::write(desk.path("bad.key"), &bad).unwrap();
        let told = desk.fails(1, "report --last --input u1.csv -o t2.html --sign bad.key");
        assert!(told.contains("error: ") && told.contains("hint: "), "{bad}: {told}");
    }
    // A byte of it is another one, at any place.
    for place in (0..whole.len()).step_by(7) {
        let mut bytes = whole.clone().into_bytes();
        bytes[place] ^= 1;
        fs::write(desk.path("trip.html.minisig"), &bytes).unwrap();
        let output = desk.run("report verify trip.html --key anna.pub");
        // The first line says nothing that is signed.
        let may_pass = place < lines[0].len();
        assert!(may_pass || output.status.code() == Some(1), "{place}: {}", text(&output.stdout));
    }
}

#[test]
fn report_and_signature_appear_together_or_not_at_all() {
    let desk = Desk::new();
    let report = "report --last --input u1.csv -o trip.html --sign";
    let wrong = desk.run_with("a bad one", &format!("{report} anna.key"));
    assert_eq!(wrong.status.code(), Some(1));
    assert!(text(&wrong.stderr).contains("Wrong password"), "{}", text(&wrong.stderr));
    let missing = desk.fails(1, &format!("{report} nobody.key"));
    assert!(missing.contains("nobody.key"), "{missing}");
    assert_eq!(desk.reports(), Vec::<String>::new());

    // A signature of somebody is there, and stays.
    fs::write(desk.path("trip.html.minisig"), "theirs").unwrap();
    let exists = desk.fails(1, &format!("{report} anna.key"));
    assert!(exists.contains("trip.html.minisig exists"), "{exists}");
    assert_eq!(desk.reports(), ["trip.html.minisig"]);
    assert_eq!(fs::read_to_string(desk.path("trip.html.minisig")).unwrap(), "theirs");
    desk.ok(&format!("{report} anna.key --force"));
    assert_eq!(desk.reports(), ["trip.html", "trip.html.minisig"]);
    desk.ok("report verify trip.html --key anna.pub");

    let told = desk.fails(2, "report --last --input u1.csv --sign anna.key");
    assert!(told.contains("cannot be signed") && told.contains("with -o"), "{told}");
}

#[test]
fn a_key_is_its_owners_and_never_overwritten() {
    let desk = Desk::new();
    let mode = |name: &str| fs::metadata(desk.path(name)).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode("anna.key"), 0o600);
    assert_ne!(mode("anna.pub") & 0o044, 0, "others may read it, by the usual mask");
    let before = fs::read(desk.path("anna.key")).unwrap();
    let told = desk.fails(1, "report key -o anna");
    assert!(told.contains("exists"), "{told}");
    assert_eq!(fs::read(desk.path("anna.key")).unwrap(), before);
    fs::remove_file(desk.path("anna.key")).unwrap();
    desk.fails(1, "report key -o anna");
    assert!(!desk.path("anna.key").exists(), "no key without its other half");

    desk.ok("report key -o open --no-password");
    let signed = desk.run_with("", "report --last --input u1.csv -o t.txt --sign open.key");
    assert!(signed.status.success(), "{}", text(&signed.stderr));
    desk.ok("report verify t.txt --key open.pub");
}

#[test]
fn without_a_terminal_a_password_is_not_waited_for() {
    let desk = Desk::new();
    let mut command = std::process::Command::new("setsid");
    command.arg(env!("CARGO_BIN_EXE_ser-cli")).current_dir(desk.0.path());
    command.env_remove("SER_SIGN_PASSWORD").stdin(std::process::Stdio::null());
    let output = command.args(["report", "key", "-o", "carl"]).output().expect("setsid runs");
    let told = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.contains("SER_SIGN_PASSWORD") && !desk.path("carl.key").exists(), "{told}");
}

/// minisign by the author of the format.
mod needs_minisign {
    use std::io::Write;
    use std::process::{Command, Stdio};

    use super::*;

    /// Runs minisign, which gets these lines on its standard input.
    fn minisign(desk: &Desk, arguments: &[&str], input: &str) -> Output {
        let mut command = Command::new("minisign");
        command.args(arguments).current_dir(desk.0.path());
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("minisign runs: cargo xtask test --all installs it");
        child.stdin.take().expect("piped").write_all(input.as_bytes()).expect("it reads");
        child.wait_with_output().expect("it ends")
    }

    #[test]
    #[ignore = "needs minisign: cargo xtask test"]
    fn minisign_verifies_our_signatures_and_tells_what_is_wrong() {
        let desk = Desk::new();
        desk.sign("trip.html");
        let verify = |key: &str| minisign(&desk, &["-V", "-m", "trip.html", "-p", key], "");
        let good = verify("anna.pub");
        assert!(good.status.success(), "{}", text(&good.stderr));
        let told = text(&good.stdout);
        assert!(told.contains("site:Northfield") && told.contains("entries_sha256:"), "{told}");
        assert!(!verify("ben.pub").status.success());
        desk.edit("trip.html.minisig", |text| text.replace("Northfield", "Southfield"));
        assert!(!verify("anna.pub").status.success());
        desk.edit("trip.html.minisig", |text| text.replace("Southfield", "Northfield"));
        assert!(verify("anna.pub").status.success());
        desk.edit("trip.html", |text| text.replacen("</", " </", 1));
        assert!(!verify("anna.pub").status.success());
    }

    #[test]
    #[ignore = "needs minisign: cargo xtask test"]
    fn we_verify_signatures_and_use_keys_that_minisign_has_made() {
        let desk = Desk::new();
        let made = minisign(
            &desk,
            &["-G", "-p", "mini.pub", "-s", "mini.key"],
            "a good one\na good one\n",
        );
        assert!(made.status.success(), "{}", text(&made.stderr));
        let open = minisign(&desk, &["-G", "-W", "-p", "open.pub", "-s", "open.key"], "");
        assert!(open.status.success(), "{}", text(&open.stderr));
        fs::write(desk.path("trip.txt"), "any text").unwrap();
        for (key, public) in [("mini.key", "mini.pub"), ("open.key", "open.pub")] {
            let arguments = ["-S", "-s", key, "-m", "trip.txt", "-t", "from minisign"];
            let signed = minisign(&desk, &arguments, "a good one\n");
            assert!(signed.status.success(), "{}", text(&signed.stderr));
            let told = desk.ok(&format!("report verify trip.txt --key {public}"));
            assert!(told.contains("comment         from minisign"), "{told}");
            let told = desk.fails(1, "report verify trip.txt --key anna.pub");
            assert!(told.contains("another key"), "{told}");

            let name = format!("{key}.html");
            desk.ok(&format!("report --last --input u1.csv -o {name} --sign {key}"));
            let verified = minisign(&desk, &["-V", "-m", &name, "-p", public], "");
            assert!(verified.status.success(), "{}", text(&verified.stderr));
        }
    }

    #[test]
    #[ignore = "needs minisign: cargo xtask test"]
    fn a_damaged_key_without_a_checksum_signs_nothing() {
        let desk = Desk::new();
        let made = minisign(&desk, &["-G", "-W", "-p", "open.pub", "-s", "open.key"], "");
        assert!(made.status.success(), "{}", text(&made.stderr));
        let whole = fs::read_to_string(desk.path("open.key")).unwrap();
        let begin = whole.find('\n').unwrap() + 1;
        // The private and the public half of the key.
        for place in [begin + 90, begin + 120, begin + 150] {
            let mut bytes = whole.clone().into_bytes();
            bytes[place] = if bytes[place] == b'A' { b'B' } else { b'A' };
            fs::write(desk.path("open.key"), bytes).unwrap();
            let told = desk.fails(1, "report --last --input u1.csv -o trip.html --sign open.key");
            assert!(told.contains("cannot sign trip.html"), "{place}: {told}");
            assert_eq!(desk.reports(), Vec::<String>::new());
        }
    }

    #[test]
    #[ignore = "needs minisign: cargo xtask test"]
    fn minisign_signs_with_keys_that_we_have_made() {
        let desk = Desk::new();
        desk.ok("report key -o open --no-password");
        fs::write(desk.path("trip.txt"), "any text").unwrap();
        for name in ["anna", "open"] {
            let key = format!("{name}.key");
            let arguments = ["-S", "-s", &key, "-m", "trip.txt"];
            let signed = minisign(&desk, &arguments, "a good one\n");
            assert!(signed.status.success(), "{}", text(&signed.stderr));
            desk.ok(&format!("report verify trip.txt --key {name}.pub"));
        }
    }
}
