//! The picture of an incident: a lane for each point that moved, over one axis of time.
//!
//! `lanes` and `steps` know what was when, `drawing` how that looks, `chart` puts it below an axis.
//! Everything that stands at a time says so in `data-a` and `data-b`, in microseconds after the
//! first change. The page's script moves it when the reader zooms; without the script the picture
//! is as it was drawn.

mod axis;
mod chart;
mod drawing;
mod frame;
mod lanes;
mod legend;
mod scale;
mod steps;
mod ticks;

use maud::{Markup, html};

use self::chart::Window;
pub(super) use self::lanes::Lanes;
use super::super::{Clock, Document};

/// What is shown a second time if the incident is much longer: most of what matters is in it.
const EARLY_US: i64 = 100_000;

/// The incident, and the first 100 ms of it if it is much longer.
pub(super) fn section(document: &Document<'_>, lanes: &Lanes, clock: &Clock) -> Markup {
    let margin = lanes.margin_us();
    let steps = steps::lanes(document);
    let whole = Window {
        name: "lane",
        title: "The whole incident",
        from_us: lanes.least_us.saturating_sub(margin),
        to_us: lanes.most_us.saturating_add(margin),
    };
    let early = Window {
        name: "early",
        title: "The first 100 ms",
        from_us: -5_000,
        to_us: EARLY_US + 5_000,
    };
    let length = lanes.most_us.saturating_sub(lanes.least_us);
    let draw = |window: &Window| picture(window, &chart::charts(lanes, &steps, window, clock));
    html! {
        (drawing::patterns())
        div data-steps=(ticks::steps_us()) data-ticks=(chart::TICKS) {
            (draw(&whole))
            @if length > 3 * EARLY_US {
                (draw(&early))
            }
        }
        (legend::legend(lanes, &steps))
        @if lanes.timeless > 0 {
            p.alarm { (lanes.timeless) " changes have no time, and are not in the picture." }
        }
    }
}

/// The charts of one window; the script shows one stretch of time in all of them.
fn picture(window: &Window, charts: &[Markup]) -> Markup {
    html! {
        figure.picture data-from=(window.from_us) data-to=(window.to_us) {
            figcaption { (window.title) }
            div.scroll tabindex="0" role="group" aria-label=(window.title) {
                @for chart in charts { (chart) }
            }
        }
    }
}
