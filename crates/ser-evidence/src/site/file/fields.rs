//! The keys of one table: asked for one by one, each with its type.
//!
//! What is asked for and missing, or of another type, is told and gives `None`. The caller goes on
//! with the next key, so that a file is told all its mistakes at once.

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::kind::{self, Kind};
use super::number;
use crate::site::checks::{
    hidden_character, missing_key, out_of_range, too_fine, unknown_key, wrong_type,
};
use crate::site::diagnostic::{Findings, Span};

/// The most characters of a name.
pub(super) const NAME: usize = 200;

/// The most characters of a port or a reason.
pub(super) const LONG: usize = 1000;

/// The largest number of milliseconds: a year.
const YEAR_MS: i64 = 366 * 86_400_000;

/// A table of a site file.
pub(super) struct Fields<'t, 'f> {
    table: &'t DeTable<'t>,
    kind: &'static Kind,
    /// Where it begins.
    head: Span,
    pub(super) findings: &'f mut Findings,
}

/// The range of a number, and how it is written.
#[derive(Clone, Copy, Debug)]
pub(super) struct Range {
    pub(super) least: i64,
    pub(super) most: i64,
    pub(super) words: &'static str,
}

impl Range {
    /// Thousandths of a number from 0 to a year of milliseconds.
    pub(super) const TIME_MS: Range =
        Range { least: 0, most: YEAR_MS * 1000, words: "0 or more, and at most a year" };

    fn contains(self, number: i64) -> bool {
        (self.least..=self.most).contains(&number)
    }
}

impl<'t, 'f> Fields<'t, 'f> {
    /// The keys of a table that begins at `head`. Unknown ones are told.
    pub(super) fn new(
        table: &'t DeTable<'t>,
        kind: &'static Kind,
        head: Span,
        findings: &'f mut Findings,
    ) -> Fields<'t, 'f> {
        for (key, _) in table {
            let (name, span) = (key.get_ref().as_ref(), key.span());
            if !kind.keys.contains(&name) {
                let elsewhere = kind::with_key(name);
                let elsewhere: Vec<&str> = elsewhere.iter().map(String::as_str).collect();
                unknown_key::found(findings, (span, name), (kind.what, kind.keys), &elsewhere);
            }
        }
        Fields { table, kind, head, findings }
    }

    /// Where the table begins.
    pub(super) fn head(&self) -> Span {
        self.head.clone()
    }

    /// What kind of table it is.
    pub(super) fn what(&self) -> &'static str {
        self.kind.what
    }

    /// Whether a key is there, even if it is not understood.
    pub(super) fn has(&self, key: &str) -> bool {
        self.get(key).is_some()
    }

    fn get(&self, key: &str) -> Option<&'t Spanned<DeValue<'t>>> {
        self.table.get(key)
    }

    /// Tells that a key is missing, if it is.
    pub(super) fn require(&mut self, key: &'static str, example: &str) {
        if self.get(key).is_none() {
            let head = self.head.clone();
            missing_key::found(self.findings, head, self.kind.what, (key, example));
        }
    }

    fn wrong(
        &mut self,
        key: &str,
        value: &Spanned<DeValue<'_>>,
        wanted: &'static str,
        example: &str,
    ) {
        let example = format!("{key} = {example}");
        let found = describe(value.get_ref());
        wrong_type::found(self.findings, value.span(), key, (wanted, &example), found);
    }

    /// A text as it is written. Its content has not been looked at.
    pub(super) fn text(&mut self, key: &str, example: &str) -> Option<Spanned<String>> {
        let value = self.get(key)?;
        match value.get_ref() {
            DeValue::String(text) => Some(Spanned::new(value.span(), text.clone().into_owned())),
            // Roles such as 86 look like numbers.
            DeValue::Integer(number) if number.as_str().len() < 10 => {
                self.wrong(key, value, "a text", &format!("\"{number}\""));
                None
            }
            _ => {
                self.wrong(key, value, "a text", example);
                None
            }
        }
    }

    /// A text that names something else in the file. It is not looked for if it has a character
    /// that no name has.
    pub(super) fn reference(&mut self, key: &str, example: &str) -> Option<Spanned<String>> {
        let text = self.text(key, example)?;
        let is_visible = hidden_character::passes(self.findings, &text.span(), key, text.get_ref());
        is_visible.then_some(text)
    }

    /// A text that people read: of visible characters, not empty, and not too long.
    pub(super) fn name(
        &mut self,
        key: &str,
        most: usize,
        example: &str,
    ) -> Option<Spanned<String>> {
        let text = self.text(key, example)?;
        super::text::look(self.findings, &text, key, most);
        Some(text)
    }

    /// A time, between quotes or not.
    pub(super) fn time(&mut self, key: &str, example: &str) -> Option<Spanned<String>> {
        let value = self.get(key)?;
        match value.get_ref() {
            DeValue::Datetime(time) => Some(Spanned::new(value.span(), time.to_string())),
            DeValue::String(text) => Some(Spanned::new(value.span(), text.clone().into_owned())),
            _ => {
                self.wrong(key, value, "a date and time", example);
                None
            }
        }
    }

    /// `true` or `false`.
    pub(super) fn switch(&mut self, key: &str) -> Option<Spanned<bool>> {
        let value = self.get(key)?;
        match value.get_ref() {
            DeValue::Boolean(is_so) => Some(Spanned::new(value.span(), *is_so)),
            _ => {
                self.wrong(key, value, "`true` or `false`", "true");
                None
            }
        }
    }

    /// A whole number.
    pub(super) fn whole(&mut self, key: &str, range: Range, example: &str) -> Option<Spanned<i64>> {
        let value = self.get(key)?;
        let DeValue::Integer(integer) = value.get_ref() else {
            self.wrong(key, value, "a whole number", example);
            return None;
        };
        let number = i64::from_str_radix(integer.as_str(), integer.radix()).ok();
        match number.filter(|&number| range.contains(number)) {
            Some(number) => Some(Spanned::new(value.span(), number)),
            None => {
                out_of_range::found(self.findings, value.span(), key, range.words);
                None
            }
        }
    }

    /// A number in thousandths: milliseconds become microseconds. `range` is in thousandths, too.
    pub(super) fn thousandths(
        &mut self,
        key: &str,
        range: Range,
        example: &str,
    ) -> Option<Spanned<i64>> {
        let value = self.get(key)?;
        let number = self.thousandths_of(key, value, range, example)?;
        Some(Spanned::new(value.span(), number))
    }

    fn thousandths_of(
        &mut self,
        key: &str,
        value: &Spanned<DeValue<'_>>,
        range: Range,
        example: &str,
    ) -> Option<i64> {
        let number = match value.get_ref() {
            DeValue::Integer(integer) => number::of_integer(integer),
            DeValue::Float(float) => number::of_decimal(float.as_str()),
            _ => {
                self.wrong(key, value, "a number", example);
                return None;
            }
        };
        match number {
            Ok(number) if range.contains(number) => return Some(number),
            Err(number::Error::TooFine) => too_fine::found(self.findings, value.span(), key),
            _ => out_of_range::found(self.findings, value.span(), key, range.words),
        }
        None
    }

    /// Two numbers in thousandths, shortest and longest.
    pub(super) fn window(
        &mut self,
        key: &str,
        range: Range,
        example: &str,
    ) -> Option<Spanned<(i64, i64)>> {
        let value = self.get(key)?;
        let ends: Vec<&Spanned<DeValue<'_>>> = match value.get_ref() {
            DeValue::Array(array) => array.iter().collect(),
            _ => Vec::new(),
        };
        let [first, second] = ends.as_slice() else {
            self.wrong(key, value, "two numbers between brackets", example);
            return None;
        };
        let first = self.thousandths_of(key, first, range, example);
        let second = self.thousandths_of(key, second, range, example);
        Some(Spanned::new(value.span(), (first?, second?)))
    }

    /// A table that may be there once.
    pub(super) fn table(&mut self, key: &str, kind: &'static Kind) -> Option<Fields<'t, '_>> {
        let value = self.get(key)?;
        match value.get_ref() {
            DeValue::Table(table) => Some(Fields::new(table, kind, value.span(), self.findings)),
            other => {
                let (wanted, example) = match kind.head {
                    "" => ("keys between braces", format!("{key} = {{ … }}")),
                    head => ("one table", head.to_owned()),
                };
                let (span, found) = (first_of(value).unwrap_or(value.span()), describe(other));
                wrong_type::found(self.findings, span, key, (wanted, &example), found);
                None
            }
        }
    }

    /// All tables of a list, each of which begins with `[[key]]`, in the order of the file.
    pub(super) fn for_each(
        &mut self,
        key: &str,
        kind: &'static Kind,
        mut take: impl FnMut(&mut Fields<'t, '_>),
    ) {
        let Some(value) = self.get(key) else { return };
        let tables: Vec<&Spanned<DeValue<'_>>> = match value.get_ref() {
            DeValue::Array(array) => array.iter().collect(),
            _ => vec![value],
        };
        let is_list = value.get_ref().is_array();
        for value in tables {
            match value.get_ref() {
                DeValue::Table(table) => {
                    let mut fields = Fields::new(table, kind, value.span(), self.findings);
                    if !is_list {
                        let wanted = ("a list of tables", kind.head);
                        wrong_type::found(fields.findings, fields.head(), key, wanted, "one table");
                    }
                    take(&mut fields);
                }
                other => {
                    let wanted = ("a list of tables", kind.head);
                    let found = describe(other);
                    wrong_type::found(self.findings, value.span(), key, wanted, found);
                }
            }
        }
    }
}

/// Where the first table of a list begins.
fn first_of(value: &Spanned<DeValue<'_>>) -> Option<Span> {
    value.get_ref().as_array().and_then(|list| list.iter().next()).map(Spanned::span)
}

/// What a value is, in words.
fn describe(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "a text",
        DeValue::Integer(_) => "a whole number",
        DeValue::Float(_) => "a number with decimals",
        DeValue::Boolean(_) => "`true` or `false`",
        DeValue::Datetime(_) => "a date or time",
        DeValue::Array(_) => "a list",
        DeValue::Table(_) => "a table",
    }
}
