//! Samples as lines of text: delimited numbers or JSON.

use serde_json::Value;

use crate::layout::{channel_mistakes, double_counter, scale_mistake};

/// Longest line taken; what is longer is malformed, whatever it holds.
pub const MAX_LINE: usize = 65_536;

/// What the lines are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Delimited numbers.
    Csv,
    /// An object or an array a line.
    Json,
    /// By each line's first character.
    Auto,
}

impl Format {
    /// All formats with their names.
    pub const NAMES: [(&'static str, Format); 3] =
        [("csv", Format::Csv), ("json", Format::Json), ("auto", Format::Auto)];
}

/// Where a number stands in a line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Column {
    /// A name of the header, or a key of the object.
    Name(String),
    /// From 0.
    Index(usize),
}

/// The user's description of a line.
#[derive(Debug, Clone, PartialEq)]
pub struct LinesConfig {
    /// What the lines are.
    pub format: Format,
    /// Between the numbers; `None` to find it in the first line. A space stands for any white space.
    pub delimiter: Option<char>,
    /// `None` where the sender counts nothing.
    pub counter: Option<Column>,
    /// One column an actuator.
    pub target: Vec<Column>,
    /// One column an actuator.
    pub measured: Vec<Column>,
    /// Factors of target and measured, one pair an actuator; empty for none.
    pub scale: Vec<(f64, f64)>,
}

impl LinesConfig {
    /// counter, target_1, measured_1, target_2, ...; in JSON `{"counter": 0, "target": [..], "measured": [..]}`.
    pub fn usual(n_actuators: usize, counted: bool) -> Self {
        let first = usize::from(counted);
        Self {
            format: Format::Auto,
            delimiter: None,
            counter: counted.then_some(Column::Index(0)),
            target: (0..n_actuators).map(|a| Column::Index(first + 2 * a)).collect(),
            measured: (0..n_actuators).map(|a| Column::Index(first + 2 * a + 1)).collect(),
            scale: Vec::new(),
        }
    }

    /// Everything that is wrong with it, a line each.
    pub fn mistakes(&self) -> Vec<String> {
        let mut found = channel_mistakes(self.target.len(), self.measured.len());
        let n = self.target.len();
        if !self.scale.is_empty() && self.scale.len() != n {
            found.push(format!("layout: scale needs one pair an actuator, {n}, not {}", self.scale.len()));
        }
        for (i, (target, measured)) in self.scale.iter().enumerate() {
            found.extend(scale_mistake(&format!("target[{i}]"), *target));
            found.extend(scale_mistake(&format!("measured[{i}]"), *measured));
        }
        if let Some(c) = self.delimiter.filter(|c| c.is_ascii_alphanumeric() || "+-.\"\r\n".contains(*c)) {
            found.push(format!("layout: delimiter must be a character that is no part of a number, not {c:?}"));
        }
        found
    }
}

/// What a line was.
#[derive(Debug, Clone, PartialEq)]
pub enum Line {
    /// Empty, a comment that starts with #, or the header.
    Nothing,
    /// A sample, with its counter where there is one.
    Sample(Option<i64>),
    /// Not a sample.
    Malformed,
    /// The header does not have what the layout names: no line will be a sample.
    Unusable(String),
}

/// Reads one line after the other.
#[derive(Debug)]
pub struct LineParser {
    config: LinesConfig,
    delimiter: Option<char>,
    /// Of delimited lines, once the first has been seen: counter, target, measured.
    columns: Option<(Option<usize>, Vec<usize>, Vec<usize>)>,
    header: String,
    cells: Vec<f64>,
    unwelcome: Vec<bool>,
}

impl LineParser {
    /// Checks the layout.
    ///
    /// # Errors
    /// Everything that is wrong, a line each.
    pub fn new(config: LinesConfig) -> Result<Self, Vec<String>> {
        let mistakes = config.mistakes();
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        let delimiter = config.delimiter;
        let (cells, unwelcome) = (Vec::new(), Vec::new());
        Ok(Self { config, delimiter, columns: None, header: String::new(), cells, unwelcome })
    }

    /// What a line must have, in words.
    pub fn expected(&self) -> String {
        let place = |column: &Column| match column {
            Column::Name(name) => format!("'{}'", shown(&[name])),
            Column::Index(at) => format!("column {at}"),
        };
        let of = |columns: &[Column]| columns.iter().map(place).collect::<Vec<_>>().join(", ");
        let counter = self.config.counter.as_ref().map(|c| format!("a whole-number counter in {}, ", place(c)));
        format!(
            "{}target in {} and measured in {}; say where they stand by a layout, or that nothing is counted",
            counter.unwrap_or_default(),
            of(&self.config.target),
            of(&self.config.measured)
        )
    }

    /// Number of actuators.
    pub fn n_actuators(&self) -> usize {
        self.config.target.len()
    }

    /// Reads a line, without its end, into slices of one number an actuator.
    pub fn read(&mut self, line: &[u8], target: &mut [f64], measured: &mut [f64]) -> Line {
        if line.len() > MAX_LINE {
            return Line::Malformed;
        }
        let Ok(line) = std::str::from_utf8(line) else { return Line::Malformed };
        let line = line.trim_start_matches('\u{feff}').trim();
        if line.is_empty() || line.starts_with('#') {
            return Line::Nothing;
        }
        let found = match self.config.format {
            Format::Json => self.json(line, target, measured),
            Format::Auto if line.starts_with(['{', '[']) => self.json(line, target, measured),
            _ => self.delimited(line, target, measured),
        };
        if matches!(found, Line::Sample(_)) {
            for (i, (of_target, of_measured)) in self.config.scale.iter().enumerate() {
                target[i] *= of_target;
                measured[i] *= of_measured;
            }
        }
        found
    }

    fn delimited(&mut self, line: &str, target: &mut [f64], measured: &mut [f64]) -> Line {
        let delimiter = *self.delimiter.get_or_insert_with(|| likely_delimiter(line));
        self.split(line, delimiter);
        if self.columns.is_none() {
            let is_header = self.unwelcome.contains(&true) && self.cells.iter().all(|cell| cell.is_nan());
            match self.resolve(line, delimiter, is_header) {
                Ok(columns) => self.columns = Some(columns),
                Err(message) => return Line::Unusable(message),
            }
            if is_header {
                self.header = line.to_owned();
                return Line::Nothing;
            }
        }
        if !self.header.is_empty() && line == self.header {
            return Line::Nothing;
        }
        let Some((counter, targets, measureds)) = &self.columns else { return Line::Malformed };
        let cell = |i: usize| self.cells.get(i).copied().filter(|_| !self.unwelcome[i]);
        for (columns, values) in [(targets, target), (measureds, measured)] {
            for (column, value) in columns.iter().zip(values) {
                let Some(found) = cell(*column) else { return Line::Malformed };
                *value = found;
            }
        }
        match counter {
            None => Line::Sample(None),
            Some(column) => counted(cell(*column)),
        }
    }

    /// The line's numbers; an empty cell is NaN, text is unwelcome.
    fn split(&mut self, line: &str, delimiter: char) {
        self.cells.clear();
        self.unwelcome.clear();
        let mut keep = |cell: &str| {
            let cell = cell.trim().trim_matches('"');
            let number = if cell.is_empty() { Some(f64::NAN) } else { parsed(cell, delimiter) };
            self.cells.push(number.unwrap_or(f64::NAN));
            self.unwelcome.push(number.is_none());
        };
        match delimiter {
            ' ' => line.split_whitespace().for_each(&mut keep),
            other => line.split(other).for_each(&mut keep),
        }
    }

    /// Where the named columns are.
    #[allow(clippy::type_complexity)]
    fn resolve(
        &self,
        line: &str,
        delimiter: char,
        is_header: bool,
    ) -> Result<(Option<usize>, Vec<usize>, Vec<usize>), String> {
        let names: Vec<&str> = match (is_header, delimiter) {
            (false, _) => Vec::new(),
            (true, ' ') => line.split_whitespace().collect(),
            (true, other) => line.split(other).map(|name| name.trim().trim_matches('"').trim()).collect(),
        };
        let find = |column: &Column| match column {
            Column::Index(i) => Ok(*i),
            Column::Name(name) if !is_header => Err(format!(
                "the layout names the channel '{name}', but the first line holds numbers and no names: begin with a header \
                 line, or give the column's number"
            )),
            Column::Name(name) => names
                .iter()
                .position(|found| *found == name.trim())
                .ok_or_else(|| format!("there is no channel '{name}': the header has {}", shown(&names))),
        };
        let all = |columns: &[Column]| columns.iter().map(find).collect::<Result<Vec<_>, _>>();
        let counter = self.config.counter.as_ref().map(find).transpose()?;
        Ok((counter, all(&self.config.target)?, all(&self.config.measured)?))
    }

    fn json(&mut self, line: &str, target: &mut [f64], measured: &mut [f64]) -> Line {
        let Ok(value) = serde_json::from_str::<Value>(line) else { return Line::Malformed };
        for (key, columns, values) in
            [("target", &self.config.target, target), ("measured", &self.config.measured, measured)]
        {
            for (i, (column, out)) in columns.iter().zip(values).enumerate() {
                let found = match column {
                    Column::Name(name) => value.get(name),
                    Column::Index(at) if value.is_array() => value.get(*at),
                    // One number will do for one actuator.
                    Column::Index(_) => {
                        value.get(key).and_then(|v| if v.is_array() { v.get(i) } else { Some(v).filter(|_| i == 0) })
                    }
                };
                let Some(number) = found.and_then(as_number) else { return Line::Malformed };
                *out = number;
            }
        }
        match &self.config.counter {
            None => Line::Sample(None),
            Some(column) => counted(
                match column {
                    Column::Name(name) => value.get(name),
                    Column::Index(at) if value.is_array() => value.get(*at),
                    Column::Index(_) => value.get("counter"),
                }
                .and_then(as_number),
            ),
        }
    }
}

fn counted(cell: Option<f64>) -> Line {
    cell.and_then(double_counter).map_or(Line::Malformed, |counter| Line::Sample(Some(counter)))
}

/// A number of JSON; null is NaN.
fn as_number(value: &Value) -> Option<f64> {
    if value.is_null() { Some(f64::NAN) } else { value.as_f64() }
}

/// A semicolon goes before a comma, which may be decimal; white space where there is none of the others.
fn likely_delimiter(line: &str) -> char {
    [';', '\t', ','].into_iter().find(|c| line.contains(*c)).unwrap_or(' ')
}

fn parsed(cell: &str, delimiter: char) -> Option<f64> {
    if delimiter != ',' && cell.contains(',') && !cell.contains('.') {
        return cell.replacen(',', ".", 1).parse().ok();
    }
    cell.parse().ok()
}

/// The first names, so that the message stays a line.
fn shown(names: &[&str]) -> String {
    const MOST: usize = 12;
    let mut text = names.iter().take(MOST).map(|n| n.chars().take(40).collect()).collect::<Vec<String>>().join(", ");
    if names.len() > MOST {
        text.push_str(", ...");
    }
    text
}

/// Cuts a stream of bytes into lines. What does not end within [`MAX_LINE`] is told once, as too long.
#[derive(Debug, Default)]
pub struct Splitter {
    rest: Vec<u8>,
    skipping: bool,
}

impl Splitter {
    /// Calls with each line that ends in `bytes`, without its end; with `None` for one that was too long.
    pub fn push(&mut self, bytes: &[u8], mut line: impl FnMut(Option<&[u8]>)) {
        let mut bytes = bytes;
        while let Some(end) = bytes.iter().position(|b| *b == b'\n') {
            let (first, after) = (&bytes[..end], &bytes[end + 1..]);
            if std::mem::take(&mut self.skipping) {
                // Told when it became too long.
            } else if self.rest.is_empty() && first.len() <= MAX_LINE {
                line(Some(first));
            } else if self.rest.len() + first.len() > MAX_LINE {
                line(None);
            } else {
                self.rest.extend_from_slice(first);
                line(Some(&self.rest));
            }
            self.rest.clear();
            bytes = after;
        }
        if self.skipping {
            return;
        }
        if self.rest.len() + bytes.len() > MAX_LINE {
            self.skipping = true;
            self.rest.clear();
            line(None);
        } else {
            self.rest.extend_from_slice(bytes);
        }
    }

    /// The last line, where the stream ended without an end of line.
    pub fn finish(&mut self) -> Option<Vec<u8>> {
        let rest = std::mem::take(&mut self.rest);
        (!rest.is_empty()).then_some(rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(parser: &mut LineParser, line: &str) -> (Line, Vec<f64>, Vec<f64>) {
        let n = parser.n_actuators();
        let (mut target, mut measured) = (vec![0.0; n], vec![0.0; n]);
        let found = parser.read(line.as_bytes(), &mut target, &mut measured);
        (found, target, measured)
    }

    fn usual(n: usize) -> LineParser {
        LineParser::new(LinesConfig::usual(n, true)).unwrap()
    }

    fn named() -> LinesConfig {
        let name = |n: &str| Column::Name(n.to_owned());
        LinesConfig {
            counter: Some(name("n")),
            target: vec![name("x")],
            measured: vec![name("y")],
            ..LinesConfig::usual(1, true)
        }
    }

    #[test]
    fn delimited_numbers_are_read_with_any_usual_delimiter() {
        for line in ["7,1.5,2.5", "7;1.5;2.5", "7\t1.5\t2.5", " 7  1.5 2.5\r", "7;1,5;2,5", "7, 1.5 , \"2.5\""] {
            assert_eq!(read(&mut usual(1), line), (Line::Sample(Some(7)), vec![1.5], vec![2.5]), "{line:?}");
        }
    }

    #[test]
    fn a_first_line_without_numbers_is_the_header_and_names_find_their_columns() {
        let mut parser = LineParser::new(named()).unwrap();
        assert_eq!(read(&mut parser, "y,,n,x").0, Line::Nothing, "a column without a name");
        let mut parser = LineParser::new(named()).unwrap();
        assert_eq!(read(&mut parser, "y, \"n\", x").0, Line::Nothing);
        assert_eq!(read(&mut parser, "2.5, 7, 1.5"), (Line::Sample(Some(7)), vec![1.5], vec![2.5]));
        assert_eq!(
            read(&mut parser, "y, \"n\", x").0,
            Line::Nothing,
            "the header again, of a sender that started again"
        );
    }

    #[test]
    fn an_unknown_channel_is_told_with_those_that_there_are() {
        let mut parser = LineParser::new(named()).unwrap();
        let Line::Unusable(message) = read(&mut parser, "n,x,z").0 else { panic!() };
        assert!(message.contains("no channel 'y'") && message.contains("n, x, z"), "{message}");
        let Line::Unusable(message) = read(&mut LineParser::new(named()).unwrap(), "1,2,3").0 else { panic!() };
        assert!(message.contains("no names"), "{message}");
    }

    #[test]
    fn json_objects_arrays_and_names_are_read() {
        let cases = [
            r#"{"counter": 7, "target": [1.5, 3], "measured": [2.5, 4]}"#,
            r#"[7, 1.5, 2.5, 3, 4]"#,
            r#"{"measured": [2.5, 4], "counter": 7.0, "target": [1.5, 3], "more": "x"}"#,
        ];
        for line in cases {
            assert_eq!(read(&mut usual(2), line), (Line::Sample(Some(7)), vec![1.5, 3.0], vec![2.5, 4.0]), "{line}");
        }
        let one = r#"{"counter": 7, "target": 1.5, "measured": 2.5}"#;
        assert_eq!(read(&mut usual(1), one), (Line::Sample(Some(7)), vec![1.5], vec![2.5]));
        let mut parser = LineParser::new(named()).unwrap();
        assert_eq!(read(&mut parser, r#"{"n":7,"x":1.5,"y":null}"#).0, Line::Sample(Some(7)));
    }

    #[test]
    fn what_is_no_sample_is_malformed() {
        let mut parser = usual(1);
        assert_eq!(read(&mut parser, "0,1,2").0, Line::Sample(Some(0)));
        for line in ["1,2", "1,x,2", "1.5,1,2", "-1,1,2", "nan,1,2", "{\"counter\":1}", "[1,2]", "{", "[[[[", "a,b,c"] {
            assert_eq!(read(&mut parser, line).0, Line::Malformed, "{line}");
        }
        assert_eq!(parser.read(b"\xff\xfe,1", &mut [0.0], &mut [0.0]), Line::Malformed);
        assert_eq!(parser.read(&vec![b'1'; MAX_LINE + 1], &mut [0.0], &mut [0.0]), Line::Malformed);
    }

    #[test]
    fn an_empty_cell_is_a_sample_that_is_not_a_number() {
        let (line, target, measured) = read(&mut usual(1), "3,,nan");
        assert_eq!(line, Line::Sample(Some(3)));
        assert!(target[0].is_nan() && measured[0].is_nan());
    }

    #[test]
    fn empty_lines_and_comments_are_passed_over() {
        for line in ["", "   ", "\r", "# counter, x, y", "\u{feff}"] {
            assert_eq!(read(&mut usual(1), line).0, Line::Nothing);
        }
    }

    #[test]
    fn scales_apply_to_each_channel() {
        let config = LinesConfig { scale: vec![(1e-3, 2.0)], ..LinesConfig::usual(1, false) };
        let (line, target, measured) = read(&mut LineParser::new(config).unwrap(), "5000,3");
        assert_eq!((line, target, measured), (Line::Sample(None), vec![5.0], vec![6.0]));
    }

    #[test]
    fn all_mistakes_are_told_at_once() {
        let config = LinesConfig {
            delimiter: Some('5'),
            measured: vec![],
            scale: vec![(0.0, f64::NAN), (1.0, 1.0)],
            ..LinesConfig::usual(1, true)
        };
        assert_eq!(LineParser::new(config).unwrap_err().len(), 5);
    }

    #[test]
    fn lines_are_the_same_however_the_bytes_come() {
        let mut text = b"one\ntwo\r\n\n".to_vec();
        text.extend(vec![b'x'; MAX_LINE + 1]);
        text.extend(b"\nlast\nrest");
        let cut = |sizes: usize| {
            let mut splitter = Splitter::default();
            let mut lines = Vec::new();
            for bytes in text.chunks(sizes) {
                splitter.push(bytes, |line| lines.push(line.map(<[u8]>::to_vec)));
            }
            lines.push(splitter.finish());
            lines
        };
        let whole = cut(usize::MAX);
        assert_eq!(whole.len(), 6);
        assert_eq!(whole[3], None);
        assert_eq!(whole[5].as_deref(), Some(&b"rest"[..]));
        for sizes in [1, 2, 7, 1000, 65_536] {
            assert_eq!(cut(sizes), whole, "{sizes}");
        }
    }
}
