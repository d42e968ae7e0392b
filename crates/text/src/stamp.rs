//! Dates and times of day, as data acquisition prints them.

/// In which order a numeric date without a four-digit year in front states day and month.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    MonthFirst,
    DayFirst,
}

/// A date, a time of day, or both.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Stamp {
    /// Days since 1970-01-01.
    pub(crate) day: Option<i64>,
    /// Nanoseconds since midnight (UTC where an offset is given).
    pub(crate) ns: Option<i64>,
}

const NS_PER_S: i64 = 1_000_000_000;
const NS_PER_DAY: i64 = 86_400 * NS_PER_S;

impl Stamp {
    /// Nanoseconds since 1970, or since midnight where there is no date. Years are within 1700..=2200, so this fits.
    pub(crate) fn total_ns(self) -> i64 {
        self.day.unwrap_or(0) * NS_PER_DAY + self.ns.unwrap_or(0)
    }
}

/// The order that one date decides by itself: a number above 12 is a day.
pub(crate) fn decided_order(token: &[u8]) -> Option<Order> {
    let date = Scan { bytes: token, at: 0 }.date()?;
    if date.year_first || date.named_month {
        None
    } else if date.first > 12 {
        Some(Order::DayFirst)
    } else if date.second > 12 {
        Some(Order::MonthFirst)
    } else {
        None
    }
}

/// The customary order where no date decides: month first with slashes (the DAQ default), day first with dots.
pub(crate) fn customary_order(token: &[u8]) -> Order {
    match (Scan { bytes: token, at: 0 }).date() {
        Some(date) if date.separator == b'/' => Order::MonthFirst,
        _ => Order::DayFirst,
    }
}

/// The stamp that a whole token spells, or None.
#[inline]
pub(crate) fn parse(token: &[u8], order: Order) -> Option<Stamp> {
    // Every stamp starts with a digit and has one of these within its first five characters.
    if !token.first()?.is_ascii_digit() || !token.iter().take(5).any(|b| matches!(b, b':' | b'/' | b'-' | b'.')) {
        return None;
    }
    let mut scan = Scan { bytes: token, at: 0 };
    let day = match scan.date() {
        Some(date) => {
            let day = date.days_since_1970(order)?;
            if scan.done() {
                return Some(Stamp { day: Some(day), ns: None });
            }
            if !scan.take(b'T') && !scan.take(b't') && !scan.blanks() {
                return None;
            }
            Some(day)
        }
        None => None,
    };
    let mut ns = scan.time()?;
    if day.is_some() {
        ns -= scan.utc_offset()?;
    }
    scan.done().then_some(Stamp { day, ns: Some(ns) })
}

struct Date {
    first: i64,
    second: i64,
    third: i64,
    year_first: bool,
    named_month: bool,
    separator: u8,
}

impl Date {
    fn days_since_1970(&self, order: Order) -> Option<i64> {
        let (year, month, day) = match (self.year_first, self.named_month, order) {
            (true, ..) => (self.first, self.second, self.third),
            (_, true, _) | (_, _, Order::DayFirst) => (self.third, self.second, self.first),
            (.., Order::MonthFirst) => (self.third, self.first, self.second),
        };
        let year = if year < 100 { year + 2000 } else { year };
        if !(1700..=2200).contains(&year) || !(1..=12).contains(&month) || !(1..=31).contains(&day) {
            return None;
        }
        // Days from the civil calendar, years beginning in March (Hinnant, "chrono-compatible low-level date algorithms").
        let y = if month <= 2 { year - 1 } else { year };
        let era = y.div_euclid(400);
        let year_of_era = y.rem_euclid(400);
        let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
        let day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
        Some(era * 146_097 + day_of_era - 719_468)
    }
}

struct Scan<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Scan<'_> {
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    fn done(&self) -> bool {
        self.at == self.bytes.len()
    }

    fn take(&mut self, byte: u8) -> bool {
        let found = self.peek() == Some(byte);
        self.at += usize::from(found);
        found
    }

    fn blanks(&mut self) -> bool {
        let start = self.at;
        while self.peek() == Some(b' ') {
            self.at += 1;
        }
        self.at > start
    }

    /// Up to `most` digits: their value and how many they are.
    fn digits(&mut self, most: usize) -> Option<(i64, usize)> {
        let start = self.at;
        let mut value = 0;
        while self.at - start < most
            && let Some(digit @ b'0'..=b'9') = self.peek()
        {
            value = value * 10 + i64::from(digit - b'0');
            self.at += 1;
        }
        (self.at > start).then_some((value, self.at - start))
    }

    /// A date, or None with the position unchanged.
    fn date(&mut self) -> Option<Date> {
        let start = self.at;
        let date = self.date_or_not();
        if date.is_none() {
            self.at = start;
        }
        date
    }

    fn date_or_not(&mut self) -> Option<Date> {
        let (first, n_first) = self.digits(4)?;
        let separator = self.peek().filter(|b| matches!(b, b'-' | b'/' | b'.' | b' '))?;
        self.at += 1;
        let (second, named_month) = match self.digits(2) {
            Some((value, _)) => (value, false),
            None => (self.month()?, true),
        };
        if separator == b' ' && !named_month || !self.take(separator) {
            return None;
        }
        let (third, n_third) = self.digits(4)?;
        let year_first = n_first == 4;
        if year_first && n_third > 2 || !year_first && (n_first > 2 || n_third == 3 || n_third == 1) {
            return None;
        }
        Some(Date { first, second, third, year_first, named_month, separator })
    }

    fn month(&mut self) -> Option<i64> {
        const MONTHS: [&[u8]; 12] =
            [b"jan", b"feb", b"mar", b"apr", b"may", b"jun", b"jul", b"aug", b"sep", b"oct", b"nov", b"dec"];
        let name = self.bytes.get(self.at..self.at + 3)?;
        let month = MONTHS.iter().position(|m| name.eq_ignore_ascii_case(m))?;
        self.at += 3;
        Some(month as i64 + 1)
    }

    /// A time of day in nanoseconds: h:m, h:m:s, h:m:s.f (or ,f or :f), m:s.f, with AM or PM behind.
    fn time(&mut self) -> Option<i64> {
        let (a, _) = self.digits(2)?;
        if !self.take(b':') {
            return None;
        }
        let (b, _) = self.digits(2)?;
        let (mut hour, minute, second, fraction) = if self.take(b':') {
            let (c, _) = self.digits(2)?;
            let fraction = match self.peek() {
                Some(b'.' | b',' | b':') => self.fraction()?,
                _ => 0,
            };
            (a, b, c, fraction)
        } else if self.peek() == Some(b'.') {
            (0, a, b, self.fraction()?)
        } else {
            (a, b, 0, 0)
        };
        if hour > 24 || minute > 59 || second > 60 {
            return None;
        }
        let before = self.at;
        self.blanks();
        let half = self.bytes.get(self.at..self.at + 2).map(|h| [h[0].to_ascii_lowercase(), h[1].to_ascii_lowercase()]);
        match half {
            Some([b'a', b'm']) if hour <= 12 => {
                hour %= 12;
                self.at += 2;
            }
            Some([b'p', b'm']) if hour <= 12 => {
                hour = hour % 12 + 12;
                self.at += 2;
            }
            _ => self.at = before,
        }
        Some(((hour * 60 + minute) * 60 + second) * NS_PER_S + fraction)
    }

    /// The separator and up to nine digits, in nanoseconds; further digits are read and cut off.
    fn fraction(&mut self) -> Option<i64> {
        self.at += 1;
        let (value, n) = self.digits(9)?;
        while let Some(b'0'..=b'9') = self.peek() {
            self.at += 1;
        }
        Some((n..9).fold(value, |v, _| v * 10))
    }

    /// Nothing, Z, or an offset such as +02:00: nanoseconds ahead of UTC.
    fn utc_offset(&mut self) -> Option<i64> {
        let ahead = match self.peek() {
            None => return Some(0),
            Some(b'Z' | b'z') => {
                self.at += 1;
                return Some(0);
            }
            Some(b'+') => 1,
            Some(b'-') => -1,
            _ => return None,
        };
        self.at += 1;
        let (hours, _) = self.digits(2)?;
        self.take(b':');
        let minutes = self.digits(2).map_or(0, |(m, _)| m);
        Some(ahead * (hours * 60 + minutes) * 60 * NS_PER_S)
    }
}

#[cfg(test)]
mod tests {
    use super::{NS_PER_S, Order, Stamp, customary_order, decided_order, parse};

    fn seconds(token: &str) -> f64 {
        let stamp = parse(token.as_bytes(), Order::MonthFirst).unwrap_or_else(|| panic!("{token}"));
        stamp.total_ns() as f64 / NS_PER_S as f64
    }

    #[test]
    fn dates_and_times_have_their_known_epoch_seconds() {
        // From `date -u -d ... +%s.%3N`.
        assert_eq!(seconds("05/25/2022 05:46:08.066 PM"), 1653500768.066);
        assert_eq!(seconds("2022-05-25T17:46:08.066Z"), 1653500768.066);
        assert_eq!(seconds("2022-05-25 19:46:08,066+02:00"), 1653500768.066);
        assert_eq!(seconds("25-May-2022 17:46:08"), 1653500768.0);
        assert_eq!(seconds("2000-02-29 12:00 AM"), 951782400.0);
        assert_eq!(seconds("1969-12-31 23:59:59"), -1.0);
    }

    #[test]
    fn a_time_of_day_counts_from_midnight() {
        assert_eq!(seconds("00:00:01.5"), 1.5);
        assert_eq!(seconds("12:30"), 45000.0);
        assert_eq!(seconds("12:00:00 AM"), 0.0);
        assert_eq!(seconds("12:30:00 pm"), 45000.0);
        assert_eq!(seconds("01:02.25"), 62.25);
        assert_eq!(seconds("17:46:08:066"), 63968.066);
    }

    #[test]
    fn day_and_month_are_told_apart_where_a_number_exceeds_twelve() {
        assert_eq!(decided_order(b"05/25/2022"), Some(Order::MonthFirst));
        assert_eq!(decided_order(b"25/05/2022"), Some(Order::DayFirst));
        assert_eq!(decided_order(b"05/06/2022"), None);
        assert_eq!(customary_order(b"05.06.2022"), Order::DayFirst);
        assert_eq!(parse(b"25.05.2022", Order::DayFirst), Some(Stamp { day: Some(19137), ns: None }));
    }

    #[test]
    fn other_tokens_are_no_stamps() {
        for token in ["", "1.5", "12", "1-2", "25:61", "2022-13-01", "1/2", "DAQ", "12:30:61", "1.2.3", "05:46 XM"] {
            assert_eq!(parse(token.as_bytes(), Order::MonthFirst), None, "{token}");
        }
    }
}
