//! What must be said: "unknown" is no way out. Each rule here is reckoned from the truth of the
//! world and the site alone.

use ser_evidence::record::Reference;

use crate::adapter::{Ends, Said};
use crate::judge::{Judge, Judged, show};
use crate::known::Known;
use crate::observing::Observed;
use crate::true_time::US;

/// For what rounding adds up to, and the room that is left for it.
const SLACK_US: i64 = 40;

/// How fast the UTC clock of a host may move away from its monotonic one.
const HOST_SLEW_PPM: i64 = 500;

impl<'a> Judge<'a> {
    pub(crate) fn enough_is_said(&mut self) {
        let known = Known::of(self);
        for judged in self.rows.clone() {
            self.bounds_are_no_wider_than_an_observation(&known, judged);
        }
        for (one, other) in self.pairs() {
            self.order_by_a_broadcast_is_said(&known, one, other);
            self.time_between_two_of_a_run_is_said(&known, one, other);
        }
    }

    /// One observation near an entry of the same run bounds it.
    fn bounds_are_no_wider_than_an_observation(&mut self, known: &Known<'a>, judged: Judged<'a>) {
        let (row, truth) = (judged.row, judged.truth);
        for observed in known.observed_in_run_of(judged) {
            let Reference::Host { bound, reading } = observed.observation.at else {
                continue;
            };
            let Some(width) = bound.width_us() else { continue };
            let ms = truth.shown.shown_ms - observed.shown.shown_ms;
            let most = width + 2 * self.drift_us(row.recorder, ms) + self.sample_us(row.recorder);
            let on_hosts = self.said.on_hosts(row.event, None);
            let ends = on_hosts.iter().find(|(boot, _)| *boot == reading.boot).map(|(_, e)| *e);
            if !is_narrower(ends.unwrap_or((None, None)), most + SLACK_US) {
                self.fault(
                    "narrow on host",
                    format!(
                        "{row:?}: {ends:?} on the host is wider than {most} us by {observed:?}"
                    ),
                );
            }
            let doubt = reading.utc_doubt_us.or(self.story.world.site.utc_doubt_us);
            let Some(doubt) = doubt.and_then(|doubt| i64::try_from(doubt).ok()) else { continue };
            let host = self.story.world.hosts.iter().find(|host| host.boot == reading.boot);
            let read = host.expect("a host of the world").instant(reading.monotonic);
            let apart_us = (truth.shown.began - read).abs() / US + width + most;
            let most = most + 2 * doubt + apart_us * HOST_SLEW_PPM / 500_000;
            let ends = self.said.utc(row.event, None);
            if !is_narrower(ends, most + SLACK_US) {
                self.fault(
                    "narrow in UTC",
                    format!("{row:?}: {ends:?} in UTC is wider than {most} us"),
                );
            }
        }
    }

    /// Two recorders that heard one broadcast can be compared to the millisecond.
    fn order_by_a_broadcast_is_said(
        &mut self,
        known: &Known<'a>,
        one: Judged<'a>,
        other: Judged<'a>,
    ) {
        if one.row.recorder == other.row.recorder {
            return;
        }
        for a in known.observed_in_run_of(one) {
            for b in known.observed_in_run_of(other) {
                let broadcast = a.observation.how.broadcast();
                if broadcast.is_none() || broadcast != b.observation.how.broadcast() {
                    continue;
                }
                let since = |observed: &Observed, judged: Judged<'a>| {
                    judged.truth.shown.shown_ms - observed.shown.shown_ms
                };
                let (a_ms, b_ms) = (since(a, one), since(b, other));
                let drift =
                    self.drift_us(one.row.recorder, a_ms) + self.drift_us(other.row.recorder, b_ms);
                // The samples are as far apart as the stamps, to the phase of two milliseconds.
                let samples = (b_ms - a_ms) * 1000 - drift - 1000;
                let least = samples - self.after_us(one) - self.before_us(other) - SLACK_US;
                let said = self.said.order(one.row.event, other.row.event);
                if least > 0 && said != Said::Before {
                    self.fault(
                        "order by broadcast",
                        format!(
                            "{said:?}, and by broadcast {broadcast:?} at least {least} us: {}",
                            show(one, other)
                        ),
                    );
                }
            }
        }
    }

    /// Inside a run the stamps say how much later, whatever the clock shows.
    fn time_between_two_of_a_run_is_said(
        &mut self,
        known: &Known<'a>,
        one: Judged<'a>,
        other: Judged<'a>,
    ) {
        if !known.is_one_run(one, other) {
            return;
        }
        let recorder = one.row.recorder;
        let ms = other.truth.shown.shown_ms - one.truth.shown.shown_ms;
        let most = 2 * self.drift_us(recorder, ms) + 2 * self.sample_us(recorder) + SLACK_US;
        let (a, b) = (one.truth.moves[0].input, other.truth.moves[0].input);
        let ends = self.said.delta((one.row.event, a), (other.row.event, b));
        if !is_narrower(ends, most) {
            self.fault(
                "narrow delta",
                format!("{ends:?} is wider than {most} us: {}", show(one, other)),
            );
        }
    }

    /// How much a clock can drift in this many milliseconds.
    fn drift_us(&self, recorder: usize, ms: i64) -> i64 {
        let ppb = i64::from(self.story.world.site.recorders[recorder].drift_ppb);
        (ms.abs() * ppb).div_euclid(1_000_000) + 1
    }

    /// How much earlier than the tick of its stamp a contact may have moved at most.
    fn before_us(&self, judged: Judged<'a>) -> i64 {
        let delays = self.story.world.site.recorders[judged.row.recorder].delays;
        1000 + i64::from(delays.closing_us.1.max(delays.opening_us.1))
    }

    /// How much later at most; mostly negative.
    fn after_us(&self, judged: Judged<'a>) -> i64 {
        let recorder = &self.story.world.site.recorders[judged.row.recorder];
        let delays = recorder.delays;
        let original = if recorder.is_original { 1000 } else { 0 };
        original - i64::from(delays.closing_us.0.min(delays.opening_us.0))
    }

    /// From the first to the last moment at which a contact may have moved, by one sample.
    fn sample_us(&self, recorder: usize) -> i64 {
        let recorder = &self.story.world.site.recorders[recorder];
        let delays = recorder.delays;
        let longest = delays.closing_us.1.max(delays.opening_us.1);
        let shortest = delays.closing_us.0.min(delays.opening_us.0);
        let original = if recorder.is_original { 1000 } else { 0 };
        1000 + original + i64::from(longest - shortest)
    }
}

fn is_narrower(ends: Ends, most_us: i64) -> bool {
    matches!(ends, (Some(lo), Some(hi)) if hi - lo <= most_us)
}
