//! The clocks of the observing hosts: monotonic, one for each boot, and UTC.

use std::collections::BTreeMap;

use super::envelope::{Envelope, Known, NO_HI, NO_LO, Slope};
use crate::record::{Boot, HostReading};
use crate::time::{Bound, Host, Moment, Utc};

/// How much a host's UTC may drift away from its monotonic clock between two readings, in parts per
/// billion. Operating systems slew a clock by at most this much.
const HOST_DRIFT_PPB: u32 = 500_000;

/// How much the monotonic clock of a host gains or loses at most, in parts per billion: as much as
/// the crystals of computers do.
pub(crate) const HOST_RATE_PPB: u32 = 50_000;

/// What is known of the boots of all hosts.
#[derive(Debug, Default)]
pub(crate) struct Hosts {
    boots: BTreeMap<Boot, BootClock>,
}

/// One boot.
#[derive(Debug)]
struct BootClock {
    /// UTC less the monotonic clock, at moments of the latter; empty if no reading has a doubt.
    offset: Envelope,
    /// Every reading: monotonic, and UTC less monotonic.
    readings: Vec<(i64, i64)>,
}

impl Hosts {
    /// From all readings. `utc_doubt_us` is used where the operating system did not know. Returns
    /// also the boots whose readings contradict each other: their UTC was set meanwhile.
    pub(crate) fn new(
        readings: impl IntoIterator<Item = HostReading>,
        utc_doubt_us: Option<u64>,
    ) -> (Hosts, Vec<Boot>) {
        let mut by_boot: BTreeMap<Boot, Vec<HostReading>> = BTreeMap::new();
        for reading in readings {
            by_boot.entry(reading.boot).or_default().push(reading);
        }
        let mut stepped = Vec::new();
        let clock = |(boot, readings): (Boot, Vec<HostReading>)| {
            let (clock, is_steady) = BootClock::new(&readings, utc_doubt_us);
            if !is_steady {
                stepped.push(boot);
            }
            (boot, clock)
        };
        let boots = by_boot.into_iter().map(clock).collect();
        (Hosts { boots }, stepped)
    }

    /// All boots, in order.
    pub(crate) fn boots(&self) -> impl Iterator<Item = Boot> {
        self.boots.keys().copied()
    }

    /// UTC less the monotonic clock, for the list. Where nothing is known of it, the host's own UTC
    /// is taken to be right to `anything_us`. If its readings allow it, the host's monotonic clock
    /// is taken to run as UTC does: then all recorders that it has observed stay together.
    pub(crate) fn placed(&self, boot: Boot, anything_us: i64) -> Envelope {
        let steady = Slope::within(0);
        let Some(clock) = self.boots.get(&boot) else {
            return Envelope::with_slope(Vec::new(), steady);
        };
        if !clock.offset.is_empty() {
            let is_steady = clock.offset.allows(steady);
            return if is_steady { clock.offset.narrowed(steady) } else { clock.offset.clone() };
        }
        let known = |&(x, offset): &(i64, i64)| Known {
            x,
            lo: offset - anything_us,
            hi: offset + anything_us,
            id: 0,
        };
        Envelope::with_slope(clock.readings.iter().map(known).collect(), steady)
    }

    /// A reading of a boot of whose UTC nothing is known but what the host said: monotonic and UTC.
    pub(crate) fn nominal_only(&self, boot: Boot) -> Option<(i64, i64)> {
        let clock = self.boots.get(&boot).filter(|clock| clock.offset.is_empty())?;
        let &(x, offset) = clock.readings.last()?;
        Some((x, x.saturating_add(offset)))
    }

    /// A bound on a boot's monotonic clock in UTC.
    pub(crate) fn utc(&self, boot: Boot, bound: Bound<Host>) -> Bound<Utc> {
        let Some(clock) = self.boots.get(&boot) else { return Bound::UNKNOWN };
        let lo = bound.lo().map_or(NO_LO, |lo| clock.offset.at(lo.us()).0);
        let hi = bound.hi().map_or(NO_HI, |hi| clock.offset.at(hi.us()).1);
        bound.moved_to(lo, hi)
    }

    /// A bound in UTC on a boot's monotonic clock, near a moment of the latter.
    pub(crate) fn monotonic(&self, boot: Boot, bound: Bound<Utc>) -> Bound<Host> {
        let Some(clock) = self.boots.get(&boot) else { return Bound::UNKNOWN };
        let lo = bound.lo().map_or(NO_LO, |lo| negated(clock.around(lo).1));
        let hi = bound.hi().map_or(NO_HI, |hi| negated(clock.around(hi).0));
        bound.moved_to(lo, hi)
    }
}

/// An offset the other way round. An unknown end becomes the other unknown end.
fn negated(offset: i64) -> i64 {
    match offset {
        NO_LO => NO_HI,
        NO_HI => NO_LO,
        offset => -offset,
    }
}

impl BootClock {
    fn new(readings: &[HostReading], utc_doubt_us: Option<u64>) -> (BootClock, bool) {
        let offset_of = |reading: &HostReading| reading.utc.us() - reading.monotonic.us();
        let known = |reading: &HostReading| {
            let doubt = reading.utc_doubt_us.or(utc_doubt_us)?;
            let doubt = i64::try_from(doubt).unwrap_or(i64::MAX / 4);
            let (x, offset) = (reading.monotonic.us(), offset_of(reading));
            Some(Known { x, lo: offset - doubt, hi: offset + doubt, id: 0 })
        };
        let points = readings.iter().filter_map(known).collect();
        // A host's rate is not learnt: it is slewed at any time.
        let (offset, contradictions) = Envelope::new(points, HOST_DRIFT_PPB, HOST_DRIFT_PPB);
        let mut readings: Vec<(i64, i64)> =
            readings.iter().map(|reading| (reading.monotonic.us(), offset_of(reading))).collect();
        readings.sort_unstable();
        readings.dedup();
        (BootClock { offset, readings }, contradictions.is_empty())
    }

    /// As the reading nearest in time has it.
    fn nearest(&self, monotonic: i64) -> i64 {
        let next = self.readings.partition_point(|&(x, _)| x < monotonic);
        let before = next.checked_sub(1).and_then(|before| self.readings.get(before));
        let distance = |reading: &&(i64, i64)| reading.0.abs_diff(monotonic);
        let nearest = [before, self.readings.get(next)].into_iter().flatten().min_by_key(distance);
        nearest.map_or(0, |&(_, offset)| offset)
    }

    /// UTC less monotonic at a moment of UTC. Which moment of the monotonic clock that is is itself
    /// in doubt.
    fn around(&self, utc: Moment<Utc>) -> (i64, i64) {
        let (lo, hi) = self.offset.at(self.near(utc));
        if lo == NO_LO || hi == NO_HI {
            return (lo, hi);
        }
        let (least, most) = self.offset.slope().change(hi.saturating_sub(lo).max(1));
        (lo.saturating_add(least), hi.saturating_add(most))
    }

    /// About which moment of the monotonic clock this is.
    fn near(&self, utc: Moment<Utc>) -> i64 {
        let first = self.readings.first().map_or(0, |&(_, offset)| offset);
        let about = utc.us().saturating_sub(first);
        utc.us().saturating_sub(self.nearest(about))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reading(monotonic: i64, utc: i64, utc_doubt_us: Option<u64>) -> HostReading {
        HostReading {
            boot: Boot(7),
            monotonic: Moment::from_us(monotonic),
            utc: Moment::from_us(utc),
            utc_doubt_us,
        }
    }

    #[test]
    fn utc_is_as_doubtful_as_the_host_says() {
        let (hosts, stepped) = Hosts::new([reading(1000, 5_001_000, Some(50))], None);
        assert_eq!(stepped, []);
        let utc = hosts.utc(Boot(7), Bound::from_us(1000, 1010));
        // Ten microseconds later one of rounding is added.
        assert_eq!(utc, Bound::from_us(5_000_950, 5_001_061));
        let back = hosts.monotonic(Boot(7), Bound::from_us(5_001_000, 5_001_000));
        // Where it is on the monotonic clock is known to 100 us: another microsecond.
        assert_eq!(back, Bound::from_us(949, 1051));
    }

    #[test]
    fn a_host_that_does_not_know_its_doubt_has_the_one_of_the_site() {
        let (hosts, _) = Hosts::new([reading(1000, 5_001_000, None)], Some(20_000));
        let utc = hosts.utc(Boot(7), Bound::from_us(1000, 1000));
        assert_eq!(utc, Bound::from_us(4_981_000, 5_021_000));
        let (hosts, _) = Hosts::new([reading(1000, 5_001_000, None)], None);
        assert_eq!(hosts.utc(Boot(7), Bound::from_us(1000, 1000)), Bound::UNKNOWN);
    }

    #[test]
    fn a_host_whose_utc_was_set_is_told() {
        let readings = [reading(0, 1_000_000, Some(10)), reading(1_000_000, 9_000_000, Some(10))];
        let (hosts, stepped) = Hosts::new(readings, None);
        assert_eq!(stepped, [Boot(7)]);
        let utc = hosts.utc(Boot(7), Bound::from_us(0, 0));
        assert!(utc.contains(Moment::from_us(1_000_000)), "{utc:?}");
        assert!(utc.contains(Moment::from_us(8_000_000)), "{utc:?}");
    }
}
