//! Did the actuator do what the simulation asked?
//!
//! The frequency-domain evaluation of actuator tracking in real-time hybrid simulation: Guo, Xu and Chen (2014), Smart
//! Structures and Systems 14(6), 1197-1220. Numerics only: no files, no clock, no log.
//!
//! Data flows through the modules in this order:
//!
//! 1. [`pair`]: target and measured displacement on one clock, checked once.
//! 2. [`window`]: detrending and windows.
//! 3. [`decimate`]: P, as a short cascade or as the paper's Chebyshev filter.
//! 4. `spectrum`: Q by folding, the transform, the kept bins.
//! 5. [`tracking`]: Eqs 6-12, amplitude and delay; [`Evaluator`] is the plan, [`EvaluatorState`] its buffers.
//! 6. [`bad_samples`]: spikes, dropouts, frozen, clipped and held samples, which the next step leaves out.
//! 7. `alignment`: the estimators that shift the target before it is windowed; `lag` finds where to start, `lagrange` reads
//!    between samples, `floor` tells how noisy the target is, `noise` gives the intervals, [`reason`] says why there is none.
//! 8. [`moving`]: the same over moving windows.
//! 9. [`monitor`]: the same while the test runs, sample by sample; [`causal`] is its P.
//! 10. [`factors`]: the largest P and Q that a tolerance allows.
//! 11. [`key_frequencies`]: the few bins that hold most of the weight, evaluated alone.
//! 12. [`response`]: gain, phase, delay and coherence over frequency, with intervals.
//! 13. [`slopes`]: the same as two straight lines.
//! 14. [`mod@indices`]: the time-domain indices in use beside them.
//!
//! [`dynamics`] makes such signals: virtual tests of structures with actuators that lag. It and the evaluation do not know
//! each other.
//!
//! Signs: a positive delay means that measured lags target; amplitude 1 is perfect. Units are SI.

#![forbid(unsafe_code)]

mod alignment;
pub mod bad_samples;
pub mod causal;
pub mod decimate;
pub mod dynamics;
pub mod error;
pub mod factors;
mod floor;
pub mod indices;
pub mod key_frequencies;
mod lag;
mod lagrange;
pub mod monitor;
pub mod moving;
mod noise;
pub mod pair;
mod quantile;
pub mod reason;
pub mod response;
pub mod slopes;
mod spectrum;
mod sums;
pub mod tracking;
pub mod window;

pub use bad_samples::{BAD_KINDS, BadCount, BadFound, BadKind, BadSamples, bridged};
pub use causal::{CausalDecimator, CausalState};
pub use decimate::Decimator;
pub use error::{Error, Result, Signal};
pub use factors::{DelayMeasure, FactorChange, Factors, FactorsConfig, PriorBounds, choose_factors, prior_bounds};
pub use indices::{IndexHistories, Indices, index_histories, indices};
pub use key_frequencies::{KeyFrequencies, KeyFrequenciesConfig, KeyFrequenciesState};
pub use monitor::{Monitor, MonitorConfig, MonitorState, Processed, Reading};
pub use moving::{MovingConfig, MovingTracking, evaluate_moving};
pub use pair::Pair;
pub use reason::Reason;
pub use response::{FrequencyResponse, ResponseConfig, Unaligned, frequency_response};
pub use slopes::{FrequencySlopes, Slope, SlopesConfig, frequency_slopes};
pub use tracking::{Estimator, Evaluator, EvaluatorConfig, EvaluatorState, Noise, Spectra, Tracking};
pub use window::{Detrend, Window};
