//! The picture of an incident: a lane for each point that moved, over one axis of time.
//!
//! Everything that stands at a time says so in `data-a` and `data-b`, in microseconds after the
//! first change. The page's script moves it when the reader zooms; without the script the picture
//! is as it was drawn.

mod axis;
mod lanes;
mod scale;
mod steps;
mod ticks;

use maud::{Markup, html};

pub(super) use self::lanes::Lanes;
use self::lanes::{Edge, Lane, State, Stretch};
use self::scale::Scale;
use self::steps::StepLane;
use super::super::{Clock, Document};

/// Where the time begins, beside the names.
const LEFT_PX: f64 = 250.0;
/// How wide the time is.
const WIDTH_PX: f64 = 830.0;
/// The whole picture.
const FULL_PX: f64 = 1100.0;
/// The axis, above the lanes.
const TOP_PX: f64 = 34.0;
/// A lane.
const LANE_PX: f64 = 32.0;
/// Below the lanes: when it begins and ends.
const BOTTOM_PX: f64 = 24.0;

/// No more names of times than this.
const TICKS: usize = 10;

/// What is shown a second time if the incident is much longer: most of what matters is in it.
const EARLY_US: i64 = 100_000;

/// The incident, and the first 100 ms of it if it is much longer.
pub(super) fn section(document: &Document<'_>, lanes: &Lanes, clock: &Clock) -> Markup {
    let margin = lanes.margin_us();
    let steps = steps::lanes(document);
    let whole = Window {
        name: "lane",
        from_us: lanes.least_us.saturating_sub(margin),
        to_us: lanes.most_us.saturating_add(margin),
    };
    let early = Window { name: "early", from_us: -5_000, to_us: EARLY_US + 5_000 };
    let length = lanes.most_us.saturating_sub(lanes.least_us);
    let draw = |window: &Window, title: &str| picture(lanes, &steps, window, title, clock);
    html! {
        (draw(&whole, "The whole incident"))
        @if length > 3 * EARLY_US {
            (draw(&early, "The first 100 ms"))
        }
        (legend())
        @if lanes.timeless > 0 {
            p.alarm { (lanes.timeless) " changes have no time, and are not in the picture." }
        }
    }
}

/// What a picture shows, in microseconds after the first change.
struct Window {
    /// What the names of its lanes begin with.
    name: &'static str,
    from_us: i64,
    to_us: i64,
}

fn picture(
    lanes: &Lanes,
    steps: &[StepLane],
    window: &Window,
    title: &str,
    clock: &Clock,
) -> Markup {
    let origin_us = lanes.origin_us;
    let scale = Scale::new((window.from_us, window.to_us), LEFT_PX, WIDTH_PX);
    let moved = |lane: &Lane| lane.edges.iter().any(|edge| scale.contains(edge.at_us));
    let shown: Vec<(usize, &Lane)> =
        lanes.lanes.iter().enumerate().filter(|(_, lane)| moved(lane)).collect();
    let steps: Vec<&StepLane> = steps.iter().filter(|step| scale.contains(step.after_us)).collect();
    let rows = shown.len() + steps.len();
    let bottom = y_px(rows);
    let label = format!("{title}: {} points over time; the table above says the same", shown.len());
    let window_us = [window.from_us, window.to_us];
    html! {
        figure.picture data-from=(window_us[0]) data-to=(window_us[1]) {
            figcaption { (title) }
            div.scroll tabindex="0" role="group" aria-label=(title) {
                svg role="img" aria-label=(label) viewBox={ "0 0 " (FULL_PX) " " (bottom + BOTTOM_PX) }
                    data-left=(LEFT_PX) data-width=(WIDTH_PX) data-bottom=(bottom) {
                    (hatching(window.name))
                    (axis(&scale, window, bottom))
                    @for (row, &(number, lane)) in shown.iter().enumerate() {
                        (draw_lane(lane, (window.name, number), y_px(row), &scale))
                    }
                    @for (row, step) in steps.iter().enumerate() {
                        (step.draw(y_px(shown.len() + row), &scale))
                    }
                    text.end x=(LEFT_PX) y=(bottom + 16.0) {
                        (clock.date_and_time(origin_us.saturating_add(window.from_us)))
                    }
                    text.end.last x=(LEFT_PX + WIDTH_PX) y=(bottom + 16.0) {
                        (clock.time(origin_us.saturating_add(window.to_us)))
                    }
                }
            }
        }
    }
}

/// Where a lane begins.
fn y_px(row: usize) -> f64 {
    let rows = f64::from(u32::try_from(row).unwrap_or(u32::MAX));
    TOP_PX + rows * LANE_PX
}

/// A place in the picture, to a tenth of a pixel.
fn px(place: f64) -> String {
    format!("{place:.1}")
}

/// What is drawn where something is missing.
fn hatching(name: &str) -> Markup {
    html! {
        defs {
            pattern id={ (name) "-hatch" } width="6" height="6" patternUnits="userSpaceOnUse"
                patternTransform="rotate(45)" {
                rect.hatch width="2.5" height="6" {}
            }
        }
    }
}

fn axis(scale: &Scale, window: &Window, bottom: f64) -> Markup {
    let found = ticks::ticks((window.from_us, window.to_us), TICKS);
    html! {
        text.axis.title x=(LEFT_PX - 12.0) y="18" { "after the first change" }
        g.ticks data-step=(found.step_us) {
            @for at_us in &found.at_us {
                @let x = px(scale.x_px(*at_us));
                line.grid data-a=(at_us) x1=(x) x2=(x) y1=(TOP_PX - 8.0) y2=(bottom) {}
                text.axis x=(x) y="18" { (ticks::label(*at_us, found.step_us)) }
            }
        }
    }
}

fn draw_lane(lane: &Lane, (name, number): (&str, usize), y: f64, scale: &Scale) -> Markup {
    let text = names_of(lane);
    html! {
        g.lane.first[lane.is_first] id={ (name) "-" (number) } data-lane=(number) {
            rect.back x="0" y=(y) width=(FULL_PX) height=(LANE_PX) {}
            text.name x=(LEFT_PX - 12.0) y=(y + 15.0) { title { (text) } (shortened(&lane.point, 34)) }
            text.recorder x=(LEFT_PX - 12.0) y=(y + 27.0) {
                (shortened(&lane.recorder, 40))
                @if lane.is_first { " · first-out" }
            }
            @for stretch in &lane.stretches {
                (draw_stretch(stretch, name, y, scale))
            }
            @for edge in &lane.edges {
                (draw_edge(edge, y, scale))
            }
        }
    }
}

fn names_of(lane: &Lane) -> String {
    format!("{} ({})", lane.point, lane.recorder)
}

/// A name in so many characters.
fn shortened(name: &str, most: usize) -> String {
    match name.chars().count() > most {
        true => name.chars().take(most.saturating_sub(1)).chain(['…']).collect(),
        false => name.to_owned(),
    }
}

fn draw_stretch(stretch: &Stretch, name: &str, y: f64, scale: &Scale) -> Markup {
    let (from, to) = (stretch.from_us, stretch.to_us);
    let (class, top, height) = match stretch.state {
        State::On { is_abnormal: false } => ("on", 7.0, 18.0),
        State::On { is_abnormal: true } => ("on abnormal", 7.0, 18.0),
        State::Off { is_abnormal: false } => ("off", 23.0, 2.0),
        State::Off { is_abnormal: true } => ("off abnormal", 23.0, 2.0),
        State::Unknown => ("unknown", 7.0, 18.0),
    };
    let (x, width) = scale.stretch(from, to).unwrap_or((LEFT_PX, 0.0));
    let fill = (stretch.state == State::Unknown).then(|| format!("url(#{name}-hatch)"));
    html! {
        rect class=(class) data-a=(from) data-b=(to) x=(px(x)) y=(px(y + top)) width=(px(width))
            height=(height) fill=[fill] {
            @if stretch.state == State::Unknown { title { "not known: something is missing" } }
        }
    }
}

fn draw_edge(edge: &Edge, y: f64, scale: &Scale) -> Markup {
    let at = edge.at_us;
    let doubt = edge.doubt_us.unwrap_or_default();
    let (from, to) = (at.saturating_sub(doubt), at.saturating_add(doubt));
    let (x, width) = scale.stretch(from, to).unwrap_or((LEFT_PX, 0.0));
    let hidden = (!scale.contains(at)).then_some("none");
    html! {
        g.edge {
            title { (edge.text) }
            @if edge.doubt_us.is_some() {
                rect.doubt data-a=(from) data-b=(to) x=(px(x)) y=(px(y + 3.0)) width=(px(width))
                    height="26" {}
            }
            line.moved.loose[edge.doubt_us.is_none()] data-a=(at) x1=(px(scale.x_px(at)))
                x2=(px(scale.x_px(at))) y1=(px(y + 3.0)) y2=(px(y + 29.0)) display=[hidden] {}
        }
    }
}

/// What the colours mean.
fn legend() -> Markup {
    let y = 4.0;
    html! {
        p.legend {
            span { svg viewBox="0 0 28 20" aria-hidden="true" { rect.on x="0" y=(y) width="28" height="12" {} } "on" }
            span { svg viewBox="0 0 28 20" aria-hidden="true" { rect.off x="0" y="14" width="28" height="2" {} } "off" }
            span { svg viewBox="0 0 28 20" aria-hidden="true" { rect.on.abnormal x="0" y=(y) width="28" height="12" {} } "not normal" }
            span { svg viewBox="0 0 28 20" aria-hidden="true" { rect.unknown fill="url(#lane-hatch)" x="0" y=(y) width="28" height="12" {} } "not known" }
            span { svg viewBox="0 0 28 20" aria-hidden="true" {
                rect.doubt x="6" y="1" width="16" height="18" {} line.moved x1="14" x2="14" y1="1" y2="19" {}
            } "a change and its doubt" }
            span { svg viewBox="0 0 28 20" aria-hidden="true" { rect.window x="1" y=(y) width="26" height="12" {} } "expected within" }
        }
    }
}
