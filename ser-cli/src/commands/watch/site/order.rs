//! The order of what several recorders have recorded.

use crate::output::Record;

/// A date and time as its fields, the largest first.
type Shown = (u16, [u8; 5], u16);

/// Puts records in order by what the clocks showed. Those of one recorder stay in their order,
/// also where its clock went back; a loss stays before the event that follows it.
pub(super) fn by_shown_time(of_recorders: Vec<Vec<Record>>) -> Vec<(usize, Record)> {
    let mut all: Vec<(Shown, usize, Record)> = Vec::new();
    for (recorder, records) in of_recorders.into_iter().enumerate() {
        let times = times(&records);
        all.extend(times.into_iter().zip(records).map(|(time, record)| (time, recorder, record)));
    }
    // A stable sort: what shows the same time stays together by recorder.
    all.sort_by_key(|(time, ..)| *time);
    all.into_iter().map(|(_, recorder, record)| (recorder, record)).collect()
}

/// A time for each record, which never goes back.
fn times(records: &[Record]) -> Vec<Shown> {
    let mut times: Vec<Shown> = Vec::with_capacity(records.len());
    let mut latest = Shown::default();
    for record in records {
        latest = latest.max(shown(record).unwrap_or(latest));
        times.push(latest);
    }
    // A loss has the time of what follows it.
    let mut next = latest;
    for (time, record) in times.iter_mut().zip(records).rev() {
        if matches!(record, Record::Loss(_)) {
            *time = next;
        }
        next = *time;
    }
    times
}

fn shown(record: &Record) -> Option<Shown> {
    let Record::Event(event) = record else { return None };
    let time = event.entry.time;
    time.check().ok()?;
    let fields = [time.month, time.day, time.hour, time.minute, time.second];
    Some((time.full_year(), fields, time.millisecond))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::testing::{entry, event, four_lost};

    fn at(number: u16, time: &str) -> Record {
        Record::Event(event(number, entry(time, &[1], &[1])))
    }

    /// The numbers of the events in their order; 0 for a loss.
    fn ordered(of_recorders: Vec<Vec<Record>>) -> Vec<(usize, u16)> {
        let number = |record: &Record| match record {
            Record::Event(event) => event.number,
            Record::Loss(_) => 0,
        };
        let ordered = by_shown_time(of_recorders);
        ordered.iter().map(|(recorder, record)| (*recorder, number(record))).collect()
    }

    #[test]
    fn recorders_are_merged_by_time() {
        assert_eq!(
            ordered(vec![vec![at(1, "00.250"), at(2, "00.300")], vec![at(1, "00.260")]]),
            [(0, 1), (1, 1), (0, 2)]
        );
    }

    #[test]
    fn one_recorder_stays_in_its_order_where_its_clock_goes_back() {
        assert_eq!(
            ordered(vec![vec![at(1, "05.000"), at(2, "01.000")], vec![at(1, "03.000")]]),
            [(1, 1), (0, 1), (0, 2)]
        );
    }

    #[test]
    fn a_loss_stays_before_what_follows_it() {
        assert_eq!(
            ordered(vec![
                vec![at(1, "01.000"), Record::Loss(four_lost()), at(6, "05.000")],
                vec![at(1, "03.000"), Record::Loss(four_lost())],
            ]),
            [(0, 1), (1, 1), (1, 0), (0, 0), (0, 6)]
        );
    }
}
