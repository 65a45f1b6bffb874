//! What is to be said about a site file, as data.
//!
//! Nothing here prints or knows of terminals. A diagnostic says where in the text something is, in
//! a short phrase what is wrong, and what would be right. Text that it repeats from the file is
//! harmless wherever it is shown.

use std::ops::Range;

use ser_console::Harmless;

/// A place in the text: byte offsets, which always lie between two characters of it.
pub type Span = Range<usize>;

/// How much a diagnostic matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// The file cannot be used.
    Error,
    /// The file can be used, and probably does not say what was meant.
    Warning,
}

/// Something to be said about a place in a site file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// The name of the check that found it, as in `docs/site-file.md`.
    pub check: &'static str,
    /// How much it matters.
    pub severity: Severity,
    /// Where it is.
    pub span: Span,
    /// What is wrong, in lower case and without a full stop.
    pub phrase: String,
    /// What to write beside the place; may be empty.
    pub label: String,
    /// What would be right.
    pub helps: Vec<String>,
    /// Other places that have to do with it.
    pub related: Vec<Related>,
}

/// Another place that has to do with a diagnostic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Related {
    /// Where it is.
    pub span: Span,
    /// What it has to do with it.
    pub label: String,
}

impl Diagnostic {
    pub(super) fn error(check: &'static str, span: Span, phrase: impl Into<String>) -> Diagnostic {
        let (phrase, severity) = (phrase.into(), Severity::Error);
        let (label, helps, related) = (String::new(), Vec::new(), Vec::new());
        Diagnostic { check, severity, span, phrase, label, helps, related }
    }

    pub(super) fn warning(
        check: &'static str,
        span: Span,
        phrase: impl Into<String>,
    ) -> Diagnostic {
        Diagnostic { severity: Severity::Warning, ..Diagnostic::error(check, span, phrase) }
    }

    #[must_use]
    pub(super) fn label(self, label: impl Into<String>) -> Diagnostic {
        Diagnostic { label: label.into(), ..self }
    }

    #[must_use]
    pub(super) fn help(mut self, help: impl Into<String>) -> Diagnostic {
        self.helps.push(help.into());
        self
    }

    #[must_use]
    pub(super) fn related(mut self, span: Span, label: impl Into<String>) -> Diagnostic {
        self.related.push(Related { span, label: label.into() });
        self
    }

    /// Whether the file cannot be used because of it.
    #[must_use]
    pub fn is_error(&self) -> bool {
        self.severity == Severity::Error
    }
}

/// Diagnostics that are kept; of a file with more, only the first are of use to anybody.
const KEPT: usize = 200;

/// Collects diagnostics.
#[derive(Debug, Default)]
pub(super) struct Findings {
    list: Vec<Diagnostic>,
    dropped: usize,
    compared: usize,
}

impl Findings {
    pub(super) fn add(&mut self, diagnostic: Diagnostic) {
        if self.list.len() < KEPT {
            self.list.push(diagnostic);
        } else {
            self.dropped += 1;
        }
    }

    /// Whether anything found so far makes the file unusable.
    pub(super) fn has_errors(&self) -> bool {
        self.dropped > 0 || self.list.iter().any(Diagnostic::is_error)
    }

    /// Notes that names are going to be compared. `false` once so many were compared that a reader
    /// of the diagnostics would wait for it.
    pub(super) fn may_compare(&mut self, names: usize) -> bool {
        const COMPARISONS: usize = 200_000;
        self.compared = self.compared.saturating_add(names);
        self.compared <= COMPARISONS && self.list.len() < KEPT
    }

    /// Keeps only what fits the condition.
    pub(super) fn retain(&mut self, condition: impl Fn(&Diagnostic) -> bool) {
        self.list.retain(condition);
    }

    /// All diagnostics in the order of the text.
    pub(super) fn into_list(mut self) -> Vec<Diagnostic> {
        self.list.sort_by_key(|diagnostic| (diagnostic.span.start, diagnostic.span.end));
        if let (Some(last), true) = (self.list.last(), self.dropped > 0) {
            let phrase = format!("{} more problems are not listed", self.dropped);
            let more = Diagnostic::error("too-many", last.span.clone(), phrase)
                .help("correct those that are listed, and check again");
            self.list.push(more);
        }
        self.list
    }
}

/// How much of a text is repeated.
const REPEATED: usize = 60;

/// A text from the file between back quotes: harmless, on one line, and not too long.
pub(super) fn quoted(text: &str) -> String {
    let mut letters = text.chars();
    let mut shown: String = letters.by_ref().take(REPEATED).collect();
    if letters.next().is_some() {
        shown.push('…');
    }
    format!("`{}`", Harmless(shown).line())
}

/// Several texts between back quotes, as in "`a`, `b` or `c`".
pub(super) fn quoted_list<'t>(texts: impl IntoIterator<Item = &'t str>, word: &str) -> String {
    let mut quoted: Vec<String> = texts.into_iter().map(quoted).collect();
    match (quoted.pop(), quoted.is_empty()) {
        (Some(last), false) => format!("{} {word} {last}", quoted.join(", ")),
        (Some(only), true) => only,
        (None, _) => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_repeated_from_a_file_is_harmless_and_short() {
        assert_eq!(quoted("a\u{1B}[2J\n\u{202E}"), r"`a\u{1b}[2J\n\u{202e}`");
        assert_eq!(quoted(&"x".repeat(1000)).chars().count(), REPEATED + 3);
    }

    #[test]
    fn a_list_reads_as_a_sentence_does() {
        assert_eq!(quoted_list(["a"], "or"), "`a`");
        assert_eq!(quoted_list(["a", "b", "c"], "or"), "`a`, `b` or `c`");
        assert_eq!(quoted_list([], "or"), "");
    }

    #[test]
    fn a_file_full_of_mistakes_is_told_in_bounds() {
        let mut findings = Findings::default();
        for start in (0..KEPT + 7).rev() {
            findings.add(Diagnostic::error("x", start..start, "wrong"));
        }
        let list = findings.into_list();
        assert_eq!(list.len(), KEPT + 1);
        assert!(list.windows(2).all(|pair| pair[0].span.start <= pair[1].span.start));
        assert_eq!(list.last().unwrap().phrase, "7 more problems are not listed");
    }
}
