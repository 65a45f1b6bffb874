//! Names in a configuration, which have no way to quote a comma.

use std::collections::HashSet;

use ser_evidence::timeline::Timeline;

use super::{Data, Options};
use crate::export::channels::{Channel, Channels, recorder_name};
use crate::report::names::harmless;

/// The longest name, in characters.
pub(super) const MAX_NAME: usize = 64;

/// What the configuration says of a channel.
#[derive(Debug)]
pub(super) struct ChannelText {
    /// Its name, unique in the file.
    pub(super) name: String,
    /// What it belongs to.
    pub(super) equipment: String,
    /// Its normal state.
    pub(super) is_normally_on: bool,
}

/// All channels. A binary record with a rate is filled up to whole words, because there are readers
/// that take nothing else.
pub(super) fn channels(
    timeline: &Timeline<'_>,
    channels: &Channels,
    options: Options,
) -> Vec<ChannelText> {
    let mut taken = HashSet::new();
    let with_recorder = channels.are_of_several();
    let text = |channel: &Channel| {
        let point = channel.named(timeline);
        let name = channel.name(timeline);
        let name = match with_recorder {
            true => format!("{}/{name}", recorder_name(timeline, channel.recorder)),
            false => name,
        };
        let equipment = point.and_then(|point| point.equipment.as_deref()).unwrap_or_default();
        ChannelText {
            name: unique(&name, &mut taken),
            equipment: field(&harmless(equipment)),
            is_normally_on: point.and_then(|point| point.normal).unwrap_or(false),
        }
    };
    let mut texts: Vec<ChannelText> = channels.all().iter().map(text).collect();
    if options.has_rate && options.data == Data::Binary {
        while !texts.len().is_multiple_of(16) {
            let name = unique(&format!("spare {}", texts.len() + 1), &mut taken);
            texts.push(ChannelText { name, equipment: String::new(), is_normally_on: false });
        }
    }
    texts
}

/// A text as a field: without commas, and not too long.
pub(super) fn field(text: &str) -> String {
    let cut: String = text.chars().take(MAX_NAME).collect();
    cut.replace(',', ";").trim().to_owned()
}

fn unique(name: &str, taken: &mut HashSet<String>) -> String {
    let mut unique = field(name);
    let mut count = 1_u32;
    while unique.is_empty() || !taken.insert(unique.clone()) {
        count += 1;
        let end = format!("~{count}");
        let kept = MAX_NAME.saturating_sub(end.len());
        unique = field(name).chars().take(kept).collect::<String>() + &end;
    }
    unique
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_have_no_comma_and_are_neither_long_nor_twice() {
        let mut taken = HashSet::new();
        let long = "Ü".repeat(200);
        let given = ["a, b", "a; b", &long, &long, ""];
        let unique = given.map(|name| unique(name, &mut taken));
        assert_eq!(unique[..2], ["a; b", "a; b~2"]);
        assert_eq!(unique[2].chars().count(), 64);
        assert_eq!(unique[3], format!("{}~2", "Ü".repeat(62)));
        assert!(!unique[4].is_empty());
    }
}
