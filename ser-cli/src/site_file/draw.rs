//! Diagnostics of a site file as a person reads them: phrase, line, caret, help.

use std::io::Write;

use annotate_snippets::renderer::DecorStyle;
use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};
use ser_console::Harmless;
use ser_evidence::site::{Diagnostic, Severity};

use super::source::Source;

/// More than these nobody reads at once.
const DRAWN: usize = 50;

/// Draws diagnostics on standard error, in colour where that is wanted.
pub(super) fn on_stderr(name: &str, text: &str, diagnostics: &[Diagnostic]) {
    let mut out = anstream::stderr().lock();
    // When standard error is gone, nobody can be told.
    let _ = out.write_all(drawn(name, text, diagnostics).as_bytes());
}

/// All diagnostics as text with colours.
fn drawn(name: &str, text: &str, diagnostics: &[Diagnostic]) -> String {
    let renderer = Renderer::styled().decor_style(DecorStyle::Ascii);
    let source = Source::of(text);
    let mut all = String::new();
    for diagnostic in diagnostics.iter().take(DRAWN) {
        all += &renderer.render(&[group(name, &source, diagnostic)]);
        all += "\n\n";
    }
    if let Some(more) = diagnostics.len().checked_sub(DRAWN).filter(|&more| more > 0) {
        all += &format!("{more} more are not shown\n\n");
    }
    all
}

fn group<'a>(name: &'a str, source: &'a Source, diagnostic: &'a Diagnostic) -> Group<'a> {
    let level = match diagnostic.severity {
        Severity::Error => Level::ERROR,
        Severity::Warning => Level::WARNING,
    };
    let title = level.primary_title(harmless(&diagnostic.phrase)).id(diagnostic.check);
    let label = Some(&diagnostic.label).filter(|label| !label.is_empty());
    let primary = AnnotationKind::Primary.span(source.span(&diagnostic.span));
    let related = diagnostic.related.iter().map(|related| {
        AnnotationKind::Context.span(source.span(&related.span)).label(harmless(&related.label))
    });
    let snippet = Snippet::source(source.text.as_str())
        .path(name)
        .annotation(primary.label(label.map(|label| harmless(label))))
        .annotations(related);
    let helps = diagnostic.helps.iter().map(|help| Level::HELP.message(harmless(help)));
    title.element(snippet).elements(helps)
}

/// Diagnostics are harmless already; nothing that is shown depends on it.
fn harmless(text: &str) -> String {
    Harmless(text).line()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use ser_console::is_obeyed;
    use ser_evidence::site::{Related, inspect};

    use super::*;

    /// What is drawn of a file, without colours.
    fn plain(text: &str) -> String {
        let drawn = drawn("a.toml", text, &inspect(text).diagnostics);
        anstream::adapter::strip_str(&drawn).to_string()
    }

    #[test]
    fn nothing_in_a_file_reaches_a_terminal_as_it_is() {
        for text in [
            "site = \"\u{1B}[2J\" # \u{202E}\u{9B}2J",
            "\u{1B}]0;title\u{7} = 1\r\r\n",
            "site = \"a\u{2066}b\"\ntime_zone = \"\\u001B[2J\"\n# \u{0} \u{8}",
            "\u{FEFF}= \u{2028}",
            "\t\u{1F600}\u{200D} = [",
            "",
        ] {
            let drawn = plain(text);
            let is_shown = |letter: char| letter == '\n' || !is_obeyed(letter);
            assert!(drawn.chars().all(is_shown), "{drawn:?}");
            assert!(drawn.contains("error["), "{drawn}");
        }
    }

    #[test]
    fn of_very_many_only_the_first_are_drawn() {
        let drawn = plain(&"[[expect]]\n".repeat(300));
        assert_eq!(drawn.matches("error[").count(), DRAWN);
        assert!(drawn.ends_with(" more are not shown\n\n"), "{drawn}");
    }

    /// Pieces of site files and what does not belong in one.
    fn piece() -> impl Strategy<Value = String> {
        let pieces = [
            "[[point]]\n",
            "[[recorder]]\r\n",
            "name = ",
            "\"52-1 closed\"",
            "input = 7\n",
            "\n",
            "\r",
            "\"",
            "\"\"\"",
            "[",
            "{",
            "=",
            "\t",
            "# ",
            "\u{1B}[2J",
            "\u{202E}",
            "\u{200D}",
            "\u{0}",
            "遮断器",
            "e\u{301}",
            "\u{1F468}\u{200D}\u{1F469}",
            "\u{FEFF}",
            "\u{2028}",
            "xxxxxxxxxxxxxxxxxxxx",
        ];
        prop_oneof![
            4 => proptest::sample::select(pieces.to_vec()).prop_map(str::to_owned),
            1 => any::<String>(),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 500,
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        #[test]
        fn whatever_the_file_it_can_be_drawn_and_is_harmless(
            pieces in proptest::collection::vec(piece(), 0..40)
        ) {
            let drawn = plain(&pieces.concat());
            prop_assert!(drawn.chars().all(|letter| letter == '\n' || !is_obeyed(letter)));
        }

        #[test]
        fn wherever_a_diagnostic_points_it_can_be_drawn(
            pieces in proptest::collection::vec(piece(), 0..20),
            places in proptest::collection::vec(0_usize..400, 4),
        ) {
            let text = pieces.concat();
            let mut diagnostic = inspect("").diagnostics.remove(0);
            let span = |from: usize, to: usize| places[from].min(places[to])..places[from].max(places[to]);
            diagnostic.span = span(0, 1);
            diagnostic.related = vec![Related { span: span(2, 3), label: "here".to_owned() }];
            let drawn = drawn("a.toml", &text, &[diagnostic]);
            let plain = anstream::adapter::strip_str(&drawn).to_string();
            prop_assert!(plain.chars().all(|letter| letter == '\n' || !is_obeyed(letter)));
        }
    }
}
