//! Tables as laboratories write them, with what is to be read from them written down by hand.

use rthstrack_text::{Delimiter, Encoding, MISSING_STAMP, Table, TextError, Values, read};

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
    assert_eq!(found.notes, ["2 line(s) of empty cells at the end of the file were left out"]);
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
    assert_eq!(found.notes, ["2 comment line(s) among the numbers were left out"]);
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
    assert!(message("t,x\n0,001,1,5\n0,002,2,5\n").starts_with("line 1 names 2 columns, but line 2 has 4 fields"));
    assert!(message("t,x,y\n0.5,1\n1.5,2\n").starts_with("line 1 names 3 columns, but line 2 has 2 fields"));
    // Prose above columns divided by blanks names nothing, and a note says so.
    let found = table("Recorded in the laboratory\n1.5 2.5\n3.5 4.5\n");
    assert_eq!(found.columns[0].name, None);
    assert_eq!(found.notes, ["line 1: 4 words above 2 columns were not taken as names"]);
}
