//! The time between an event and the others, as the tables show it.

use ser_proto::TimeStamp;

use crate::time::Delta;

/// Remembers the events that the next one is compared with.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Elapsed {
    first: Option<TimeStamp>,
    previous: Option<TimeStamp>,
}

impl Elapsed {
    /// The time since the previous and since the first event. Empty for the first event itself; `?`
    /// if one of the two has an impossible date.
    pub(crate) fn at(&mut self, time: TimeStamp) -> [String; 2] {
        let since = [self.previous, self.first].map(|earlier| match earlier {
            None => String::new(),
            Some(earlier) => {
                Delta::between(earlier, time).map_or("?".to_string(), |delta| delta.to_string())
            }
        });
        self.first.get_or_insert(time);
        self.previous = Some(time);
        since
    }
}
