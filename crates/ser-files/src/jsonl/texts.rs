//! Fields that are words in a file and types in the program.

use std::borrow::Cow;
use std::fmt;
use std::ops::RangeInclusive;

use ser_console::is_obeyed;
use ser_evidence::record::{How, Life, Outcome, PointRecord};
use ser_proto::{Inputs, Model};
use serde::de::{Error, SeqAccess, Visitor};
use serde::ser::SerializeSeq;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Text of a line; copied only if something in it was escaped.
#[derive(Debug, Deserialize)]
pub(super) struct Text<'a>(#[serde(borrow)] pub(super) Cow<'a, str>);

/// A set of inputs as a list of their numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Numbers(pub(super) Inputs);

impl Serialize for Numbers {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let count = usize::try_from(self.0.0.count_ones()).ok();
        let mut list = serializer.serialize_seq(count)?;
        self.0.numbers().try_for_each(|number| list.serialize_element(&number))?;
        list.end()
    }
}

impl<'de> Deserialize<'de> for Numbers {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Numbers, D::Error> {
        deserializer.deserialize_seq(NumbersVisitor)
    }
}

struct NumbersVisitor;

impl<'de> Visitor<'de> for NumbersVisitor {
    type Value = Numbers;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of numbers of inputs")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Numbers, A::Error> {
        let mut inputs = 0_u32;
        while let Some(number) = list.next_element::<u8>()? {
            let bit = number.checked_sub(1).and_then(|place| 1_u32.checked_shl(place.into()));
            inputs |=
                bit.ok_or_else(|| A::Error::custom(format_args!("there is no input {number}")))?;
        }
        Ok(Numbers(Inputs(inputs)))
    }
}

pub(super) const fn model_name(model: Model) -> &'static str {
    match model {
        Model::Ser160 => "ser160",
        Model::Ser320 => "ser320",
    }
}

pub(super) fn model_named(name: &str) -> Option<Model> {
    [Model::Ser160, Model::Ser320].into_iter().find(|&model| model_name(model) == name)
}

pub(super) const fn how_name(how: How) -> &'static str {
    match how {
        How::Set { .. } => "set",
        How::Mark { .. } => "mark",
        How::Query => "query",
        How::Event => "event",
        How::Hand => "hand",
    }
}

/// The number of a broadcast, written as lives are; here 0 is a number, too.
pub(super) fn broadcast_named(name: &str) -> Option<u64> {
    let number = u64::from_str_radix(name, 16).ok()?;
    Some(number).filter(|number| format!("{number:016x}") == name)
}

/// The life of this name; [`Life::UNKNOWN`] if there is no name.
pub(super) fn life_named(name: Option<&str>) -> Option<Life> {
    name.map_or(Some(Life::UNKNOWN), Life::from_name)
}

/// What came of a command, without the reason.
pub(super) const fn outcome_name(outcome: &Outcome) -> &'static str {
    match outcome {
        Outcome::Done => "done",
        Outcome::Sent => "sent",
        Outcome::Refused(_) => "refused",
        Outcome::NotAnswered(_) => "not answered",
        Outcome::NotSent(_) => "not sent",
    }
}

/// Whether this may be the name of a point, or what a state is called.
pub(super) fn fit_to_show(text: &str) -> bool {
    is_line(text, 1..=PointRecord::LONGEST)
}

/// Whether this is one line that can be seen, with so many characters.
pub(super) fn is_line(text: &str, length: RangeInclusive<usize>) -> bool {
    text.trim() == text && length.contains(&text.chars().count()) && !text.chars().any(is_obeyed)
}
