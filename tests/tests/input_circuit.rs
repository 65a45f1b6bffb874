//! The circuit in front of each input, as `docs/hardware.md` draws it, calculated for its worst
//! case. The page's figures must be the results, and its levels must be valid ones.

use std::fs;
use std::path::Path;

// Parts, in ohms and farads, by the names that the page has for them.
const SERIES_FIELD: (f64, &str) = (3600.0, "3.6 kΩ");
const SHUNT: (f64, &str) = (820.0, "820 Ω");
const PULL_UP: (f64, &str) = (15_000.0, "15 kΩ");
const SERIES_PIN: (f64, &str) = (3300.0, "3.3 kΩ");
const FILTER: (f64, &str) = (4.7e-9, "4.7 nF");

const RESISTOR: [f64; 2] = [0.99, 1.01];
const CAPACITOR: [f64; 2] = [0.9, 1.1];

// From data sheets: the controller's (I/O static characteristics) and the optocoupler's.
const SUPPLY: [f64; 2] = [3.3 * 0.95, 3.3 * 1.05];
const LOW_OF_SUPPLY: f64 = 0.3;
const HIGH_OF_SUPPLY: f64 = 0.7;
const PIN_LEAKAGE: f64 = 1e-6;
const LED: [f64; 2] = [1.0, 1.3];
const LED_TYPICAL: f64 = 1.15;
const SATURATED: [f64; 2] = [0.1, 0.4];
const TRANSFER_MIN: f64 = 0.3;
/// The LED current at which that ratio holds.
const TRANSFER_AT: f64 = 1e-3;
const DARK_CURRENT: f64 = 50e-6;
const ON_MAX_US: f64 = 20.0;
const OFF_MAX_US: f64 = 200.0;

fn led_current(field: f64, led: f64, [series, shunt]: [f64; 2]) -> f64 {
    (field - led) / (SERIES_FIELD.0 * series) - led / (SHUNT.0 * shunt)
}

/// The shortest and the longest time, in microseconds, that the pin takes to change its level. The
/// threshold may be anywhere between the two guaranteed ones.
fn filter_us(closes: bool) -> [f64; 2] {
    let mut times = Vec::new();
    for (capacitor, resistor) in pairs(CAPACITOR, RESISTOR) {
        for (saturated, threshold) in pairs(SATURATED, [LOW_OF_SUPPLY, HIGH_OF_SUPPLY]) {
            for supply in SUPPLY {
                let threshold = threshold * supply;
                let (from, to, source) = if closes {
                    (supply, saturated, SERIES_PIN.0)
                } else {
                    (saturated, supply, SERIES_PIN.0 + PULL_UP.0)
                };
                let constant = source * resistor * FILTER.0 * capacitor;
                times.push(constant * ((from - to) / (threshold - to)).ln() * 1e6);
            }
        }
    }
    [times.iter().copied().fold(f64::MAX, f64::min), times.iter().copied().fold(0.0, f64::max)]
}

fn pairs(a: [f64; 2], b: [f64; 2]) -> impl Iterator<Item = (f64, f64)> {
    a.into_iter().flat_map(move |a| b.map(|b| (a, b)))
}

/// The page with all its lines joined.
fn page() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/hardware.md");
    fs::read_to_string(path)
        .expect("docs/hardware.md")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

fn assert_says(page: &str, figures: &[String]) {
    let missing: Vec<_> = figures.iter().filter(|figure| !page.contains(*figure)).collect();
    assert!(missing.is_empty(), "docs/hardware.md does not say {missing:#?}");
}

#[test]
fn the_parts_are_those_of_the_page() {
    let parts = [SERIES_FIELD.1, SHUNT.1, PULL_UP.1, SERIES_PIN.1, FILTER.1];
    // Each part is named in the list of parts and in the drawing.
    for part in parts {
        assert!(page().matches(part).count() >= 2, "{part}");
    }
}

#[test]
fn a_closed_contact_is_a_valid_low_with_the_weakest_parts() {
    let low = SATURATED[1] + PIN_LEAKAGE * SERIES_PIN.0 * RESISTOR[1];
    let wanted = LOW_OF_SUPPLY * SUPPLY[0];
    assert!(low < wanted - 0.2, "{low} V");
    let led = led_current(11.0, LED[1], [RESISTOR[1], RESISTOR[0]]);
    assert!(led > TRANSFER_AT, "{led} A: less than what the transfer is given for");
    let sinks = TRANSFER_MIN * led;
    let has_to_sink = (SUPPLY[1] - SATURATED[1]) / (PULL_UP.0 * RESISTOR[0]) + PIN_LEAKAGE;
    // The reserve covers what the optocoupler loses over the years.
    let reserve = sinks / has_to_sink - 1.0;
    assert!(reserve > 0.5, "{sinks} A of {has_to_sink} A");
    let at_24 = TRANSFER_MIN * led_current(24.0, LED[1], [RESISTOR[1], RESISTOR[0]]);
    assert!(at_24 > 6.0 * has_to_sink, "{at_24} A of {has_to_sink} A");
    assert_says(
        &page(),
        &[
            format!("| {low:.2} V at most | {wanted:.2} V at most |"),
            format!("{:.2} mA at most to sink | {:.2} mA at least", has_to_sink * 1e3, sinks * 1e3),
            format!("{:.0} % more than it has to at 11 V", (reserve * 100.0).floor()),
        ],
    );
}

#[test]
fn the_chips_pull_up_would_spoil_the_low_of_input_13() {
    // PB12 and PA10 have 8–15 kΩ in place of 30–50 kΩ.
    let pulled = |chip: f64| {
        let series = SERIES_PIN.0 * RESISTOR[1];
        SATURATED[1] + (SUPPLY[0] - SATURATED[1]) * series / (series + chip)
    };
    assert!(
        pulled(30_000.0) < LOW_OF_SUPPLY * SUPPLY[0] && pulled(8_000.0) > LOW_OF_SUPPLY * SUPPLY[0]
    );
    assert_says(&page(), &[format!("would have {:.2} V where", pulled(8_000.0))]);
}

#[test]
fn an_open_contact_is_a_valid_high_with_the_leakiest_parts() {
    let high = |supply: f64| supply - (DARK_CURRENT + PIN_LEAKAGE) * PULL_UP.0 * RESISTOR[1];
    // The pin's own leakage comes through the series resistor, too.
    let at_pin = |supply: f64| high(supply) - PIN_LEAKAGE * SERIES_PIN.0 * RESISTOR[1];
    for supply in SUPPLY {
        let high = at_pin(supply);
        assert!(high > HIGH_OF_SUPPLY * supply + 0.1, "{high} V at {supply} V");
    }
    let wanted = HIGH_OF_SUPPLY * SUPPLY[0];
    assert_says(
        &page(),
        &[format!("{:.2} V at least | {wanted:.2} V at least", at_pin(SUPPLY[0]))],
    );
    // The LED gets less than it needs to conduct. The little current that it takes is less than the
    // dark current.
    let at_led =
        4.2 * SHUNT.0 * RESISTOR[1] / (SHUNT.0 * RESISTOR[1] + SERIES_FIELD.0 * RESISTOR[0]);
    assert!(at_led < 0.8, "{at_led} V");
    assert_says(&page(), &["up to 4.2 V it has less than 0.8 V".to_owned()]);
}

#[test]
fn the_field_side_has_the_currents_of_the_page() {
    let weakest = led_current(11.0, LED[1], [RESISTOR[1], RESISTOR[0]]);
    let typical = |field| led_current(field, LED_TYPICAL, [1.0, 1.0]);
    let input = |field: f64| (field - LED_TYPICAL) / SERIES_FIELD.0;
    let heat = input(30.0).powi(2) * SERIES_FIELD.0;
    assert!(heat < 0.25, "half of what the resistor takes");
    assert_says(
        &page(),
        &[
            format!(
                "{:.2} mA at least, so the transistor sinks {:.2} mA",
                weakest * 1e3,
                weakest * TRANSFER_MIN * 1e3
            ),
            format!(
                "typically has {:.1} mA and the input takes {:.1} mA",
                typical(24.0) * 1e3,
                input(24.0) * 1e3
            ),
            format!(
                "at 30 V {:.1} and {:.1} mA, with {heat:.2} W",
                typical(30.0) * 1e3,
                input(30.0) * 1e3
            ),
            format!("are {:.0} mA", 32.0 * input(24.0) * 1e3),
        ],
    );
    // Type 3 wants 2 mA at 11 V.
    assert!((11.0 - LED[1]) / (SERIES_FIELD.0 * RESISTOR[1]) > 2e-3);
}

#[test]
fn delays_and_what_the_test_sheet_makes_of_them_are_those_of_the_circuit() {
    let constant = |source: f64| source * FILTER.0 * 1e6;
    let (while_on, while_off) = (constant(SERIES_PIN.0), constant(SERIES_PIN.0 + PULL_UP.0));
    let ([closes, closes_max], [opens, opens_max]) = (filter_us(true), filter_us(false));
    // Times are in milliseconds from here on.
    let late = |filter_us: f64, optocoupler_us: f64| (filter_us + optocoupler_us) / 1e3;
    let (on, on_max) = (late(closes, 0.0), late(closes_max, ON_MAX_US));
    let (off, off_max) = (late(opens, 0.0), late(opens_max, OFF_MAX_US));
    let up = |ms: f64| (ms * 100.0).ceil() / 100.0;
    let (among_on, among_off) = (on_max - on, off_max - off);
    let pulse = [0.5 - (on_max - off), 0.5 + (off_max - on)];
    assert_says(
        &page(),
        &[
            format!(
                "is {while_on:.0} µs while the transistor pulls, {while_off:.0} µs while the \
                 resistors do"
            ),
            format!(
                "closes | {closes:.0}–{closes_max:.0} µs | {ON_MAX_US} µs at most | \
                 {on:.2}–{:.2} ms",
                up(on_max)
            ),
            format!(
                "opens | {opens:.0}–{opens_max:.0} µs | {OFF_MAX_US} µs at most, out of saturation"
            ),
            format!("| {off:.2}–{:.2} ms |", up(off_max)),
            format!(
                "close more than {among_on:.2} ms apart, or open more than {among_off:.2} ms apart"
            ),
            format!("up to {:.2} ms late against one that closes", up(off_max - on)),
            format!(
                "low within {:.2} ms after closing, high within {:.2} ms",
                up(on_max),
                up(off_max)
            ),
            format!(
                "{:.0} % of the edges ON and {:.0} % of those OFF",
                among_on * 100.0,
                among_off * 100.0
            ),
            format!("{:.0}–{:.0} % of the pulses", pulse[0] * 100.0, pulse[1] * 100.0),
            format!("stays low for {:.2}–{:.2} ms", pulse[0], pulse[1]),
        ],
    );
    // The fastest signal of the test sheet stays longer than a sample on either side.
    let half_period_ms = 1000.0 / 300.0 / 2.0;
    assert!(half_period_ms - (off_max - on) > 1.0 && half_period_ms - (on_max - off) > 1.0);
}
