//! The one table of units: how they are spelled, what they measure and how large they are.

/// What a unit measures, as far as anything asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Quantity {
    Length,
    Time,
    Velocity,
    Acceleration,
    Frequency,
    Force,
    Voltage,
    Current,
    Other,
}

use Quantity::{Acceleration, Current, Force, Frequency, Length, Other, Time, Voltage};

impl Quantity {
    /// Its name in lower case.
    pub fn name(self) -> &'static str {
        match self {
            Length => "length",
            Time => "time",
            Self::Velocity => "velocity",
            Acceleration => "acceleration",
            Frequency => "frequency",
            Force => "force",
            Voltage => "voltage",
            Current => "current",
            Other => "other",
        }
    }
}

/// A known unit: what it measures, and how many of the SI's unit are in one (1 where nothing asks: `Other`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// What it measures.
    pub quantity: Quantity,
    /// Its size in SI.
    pub si: f64,
}

/// Quantity, size in SI, spellings in lower case, and those letters that are a unit behind an underscore (`disp_mm`),
/// there only as written.
const UNITS: &[(Quantity, f64, &[&str], &[&str])] = &[
    (Length, 1.0, &["m", "meter", "meters", "metre", "metres", "м", "米"], &["m"]),
    (Length, 1e-3, &["mm", "millimeter", "millimeters", "millimetre", "millimetres", "мм", "毫米", "ミリ"], &["mm"]),
    (Length, 1e-2, &["cm", "centimeter", "centimeters", "centimetre", "centimetres", "см", "厘米"], &["cm"]),
    (Length, 1e-6, &["um", "µm", "micron", "microns"], &["um", "µm"]),
    (Length, 0.0254, &["in", "inch", "inches", "\""], &[]),
    (Length, 2.54e-5, &["mil", "mils"], &[]),
    (Length, 0.3048, &["ft", "foot", "feet"], &["ft"]),
    (
        Time,
        1.0,
        &["s", "sec", "secs", "second", "seconds", "sekunden", "sekunde", "secondes", "segundos", "secondi"],
        &["s"],
    ),
    (Time, 1.0, &["с", "сек", "秒", "초"], &[]),
    (
        Time,
        1e-3,
        &["ms", "msec", "msecs", "millisecond", "milliseconds", "millisekunden", "мс", "毫秒", "ミリ秒"],
        &["ms"],
    ),
    (Time, 1e-6, &["us", "µs", "usec", "microsecond", "microseconds", "мкс", "微秒"], &["us"]),
    (Time, 1e-9, &["ns", "nsec", "nanosecond", "nanoseconds"], &["ns"]),
    (Time, 60.0, &["min", "minutes"], &[]),
    (Time, 3600.0, &["h", "hours"], &[]),
    (Quantity::Velocity, 1.0, &["mps"], &["mps"]),
    (Acceleration, 9.80665, &["g", "gn"], &["g"]),
    (Acceleration, 1e-2, &["gal", "gals"], &[]),
    (Frequency, 1.0, &["hz", "sps", "s/s", "samples/s", "samples/sec"], &["Hz"]),
    (Frequency, 1e3, &["khz", "ks/s"], &["kHz"]),
    (Force, 1.0, &["n", "н", "牛"], &["N"]),
    (Force, 1e3, &["kn", "кн", "千牛"], &["kN"]),
    (Force, 1e6, &["mn"], &["MN"]),
    (Force, 4.448_221_615_260_5, &["lbf", "lb", "lbs"], &["lbf"]),
    (Force, 4_448.221_615_260_5, &["kip", "kips"], &["kip", "kips"]),
    (Force, 9.80665, &["kgf"], &[]),
    (Voltage, 1.0, &["v", "volt", "volts"], &["V"]),
    (Voltage, 1e-3, &["mv"], &["mV"]),
    (Voltage, 1e3, &["kv"], &[]),
    (Current, 1.0, &["a"], &["A"]),
    (Current, 1e-3, &["ma"], &["mA"]),
    (
        Other,
        1.0,
        &["%", "deg", "degs", "degree", "degrees", "°", "°c", "degc", "c", "k", "rad", "mrad", "radians"],
        &["deg", "rad"],
    ),
    (Other, 1.0, &["pa", "kpa", "mpa", "gpa", "bar", "psi", "ksi"], &["Pa", "kPa", "MPa", "psi"]),
    (Other, 1.0, &["nm", "knm", "j", "w", "kw", "kg", "t", "l", "rpm", "gpm", "lpm"], &[]),
    (Other, 1.0, &["strain", "ustrain", "µstrain", "µε", "microstrain", "counts", "bit", "cycles"], &[]),
];

/// The unit that a text is: a spelling of the table, or spellings with powers joined by / * · . ^ or blanks; in
/// brackets or not, capitals or not. None for anything else.
pub fn unit(text: &str) -> Option<Unit> {
    // `sec.` and `in.` too.
    let plain = text.trim().trim_matches(['[', ']', '(', ')', '.']).trim().to_lowercase().replace('μ', "µ");
    symbol(&plain).or_else(|| compound(&plain))
}

/// Whether letters behind an underscore are a unit, as they are written.
pub fn is_unit_suffix(text: &str) -> bool {
    UNITS.iter().any(|(.., suffixes)| suffixes.contains(&text))
}

fn symbol(plain: &str) -> Option<Unit> {
    let row = UNITS.iter().find(|(_, _, spellings, _)| spellings.contains(&plain))?;
    Some(Unit { quantity: row.0, si: row.1 })
}

fn compound(plain: &str) -> Option<Unit> {
    let (mut metres, mut seconds, mut others) = (0, 0, false);
    let (mut si, mut n_symbols) = (1.0, 0);
    // 1/s: nothing else begins with a number.
    let mut rest = plain.strip_prefix('1').filter(|after| after.trim_start().starts_with('/')).unwrap_or(plain);
    while !rest.is_empty() {
        let start = rest.find(|c| !" /*·.".contains(c))?;
        let sign = if rest[..start].contains('/') { -1 } else { 1 };
        rest = &rest[start..];
        let end = rest.find(|c: char| " /*·.^-²³".contains(c) || c.is_ascii_digit()).unwrap_or(rest.len());
        let part = symbol(&rest[..end])?;
        let (power, behind) = power(&rest[end..])?;
        let power = sign * power;
        rest = behind;
        match part.quantity {
            Length => metres += power,
            Time => seconds += power,
            _ => others = true,
        }
        si *= part.si.powi(power);
        n_symbols += 1;
    }
    let quantity = match (metres, seconds) {
        _ if others => Other,
        (1, -1) => Quantity::Velocity,
        (1, -2) => Acceleration,
        (0, -1) => Frequency,
        _ => Other,
    };
    (n_symbols > 0).then_some(Unit { quantity, si: if quantity == Other { 1.0 } else { si } })
}

/// The power behind a symbol, 1 where there is none, and what follows. Without a mark only 2, 3 and 4 are powers: `a1`
/// is a name.
fn power(text: &str) -> Option<(i32, &str)> {
    let marked = text.strip_prefix('^').or_else(|| text.strip_prefix("**"));
    let rest = marked.unwrap_or(text);
    let minus = rest.strip_prefix('-');
    let digits = minus.unwrap_or(rest);
    let is_marked = marked.is_some() || minus.is_some();
    let size = match digits.chars().next() {
        Some('²') => 2,
        Some('³') => 3,
        Some(digit @ '1'..='9') if is_marked || ('2'..='4').contains(&digit) => digit as i32 - '0' as i32,
        Some('0'..='9') => return None,
        _ if is_marked => return None,
        _ => return Some((1, text)),
    };
    let behind = digits.char_indices().nth(1).map_or("", |(at, _)| &digits[at..]);
    Some((if minus.is_some() { -size } else { size }, behind))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spelling_stands_in_one_row() {
        let all: Vec<_> = UNITS.iter().flat_map(|row| row.2).collect();
        for (at, one) in all.iter().enumerate() {
            assert!(!all[..at].contains(one), "{one}");
            assert_eq!(**one, one.to_lowercase());
        }
        for suffix in UNITS.iter().flat_map(|row| row.3) {
            assert!(unit(suffix).is_some(), "{suffix}");
        }
    }

    #[test]
    fn powers_and_quotients_of_known_units_are_units() {
        let cases = [
            ("mm/s", Quantity::Velocity, 1e-3),
            ("in/sec", Quantity::Velocity, 0.0254),
            ("CM/SEC/SEC", Acceleration, 1e-2),
            ("[m/s²]", Acceleration, 1.0),
            ("m/s**2", Acceleration, 1.0),
            ("feet/sec^2", Acceleration, 0.3048),
            ("m s-2", Acceleration, 1.0),
            ("1/s", Frequency, 1.0),
            ("kN/mm", Other, 1.0),
            ("N m", Other, 1.0),
            ("um/m", Other, 1.0),
            ("m^2", Other, 1.0),
        ];
        for (text, quantity, si) in cases {
            assert_eq!(unit(text), Some(Unit { quantity, si }), "{text}");
        }
        for text in
            ["", "1", "-", "a1", "m1", "mm-", "m/", "/", "x", "disp", "5 mm", "mm mm x", "V 2", "m2x", "sampling rate"]
        {
            assert_eq!(unit(text), None, "{text}");
        }
    }
}
