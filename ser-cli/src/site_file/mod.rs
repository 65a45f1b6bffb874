//! Site files: from a path to the site, and what is wrong with it drawn for people.

mod choice;
mod draw;
mod ports;
mod source;

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use ser_console::Harmless;
use ser_evidence::site::{self, Diagnostic, Reading, Role, Site};
use ser_proto::Model;

#[cfg(unix)]
pub(crate) use choice::bus_name;
pub(crate) use choice::{Chosen, choose};

use crate::error::{Failure, Result};

/// A site file is at most so large, and a few bytes more show that this one is not.
const LARGEST: u64 = (4 << 20) + 1;

/// A file that was read, and what it says.
pub(crate) struct Inspected {
    name: String,
    text: String,
    reading: Reading,
}

impl Inspected {
    /// Reads a site file and looks at everything in it, its ports included.
    pub(crate) fn of(path: &Path) -> Result<Inspected> {
        let name = Harmless(path.display()).line();
        let text = text(path, &name, "ser-cli site new -o FILE writes a site file")?;
        let mut reading = site::inspect(&text);
        ports::look(&mut reading);
        Ok(Inspected { name, text, reading })
    }

    /// Draws errors and warnings on standard error.
    pub(crate) fn draw(&self) {
        draw::on_stderr(&self.name, &self.text, &self.reading.diagnostics);
    }

    /// The file's name, harmless.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// The site, or how many errors keep it from being one.
    pub(crate) fn into_site(self) -> Result<Site> {
        let Inspected { name, reading: Reading { site, diagnostics, .. }, .. } = self;
        site.ok_or_else(|| {
            let errors = diagnostics.iter().filter(|found| found.is_error()).count();
            let counted =
                [counted(errors, "error"), counted(diagnostics.len() - errors, "warning")];
            let counted: Vec<String> = counted.into_iter().flatten().collect();
            Failure::new(format!("{name} has {}", counted.join(" and ")))
                .hint("ser-cli site new writes a file in which every key is explained")
        })
    }
}

/// The site that a file describes; errors are drawn on standard error.
pub(crate) fn load(path: &Path) -> Result<Site> {
    let inspected = Inspected::of(path)?;
    if inspected.reading.site.is_none() {
        inspected.draw();
    }
    inspected.into_site()
}

/// As in "1 error", "2 errors"; `None` if there are none.
pub(crate) fn counted(count: usize, what: &str) -> Option<String> {
    match count {
        0 => None,
        1 => Some(format!("1 {what}")),
        _ => Some(format!("{count} {what}s")),
    }
}

/// The text of a file that a user writes. `hint` says where to begin if it is not there.
pub(crate) fn text_of(path: &Path, hint: &str) -> Result<String> {
    text(path, &Harmless(path.display()).line(), hint)
}

/// Draws mistakes of such a file on standard error.
pub(crate) fn draw(path: &Path, text: &str, mistakes: &[Diagnostic]) {
    draw::on_stderr(&Harmless(path.display()).line(), text, mistakes);
}

fn text(path: &Path, name: &str, hint: &str) -> Result<String> {
    let failure = |error: &io::Error| Failure::reading(name, error).hint(hint);
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(|error| failure(&error))?;
    file.take(LARGEST).read_to_end(&mut bytes).map_err(|error| failure(&error))?;
    // A text that was cut for its length may end in the middle of a character.
    let is_cut = bytes.len() as u64 == LARGEST;
    match String::from_utf8(bytes) {
        Ok(text) => Ok(text),
        Err(error) if is_cut => Ok(String::from_utf8_lossy(error.as_bytes()).into_owned()),
        Err(error) => Err(not_text(name, &error)),
    }
}

fn not_text(name: &str, error: &std::string::FromUtf8Error) -> Failure {
    let before = error.as_bytes().get(..error.utf8_error().valid_up_to()).unwrap_or_default();
    let line = before.iter().filter(|&&byte| byte == b'\n').count() + 1;
    Failure::new(format!("{name} is not UTF-8: see line {line}"))
        .hint("save it as UTF-8 in your editor; the encoding is often in its dialogue Save As")
}

/// A diagnostic of this program's own.
fn error(check: &'static str, span: site::Span, phrase: String) -> Diagnostic {
    Diagnostic {
        check,
        severity: site::Severity::Error,
        span,
        phrase,
        label: String::new(),
        helps: Vec::new(),
        related: Vec::new(),
    }
}

/// A model as site files have it.
pub(crate) fn model_name(model: Model) -> &'static str {
    match model {
        Model::Ser160 => "ser160",
        Model::Ser320 => "ser320",
    }
}

/// A role as site files have it.
pub(crate) fn role_name(role: Role) -> &'static str {
    match role {
        Role::BreakerClosed => "52a",
        Role::BreakerOpen => "52b",
        Role::Trip => "trip",
        Role::Close => "close",
        Role::Pickup => "pickup",
        Role::Lockout => "86",
        Role::Alarm => "alarm",
    }
}
