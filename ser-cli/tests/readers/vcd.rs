//! A waveform as what it says: by signal, its values and when it takes them.

use std::collections::BTreeMap;

/// By scope and name.
pub(super) type Signals = BTreeMap<String, Vec<(u64, String)>>;

/// Reads what a program writes.
pub(super) fn read(text: &str) -> Signals {
    let mut scopes: Vec<&str> = Vec::new();
    let mut names: BTreeMap<&str, String> = BTreeMap::new();
    let mut signals = Signals::new();
    let mut at = 0;
    let mut lines = text.lines();
    for line in lines.by_ref() {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["$scope", _, name, "$end"] => scopes.push(name),
            ["$upscope", ..] => _ = scopes.pop(),
            ["$var", _, _, id, name, ..] => {
                let name = format!("{}.{name}", scopes.join("."));
                signals.insert(name.clone(), Vec::new());
                names.insert(id, name);
            }
            ["$enddefinitions", ..] => break,
            _ => {}
        }
    }
    for line in lines {
        if let Some(time) = line.strip_prefix('#') {
            at = time.parse().expect("a time");
            continue;
        }
        let (value, id) = match line.split_once(' ') {
            Some((value, id)) => (&value[1..], id),
            None if line.starts_with('$') => continue,
            None => line.split_at(1),
        };
        let signal = names.get(id).and_then(|name| signals.get_mut(name));
        let signal = signal.unwrap_or_else(|| panic!("no signal {id}: {line}"));
        // Some programs repeat values, and some write them as escaped text.
        let value = value.replace("\\?", "?");
        match signal.last_mut() {
            Some((last, known)) if *last == at => *known = value,
            Some((_, known)) if *known == value && value != "1" => {}
            _ => signal.push((at, value)),
        }
    }
    signals
}
