//! The pins of `docs/hardware.md` are exactly those of `firmware/stm32f407/src/pins.rs`.

use std::collections::BTreeSet;
use std::fs;
use std::ops::RangeInclusive;
use std::path::Path;

/// Port and number.
type Pin = (char, u8);

/// Pins that the program does not touch: the main crystal's.
const BY_HARDWARE: [Pin; 2] = [('H', 0), ('H', 1)];

fn read(path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)).expect(path)
}

/// `PB0–PB15`, `PF12–15` or `PA2`.
fn pins(name: &str) -> Option<(char, RangeInclusive<u8>)> {
    let (port, numbers) = name.strip_prefix('P')?.split_at_checked(1)?;
    let port = port.chars().next().filter(char::is_ascii_uppercase)?;
    let (first, last) = numbers.split_once('–').unwrap_or((numbers, numbers));
    let last = last.strip_prefix('P').and_then(|last| last.strip_prefix(port)).unwrap_or(last);
    Some((port, first.parse().ok()?..=last.parse().ok()?))
}

/// The pins in the first column of the page's table.
fn on_page(page: &str) -> BTreeSet<Pin> {
    let (_, chapter) = page.split_once("\n## Pins\n").expect("the chapter");
    let table = chapter.lines().skip_while(|line| !line.starts_with("| pins |"));
    let rows = table.skip(2).take_while(|line| line.starts_with('|'));
    let names = rows.flat_map(|row| row.split('|').nth(1).unwrap_or_default().split(','));
    names
        .filter_map(|name| pins(name.trim()))
        .flat_map(|(port, all)| all.map(move |pin| (port, pin)))
        .collect()
}

/// The pins that the program assigns. Numbers may be names of constants.
fn assigned(source: &str) -> BTreeSet<Pin> {
    let number = |word: &str| {
        let constant = || source.split_once(&format!("const {word}: u8 = "))?.1.split(';').next();
        word.parse().ok().or_else(|| constant()?.parse().ok())
    };
    let numbers = |list: &str| -> Vec<u8> {
        let words = list.split(|letter: char| !letter.is_ascii_alphanumeric() && letter != '_');
        words.filter(|word| !word.is_empty()).map(|word| number(word).expect(word)).collect()
    };
    let mut assigned = BTreeSet::new();
    for assignment in source.split("assign(Port::").skip(1) {
        let (port, rest) = assignment.split_at(1);
        let port = port.chars().next().expect("a port");
        let sets = rest.split("Role::").next().unwrap_or_default().trim_matches([',', ' ']);
        for set in sets.split('|').map(str::trim) {
            let (kind, list) = set.split_once('(').expect(set);
            match (kind, &numbers(list)[..]) {
                ("range", &[first, last]) => assigned.extend((first..=last).map(|pin| (port, pin))),
                ("pin" | "pins", list) => assigned.extend(list.iter().map(|&pin| (port, pin))),
                other => panic!("{other:?}"),
            }
        }
    }
    assigned
}

#[test]
fn the_page_has_the_pins_of_the_program() {
    let assigned = assigned(&read("firmware/stm32f407/src/pins.rs"));
    assert!(assigned.len() > 60, "{assigned:?}");
    let on_page = on_page(&read("docs/hardware.md"));
    let expected: BTreeSet<_> = assigned.into_iter().chain(BY_HARDWARE).collect();
    assert_eq!(on_page, expected);
}

#[test]
fn pins_are_read_as_they_are_written() {
    assert_eq!(pins("PB0–PB15"), Some(('B', 0..=15)));
    assert_eq!(pins("PF12–15"), Some(('F', 12..=15)));
    assert_eq!(pins("PA2"), Some(('A', 2..=2)));
    assert_eq!((pins("NRST"), pins("VBAT"), pins("PB")), (None, None, None));
    let source = "assign(Port::A, pins([1, LAMP]), Role::Output),\n\
                  assign(Port::B, range(0, 1) | range(7, 7), Role::Input),\nconst LAMP: u8 = 9;";
    assert_eq!(
        assigned(source),
        BTreeSet::from([('A', 1), ('A', 9), ('B', 0), ('B', 1), ('B', 7)])
    );
}
