//! Names in a configuration, which have no way to quote a comma.

use std::collections::{HashMap, HashSet};

use ser_evidence::timeline::Timeline;

use super::options::{Data, Options};
use crate::export::channels::{Channel, Channels, recorder_name};
use crate::names::harmless;

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
    let mut taken = Taken::default();
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
            name: taken.unique(&name),
            equipment: field(&harmless(equipment)),
            is_normally_on: point.and_then(|point| point.normal).unwrap_or(false),
        }
    };
    let mut texts: Vec<ChannelText> = channels.all().iter().map(text).collect();
    if options.has_rate && options.data == Data::Binary {
        while !texts.len().is_multiple_of(16) {
            let name = taken.unique(&format!("spare {}", texts.len() + 1));
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

/// Names that are taken.
#[derive(Default)]
struct Taken {
    names: HashSet<String>,
    /// By what stands before a number: the number that was given last. Of many equal names none looks
    /// at all others.
    counts: HashMap<String, u32>,
}

impl Taken {
    fn unique(&mut self, name: &str) -> String {
        let name = field(name);
        if !name.is_empty() && self.names.insert(name.clone()) {
            return name;
        }
        // A longer number leaves less room for the name.
        let mut digits = 1;
        loop {
            let stem: String = name.chars().take(MAX_NAME.saturating_sub(1 + digits)).collect();
            let count = self.counts.entry(format!("{stem}~")).or_insert(1);
            *count += 1;
            let unique = format!("{stem}~{count}");
            digits = count.to_string().len().max(digits);
            if unique.chars().count() <= MAX_NAME && self.names.insert(unique.clone()) {
                return unique;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_have_no_comma_and_are_neither_long_nor_twice() {
        let mut taken = Taken::default();
        let long = "Ü".repeat(200);
        let given = ["a, b", "a; b", &long, &long, ""];
        let unique = given.map(|name| taken.unique(name));
        assert_eq!(unique[..2], ["a; b", "a; b~2"]);
        assert_eq!(unique[2].chars().count(), 64);
        assert_eq!(unique[3], format!("{}~2", "Ü".repeat(62)));
        assert!(!unique[4].is_empty());
    }

    /// So many that a look at each other one would take minutes.
    #[test]
    fn many_equal_names_are_numbered_at_once() {
        let mut taken = Taken::default();
        let long = "x".repeat(MAX_NAME);
        let all: HashSet<String> = (0..100_000)
            .map(|place| taken.unique(if place % 2 == 0 { "a" } else { &long }))
            .collect();
        assert_eq!(all.len(), 100_000);
        assert!(all.iter().all(|name| name.chars().count() <= MAX_NAME));
        assert!(all.contains("a~50000"));
    }
}
