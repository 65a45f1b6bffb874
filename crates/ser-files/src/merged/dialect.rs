//! How rows of CSV are written: separators, ends of lines, times, and what spreadsheets do with text.

/// Which program the rows are for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Dialect {
    /// As `read` writes them: commas, and lines that end with a line feed.
    #[default]
    Plain,
    /// By RFC 4180: commas, and lines that end with CR LF.
    Rfc4180,
    /// For a German spreadsheet: a byte order mark, semicolons, CR LF, and times such as
    /// `22.11.2026 10:00:00,250`.
    ExcelDe,
}

impl Dialect {
    /// What the file begins with.
    pub(crate) const fn mark(self) -> &'static str {
        match self {
            Dialect::Plain | Dialect::Rfc4180 => "",
            Dialect::ExcelDe => "\u{FEFF}",
        }
    }

    pub(crate) const fn separator(self) -> u8 {
        match self {
            Dialect::Plain | Dialect::Rfc4180 => b',',
            Dialect::ExcelDe => b';',
        }
    }

    pub(crate) const fn line_end(self) -> &'static [u8] {
        match self {
            Dialect::Plain => b"\n",
            Dialect::Rfc4180 | Dialect::ExcelDe => b"\r\n",
        }
    }
}

/// A text as a field. In a spreadsheet, a text that it would take for a formula or a number gets an
/// apostrophe in front: that changes it, and makes it harmless.
pub(crate) fn field(text: &str, dialect: Dialect, is_spreadsheet_safe: bool) -> String {
    let is_taken = is_spreadsheet_safe && (is_formula(text) || is_number(text));
    let text = if is_taken { format!("'{text}") } else { text.to_owned() };
    let separator = char::from(dialect.separator());
    let is_padded = dialect != Dialect::Plain && text.trim() != text;
    match is_padded || text.contains([separator, '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text,
    }
}

/// Whether a spreadsheet may take a text for a formula. Some look past blanks and quotes, and some
/// take the signs of full width as well.
fn is_formula(text: &str) -> bool {
    let first = text.trim_start_matches(|letter: char| letter.is_whitespace() || letter == '"');
    let is_sign =
        |letter: char| matches!(letter, '=' | '+' | '-' | '@' | '＝' | '＋' | '－' | '＠');
    first.starts_with(is_sign) || text.starts_with(['\t', '\r', '\n'])
}

/// Whether it is a number to a spreadsheet, such as the name of a life that has digits only, or an
/// `e` among them.
fn is_number(text: &str) -> bool {
    let is_long = text.len() > 1;
    is_long
        && text.parse::<f64>().is_ok()
        && text.starts_with(|letter: char| letter.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_spreadsheet_takes_for_something_else_gets_an_apostrophe() {
        let safe = |text| field(text, Dialect::Rfc4180, true);
        for text in ["=1+1", "+1", "-2+3", "@SUM(A1)", " =1+1", "＝1", "1234567890123456", "12e45"]
        {
            assert!(safe(text).trim_matches('"').starts_with('\''), "{text}: {}", safe(text));
        }
        for text in ["52-1 closed", "U1-SER1", "a=b", "0", "9f3c5a7e21b04d68", ""] {
            assert_eq!(safe(text), text);
        }
        assert_eq!(field("=1+1", Dialect::Rfc4180, false), "=1+1");
    }

    #[test]
    fn fields_are_quoted_where_their_dialect_needs_it() {
        assert_eq!(field("a,b", Dialect::Rfc4180, false), "\"a,b\"");
        assert_eq!(field("a,b", Dialect::ExcelDe, false), "a,b");
        assert_eq!(field("a;b", Dialect::ExcelDe, false), "\"a;b\"");
        assert_eq!(field("say \"a\"", Dialect::Plain, false), "\"say \"\"a\"\"\"");
    }
}
