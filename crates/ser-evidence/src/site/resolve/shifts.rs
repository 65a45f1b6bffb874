//! Corrections by hand.

use std::collections::BTreeMap;

use toml::Spanned;

use super::names::Names;
use crate::site::checks::{backward_shift, overlapping_shifts};
use crate::site::diagnostic::{Findings, Span};
use crate::site::file::{ShiftTable, SiteTable};
use crate::site::model::{RecorderId, Shift};
use crate::time::{Moment, Utc};

/// All shifts that could be understood.
pub(super) fn shifts(table: &SiteTable, names: &Names<'_>, findings: &mut Findings) -> Vec<Shift> {
    let mut spans: BTreeMap<RecorderId, Vec<Occupied>> = BTreeMap::new();
    let mut shifts = Vec::new();
    for shift in &table.shifts {
        let recorder = names.recorder(&shift.recorder, findings);
        let times = times(shift, findings);
        if let (Some(recorder), Some((from, to))) = (recorder, times) {
            let head = shift.recorder.head.clone();
            spans.entry(recorder).or_default().push(Occupied { from, to, head });
            shifts.extend(resolved(shift, recorder, (from, to)));
        }
    }
    for (recorder, mut of_recorder) in spans {
        of_recorder.sort_by_key(|occupied| (occupied.from, occupied.head.start));
        look_for_overlaps(&of_recorder, names.recorder_name(recorder), findings);
    }
    shifts
}

/// The time of a shift, and where the shift is.
struct Occupied {
    from: Moment<Utc>,
    to: Moment<Utc>,
    head: Span,
}

fn times(shift: &ShiftTable, findings: &mut Findings) -> Option<(Moment<Utc>, Moment<Utc>)> {
    let (from, to): (&Spanned<_>, &Spanned<_>) = (shift.from.as_ref()?, shift.to.as_ref()?);
    if from.get_ref() >= to.get_ref() {
        backward_shift::found(findings, to.span(), from.span());
        return None;
    }
    Some((*from.get_ref(), *to.get_ref()))
}

fn resolved(
    shift: &ShiftTable,
    recorder: RecorderId,
    (from, to): (Moment<Utc>, Moment<Utc>),
) -> Option<Shift> {
    Some(Shift { recorder, us: shift.us?, from, to, why: shift.why.clone()? })
}

/// Tells each shift that begins before an earlier one has ended.
fn look_for_overlaps(shifts: &[Occupied], recorder: &str, findings: &mut Findings) {
    let mut last: Option<&Occupied> = None;
    for shift in shifts {
        if let Some(last) = last.filter(|last| shift.from < last.to) {
            // Told at the one that comes later in the file.
            let (first, second) = match last.head.start < shift.head.start {
                true => (&last.head, &shift.head),
                false => (&shift.head, &last.head),
            };
            overlapping_shifts::found(findings, (second.clone(), recorder), first.clone());
        }
        if last.is_none_or(|last| shift.to > last.to) {
            last = Some(shift);
        }
    }
}
