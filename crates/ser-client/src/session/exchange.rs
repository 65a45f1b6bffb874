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
    /// When the reply began.
    reply: Beginning,
}

/// When a frame began, as well as that is known from its bytes.
///
/// They may come in pieces, each long after its bytes were sent: a USB adapter holds them back. The
/// first byte of a frame was sent no later than any of them arrived, less the time that the bytes up
/// to that one are on the line. So the piece that was held back least tells most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Beginning {
    /// When the first piece arrived.
    seen: Duration,
    /// The latest time at which the first bit can have been sent, by the rate of the line.
    no_later: Duration,
    bytes: usize,
}

impl Beginning {
    /// A frame of which nothing has arrived before this time.
    pub(super) const fn at(now: Duration) -> Beginning {
        Beginning { seen: now, no_later: now, bytes: 0 }
    }

    /// Takes its next byte.
    pub(super) fn take_byte(&mut self, now: Duration, line_rate: LineRate) {
        self.bytes += 1;
        let sent_by = now.saturating_sub(at_least(self.bytes, line_rate));
        self.no_later = self.no_later.min(sent_by);
    }
}

/// How long that many bytes are on the line at the least.
fn at_least(bytes: usize, line_rate: LineRate) -> Duration {
    let time = line_rate.time_for(bytes);
    time - time / RATE_TOLERANCE
}

impl Exchange {
    pub(super) fn new(
        attempts: u32,
        (first_sent, last_sent, answered): (Duration, Duration, Duration),
        request: usize,
        reply: Beginning,
        line_rate: LineRate,
    ) -> Exchange {
        let request = at_least(request, line_rate);
        Exchange { attempts, first_sent, last_sent, answered, request, reply }
    }

    /// The same over a connection whose bytes take an unknown time.
    pub(crate) const fn without_rate(self) -> Exchange {
        let reply = Beginning::at(self.reply.seen);
        Exchange { request: Duration::ZERO, reply, ..self }
    }

    /// Between which two times the recorder had received the request whole and had not begun to
    /// reply. Whatever the request does was done in between, and what the reply says was so then.
    #[must_use]
    pub fn carried_out(&self) -> (Duration, Duration) {
        let from = self.first_sent + self.request;
        let to = self.reply.no_later;
        // Otherwise the line is faster than it says.
        if from <= to { (from, to) } else { (self.first_sent, self.reply.seen) }
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
        let exchange = |answered| {
            let mut reply = Beginning::at(ms(answered));
            (0..24).for_each(|_| reply.take_byte(ms(answered), line_rate));
            Exchange::new(1, (ms(100), ms(100), ms(answered)), 48, reply, line_rate)
        };
        let margin = |time: u64| ms(time) - ms(time) / 20;
        assert_eq!(exchange(200).carried_out(), (ms(100) + margin(50), ms(200) - margin(25)));
        assert_eq!(exchange(200).without_rate().carried_out(), (ms(100), ms(200)));
        assert_eq!(exchange(130).carried_out(), (ms(100), ms(130)), "no such rate");
        let reply = Beginning::at(ms(3));
        let instant = Exchange::new(1, (ms(1), ms(1), ms(3)), 48, reply, LineRate::Instant);
        assert_eq!(instant.carried_out(), (ms(1), ms(3)));
    }

    #[test]
    fn the_piece_that_was_held_back_least_tells_when_a_frame_began() {
        let line_rate = LineRate::BitsPerSecond(10_000);
        // A byte takes a millisecond. The first eight come 9 ms late, the next eight 1 ms, and the
        // last ones 16 ms.
        let mut reply = Beginning::at(ms(117));
        for (bytes, at) in [(8, 117), (8, 117), (8, 140)] {
            (0..bytes).for_each(|_| reply.take_byte(ms(at), line_rate));
        }
        let exchange = Exchange::new(1, (ms(50), ms(50), ms(140)), 0, reply, line_rate);
        // Of sixteen milliseconds on the line, a twentieth may not have been.
        assert_eq!(exchange.carried_out().1, ms(101) + ms(16) / 20);
        assert_eq!(exchange.without_rate().carried_out().1, ms(117));
    }
}
