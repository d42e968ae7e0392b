//! Tables as laboratories write them, with what is to be read from them written down by hand.

use rthstrack_text::{Delimiter, Encoding, MISSING_STAMP, Part, Table, TextError, Values, read, read_part};

fn table(text: &str) -> Table {
    read(text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
}

fn numbers(table: &Table) -> Vec<(String, Vec<f64>)> {
    let named = |c: &rthstrack_text::Column| c.name.clone().unwrap_or_else(|| format!("column {}", c.index));
    let columns = table.columns.iter();
    columns
        .filter_map(|c| if let Values::Numbers(v) = &c.values { Some((named(c), v.clone())) } else { None })
        .collect()
}

fn notes(table: &Table) -> Vec<&str> {
    table.notes.iter().map(|note| &*note.text).collect()
}

fn message(text: &str) -> String {
    read(text.as_bytes()).expect_err("this must be refused").to_string()
}

#[test]
fn a_raw_export_has_a_counter_stamps_channels_and_events() {
    let table = table(include_str!("seeds/daq_export.txt"));
    assert_eq!(table.n_rows, 12);
    assert_eq!(table.preamble.len(), 7);
    assert_eq!(table.delimiter, Delimiter::Comma);
    let names: Vec<_> = table.columns.iter().map(|c| c.name.as_deref().unwrap()).collect();
    assert_eq!(names, ["Sample Number", "Date/Time", "CHANNEL0", "CHANNEL1", "Events"]);
    let Values::Stamps { ns, dated: true } = &table.columns[1].values else { panic!("no stamps") };
    // 2022-05-25 17:46:08.066, by `date -u`.
    assert_eq!((ns[0], ns[1] - ns[0]), (1_653_500_768_066_000_000, 1_000_000));
    assert_eq!(table.columns[4].values, Values::Text { n_entries: 2 });
}

#[test]
fn names_may_contain_delimiters_quotes_and_line_ends() {
    let table = table(include_str!("seeds/quoted.csv"));
    let names: Vec<_> = table.columns.iter().map(|c| c.name.as_deref().unwrap()).collect();
    assert_eq!(names, ["Time (s)", "Target, \"left\"", "Measured"]);
    assert_eq!(table.n_rows, 8);
}

#[test]
fn encodings_are_told_apart() {
    assert_eq!(read(include_bytes!("seeds/utf16.csv")).unwrap().encoding, Encoding::Utf16Le);
    let latin = read(include_bytes!("seeds/latin1.csv")).unwrap();
    assert_eq!(latin.encoding, Encoding::Latin1);
    assert_eq!(latin.columns[1].name.as_deref(), Some("Prüfkraft [kN]"));
    assert_eq!(table("Größe,y\n1,2\n3,4\n").columns[0].name.as_deref(), Some("Größe"));
}

#[test]
fn cells_of_nothing_are_nan_and_rows_of_nothing_at_the_end_are_left_out_with_a_note() {
    let found = table("t,a,b\n1,,5\n,,\n2,6,\n,,\n,,\n");
    assert_eq!(found.n_rows, 3);
    assert_eq!(notes(&found), ["2 line(s) of empty cells at the end of the file were left out"]);
    let columns = numbers(&found);
    assert!(columns[0].1[1].is_nan() && columns[1].1[0].is_nan() && columns[2].1[2].is_nan());
    assert_eq!((columns[0].1[2], columns[1].1[2], columns[2].1[0]), (2.0, 6.0, 5.0));
}

#[test]
fn a_column_that_is_empty_in_the_sample_may_hold_numbers_later() {
    let mut text = "t,late,x\n".to_owned();
    for i in 0..40_000 {
        let late = if i == 12_000 || i == 13_000 { "7.5" } else { "" };
        text.push_str(&format!("{i}.25,{late},1\n"));
    }
    let found = numbers(&table(&text));
    assert_eq!(found[1].0, "late");
    assert_eq!(found[1].1.len(), 40_000);
    assert_eq!((found[1].1[12_000], found[1].1[13_000]), (7.5, 7.5));
    assert_eq!(found[1].1.iter().filter(|v| !v.is_nan()).count(), 2);
}

#[test]
fn comments_among_the_rows_are_left_out_with_a_note() {
    let found = table(include_str!("seeds/comments.txt"));
    assert_eq!(numbers(&found)[2], ("y".to_owned(), vec![2.0, 3.0, 4.0]));
    assert_eq!(notes(&found), ["2 comment line(s) among the numbers were left out"]);
    assert_eq!(table("t,x\n0.5,1\n\"paused here\"\n1.5,2\n").n_rows, 2);
}

#[test]
fn stamps_without_an_entry_are_marked() {
    let found = table("clock,x\n23:59:59.5,1\n,2\nNaN,3\n00:00:00.5,4\n");
    let ns = vec![86_399_500_000_000, MISSING_STAMP, MISSING_STAMP, 500_000_000];
    assert_eq!(found.columns[0].values, Values::Stamps { ns, dated: false });
    // A date alone tells no time.
    assert_eq!(table("day,x\n2022-05-25,1\n2022-05-25,2\n").columns[0].values, Values::Text { n_entries: 2 });
}

#[test]
fn the_day_is_told_from_the_month_anywhere_in_the_sample() {
    let found = table("when,x\n05/06/2022 00:00:00,1\n05/13/2022 00:00:00,2\n");
    let Values::Stamps { ns, .. } = &found.columns[0].values else { panic!("no stamps") };
    assert_eq!(ns[1] - ns[0], 7 * 86_400 * 1_000_000_000);
    let found = table("when;x\n12.05.2022 00:00:00;1\n13.05.2022 00:00:00;2\n");
    let Values::Stamps { ns, .. } = &found.columns[0].values else { panic!("no stamps") };
    assert_eq!(ns[1] - ns[0], 86_400 * 1_000_000_000);
}

#[test]
fn errors_name_line_column_and_what_was_found() {
    assert_eq!(
        message("t,x,y\n1,2,3\n4,5\n6,7,8\n"),
        "line 3: expected 3 fields, found 2 (the first one missing is 'y'); complete the line, or put '#' before it"
    );
    assert_eq!(
        message("t,x\r\n1,2\r\n3,4,5\r\n6,7\r\n"),
        "line 3: expected 2 fields, found 3 (the last column is 'x'); complete the line, or put '#' before it"
    );
    assert_eq!(
        message("t,x\n1,2\n\n3,4 mm\n5,6\n"),
        "line 4, column 'x': expected a number, found '4 mm'; correct it, empty the cell, or put '#' before the line"
    );
    assert_eq!(read(b" \n\t"), Err(TextError::Empty));
    assert_eq!(read(b"1,2\n3,\x00"), Err(TextError::Binary { offset: 6, byte: 0 }));
    assert_eq!(read(b"\xef\xbb\xbf1,2\n3,\x00"), Err(TextError::Binary { offset: 9, byte: 0 }));
    assert_eq!(read(b"a,b\nc,d\n"), Err(TextError::NoNumbers { n_lines: 2 }));
}

#[test]
fn a_row_of_names_that_does_not_fit_is_an_error_where_a_name_would_be_wrong() {
    assert!(message("t,x\n0,001,1\n0,002,2\n").starts_with("line 1 names 2 columns, but line 2 has 3 fields"));
    assert!(message("t,x,y\n0.5,1\n1.5,2\n").starts_with("line 1 names 3 columns, but line 2 has 2 fields"));
    // Prose above columns divided by blanks names nothing, and a note says so.
    let found = table("Recorded in the laboratory\n1.5 2.5\n3.5 4.5\n");
    assert_eq!(found.columns[0].name, None);
    assert_eq!(notes(&found), ["line 1: 4 words above 2 columns were not taken as names"]);
}

fn names(table: &Table) -> Vec<&str> {
    table.columns.iter().map(|column| column.name.as_deref().unwrap_or("?")).collect()
}

fn units(table: &Table) -> Vec<&str> {
    table.columns.iter().map(|column| column.unit.as_deref().unwrap_or("")).collect()
}

fn codes(table: &Table) -> Vec<&str> {
    table.notes.iter().map(|note| note.code).collect()
}

fn part(text: &str, part: Part) -> Result<Table, TextError> {
    read_part(text.as_bytes(), part)
}

/// `n` rows of a time and two values, and what is read of the last column.
fn rows(n: usize) -> (String, Vec<f64>) {
    let values: Vec<f64> = (0..n).map(|i| 0.5 - i as f64 / 4.0).collect();
    (values.iter().enumerate().map(|(i, v)| format!("{:.2},{}.25,{v:.2}\n", i as f64 / 100.0, i % 3)).collect(), values)
}

#[test]
fn a_row_of_short_words_under_names_holds_units_known_or_not() {
    let (rows, _) = rows(4);
    // A unit of no table beside a known one, all unknown, repeated, none, empty.
    for unit in ["furlong", "Zoll", "gpm", "counts", "mm/sec", "none", "kN/mm", "in/in", "micro strain", "°", ""] {
        let found = table(&format!("Time,Target,Rotation\nsec,mm,{unit}\n{rows}"));
        assert_eq!(names(&found), ["Time", "Target", "Rotation"], "{unit}");
        assert_eq!(units(&found), ["sec", "mm", unit], "{unit}");
    }
    assert_eq!(units(&table(&format!("Time,Target,Measured\ntick,foo,bar\n{rows}"))), ["tick", "foo", "bar"]);
    assert_eq!(units(&table(&format!("A1,Target,Measured\ntick,foo,foo\n{rows}"))), ["tick", "foo", "foo"]);
    assert_eq!(names(&table(&format!("Time,Target,Measured\nsec,mm\n{rows}"))), ["Time", "Target", "Measured"]);
}

#[test]
fn a_row_of_names_under_a_row_of_groups_holds_names() {
    let (rows, _) = rows(4);
    for above in ["Run 7,Actuator 1,Actuator 1", "Run 7,,", "Recorded on a Tuesday"] {
        for under in ["Time,Target,Measured", "t,x,y"] {
            let found = table(&format!("{above}\n{under}\n{rows}"));
            assert_eq!(names(&found), under.split(',').collect::<Vec<_>>(), "{above}");
        }
    }
}

#[test]
fn blocks_of_other_columns_are_told_and_one_can_be_chosen() {
    let text = include_str!("seeds/two_blocks.dat");
    let found = table(text);
    assert_eq!((found.n_rows, names(&found)), (12, vec!["Time", "Command", "Stroke"]));
    assert_eq!(units(&found), ["Sec", "mm", "mm"]);
    assert_eq!(codes(&found), ["blocks"]);
    assert_eq!(found.notes[0].values, [2, 1, 6, 17]);
    assert!(found.notes[0].text.contains("block 2, lines 22 to 25 (4 rows: Force, Stroke)"), "{}", found.notes[0]);
    let second = part(text, Part { block: Some(2), lines: None }).unwrap();
    assert_eq!((second.n_rows, names(&second), units(&second)), (4, vec!["Force", "Stroke"], vec!["kN", "mm"]));
    // The file's own head is part of every block's.
    assert!(second.preamble[0].starts_with("MTS793"));
    assert_eq!(part(text, Part { block: Some(3), lines: None }), Err(TextError::NoBlock { n_blocks: 2 }));
    assert_eq!(part("a,b\n1,2\n3,4\n", Part { block: Some(2), lines: None }), Err(TextError::NoBlock { n_blocks: 1 }));
}

#[test]
fn the_longest_block_is_read_and_a_first_one_that_is_shorter_is_told() {
    let (long, values) = rows(40);
    let found = table(&format!("a,b\n1,2\n3,4\n5,6\n\ntime,target,measured\n{long}"));
    assert_eq!(numbers(&found)[2].1, values);
    assert_eq!(codes(&found), ["blocks"]);
    assert_eq!(found.notes[0].values, [2, 2, 7, 46]);
}

#[test]
fn a_footer_repeated_headers_and_pages_are_left_out_with_their_lines() {
    let found = table(include_str!("seeds/footer.csv"));
    assert_eq!(found.n_rows, 12);
    assert_eq!(units(&found), ["s", "furlong", "furlong"]);
    assert_eq!(codes(&found), ["left_out", "left_out"]);
    assert_eq!((found.notes[0].values.clone(), found.notes[1].values.clone()), (vec![9, 11], vec![19, 20]));
    let (rows, values) = rows(6);
    let found = table(&format!("time,target,measured\n{rows}\nthe pump was stopped\n{rows}end of test, 12 rows\n"));
    assert_eq!(numbers(&found)[2].1, [&values[..], &values[..]].concat());
    assert_eq!(found.notes.iter().map(|n| n.values[0]).collect::<Vec<_>>(), [9, 16]);
    // One event more than there is room for.
    let found = table(&format!("time,target,measured,Events\n{rows}0.06,1,2,start,stop\n"));
    assert_eq!((found.n_rows, codes(&found)), (7, vec!["words_behind"]));
    assert_eq!(found.notes[0].values, [8, 1]);
}

#[test]
fn a_last_line_that_is_cut_off_is_left_out() {
    let (rows, values) = rows(12);
    let whole = format!("time,target,measured\n{rows}");
    for n in 1..15 {
        let found = table(&whole[..whole.len() - n]);
        // Cut behind the last digit, the line is whole; amid it, or without one of its cells, it is not.
        let n_rows = if n == 1 {
            12
        } else if n < 15 && whole.len() - n > whole.rfind("0.11").unwrap() {
            11
        } else {
            12
        };
        assert_eq!(numbers(&found)[2].1, values[..n_rows], "{n}");
        assert_eq!(codes(&found).contains(&"cut_off"), n_rows == 11, "{n}");
    }
    let utf16: Vec<u8> = [0xfeff].into_iter().chain(whole.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    let found = read(&utf16[..utf16.len() - 3]).unwrap();
    assert_eq!(codes(&found), ["cut_off", "cut_off"]);
}

#[test]
fn a_row_that_is_broken_amid_the_others_is_an_error_and_lines_lead_past_it() {
    let (rows, values) = rows(6);
    for broken in ["0.06,ERR,1", "0.06,ERR,ERR", "0.06,1", "ERR,1,2", "0.06,1,2,3"] {
        let text = format!("Rate: 100\ntime,target,measured\n{rows}{broken}\n{rows}");
        assert_eq!(read(text.as_bytes()).expect_err(broken).line(), Some(9), "{broken}");
        let lines = |first, last| part(&text, Part { block: None, lines: Some((first, last)) });
        for (first, n) in [(1, 6), (3, 6), (5, 4)] {
            let found = lines(first, 8).unwrap();
            assert_eq!(names(&found), ["time", "target", "measured"]);
            assert_eq!(numbers(&found)[2].1, values[6 - n..], "{broken}");
            assert_eq!(found.preamble[0], "Rate: 100");
        }
        assert_eq!(names(&lines(10, 99).unwrap()), ["time", "target", "measured"]);
        assert_eq!(lines(90, 99), Err(TextError::NoLines { first: 90, last: 99, n_lines: 15 }));
        assert!(lines(5, 4).is_err() && lines(0, 4).is_err());
    }
    // Many broken rows at the end are the data, and no footer.
    let many = "0.06,ERR,1\n".repeat(40);
    assert!(read(format!("time,target,measured\n{rows}{rows}{rows}{rows}{many}").as_bytes()).is_err());
}

#[test]
fn commas_that_divide_and_mark_decimals_are_told_apart_where_one_reading_is_left() {
    let found = table(include_str!("seeds/decimal_commas.csv"));
    assert_eq!((found.n_rows, found.decimal_comma, codes(&found)), (12, true, vec!["decimal_commas"]));
    assert_eq!(numbers(&found)[0].1[3], 0.03);
    let (rows, values) = rows(30);
    let bare = table(&rows.replace("-", "").replace('.', ","));
    assert_eq!(numbers(&bare).len(), 3);
    assert_eq!(numbers(&bare)[2].1, values.iter().map(|v| v.abs()).collect::<Vec<_>>());
    assert!(message("t,x\n0,001,1,5\n0,002,2\n").contains("a comma cannot be both delimiter and decimal mark"));
}

#[test]
fn thousands_may_be_set_apart_and_columns_may_touch() {
    let found = table(include_str!("seeds/thousands.csv"));
    assert_eq!((found.n_rows, found.decimal_comma), (12, false));
    assert!(numbers(&found)[1].1.iter().any(|v| *v > 1000.0));
    let found = table("a;b\n1,5;1.234,5\n2,5;-1.234.567,25\n");
    assert_eq!(numbers(&found)[1].1, [1234.5, -1_234_567.25]);
    // 1,234 is a thousand where another number has both marks, and three decimals where none has.
    assert_eq!(numbers(&table("a;b\n1.5;1,234\n2.5;1,234.5\n"))[1].1, [1234.0, 1234.5]);
    assert_eq!(numbers(&table("a;b\n1;1,234\n2;0,234\n"))[1].1, [1.234, 0.234]);
    let found = table(include_str!("seeds/fused.txt"));
    assert_eq!((found.n_rows, codes(&found)), (12, vec!["fused"]));
    assert!(numbers(&found)[1].1.iter().all(|v| *v <= -1000.0 && *v >= -1005.0));
}
