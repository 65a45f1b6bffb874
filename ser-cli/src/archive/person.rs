//! Who writes to an archive, and where.

use ser_console::is_obeyed;
use ser_evidence::record::NoteRecord;

/// A person at a computer, by the names that it has for both.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Person {
    pub(crate) user: String,
    pub(crate) host: String,
}

impl Person {
    /// Whoever runs this program.
    pub(crate) fn here() -> Person {
        let named =
            ["USER", "LOGNAME", "USERNAME"].iter().find_map(|name| std::env::var(name).ok());
        Person {
            user: fit(&named.unwrap_or_default(), "somebody"),
            host: fit(&host(), "a computer"),
        }
    }
}

#[cfg(unix)]
fn host() -> String {
    rustix::system::uname().nodename().to_string_lossy().into_owned()
}

#[cfg(not(unix))]
fn host() -> String {
    std::env::var("COMPUTERNAME").unwrap_or_default()
}

/// A name as a record may hold it.
fn fit(name: &str, else_: &str) -> String {
    let seen: String = name.chars().filter(|&letter| !is_obeyed(letter)).collect();
    let short: String = seen.trim().chars().take(NoteRecord::LONGEST_NAME).collect();
    let short = short.trim_end();
    if short.is_empty() { else_.to_owned() } else { short.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_one_line_that_can_be_seen() {
        assert_eq!(fit(" ada\u{1b}[2J\n", "somebody"), "ada[2J");
        assert_eq!(fit("\u{202e}", "somebody"), "somebody");
        assert_eq!(fit(&"x".repeat(300), "somebody").len(), NoteRecord::LONGEST_NAME);
    }
}
