//! Evaluating allocates nothing: it runs here under an allocator that counts.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use rthstrack::{Decimator, Detrend, Evaluator, EvaluatorConfig, Pair, Window};

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

#[allow(unsafe_code)]
// SAFETY: every call goes to the system allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|c| c.set(c.get() + 1));
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn evaluating_allocates_nothing() {
    let target: Vec<f64> = (0..20_000).map(|i| (f64::from(i) * 0.01).sin()).collect();
    let measured: Vec<f64> = (0..20_000).map(|i| (f64::from(i) * 0.01 - 0.05).sin()).collect();
    let pair = Pair::new(&target, &measured, 1000.0).unwrap();
    for config in [
        EvaluatorConfig::default(),
        EvaluatorConfig { data_decimation: 512, frequency_decimation: 2, ..Default::default() },
        EvaluatorConfig { window: Window::Hann, detrend: Detrend::Linear, weight_power: 3, ..Default::default() },
        EvaluatorConfig { decimator: Decimator::Chebyshev, data_decimation: 8, ..Default::default() },
    ] {
        let evaluator = Evaluator::new(target.len(), 1000.0, config).unwrap();
        let mut state = evaluator.state();
        let before = COUNT.with(Cell::get);
        evaluator.evaluate(&mut state, &pair).unwrap();
        assert_eq!(COUNT.with(Cell::get), before, "{config:?}");
    }
    let before = COUNT.with(Cell::get);
    drop(std::hint::black_box(vec![1.0f64]));
    assert_eq!(COUNT.with(Cell::get), before + 1, "the allocator does count");
}
