//! Debian's and Ubuntu's packages.

use std::fs::{self, File, OpenOptions};
use std::process::Command;

use crate::places;
use crate::steps::{output, unrelated, works};

/// Whether packages can be installed in this way.
pub(crate) fn there() -> bool {
    cfg!(target_os = "linux") && works(unrelated("apt-get").arg("--version"))
}

/// Installs packages without asking. apt's output goes to a file. The error gives the reason of a
/// failure.
pub(crate) fn install(packages: &[&str]) -> Result<(), String> {
    let root = output(unrelated("id").arg("-u")).is_some_and(|id| id == "0");
    if !root && !works(unrelated("sudo").args(["-n", "true"])) {
        return Err("installing packages needs root, or sudo without a password".to_owned());
    }
    let log =
        places::firmware_target().join(format!("apt-{}.log", packages.first().unwrap_or(&"")));

    fs::create_dir_all(places::firmware_target())
        .and_then(|()| File::create(&log).map(drop))
        .map_err(|error| format!("{}: {error}", log.display()))?;

    let apt_get = |arguments: &[&str]| -> bool {
        let mut command = if root {
            unrelated("env")
        } else {
            let mut sudo = unrelated("sudo");
            sudo.args(["-n", "env"]);
            sudo
        };
        command.args(["DEBIAN_FRONTEND=noninteractive", "apt-get", "--yes", "--quiet"]);
        // Another apt may be running, for example on a machine that has just started.
        command.args(["--option", "DPkg::Lock::Timeout=120"]).args(arguments);
        log_to(&mut command, &log)
            .is_some_and(|command| command.status().is_ok_and(|status| status.success()))
    };
    let install = [&["install", "--no-install-recommends"], packages].concat();
    // A fresh container has no package lists. Most other machines have them and need no update.
    if apt_get(&install) || apt_get(&["update"]) && apt_get(&install) {
        return Ok(());
    }
    let printed = fs::read_to_string(&log).unwrap_or_default();
    let reason =
        printed.lines().rev().find(|line| line.starts_with("E:")).unwrap_or("E: apt-get failed");
    Err(format!(
        "{} ({}; all of it: {})",
        reason.trim_start_matches("E: "),
        packages.join(" "),
        log.display()
    ))
}

fn log_to<'a>(command: &'a mut Command, log: &std::path::Path) -> Option<&'a mut Command> {
    let file = OpenOptions::new().append(true).open(log).ok()?;
    let errors = file.try_clone().ok()?;
    Some(command.stdin(std::process::Stdio::null()).stdout(file).stderr(errors))
}
