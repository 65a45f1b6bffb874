//! Numbers with up to three decimals, as whole thousandths.

use toml::de::DeInteger;

/// Why a number is none that can be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Error {
    /// More than three decimals.
    TooFine,
    /// Too large, infinite, or no number.
    OutOfRange,
}

/// Thousandths of a whole number.
pub(super) fn of_integer(integer: &DeInteger<'_>) -> Result<i64, Error> {
    let whole = i64::from_str_radix(integer.as_str(), integer.radix()).ok();
    whole.and_then(|whole| whole.checked_mul(1000)).ok_or(Error::OutOfRange)
}

/// Thousandths of a decimal number, exactly.
pub(super) fn of_decimal(text: &str) -> Result<i64, Error> {
    let (mantissa, exponent) = match text.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => {
            (mantissa, exponent.parse::<i32>().map_err(|_| Error::OutOfRange)?)
        }
        None => (text, 0),
    };
    let (is_negative, mantissa) = match mantissa.strip_prefix('-') {
        Some(mantissa) => (true, mantissa),
        None => (false, mantissa.strip_prefix('+').unwrap_or(mantissa)),
    };
    let (whole, decimals) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let digits = format!("{whole}{decimals}");
    if digits.is_empty() || !digits.bytes().all(|digit| digit.is_ascii_digit()) {
        return Err(Error::OutOfRange);
    }
    let digits = digits.trim_start_matches('0');
    let significant = digits.trim_end_matches('0');
    // The number is `significant` times ten to this power, in thousandths.
    let trailing = i64::try_from(digits.len() - significant.len()).unwrap_or(i64::MAX);
    let decimals = i64::try_from(decimals.len()).unwrap_or(i64::MAX);
    let power = (i64::from(exponent) + trailing).saturating_sub(decimals).saturating_add(3);
    if significant.is_empty() {
        return Ok(0);
    }
    let power = u32::try_from(power).map_err(|_| Error::TooFine)?;
    let number = significant.parse::<i64>().ok();
    let number = number.zip(10_i64.checked_pow(power)).and_then(|(n, scale)| n.checked_mul(scale));
    number.map(|number| if is_negative { -number } else { number }).ok_or(Error::OutOfRange)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decimal_is_exact_or_told() {
        for (text, thousandths) in [
            ("0.01", Ok(10)),
            ("0.001", Ok(1)),
            ("300.0", Ok(300_000)),
            ("300.5", Ok(300_500)),
            ("-1.5", Ok(-1500)),
            ("+1.5", Ok(1500)),
            ("1e3", Ok(1_000_000)),
            ("1.5E-2", Ok(15)),
            ("0.0", Ok(0)),
            ("0.0000000", Ok(0)),
            ("0.100000000", Ok(100)),
            ("0.0005", Err(Error::TooFine)),
            ("1e-9999999999", Err(Error::OutOfRange)),
            ("1e-999999999", Err(Error::TooFine)),
            ("1e999999999", Err(Error::OutOfRange)),
            ("nan", Err(Error::OutOfRange)),
            ("-inf", Err(Error::OutOfRange)),
            ("", Err(Error::OutOfRange)),
        ] {
            assert_eq!(of_decimal(text), thousandths, "{text}");
        }
    }
}
