//! Whatever the spelling, the same table comes out with the same bits.

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use rthstrack_text::{Values, read};

#[derive(Debug, Clone)]
struct Spelling {
    delimiter: &'static str,
    comma: bool,
    end: &'static str,
    last_end: bool,
    preamble: Vec<&'static str>,
    named: bool,
    units: bool,
    quoted: bool,
    padded: bool,
    trailing: bool,
    encoding: u8,
}

fn spellings() -> impl Strategy<Value = Spelling> {
    let delimiters = prop::sample::select(vec![",", ";", "\t", "|", "  "]);
    let ends = prop::sample::select(vec!["\n", "\r\n", "\r"]);
    let lines = vec![
        "Sampling Rate: 1000",
        "# made by hand in two runs of one day",
        "Operator = me",
        "",
        "[Header]",
        "Version:  2",
        "\"a remark\"",
    ];
    let preamble = prop::collection::vec(prop::sample::select(lines), 0..6);
    let flags =
        (any::<bool>(), any::<bool>(), any::<bool>(), any::<bool>(), any::<bool>(), any::<bool>(), any::<bool>());
    (delimiters, ends, preamble, flags, 0u8..5).prop_map(|(delimiter, end, preamble, flags, encoding)| {
        let (comma, last_end, named, units, quoted, padded, trailing) = flags;
        Spelling {
            delimiter,
            comma: comma && (delimiter != "," || quoted),
            end,
            last_end,
            preamble,
            named,
            units,
            quoted,
            padded,
            trailing: trailing && delimiter != "  ",
            encoding,
        }
    })
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => (-1_000_000i64..1_000_000, 1u32..5).prop_map(|(n, digits)| n as f64 / 10f64.powi(digits as i32)),
        1 => any::<f64>().prop_filter("finite", |v| v.is_finite()),
    ]
}

fn written(rows: &[Vec<f64>], spelling: &Spelling) -> Vec<u8> {
    let n_columns = rows[0].len();
    let mut lines: Vec<Vec<String>> = Vec::new();
    if spelling.named {
        lines.push((0..n_columns).map(|i| format!("Channel{}", "abcdef".chars().nth(i).unwrap())).collect());
        if spelling.units {
            lines.push((0..n_columns).map(|_| "mm".to_owned()).collect());
        }
    }
    for row in rows {
        // A point in every number, so that a decimal comma shows.
        let token = |value: &f64| {
            let text = if value.abs() < 1e15 { format!("{value:?}") } else { format!("{value:.1}") };
            let text = if text.contains('.') { text } else { text.replace('e', ".0e") };
            if spelling.comma { text.replace('.', ",") } else { text }
        };
        lines.push(row.iter().map(token).collect());
    }
    let mut text = spelling.preamble.join(spelling.end);
    if !spelling.preamble.is_empty() {
        text.push_str(spelling.end);
    }
    let last = lines.len() - 1;
    for (i, cells) in lines.iter().enumerate() {
        let cells: Vec<String> = cells
            .iter()
            .map(|cell| if spelling.quoted { format!("\"{cell}\"") } else { cell.clone() })
            .map(|cell| if spelling.padded { format!("  {cell} ") } else { cell })
            .collect();
        text.push_str(&cells.join(spelling.delimiter));
        if spelling.trailing {
            text.push_str(spelling.delimiter);
        }
        if i < last || spelling.last_end {
            text.push_str(spelling.end);
        }
    }
    match spelling.encoding {
        0 => [b"\xef\xbb\xbf", text.as_bytes()].concat(),
        1 => [0xfeff].into_iter().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect(),
        2 => [0xfeff].into_iter().chain(text.encode_utf16()).flat_map(u16::to_be_bytes).collect(),
        _ => text.into_bytes(),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, rng_seed: RngSeed::Fixed(2014), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_same_table_comes_out_of_every_spelling(
        rows in (2usize..6, 2usize..30).prop_flat_map(|(n_columns, n_rows)| {
            prop::collection::vec(prop::collection::vec(number(), n_columns), n_rows)
        }),
        spelling in spellings(),
    ) {
        let text = written(&rows, &spelling);
        let table = read(&text).map_err(|e| TestCaseError::fail(format!("{e}: {}", text.escape_ascii())))?;
        prop_assert_eq!(table.n_rows, rows.len());
        prop_assert_eq!(table.columns.len(), rows[0].len());
        prop_assert_eq!(table.decimal_comma, spelling.comma);
        for (i, column) in table.columns.iter().enumerate() {
            let expected: Vec<u64> = rows.iter().map(|row| row[i].to_bits()).collect();
            let Values::Numbers(numbers) = &column.values else { return Err(TestCaseError::fail("not numbers")) };
            prop_assert_eq!(numbers.iter().map(|v| v.to_bits()).collect::<Vec<_>>(), expected);
            prop_assert_eq!(column.name.is_some(), spelling.named);
            prop_assert_eq!(column.unit.as_deref(), (spelling.named && spelling.units).then_some("mm"));
        }
    }

    #[test]
    fn no_bytes_make_the_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let _ = read(&bytes);
    }

    #[test]
    fn no_words_of_the_trade_make_the_reader_panic(
        words in prop::collection::vec(prop::sample::select(vec![
            "1", "-2.5", "3e5", ",", ";", "\t", " ", "\n", "\r", "\"", "#", "t", "(s)", "nan", "", "12:30", "1/2/2022", "=", ":", "|",
        ]), 0..120)
    ) {
        let _ = read(words.concat().as_bytes());
    }
}
