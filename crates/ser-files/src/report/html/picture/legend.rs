//! What the marks of the picture mean: those that are in it, and no others.

use maud::{Markup, html};

use super::drawing::{STRIPED, UNKNOWN};
use super::lanes::{Lanes, State};
use super::steps::{StepLane, Took};

/// Which marks a picture has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Marks {
    on: bool,
    off: bool,
    abnormal: bool,
    unknown: bool,
    doubt: bool,
    no_doubt_known: bool,
    expected: bool,
    in_time: bool,
    not_in_time: bool,
    not_decidable: bool,
}

impl Marks {
    fn of(lanes: &Lanes, steps: &[StepLane]) -> Marks {
        let mut marks = Marks::default();
        for stretch in lanes.lanes.iter().flat_map(|lane| &lane.stretches) {
            match stretch.state {
                State::On { is_abnormal: false } => marks.on = true,
                State::Off { is_abnormal: false } => marks.off = true,
                State::On { .. } | State::Off { .. } => marks.abnormal = true,
                State::Unknown => marks.unknown = true,
            }
        }
        let mut edges = lanes.lanes.iter().flat_map(|lane| &lane.edges);
        marks.doubt = edges.clone().any(|edge| edge.doubt_us.is_some());
        marks.no_doubt_known = edges.any(|edge| edge.doubt_us.is_none());
        marks.expected = !steps.is_empty();
        let took = |how: Took| {
            let mut took = steps.iter().filter(|step| step.then_us.is_some());
            took.any(|step| step.took() == how)
        };
        marks.in_time = took(Took::InTime);
        marks.not_in_time = took(Took::NotInTime);
        marks.not_decidable = took(Took::NotDecidable);
        marks
    }
}

pub(super) fn legend(lanes: &Lanes, steps: &[StepLane]) -> Markup {
    let marks = Marks::of(lanes, steps);
    let bar = |class: &str| html! { rect class=(class) x="0" y="4" width="28" height="12" {} };
    html! {
        p.legend {
            @if marks.on { (item(&bar("on"), "on")) }
            @if marks.off {
                (item(&html! { rect.off x="0" y="14" width="28" height="2" {} }, "off"))
            }
            @if marks.abnormal { (item(&abnormal(), "not normal, on and off")) }
            @if marks.unknown { (item(&unknown(), "not known: something is missing")) }
            @if marks.doubt { (item(&change(), "a change and its doubt")) }
            @if marks.no_doubt_known {
                (item(&loose_change(), "a change of which nobody knows how far its time is off"))
            }
            @if marks.expected { (item(&bar("window"), "expected within")) }
            @if marks.in_time { (item(&took(Took::InTime), "took, in time")) }
            @if marks.not_in_time { (item(&took(Took::NotInTime), "took, and was not in time")) }
            @if marks.not_decidable {
                (item(&took(Took::NotDecidable), "took, and whether in time cannot be decided"))
            }
        }
    }
}

fn item(mark: &Markup, meaning: &str) -> Markup {
    html! { span { svg viewBox="0 0 28 20" aria-hidden="true" { (mark) } (meaning) } }
}

fn took(how: Took) -> Markup {
    html! { rect class=(how.class()) x="0" y="8" width="28" height="4" {} }
}

fn abnormal() -> Markup {
    html! {
        rect.abnormal fill=(STRIPED) x="0" y="2" width="13" height="16" {}
        rect.abnormal fill=(STRIPED) x="15" y="12" width="13" height="6" {}
    }
}

fn unknown() -> Markup {
    html! { rect.unknown fill=(UNKNOWN) x="0" y="4" width="28" height="12" {} }
}

fn change() -> Markup {
    html! {
        rect.doubt x="6" y="1" width="16" height="18" {}
        line.moved x1="14" x2="14" y1="1" y2="19" {}
    }
}

fn loose_change() -> Markup {
    html! { line.moved.loose x1="14" x2="14" y1="1" y2="19" {} }
}
