//! Whatever comes in whatever order, every sample is counted once, and what is received and lost is what the sender counted.

use proptest::prelude::*;
use rthstrack_live::sequence::{Place, Sequence};

/// Counters from `start` on, some dropped, some doubled, some late, as a network does it.
fn deliver(start: i64, fates: &[u8]) -> Vec<i64> {
    let mut order: Vec<(usize, i64)> = Vec::new();
    for (i, fate) in fates.iter().enumerate() {
        let counter = start + i as i64;
        match fate % 16 {
            0 => {}
            1 => order.extend([(i, counter), (i, counter)]),
            2 => order.extend([(i, counter), (i + usize::from(*fate), counter)]),
            3 | 4 => order.push((i + usize::from(*fate) / 2, counter)),
            _ => order.push((i, counter)),
        }
    }
    order.sort_by_key(|(at, _)| *at);
    order.into_iter().map(|(_, counter)| counter).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn received_and_lost_are_what_the_sender_counted(
        start in 0i64..1_000_000,
        fates in proptest::collection::vec(any::<u8>(), 1..3000),
        fill in 0u64..20,
    ) {
        let sent = deliver(start, &fates);
        prop_assume!(!sent.is_empty());
        let mut sequence = Sequence::new(64, fill);
        let places: Vec<Place> = sent.iter().map(|c| sequence.place(*c, false)).collect();
        let tally = sequence.tally();
        let mut distinct = sent.clone();
        distinct.sort_unstable();
        distinct.dedup();
        let spanned = (distinct[distinct.len() - 1] - distinct[0] + 1) as u64;
        prop_assert_eq!(tally.received, distinct.len() as u64);
        prop_assert_eq!(tally.received + tally.lost, spanned);
        prop_assert_eq!(tally.received + tally.repeated, sent.len() as u64);
        let dropped = places.iter().filter(|p| **p == Place::Dropped).count() as u64;
        prop_assert_eq!(dropped, tally.repeated + tally.reordered);
        let filled: u64 = places.iter().map(|p| if let Place::AfterGap(n) = p { *n } else { 0 }).sum();
        prop_assert_eq!(filled, tally.filled);
        prop_assert!(places.iter().all(|p| *p != Place::Restarted));
    }

    #[test]
    fn the_same_holds_where_the_counter_wraps_around(
        back in 0i64..3000,
        fates in proptest::collection::vec(any::<u8>(), 1..3000),
        bits in prop_oneof![Just(16u32), Just(32)],
    ) {
        let sent = deliver((1i64 << bits) - back, &fates);
        prop_assume!(!sent.is_empty());
        let (mut plain, mut wrapped) = (Sequence::new(64, 5), Sequence::new(bits, 5));
        for counter in sent {
            prop_assert_eq!(plain.place(counter, false), wrapped.place(counter % (1 << bits), false));
        }
        prop_assert_eq!(plain.tally(), wrapped.tally());
    }

    #[test]
    fn any_counters_at_all_are_placed(
        counters in proptest::collection::vec(any::<i64>(), 1..200),
        near in proptest::collection::vec(0i64..50, 1..500),
        bits in prop_oneof![Just(16u32), Just(32), Just(64)],
    ) {
        let mut sequence = Sequence::new(bits, 8);
        let n = (counters.len() + near.len()) as u64;
        for (i, counter) in counters.into_iter().chain(near).enumerate() {
            sequence.place(counter, i % 7 == 0);
        }
        let tally = sequence.tally();
        prop_assert_eq!(tally.received + tally.repeated, n);
        prop_assert!(tally.reordered <= tally.received);
    }
}
