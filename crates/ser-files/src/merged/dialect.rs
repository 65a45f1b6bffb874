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
    let is_taken = is_spreadsheet_safe && is_taken_for_something_else(text);
    let text = if is_taken { format!("'{text}") } else { text.to_owned() };
    let separator = char::from(dialect.separator());
    let is_padded = dialect != Dialect::Plain && text.trim() != text;
    match is_padded || text.contains([separator, '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text,
    }
}

/// A text without the apostrophe that [`field`] has put in front of it. A text that nobody made
/// safe and that looks as if somebody had loses its apostrophe as well.
pub(crate) fn without_apostrophe(text: &str) -> &str {
    match text.strip_prefix('\'') {
        Some(rest) if is_taken_for_something_else(rest) => rest,
        _ => text,
    }
}

/// Whether a spreadsheet may take a text for something else. One that looks as if it had been made
/// safe is made so once more, for [`without_apostrophe`].
fn is_taken_for_something_else(text: &str) -> bool {
    let bare = text.trim_start_matches('\'');
    is_formula(bare) || is_number(bare) || is_date(bare) || is_truth(bare)
}

/// Whether a spreadsheet may take a text for a date, a time or a fraction: numbers and names of
/// months with signs between them, such as `52-1`, `3/4`, `10:30`, `1.2.` and `3 Mar`. Also an amount
/// of money or a percentage.
fn is_date(text: &str) -> bool {
    const MONTHS: [&str; 16] = [
        "jan", "feb", "mar", "mär", "apr", "may", "mai", "jun", "jul", "aug", "sep", "oct", "okt",
        "nov", "dec", "dez",
    ];
    let is_sign = |letter: char| " -/.:,%$€£()".contains(letter);
    if !text.contains(is_sign) || !text.contains(|letter: char| letter.is_ascii_digit()) {
        return false;
    }
    text.split(is_sign).all(|part| {
        let part = part.to_lowercase();
        part.bytes().all(|byte| byte.is_ascii_digit())
            || ["am", "pm", "a", "p"].contains(&part.as_str())
            || MONTHS.iter().any(|month| part.starts_with(month))
    })
}

/// Whether it is a truth value, which a spreadsheet shows in its own language.
fn is_truth(text: &str) -> bool {
    ["true", "false", "wahr", "falsch"].contains(&text.to_lowercase().as_str())
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
        for text in [
            "=1+1",
            "+1",
            "-2+3",
            "@SUM(A1)",
            " =1+1",
            "＝1",
            "1234567890123456",
            "12e45",
            "52-1",
            "3/4",
            "10:30",
            "1.2.2026",
            "3 März",
            "Mar-5",
            "50%",
            "$5",
            "1,5",
            "TRUE",
            "Falsch",
            "'52-1",
        ] {
            assert_eq!(without_apostrophe(&safe(text).replace('"', "")), text);
            assert!(safe(text).trim_matches('"').starts_with('\''), "{text}: {}", safe(text));
        }
        for text in ["52-1 closed", "U1-SER1", "a=b", "0", "9f3c5a7e21b04d68", "", "'", "'a", "Mai"]
        {
            assert_eq!(safe(text), text);
            assert_eq!(without_apostrophe(text), text);
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
