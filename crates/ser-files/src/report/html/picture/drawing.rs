//! How a lane is drawn: its names, its states as bars, its changes as strokes.
//!
//! Colour is never all that tells states apart: what is on is high, what is off is low, what is not
//! normal is striped, and what is not known is hatched the other way.

use maud::{Markup, html};

use super::frame::{FULL_PX, LANE_PX, LEFT_PX, NAMES_PX, px, shortened};
use super::lanes::{Edge, Lane, State, Stretch};
use super::scale::Scale;

/// The stripes of what is not normal.
pub(super) const STRIPED: &str = "url(#striped)";
/// The hatching of what is not known.
pub(super) const UNKNOWN: &str = "url(#hatched)";

/// Stripes and hatching, once for the whole page.
pub(super) fn patterns() -> Markup {
    html! {
        svg.patterns width="0" height="0" aria-hidden="true" {
            defs {
                pattern id="hatched" width="6" height="6" patternUnits="userSpaceOnUse"
                    patternTransform="rotate(45)" {
                    rect.hatch width="2.5" height="6" {}
                }
                pattern id="striped" width="7" height="7" patternUnits="userSpaceOnUse"
                    patternTransform="rotate(-45)" {
                    rect.stripe width="7" height="7" {}
                    rect.between width="2" height="7" {}
                }
            }
        }
    }
}

/// A lane whose name in links is `name` and its number.
pub(super) fn draw(lane: &Lane, (name, number): (&str, usize), y: f64, scale: &Scale) -> Markup {
    html! {
        g.lane.first[lane.first.is_some()] id={ (name) "-" (number) } data-lane=(number) {
            rect.back x="0" y=(y) width=(FULL_PX) height=(LANE_PX) {}
            text.name x=(NAMES_PX) y=(y + 15.0) {
                title { (lane.point) " (" (lane.recorder) ")" } (shortened(&lane.point, 28))
            }
            text.recorder x=(NAMES_PX) y=(y + 27.0) {
                (shortened(&lane.recorder, if lane.first.is_some() { 17 } else { 34 }))
                @if let Some(first) = lane.first { " · " (first) }
            }
            @for stretch in &lane.stretches {
                (draw_stretch(stretch, y, scale))
            }
            @for edge in &lane.edges {
                (draw_edge(edge, y, scale))
            }
        }
    }
}

fn draw_stretch(stretch: &Stretch, y: f64, scale: &Scale) -> Markup {
    let (from, to) = (stretch.from_us, stretch.to_us);
    let (class, top, height) = match stretch.state {
        State::On { is_abnormal: false } => ("on", 7.0, 18.0),
        State::On { is_abnormal: true } => ("abnormal", 7.0, 18.0),
        State::Off { is_abnormal: false } => ("off", 23.0, 2.0),
        State::Off { is_abnormal: true } => ("abnormal", 19.0, 6.0),
        State::Unknown => ("unknown", 7.0, 18.0),
    };
    let (fill, title) = match stretch.state {
        State::On { is_abnormal: true } => (Some(STRIPED), Some("on, not normal")),
        State::Off { is_abnormal: true } => (Some(STRIPED), Some("off, not normal")),
        State::Unknown => (Some(UNKNOWN), Some("not known: something is missing")),
        State::On { .. } | State::Off { .. } => (None, None),
    };
    let (x, width) = scale.stretch(from, to).unwrap_or((LEFT_PX, 0.0));
    html! {
        rect class=(class) data-a=(from) data-b=(to) x=(px(x)) y=(px(y + top)) width=(px(width))
            height=(height) fill=[fill] {
            @if let Some(title) = title { title { (title) } }
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
