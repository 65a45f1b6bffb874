//! One chart: some lanes below an axis of their own, so that it can be read on a page of paper.

use maud::{Markup, html};

use super::drawing;
use super::frame::{BOTTOM_PX, FULL_PX, LEFT_PX, NAMES_PX, TOP_PX, WIDTH_PX, px, y_px};
use super::lanes::{Lane, Lanes};
use super::scale::Scale;
use super::steps::StepLane;
use super::ticks;
use crate::report::Clock;

/// No chart has more lanes, so that a printed page has room for two.
const MOST_ROWS: usize = 20;

/// No more names of times than this.
pub(super) const TICKS: usize = 10;

/// Which time a picture shows, in microseconds after the first change.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    /// What the names of its lanes begin with.
    pub(super) name: &'static str,
    pub(super) title: &'static str,
    pub(super) from_us: i64,
    pub(super) to_us: i64,
}

/// A row of a chart.
enum Row<'a> {
    Lane(usize, &'a Lane),
    Step(&'a StepLane),
}

/// Where a chart stands among those of one picture.
struct Part<'a> {
    rows: &'a [Row<'a>],
    /// How many rows are in the charts before.
    before: usize,
    /// In all charts.
    all: usize,
}

impl Part<'_> {
    /// As `lanes 1 to 20 of 60`; nothing if there is no other chart.
    fn text(&self) -> Option<String> {
        let last = self.before + self.rows.len();
        let is_one_of_several = self.rows.len() < self.all;
        is_one_of_several.then(|| format!("lanes {} to {last} of {}", self.before + 1, self.all))
    }
}

/// All that moves or begins in a window, in charts of about the same height.
pub(super) fn charts(
    lanes: &Lanes,
    steps: &[StepLane],
    window: &Window,
    clock: &Clock,
) -> Vec<Markup> {
    let scale = Scale::new((window.from_us, window.to_us), LEFT_PX, WIDTH_PX);
    let moved = |lane: &Lane| lane.edges.iter().any(|edge| scale.contains(edge.at_us));
    let shown = lanes.lanes.iter().enumerate().filter(|(_, lane)| moved(lane));
    let steps = steps.iter().filter(|step| scale.contains(step.after_us));
    let rows = shown.map(|(number, lane)| Row::Lane(number, lane)).chain(steps.map(Row::Step));
    let rows: Vec<Row<'_>> = rows.collect();
    let each = rows.len().div_ceil(rows.len().div_ceil(MOST_ROWS).max(1)).max(1);
    let times = Times::of(lanes, window, clock);
    let parts = rows.chunks(each).enumerate().map(|(number, these)| {
        let part = Part { rows: these, before: number * each, all: rows.len() };
        chart(&part, window, &scale, &times)
    });
    parts.collect()
}

/// When a picture begins and ends, in words.
struct Times {
    from: String,
    to: String,
}

impl Times {
    fn of(lanes: &Lanes, window: &Window, clock: &Clock) -> Times {
        let at = |us: i64| lanes.origin_us.saturating_add(us);
        Times { from: clock.date_and_time(at(window.from_us)), to: clock.time(at(window.to_us)) }
    }
}

fn chart(part: &Part<'_>, window: &Window, scale: &Scale, times: &Times) -> Markup {
    let bottom = y_px(part.rows.len());
    let title =
        part.text().map_or(window.title.to_owned(), |part| format!("{}, {part}", window.title));
    let label = format!("{title}: points over time; the table above says the same");
    let size = format!("0 0 {FULL_PX} {}", bottom + BOTTOM_PX);
    html! {
        svg.chart role="img" aria-label=(label) viewBox=(size)
            data-left=(LEFT_PX) data-width=(WIDTH_PX) data-bottom=(bottom) {
            (axis(scale, window, bottom))
            @for (row, what) in part.rows.iter().enumerate() {
                @match what {
                    Row::Lane(number, lane) => {
                        (drawing::draw(lane, (window.name, *number), y_px(row), scale))
                    }
                    Row::Step(step) => (step.draw(y_px(row), scale)),
                }
            }
            @if let Some(text) = part.text() {
                text.axis.title x=(NAMES_PX) y=(bottom + 16.0) { (text) }
            }
            text.end x=(LEFT_PX) y=(bottom + 16.0) { (times.from) }
            text.end.last x=(LEFT_PX + WIDTH_PX) y=(bottom + 16.0) { (times.to) }
        }
    }
}

fn axis(scale: &Scale, window: &Window, bottom: f64) -> Markup {
    let found = ticks::ticks((window.from_us, window.to_us), TICKS);
    html! {
        text.axis.title x=(NAMES_PX) y="18" { "after the first change" }
        g.ticks data-step=(found.step_us) {
            @for at_us in &found.at_us {
                @let x = px(scale.x_px(*at_us));
                line.grid data-a=(at_us) x1=(x) x2=(x) y1=(TOP_PX - 8.0) y2=(bottom) {}
                text.axis x=(x) y="18" { (ticks::label(*at_us, found.step_us)) }
            }
        }
    }
}
