//! Samples that are no motion: spikes, dropouts, frozen stretches, clipped peaks, and values that are held.
//!
//! A spike leaves and returns within one sample. With the fourth difference and the second about a sample,
//!
//! ```text
//! g_i = (x_(i-2) - 4 x_(i-1) + 6 x_i - 4 x_(i+1) + x_(i+2)) / 6,   h_i = x_i - (x_(i-1) + x_(i+1)) / 2,
//! ```
//!
//! both of a spike its height, it stands out of the median of |g| or |h| around it; a kink or a step has another shape. A stretch
//! of equal values is no motion where the other channel, shifted and scaled to lie upon this one, moves on: the value jumps to
//! it at the end (and away from it at the start of a dropout), or the two come apart far beyond what they do elsewhere. So a
//! command that rests, a square wave, a coarse converter and a specimen that sticks are left alone. A channel whose values change
//! at every k-th sample only is held: it is read between those.
//!
//! `look` says what a channel looks like, by `differences`; `held`, `runs` and `spikes` mark what is no motion, the last two asking
//! the other channel (`about`); `bridge` fills its place; `examination` is all of that in order, and `found` what it tells.

mod about;
mod bridge;
mod differences;
mod examination;
pub(crate) mod found;
mod held;
mod look;
mod runs;
mod spikes;

use std::ops::Range;

pub(crate) use about::About;
pub(crate) use examination::Examination;
pub use found::{BAD_KINDS, BadCount, BadFound, BadKind, BadSamples};

use crate::pair::Pair;
use crate::settings::EvaluatorConfig;

/// Of target and measured, the stretches that are bridged.
pub type Gaps = [Vec<Range<usize>>; 2];

/// Both channels of a pair with their bad samples bridged, or read between fresh ones, and where they are bridged; None where
/// there are none, or where `config` keeps them.
pub fn bridged(pair: &Pair<'_>, config: &EvaluatorConfig) -> Option<([Vec<f64>; 2], Gaps)> {
    Examination::of(pair, config).map(|examination| (examination.signals, examination.gaps))
}
