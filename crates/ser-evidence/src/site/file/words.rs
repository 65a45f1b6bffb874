//! Keys that take one of a few words.

use ser_proto::Model;
use toml::Spanned;

use super::fields::Fields;
use crate::site::checks::unknown_word;
use crate::site::model::Role;

/// Words of a key, with what they mean.
pub(super) type Words<T> = &'static [(&'static str, T)];

pub(super) const MODELS: Words<Model> = &[("ser160", Model::Ser160), ("ser320", Model::Ser320)];

pub(super) const STATES: Words<bool> = &[("on", true), ("off", false)];

pub(super) const ROLES: Words<Role> = &[
    ("52a", Role::BreakerClosed),
    ("52b", Role::BreakerOpen),
    ("trip", Role::Trip),
    ("close", Role::Close),
    ("pickup", Role::Pickup),
    ("86", Role::Lockout),
    ("alarm", Role::Alarm),
];

/// The meaning of the word of a key. A word that is none of them is told; `meant` may know better
/// than its letters what it should be.
pub(super) fn word<T: Copy>(
    fields: &mut Fields<'_, '_>,
    key: &str,
    example: &str,
    words: Words<T>,
    meant: impl Fn(&str) -> Option<&'static str>,
) -> Option<Spanned<T>> {
    let text = fields.text(key, example)?;
    let found = words.iter().find(|(word, _)| word == text.get_ref());
    if found.is_none() {
        let words: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
        let meant = meant(text.get_ref());
        unknown_word::found(fields.findings, (text.span(), text.get_ref()), key, &words, meant);
    }
    found.map(|&(_, meaning)| Spanned::new(text.span(), meaning))
}
