//! Damaged text never makes the reader panic, and never makes it hand back columns that do not fit together.
//!
//! The seeds are the files in `seeds`, changed by rule from a fixed start, so that every run is the same run;
//! what once went wrong is kept in `found`.
//! RTHSTRACK_FUZZ sets how many inputs are tried (5,000 otherwise).

use std::fs;
use std::panic::catch_unwind;
use std::path::Path;

use rthstrack_text::{Part, Table, TextError, Values, read, read_part};

/// SplitMix64 (Steele, Lea, Flood 2014).
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }

    fn among<T: Copy>(&mut self, list: &[T]) -> T {
        list[self.below(list.len())]
    }
}

fn files(folder: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(folder);
    let mut paths: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    assert!(!paths.is_empty(), "the files are missing");
    paths.iter().map(|path| fs::read(path).unwrap()).collect()
}

/// Pieces that mean something to the reader.
const PIECES: [&[u8]; 50] = [
    b"\n",
    b"\r\n",
    b"\r",
    b"\n\n",
    b",",
    b";",
    b"\t",
    b" ",
    b"|",
    b"\"",
    b"\"\"",
    b"#",
    b"%",
    b"//",
    b".",
    b"-",
    b"+",
    b"e",
    b"E+5",
    b"d-3",
    b"0",
    b"9",
    b"1,5",
    b"1.5",
    b"nan",
    b"inf",
    b"NA",
    b"1e999",
    b"99999999999999999999",
    b"0.1e-330",
    b"\xef\xbb\xbf",
    b"\xff\xfe",
    b"\xfe\xff",
    b"\x00",
    b"\x1a",
    b"\x0c",
    b"\xe9",
    b"\xc3\xa9",
    b"05/25/2022",
    b"2022-13-45T99:99:99Z",
    b"23:59:59.999",
    b"12:30",
    b"PM",
    b"=",
    b":",
    b"***End_of_Header***",
    b"\x0cPage 2\n",
    b"1'000.5",
    b"1,234.5",
    b"time,x\ns,mm\n",
];

fn lines(text: &[u8]) -> Vec<Vec<u8>> {
    text.split_inclusive(|&b| b == b'\n').map(<[u8]>::to_vec).collect()
}

fn mutated(seeds: &[Vec<u8>], chance: &mut Chance) -> Vec<u8> {
    let mut text = seeds[chance.below(seeds.len())].clone();
    for _ in 0..chance.among(&[1, 1, 2, 3, 6, 12]) {
        let at = chance.below(text.len() + 1);
        let length = chance.among(&[1, 1, 2, 5, 20]).min(text.len() - at);
        match chance.below(13) {
            0 => text.truncate(at),
            1 => {
                text.drain(at..at + length);
            }
            2 => {
                let piece = text[at..at + length].to_vec();
                text.splice(at..at, piece);
            }
            3 if at < text.len() => text[at] ^= 1 << chance.below(8),
            4 if at < text.len() => text[at] = chance.next() as u8,
            5 | 6 => {
                let piece = chance.among(&PIECES);
                text.splice(at..at + length * chance.below(2), piece.iter().copied());
            }
            7 => {
                let mut all = lines(&text);
                if !all.is_empty() {
                    let line = chance.below(all.len());
                    all.remove(line);
                    text = all.concat();
                }
            }
            8 => {
                let mut all = lines(&text);
                if !all.is_empty() {
                    let line = all[chance.below(all.len())].clone();
                    for _ in 0..chance.among(&[1, 1, 3, 200]) {
                        all.insert(chance.below(all.len() + 1), line.clone());
                    }
                    text = all.concat();
                }
            }
            9 => {
                let mut all = lines(&text);
                if !all.is_empty() {
                    let (a, b) = (chance.below(all.len()), chance.below(all.len()));
                    all.swap(a, b);
                    text = all.concat();
                }
            }
            10 => {
                let (from, to) = (chance.among(b",;\t |.\"\n\r"), chance.among(b",;\t |.\"\n\r"));
                text.iter_mut().filter(|b| **b == from).for_each(|b| *b = to);
            }
            11 => {
                let other = &seeds[chance.below(seeds.len())];
                let start = chance.below(other.len());
                text.truncate(at);
                text.extend_from_slice(&other[start..]);
            }
            _ => text = text.iter().flat_map(|b| [*b, 0]).collect(),
        }
        text.truncate(1 << 16);
    }
    text
}

/// Whatever comes out must fit together, of the whole text and of parts of it.
fn check(text: &[u8]) -> bool {
    let n = text.len() % 7;
    let parts = [Part { block: Some(n), lines: None }, Part { block: None, lines: Some((n, 3 * n)) }];
    for part in parts {
        check_one(read_part(text, part));
    }
    check_one(read(text))
}

fn check_one(found: Result<Table, TextError>) -> bool {
    match found {
        Ok(table) => {
            for column in &table.columns {
                match &column.values {
                    Values::Numbers(numbers) => assert_eq!(numbers.len(), table.n_rows),
                    Values::Stamps { ns, .. } => assert_eq!(ns.len(), table.n_rows),
                    Values::Text { n_entries } => assert!(*n_entries <= table.n_rows),
                }
            }
            true
        }
        Err(error) => {
            let message = error.to_string();
            assert!(!message.contains(['\n', '\r', '\0']) && message.len() < 1000, "{message:?}");
            false
        }
    }
}

#[test]
fn the_seeds_are_read() {
    assert!(files("seeds").iter().all(|seed| check(seed)));
}

#[test]
fn inputs_that_failed_once_do_so_no_more() {
    for input in files("found") {
        check(&input);
    }
}

#[test]
fn mutated_files_never_panic_and_never_give_columns_that_do_not_fit_together() {
    let n: usize = std::env::var("RTHSTRACK_FUZZ").map_or(5000, |n| n.parse().expect("RTHSTRACK_FUZZ: a number"));
    let seeds = files("seeds");
    let mut chance = Chance(2014);
    let mut n_read = 0;
    for i in 0..n {
        let text = mutated(&seeds, &mut chance);
        match catch_unwind(|| check(&text)) {
            Ok(read) => n_read += usize::from(read),
            Err(_) => panic!("input {i} of this run, keep it in tests/found: {:?}", text.escape_ascii().to_string()),
        }
    }
    // The changes must leave some files readable and break others, or they test nothing.
    assert!(n_read * 10 > n && n_read * 10 < n * 9, "{n_read} of {n} were read");
}
