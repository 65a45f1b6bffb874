//! Where each entry of a life goes in the list.

/// Nowhere: nothing is known about the time of the entry, nor of a neighbour.
const NOWHERE: i64 = i64::MIN;

/// One key for each of `count` entries, never falling. Entries whose time is known have it as their
/// key. Others have what their clock says, as far as their neighbours allow it.
pub(super) fn keys(
    count: usize,
    known: &dyn Fn(usize) -> Option<i64>,
    nominal: &dyn Fn(usize) -> Option<i64>,
) -> Vec<i64> {
    let mut keys = Vec::with_capacity(count);
    let mut is_known = Vec::with_capacity(count);
    let (mut last_known, mut last) = (NOWHERE, NOWHERE);
    for place in 0..count {
        match known(place) {
            Some(time) => {
                last_known = time.max(last_known);
                last = last_known;
                is_known.push(true);
            }
            None => {
                last = nominal(place).map_or(last, |time| time.max(last));
                is_known.push(false);
            }
        }
        keys.push(last);
    }
    let mut next = None;
    for (key, is_known) in keys.iter_mut().zip(is_known).rev() {
        if let Some(next) = next
            && !is_known
            && (*key > next || *key == NOWHERE)
        {
            *key = next;
        }
        next = (*key != NOWHERE).then_some(*key);
    }
    keys
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(entries: &[(Option<i64>, Option<i64>)]) -> Vec<i64> {
        keys(entries.len(), &|place| entries[place].0, &|place| entries[place].1)
    }

    #[test]
    fn known_times_are_kept_and_others_fit_in_between() {
        let entries = [(Some(10), None), (None, Some(5)), (None, Some(99)), (Some(20), None)];
        assert_eq!(of(&entries), [10, 10, 20, 20]);
        assert_eq!(of(&[(Some(10), None), (None, Some(15)), (Some(20), None)]), [10, 15, 20]);
    }

    #[test]
    fn what_has_no_time_joins_its_neighbours() {
        assert_eq!(of(&[(None, None), (Some(10), None), (None, None)]), [10, 10, 10]);
        assert_eq!(of(&[(None, None), (None, None)]), [NOWHERE, NOWHERE]);
        assert_eq!(of(&[(None, None), (None, Some(7)), (None, Some(3))]), [7, 7, 7]);
    }
}
