//! The map: which input of which recorder a name of a foreign list is, and what its words mean.
//!
//! A TOML file of `[[point]]` tables. Mistakes are told all at once, as those of the site file are:
//! with their place and with what would be right.

use std::collections::BTreeMap;
use std::ops::Range;

use ser_evidence::site::{Diagnostic, Related, Severity, Site};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::list::fit;

/// The largest map that is read, in bytes.
const MOST_BYTES: usize = 1 << 20;

/// Mistakes that are told.
const MOST_TOLD: usize = 200;

/// The keys of a point.
const KEYS: [&str; 6] = ["from", "recorder", "input", "point", "on", "off"];

/// What names of foreign lists mean. Without one, each keeps its name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Map {
    points: BTreeMap<String, Meaning>,
}

/// What a name means.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Meaning {
    /// The recorder, if it is not that of the file, and the input.
    target: Option<(Option<String>, u8)>,
    on: Option<String>,
    off: Option<String>,
}

impl Map {
    /// Understands the text of a map. `site` is asked for its points.
    ///
    /// # Errors
    /// All mistakes, in the order of the text.
    pub fn parse(text: &str, site: Option<&Site>) -> Result<Map, Vec<Diagnostic>> {
        if text.len() > MOST_BYTES {
            let large = error("too-large", 0..0, "the map is larger than 1 MiB");
            return Err(vec![large]);
        }
        let (document, errors) = DeTable::parse_recoverable(text);
        let mut reading =
            Reading { site, map: Map::default(), taken: BTreeMap::new(), told: vec![] };
        for error in &errors {
            reading.tell(syntax(text, error));
        }
        if errors.is_empty() {
            reading.document(document.get_ref());
        }
        reading.told.sort_by_key(|told| told.span.start);
        match reading.told.is_empty() {
            true => Ok(reading.map),
            false => Err(reading.told),
        }
    }

    /// Recorder and input of a name, if the map says it.
    pub(super) fn target<'m>(&'m self, name: &str) -> Option<(Option<&'m str>, u8)> {
        let (recorder, input) = self.points.get(name)?.target.as_ref()?;
        Some((recorder.as_deref(), *input))
    }

    /// All inputs that are taken by the map.
    pub(super) fn targets(&self) -> impl Iterator<Item = (Option<&str>, u8)> {
        let targets = self.points.values().filter_map(|meaning| meaning.target.as_ref());
        targets.map(|(recorder, input)| (recorder.as_deref(), *input))
    }

    /// Whether a word of a name means on, if the map says it.
    pub(super) fn side(&self, name: &str, word: &str) -> Option<bool> {
        let meaning = self.points.get(name)?;
        match () {
            () if meaning.on.as_deref() == Some(word) => Some(true),
            () if meaning.off.as_deref() == Some(word) => Some(false),
            () => None,
        }
    }

    /// Names that no file has.
    pub(super) fn unused(&self, is_used: impl Fn(&str) -> bool) -> Vec<&str> {
        self.points.keys().map(String::as_str).filter(|name| !is_used(name)).collect()
    }
}

/// A map on its way.
struct Reading<'s> {
    site: Option<&'s Site>,
    map: Map,
    /// Inputs that are taken, and where.
    taken: BTreeMap<(Option<String>, u8), Range<usize>>,
    told: Vec<Diagnostic>,
}

impl Reading<'_> {
    fn tell(&mut self, diagnostic: Diagnostic) {
        if self.told.len() < MOST_TOLD {
            self.told.push(diagnostic);
        }
    }

    fn document(&mut self, document: &DeTable<'_>) {
        for (key, value) in document {
            if key.get_ref() != "point" {
                let phrase = format!("unknown key {} in the map", quoted(key.get_ref()));
                self.tell(
                    error("unknown-key", key.span(), &phrase)
                        .help("a map has `[[point]]` tables only"),
                );
                continue;
            }
            let DeValue::Array(points) = value.get_ref() else {
                self.tell(
                    error("wrong-type", value.span(), "`point` takes a list of tables")
                        .help("write it as in `[[point]]`"),
                );
                continue;
            };
            for point in points {
                match point.get_ref() {
                    DeValue::Table(table) => self.point(table, &point.span()),
                    _ => self.tell(
                        error("wrong-type", point.span(), "`point` takes a list of tables")
                            .help("write it as in `[[point]]`"),
                    ),
                }
            }
        }
    }

    fn point(&mut self, table: &DeTable<'_>, head: &Range<usize>) {
        for (key, _) in table {
            if !KEYS.contains(&key.get_ref().as_ref()) {
                self.tell(unknown_key(key));
            }
        }
        let from = self.text(table, "from", "\"87T\"");
        let (on, off) =
            (self.text(table, "on", "\"TRIPPED\""), self.text(table, "off", "\"RESET\""));
        let target = self.target(table);
        let Some(from) = from else {
            if table.get("from").is_none() {
                self.tell(
                    error("missing-key", head.clone(), "`from` is missing in a point")
                        .help("add the name that the list has, as in `from = \"87T\"`"),
                );
            }
            return;
        };
        if let (Some(on), Some(off)) = (&on, &off)
            && on.get_ref() == off.get_ref()
        {
            let phrase = format!("{} means on and off", quoted(on.get_ref()));
            self.tell(
                error("same-texts", off.span(), &phrase).help("give the word for the other state"),
            );
        }
        let text = |text: Option<Spanned<String>>| text.map(|text| fit(text.get_ref()));
        let meaning = Meaning { target, on: text(on), off: text(off) };
        if self.map.points.insert(fit(from.get_ref()), meaning).is_some() {
            let phrase = format!("{} is there twice", quoted(from.get_ref()));
            self.tell(error("duplicate-name", from.span(), &phrase).help("keep one of the two"));
        }
    }

    /// Where a point belongs.
    fn target(&mut self, table: &DeTable<'_>) -> Option<(Option<String>, u8)> {
        let point = self.text(table, "point", "\"F3/52-1 closed\"");
        let recorder = self.text(table, "recorder", "\"F3\"");
        let input = self.input(table);
        let (target, span) = match (point, input) {
            (Some(point), None) => {
                if let Some(recorder) = recorder {
                    self.tell(
                        error("wrong-type", recorder.span(), "`point` names the recorder already")
                            .help("write it as in `point = \"RECORDER/NAME\"`"),
                    );
                }
                (self.of_site(&point)?, point.span())
            }
            (Some(point), Some(_)) => {
                self.tell(
                    error("wrong-type", point.span(), "`point` and `input` name two places")
                        .help("keep one of them"),
                );
                return None;
            }
            (None, Some((input, span))) => {
                ((recorder.map(|recorder| fit(recorder.get_ref())), input), span)
            }
            (None, None) => {
                if let Some(recorder) = recorder.filter(|_| table.get("input").is_none()) {
                    self.tell(
                        error(
                            "missing-key",
                            recorder.span(),
                            "`input` is missing beside `recorder`",
                        )
                        .help("add it, as in `input = 7`"),
                    );
                }
                return None;
            }
        };
        if let Some(recorder) = target.0.as_deref().filter(|name| self.is_read(name)) {
            let phrase = format!("{} has a log of its own", quoted(recorder));
            self.tell(error("own-log", span.clone(), &phrase).help(
                "give the list a recorder without `port` in the site file, and connect points that \
                 watch one contact with `same_as`",
            ));
        }
        if let Some(first) = self.taken.insert(target.clone(), span.clone()) {
            let mut twice = error("duplicate-input", span, "two names for one input")
                .help("give one of them another input");
            twice.related.push(Related { span: first, label: "first used here".to_owned() });
            self.tell(twice);
        }
        Some(target)
    }

    /// Whether a recorder is read over its own port. Its stamps are its own, and a list that says UTC
    /// of them would shift them.
    fn is_read(&self, name: &str) -> bool {
        let recorders = self.site.iter().flat_map(|site| &site.recorders);
        recorders.into_iter().any(|recorder| recorder.name == name && recorder.port.is_some())
    }

    /// A point of the site.
    fn of_site(&mut self, point: &Spanned<String>) -> Option<(Option<String>, u8)> {
        let Some(site) = self.site else {
            self.tell(
                error(
                    "unknown-point",
                    point.span(),
                    "`point` is one of a site file, and there is none",
                )
                .help(
                    "give the site file with --site, or name the place with `recorder` and `input`",
                ),
            );
            return None;
        };
        let wanted = point.get_ref().as_str();
        let named = site.points.iter().filter_map(|point| {
            let recorder = &site.recorders.get(point.recorder.0)?.name;
            Some((recorder, point))
        });
        let is_it = |(recorder, point): &(&String, &ser_evidence::site::Point)| {
            point.name == wanted || format!("{recorder}/{}", point.name) == wanted
        };
        let found: Vec<_> = named.clone().filter(is_it).collect();
        match found.as_slice() {
            [(recorder, point)] => Some((Some((*recorder).clone()), point.input)),
            [] => {
                let all: Vec<String> =
                    named.map(|(recorder, point)| format!("{recorder}/{}", point.name)).collect();
                let phrase = format!("the site has no point {}", quoted(wanted));
                let unknown = error("unknown-point", point.span(), &phrase);
                self.tell(match nearest(wanted, &all) {
                    Some(near) => unknown.help(&format!("did you mean {}?", quoted(near))),
                    None => unknown.help("ser-cli site show lists the points of the site"),
                });
                None
            }
            several => {
                let phrase = format!("{} recorders have a point {}", several.len(), quoted(wanted));
                self.tell(
                    error("ambiguous-point", point.span(), &phrase)
                        .help("write the recorder before it, as in `RECORDER/NAME`"),
                );
                None
            }
        }
    }

    fn input(&mut self, table: &DeTable<'_>) -> Option<(u8, Range<usize>)> {
        let value = table.get("input")?;
        let DeValue::Integer(integer) = value.get_ref() else {
            self.tell(
                error("wrong-type", value.span(), "`input` takes a whole number")
                    .help("write it as in `input = 7`"),
            );
            return None;
        };
        let number = u8::from_str_radix(integer.as_str(), integer.radix()).ok();
        match number.filter(|number| (1..=32).contains(number)) {
            Some(number) => Some((number, value.span())),
            None => {
                self.tell(
                    error("out-of-range", value.span(), "there is no such input")
                        .help("`input` takes 1 to 32"),
                );
                None
            }
        }
    }

    fn text(&mut self, table: &DeTable<'_>, key: &str, example: &str) -> Option<Spanned<String>> {
        let value = table.get(key)?;
        match value.get_ref() {
            DeValue::String(text) if text.trim().is_empty() => {
                self.tell(
                    error("empty-text", value.span(), &format!("`{key}` is empty"))
                        .help(&format!("write it as in `{key} = {example}`")),
                );
                None
            }
            DeValue::String(text) => Some(Spanned::new(value.span(), text.clone().into_owned())),
            _ => {
                self.tell(
                    error("wrong-type", value.span(), &format!("`{key}` takes a text"))
                        .help(&format!("write it as in `{key} = {example}`")),
                );
                None
            }
        }
    }
}

fn unknown_key(key: &Spanned<std::borrow::Cow<'_, str>>) -> Diagnostic {
    let phrase = format!("unknown key {} in a point of the map", quoted(key.get_ref()));
    let unknown = error("unknown-key", key.span(), &phrase);
    let keys: Vec<String> = KEYS.map(str::to_owned).to_vec();
    match nearest(key.get_ref(), &keys) {
        Some(near) => unknown.help(&format!("did you mean {}?", quoted(near))),
        None => unknown.help("a point has `from`, `recorder`, `input`, `point`, `on` and `off`"),
    }
}

/// The name that was probably meant.
fn nearest<'c>(word: &str, candidates: &'c [String]) -> Option<&'c str> {
    const MOST: usize = 2000;
    const SIMILAR: f64 = 0.7;
    if word.len() > 200 {
        return None;
    }
    let likeness = |candidate: &str| {
        let (word, candidate) = (word.to_lowercase(), candidate.to_lowercase());
        let whole = strsim::normalized_damerau_levenshtein(&word, &candidate);
        let name = candidate.rsplit_once('/').map_or(&*candidate, |(_, name)| name);
        whole.max(strsim::normalized_damerau_levenshtein(&word, name))
    };
    let short = candidates.iter().take(MOST).filter(|candidate| candidate.len() <= 420);
    let best = short
        .map(|candidate| (likeness(candidate), candidate))
        .max_by(|one, other| one.0.total_cmp(&other.0));
    best.filter(|(likeness, _)| *likeness >= SIMILAR).map(|(_, candidate)| candidate.as_str())
}

fn syntax(text: &str, wrong: &toml::de::Error) -> Diagnostic {
    let span = wrong.span().unwrap_or(0..0);
    let end = span.end.min(text.len());
    let what = wrong.message().lines().next().unwrap_or("this is not TOML").to_owned();
    error("syntax", span.start.min(end)..end, &what)
        .help("a map looks like `[[point]]`, `from = \"87T\"`, `input = 3`")
}

/// A text of the map, short and harmless.
fn quoted(text: &str) -> String {
    crate::error::quoted(ser_console::Harmless(text).line().as_bytes())
}

/// A mistake at a place.
fn error(check: &'static str, span: Range<usize>, phrase: &str) -> Diagnostic {
    Diagnostic {
        check,
        severity: Severity::Error,
        span,
        phrase: ser_console::Harmless(phrase).line(),
        label: String::new(),
        helps: Vec::new(),
        related: Vec::new(),
    }
}

/// What would be right.
trait Help {
    fn help(self, help: &str) -> Self;
}

impl Help for Diagnostic {
    fn help(mut self, help: &str) -> Diagnostic {
        self.helps.push(help.to_owned());
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SITE: &str = "site = \"N\"\ntime_zone = \"UTC\"\n[[recorder]]\nname = \"F3\"\n\
                        [[recorder]]\nname = \"F4\"\n\
                        [[recorder]]\nname = \"SER1\"\nport = \"/dev/ttyUSB0\"\n\
                        [[point]]\nrecorder = \"SER1\"\ninput = 1\nname = \"coil\"\n\
                        [[point]]\nrecorder = \"F3\"\ninput = 7\nname = \"52-1 closed\"\n\
                        [[point]]\nrecorder = \"F4\"\ninput = 9\nname = \"trip\"\n\
                        [[point]]\nrecorder = \"F3\"\ninput = 9\nname = \"trip\"\n";

    fn parse(text: &str) -> Result<Map, Vec<String>> {
        let site = ser_evidence::site::read(SITE).unwrap();
        Map::parse(text, Some(&site)).map_err(|told| {
            let told = told.iter().map(|told| {
                assert!(!told.helps.is_empty(), "{told:?}");
                format!("{}: {} ({})", told.check, told.phrase, &text[told.span.clone()])
            });
            told.collect()
        })
    }

    #[test]
    fn a_name_gets_an_input_or_a_point_of_the_site_and_its_words() {
        let map = parse(
            "[[point]]\nfrom = \"87T\"\ninput = 3\non = \"TRIPPED\"\n\
             [[point]]\nfrom = \"52A\"\npoint = \"52-1 closed\"\n\
             [[point]]\nfrom = \"TR\"\npoint = \"F4/trip\"\n\
             [[point]]\nfrom = \"X\"\nrecorder = \"F9\"\ninput = 0x1F\noff = \"REST\"\n",
        )
        .unwrap();
        assert_eq!(map.target("87T"), Some((None, 3)));
        assert_eq!(map.target("52A"), Some((Some("F3"), 7)));
        assert_eq!(map.target("TR"), Some((Some("F4"), 9)));
        assert_eq!(map.target("X"), Some((Some("F9"), 31)));
        assert_eq!(map.target("Y"), None);
        assert_eq!(map.side("87T", "TRIPPED"), Some(true));
        assert_eq!(map.side("X", "REST"), Some(false));
        assert_eq!(map.side("87T", "REST"), None);
        assert_eq!(map.unused(|name| name == "87T"), ["52A", "TR", "X"]);
    }

    #[test]
    fn every_mistake_is_told_with_its_place() {
        for (text, expected) in [
            (
                "[[point]]\nfrm = \"a\"",
                "unknown-key: unknown key `frm` in a point of the map (frm)",
            ),
            ("[[points]]", "unknown-key: unknown key `points` in the map (points)"),
            ("point = 1", "wrong-type: `point` takes a list of tables (1)"),
            ("[[point]]\nfrom = 52", "wrong-type: `from` takes a text (52)"),
            ("[[point]]\nfrom = \" \"", "empty-text: `from` is empty (\" \")"),
            ("[[point]]\ninput = 3", "missing-key: `from` is missing in a point ([[point]])"),
            ("[[point]]\nfrom = \"a\"\ninput = 33", "out-of-range: there is no such input (33)"),
            (
                "[[point]]\nfrom = \"a\"\ninput = \"3\"",
                "wrong-type: `input` takes a whole number (\"3\")",
            ),
            (
                "[[point]]\nfrom = \"a\"\nrecorder = \"F\"",
                "missing-key: `input` is missing beside `recorder` (\"F\")",
            ),
            (
                "[[point]]\nfrom = \"a\"\npoint = \"SER1/coil\"",
                "own-log: `SER1` has a log of its own (\"SER1/coil\")",
            ),
            (
                "[[point]]\nfrom = \"a\"\nrecorder = \"SER1\"\ninput = 3",
                "own-log: `SER1` has a log of its own (3)",
            ),
            (
                "[[point]]\nfrom = \"a\"\npoint = \"52-1 close\"",
                "unknown-point: the site has no point `52-1 close` (\"52-1 close\")",
            ),
            (
                "[[point]]\nfrom = \"a\"\npoint = \"trip\"",
                "ambiguous-point: 2 recorders have a point `trip` (\"trip\")",
            ),
            (
                "[[point]]\nfrom = \"a\"\npoint = \"F3/trip\"\ninput = 1",
                "wrong-type: `point` and `input` name two places (\"F3/trip\")",
            ),
            (
                "[[point]]\nfrom = \"a\"\non = \"x\"\noff = \"x\"",
                "same-texts: `x` means on and off (\"x\")",
            ),
            (
                "[[point]]\nfrom = \"a\"\n[[point]]\nfrom = \"a\"",
                "duplicate-name: `a` is there twice (\"a\")",
            ),
            (
                "[[point]]\nfrom = \"a\"\ninput = 1\n[[point]]\nfrom = \"b\"\ninput = 1",
                "duplicate-input: two names for one input (1)",
            ),
        ] {
            let told = parse(text).unwrap_err();
            assert!(told.iter().any(|told| told == expected), "{text}: {told:?}");
        }
        let told = parse("[[point]\nfrom =").unwrap_err();
        assert!(told.iter().all(|told| told.starts_with("syntax: ")), "{told:?}");
        assert!(Map::parse("[[point]]\nfrom = \"a\"\npoint = \"b\"", None).is_err());
        assert!(Map::parse(&" ".repeat(MOST_BYTES + 1), None).is_err());
    }

    proptest::proptest! {
        #[test]
        fn no_text_is_too_much(text: String) {
            let _ = parse(&format!("[[point]]\n{text}"));
            let _ = parse(&text);
        }
    }
}
