//! Stamps as text, exactly as they were read: an impossible date stays what it is.

use ser_proto::TimeStamp;

/// The length of a stamp whose fields have their usual width.
const USUAL_LEN: usize = 23;

/// The least year byte that is no year. Its text is that of a year from 2000 on.
const FIRST_IMPOSSIBLE_YEAR: u8 = 100;

/// The last year byte whose text is also that of another one.
const LAST_AMBIGUOUS_YEAR: u8 = 169;

/// The stamp whose text this is. `year` is the year byte, if the text does not tell it.
pub(crate) fn parse(text: &[u8], year: Option<u8>) -> Option<TimeStamp> {
    let mut stamp = usual(text).or_else(|| unusual(text))?;
    if let Some(year) = year {
        let same = TimeStamp { year, ..stamp }.full_year() == stamp.full_year();
        stamp.year = Some(year).filter(|_| same)?;
    }
    Some(stamp)
}

/// The year byte of a stamp whose text does not tell it.
pub(crate) fn untold_year(stamp: &TimeStamp) -> Option<u8> {
    Some(stamp.year).filter(|year| (FIRST_IMPOSSIBLE_YEAR..=LAST_AMBIGUOUS_YEAR).contains(year))
}

/// As `2026-11-22T10:00:00.250`; a blank may stand for the `T`.
fn usual(text: &[u8]) -> Option<TimeStamp> {
    let text: &[u8; USUAL_LEN] = text.try_into().ok()?;
    let &[
        y0,
        y1,
        y2,
        y3,
        b'-',
        m0,
        m1,
        b'-',
        d0,
        d1,
        b'T' | b' ',
        h0,
        h1,
        b':',
        n0,
        n1,
        b':',
        s0,
        s1,
        b'.',
        t0,
        t1,
        t2,
    ] = text
    else {
        return None;
    };
    let two = |tens, ones| Some(digit(tens)? * 10 + digit(ones)?);
    let year = u16::from(two(y0, y1)?) * 100 + u16::from(two(y2, y3)?);
    Some(TimeStamp {
        year: year_byte(year)?,
        month: two(m0, m1)?,
        day: two(d0, d1)?,
        hour: two(h0, h1)?,
        minute: two(n0, n1)?,
        second: two(s0, s1)?,
        millisecond: u16::from(digit(t0)?) * 100 + u16::from(two(t1, t2)?),
    })
}

fn digit(byte: u8) -> Option<u8> {
    byte.is_ascii_digit().then(|| byte - b'0')
}

/// The fields of an impossible date may be wider.
fn unusual(text: &[u8]) -> Option<TimeStamp> {
    let text = std::str::from_utf8(text).ok()?;
    if !text.bytes().all(|byte| byte.is_ascii_digit() || b"-T:.".contains(&byte)) {
        return None;
    }
    let mut fields = text.split(['-', 'T', ':', '.']).map(|field| field.parse::<u16>().ok());
    let mut next = || fields.next()?;
    let byte = |field: Option<u16>| u8::try_from(field?).ok();
    let stamp = TimeStamp {
        year: year_byte(next()?)?,
        month: byte(next())?,
        day: byte(next())?,
        hour: byte(next())?,
        minute: byte(next())?,
        second: byte(next())?,
        millisecond: next()?,
    };
    // Nothing else has this text.
    (fields.next().is_none() && stamp.to_string() == text).then_some(stamp)
}

/// The byte behind a year in full; where there are two, the one of a possible year.
fn year_byte(full: u16) -> Option<u8> {
    match full {
        2000..=2069 => u8::try_from(full - 2000).ok(),
        1970.. => u8::try_from(full - 1900).ok(),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn every_stamp_is_read_as_it_is_written(
            fields: (u8, u8, u8, u8, u8, u8, u16),
        ) {
            let (year, month, day, hour, minute, second, millisecond) = fields;
            let stamp = TimeStamp { year, month, day, hour, minute, second, millisecond };
            let text = stamp.to_string();
            prop_assert_eq!(parse(text.as_bytes(), untold_year(&stamp)), Some(stamp));
        }

        #[test]
        fn no_text_is_too_much(text: Vec<u8>, year: Option<u8>) {
            let _ = parse(&text, year);
        }
    }

    #[test]
    fn what_is_no_stamp_is_none() {
        for text in [
            "",
            "2026-11-22",
            "2026-11-22T10:00:00",
            "2026-11-22T10:00:00.25",
            "2026-11-22T10:00:00.250Z",
            "1969-11-22T10:00:00.250",
            "2156-11-22T10:00:00.250",
            "2026-011-22T10:00:00.250",
            "2026-11-22T10:00:00.+50",
            "2026-11-22T10:00:00,250",
        ] {
            assert_eq!(parse(text.as_bytes(), None), None, "{text}");
        }
        assert_eq!(parse(b"2026-11-22T10:00:00.250", Some(127)), None, "another year");
        assert!(parse(b"2026-11-22 10:00:00.250", None).is_some());
    }
}
