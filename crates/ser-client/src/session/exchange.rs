//! When a request was sent and answered, and what that says of the recorder.

use std::time::Duration;

use crate::transport::line_rate::LineRate;

/// How much faster than it says a line may be, one part in so many. Two ends whose rates differ by
/// more do not understand each other.
const RATE_TOLERANCE: u32 = 20;

/// A request and its reply, in the time of the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exchange {
    /// How often the request was sent. The reply may answer any of these.
    pub attempts: u32,
    /// Just before the first byte of the first attempt was sent.
    pub first_sent: Duration,
    /// Just before the first byte of the last attempt was sent.
    pub last_sent: Duration,
    /// When the reply had arrived whole.
    pub answered: Duration,
    /// How long an attempt is on the line at the least.
    request: Duration,
    /// How long the reply is on the line at the least.
    reply: Duration,
}

impl Exchange {
    pub(super) fn new(
        attempts: u32,
        (first_sent, last_sent, answered): (Duration, Duration, Duration),
        (request, reply): (usize, usize),
        line_rate: LineRate,
    ) -> Exchange {
        let at_least = |bytes| {
            let time = line_rate.time_for(bytes);
            time - time / RATE_TOLERANCE
        };
        let (request, reply) = (at_least(request), at_least(reply));
        Exchange { attempts, first_sent, last_sent, answered, request, reply }
    }

    /// The same over a connection whose bytes take an unknown time.
    pub(crate) const fn without_rate(self) -> Exchange {
        Exchange { request: Duration::ZERO, reply: Duration::ZERO, ..self }
    }

    /// Between which two times the recorder had received the request whole and had not begun to
    /// reply. Whatever the request does was done in between, and what the reply says was so then.
    #[must_use]
    pub fn carried_out(&self) -> (Duration, Duration) {
        let from = self.first_sent + self.request;
        match self.answered.checked_sub(self.reply) {
            Some(to) if from <= to => (from, to),
            // The line is faster than it says.
            _ => (self.first_sent, self.answered),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn the_time_on_the_line_is_neither_before_the_request_nor_after_the_reply() {
        // 48 bytes take 50 ms, and 24 bytes 25 ms.
        let line_rate = LineRate::BitsPerSecond(9600);
        let exchange =
            |answered| Exchange::new(1, (ms(100), ms(100), ms(answered)), (48, 24), line_rate);
        let margin = |time: u64| ms(time) - ms(time) / 20;
        assert_eq!(exchange(200).carried_out(), (ms(100) + margin(50), ms(200) - margin(25)));
        assert_eq!(exchange(200).without_rate().carried_out(), (ms(100), ms(200)));
        assert_eq!(exchange(130).carried_out(), (ms(100), ms(130)), "no such rate");
        let instant = Exchange::new(1, (ms(1), ms(1), ms(3)), (48, 24), LineRate::Instant);
        assert_eq!(instant.carried_out(), (ms(1), ms(3)));
    }
}
