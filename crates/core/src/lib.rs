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
//! 5. [`setting`]: what a setting is; [`settings`]: what an evaluation is told; [`tracking`]: what it answers; [`reason`]: why a number is missing.
//! 6. `weigh`: the sums of Eqs 7 and 12, amplitude and delay from them (Eqs 10 and 11).
//! 7. [`bad_samples`]: spikes, dropouts, frozen, clipped and held samples, which the next step leaves out.
//! 8. `alignment`: the estimators that shift the target before it is windowed; `lag` finds where to start, `lagrange` reads
//!    between samples, `floor` tells how noisy the target is, `noise` gives the intervals.
//! 9. [`evaluator`]: whichever estimator, [`Evaluator`] is the plan, [`EvaluatorState`] its buffers.
//! 10. [`moving`]: the same over moving windows.
//! 11. [`monitor`]: the same while the test runs, sample by sample; [`causal`] is its P.
//! 12. [`factors`]: the largest P and Q that a tolerance allows.
//! 13. [`key_frequencies`]: the few bins that hold most of the weight, evaluated alone.
//! 14. [`response`]: gain, phase, delay and coherence over frequency, with intervals.
//! 15. [`slopes`]: the same as two straight lines.
//! 16. [`mod@indices`]: the time-domain indices in use beside them.
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
pub mod evaluator;
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
pub mod setting;
pub mod settings;
pub mod slopes;
mod spectrum;
mod sums;
pub mod tracking;
mod weigh;
pub mod window;

pub use bad_samples::{BAD_KINDS, BadCount, BadFound, BadKind, BadSamples, bridged};
pub use causal::{CausalDecimator, CausalState};
pub use decimate::Decimator;
pub use error::{Error, Result, Signal};
pub use evaluator::{Evaluator, EvaluatorState};
pub use factors::{DelayMeasure, FactorChange, Factors, FactorsConfig, PriorBounds, choose_factors, prior_bounds};
pub use indices::{IndexHistories, Indices, index_histories, indices};
pub use key_frequencies::{KeyFrequencies, KeyFrequenciesConfig, KeyFrequenciesState};
pub use monitor::{Monitor, MonitorConfig, MonitorState, Processed, Reading};
pub use moving::{MovingConfig, MovingTracking, evaluate_moving};
pub use pair::Pair;
pub use reason::{Reason, ReasonKind};
pub use response::{FrequencyResponse, ResponseConfig, Unaligned, frequency_response};
pub use settings::{Estimator, EvaluatorConfig, Noise};
pub use slopes::{FrequencySlopes, Slope, SlopesConfig, frequency_slopes};
pub use tracking::{Getter, NumberKind, Spectra, Tracking};
pub use window::{Detrend, Window};
