//! What a collector is to do.

use std::collections::BTreeSet;
use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;

use ser_archive::Archive;
use ser_evidence::site::Site;

/// Opens an archive to write to it.
pub type Open = Arc<dyn Fn() -> ser_archive::Result<Archive> + Send + Sync>;

/// What a collector is to do.
#[derive(Clone)]
pub struct Options {
    /// Its name, by which the archive tells collectors apart. It must stay the same from run to
    /// run.
    pub name: String,
    /// The program that it is part of, with its version, for the record of each command.
    pub program: String,
    /// The recorders: those of the site that have a port.
    pub site: Site,
    /// The site file, to be archived with what is read.
    pub site_text: Option<String>,
    /// How long a recorder may take to answer, and how often it is asked again.
    pub line: ser_client::Options,
    /// Whether recorders may be made to report by themselves; their setting is put back at the end.
    pub may_configure: bool,
    /// When clocks are set each day, by the time zone of the site.
    pub set_clocks: Option<DailyTime>,
    /// Recorders that were moved from one port to another on purpose.
    pub moved: BTreeSet<String>,
    /// Where everything goes that is archived.
    pub forward: Option<Forward>,
    /// For how long entries are kept. Without it, for ever.
    pub keep_for: Option<Duration>,
    /// How much room the archive may take, in bytes. Without it, as much as there is.
    pub keep_bytes: Option<u64>,
    /// Whether each recorder is read once, and that is all.
    pub once: bool,
    /// How often, and how long.
    pub times: Times,
}

/// Where everything goes that is archived here.
#[derive(Clone)]
pub struct Forward {
    /// The name of the outlet: the address of the other archive, without a password.
    pub outlet: String,
    /// Opens the other archive.
    pub open: Open,
}

/// A time of the day: hour and minute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DailyTime {
    hour: i8,
    minute: i8,
}

impl DailyTime {
    pub(crate) const fn of_day(self) -> (i8, i8) {
        (self.hour, self.minute)
    }
}

/// As in `03:30`.
impl FromStr for DailyTime {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<DailyTime, &'static str> {
        const FORM: &str = "a time of the day is written as in 03:30";
        let number = |text: &str, below: i8| {
            let is_ours = text.len() == 2 && text.bytes().all(|byte| byte.is_ascii_digit());
            text.parse().ok().filter(|number: &i8| is_ours && *number < below)
        };
        let (hour, minute) = text.split_once(':').ok_or(FORM)?;
        let time = number(hour, 24).zip(number(minute, 60));
        time.map(|(hour, minute)| DailyTime { hour, minute }).ok_or(FORM)
    }
}

/// How often a collector does things, and how long it waits.
#[derive(Clone, Copy, Debug)]
pub struct Times {
    /// How often a recorder is read that does not report by itself.
    pub poll: Duration,
    /// How often one is read that does, in case a report gets lost.
    pub check: Duration,
    /// How often clocks are looked at, besides after each incident.
    pub look_at_clock: Duration,
    /// How often the arrival of an entry is taken for a look at the clock, where that cannot be
    /// asked.
    pub take_arrival: Duration,
    /// How often it is told that nothing is missing so far, besides after each incident.
    pub vouch: Duration,
    /// How often recorders are asked what their chatter filters left out.
    pub look_at_left_out: Duration,
    /// The first pause after a failure. The next one is twice as long.
    pub first_pause: Duration,
    /// The longest pause.
    pub longest_pause: Duration,
    /// How often a failure that lasts is told again.
    pub tell_again: Duration,
    /// How often what is old is let go, and the heads of the chains are told.
    pub look_after_archive: Duration,
}

impl Default for Times {
    fn default() -> Times {
        let minutes = |count: u64| Duration::from_secs(60 * count);
        Times {
            poll: Duration::from_secs(1),
            check: Duration::from_secs(10),
            look_at_clock: minutes(60),
            take_arrival: minutes(10),
            vouch: minutes(60),
            look_at_left_out: minutes(10),
            first_pause: Duration::from_secs(1),
            longest_pause: minutes(1),
            tell_again: minutes(60),
            look_after_archive: minutes(24 * 60),
        }
    }
}

impl Times {
    /// All of them so many times faster: a test lives through an hour in a minute.
    #[must_use]
    pub fn faster(self, times: u32) -> Times {
        let faster = |time: Duration| time / times.max(1);
        Times {
            poll: faster(self.poll),
            check: faster(self.check),
            look_at_clock: faster(self.look_at_clock),
            take_arrival: faster(self.take_arrival),
            vouch: faster(self.vouch),
            look_at_left_out: faster(self.look_at_left_out),
            first_pause: faster(self.first_pause),
            longest_pause: faster(self.longest_pause),
            tell_again: faster(self.tell_again),
            look_after_archive: faster(self.look_after_archive),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_of_the_day_has_an_hour_and_a_minute() {
        assert_eq!("03:30".parse(), Ok(DailyTime { hour: 3, minute: 30 }));
        assert_eq!("23:59".parse(), Ok(DailyTime { hour: 23, minute: 59 }));
        for wrong in ["", "3:30", "24:00", "03:60", "03:3", "+3:30", "03:30:00", "noon"] {
            assert!(wrong.parse::<DailyTime>().is_err(), "{wrong}");
        }
    }
}
