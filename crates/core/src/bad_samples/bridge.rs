//! What stands in the place of bad samples.

use std::ops::Range;

use super::differences::fourth;

/// The mark of a sample that is motion; others are marked 1 + kind.
pub(super) const GOOD: u8 = 0;

/// A straight line from good to good sample in place of what is marked in `range`, of one sample a cubic; of ends, the nearest
/// good one.
#[inline]
pub(super) fn bridge(signal: &mut [f64], marks: &[u8], range: Range<usize>) {
    let n = signal.len();
    let mut a = range.start;
    while a < range.end {
        if marks[a] == GOOD {
            a += 1;
            continue;
        }
        let mut first = a;
        while first > 0 && marks[first - 1] != GOOD {
            first -= 1;
        }
        let mut b = a;
        while b < n && marks[b] != GOOD {
            b += 1;
        }
        match (first.checked_sub(1).map(|i| signal[i]), signal.get(b).copied()) {
            // Of one sample the cubic through its neighbours, so that those do not stand out.
            (Some(_), Some(_)) if b - first == 1 && first >= 2 && marks.get(b + 1) == Some(&GOOD) => {
                signal[first] -= fourth(signal, first);
            }
            (Some(from), Some(to)) => {
                let step = (to - from) / (b - first + 1) as f64;
                (first..b).for_each(|i| signal[i] = from + step * (i - first + 1) as f64);
            }
            (Some(end), None) | (None, Some(end)) => signal[first..b].fill(end),
            (None, None) => {}
        }
        a = b;
    }
}

/// Takes sample i, which comes after all that are there, into the stretches that are bridged.
pub(super) fn widen(gaps: &mut Vec<Range<usize>>, i: usize) {
    match gaps.last_mut() {
        Some(gap) if gap.end == i => gap.end = i + 1,
        _ => gaps.push(i..i + 1),
    }
}
