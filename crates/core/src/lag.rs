//! Where the search for the delay starts: the peaks of the normalised correlation of measured and shifted target.
//!
//! ```text
//! rho(l) = sum o_i (x_(i-l) - mean_l) / sqrt(sum o_i^2  sum (x_(i-l) - mean_l)^2),   o = measured less its mean
//! ```
//!
//! summed over the judged samples, the target taken from outside the window where there is some; each lag is divided by the
//! energy of its own stretch of target. Both signals are first averaged over as many samples as leave nine tenths of the
//! target's energy (a straight line taken out; more of a broad band's): a peak needs no more resolution than a fifth of the shortest period, as it is
//! read from the cosine through the three entries around it, which is the correlation of a narrow band, and nearly that of others.

use std::ops::Range;

use pulp::{Arch, NullaryFnOnce};

use crate::pair::Pair;
use crate::reason::Reason;
use crate::sums;
use crate::window::Detrend;

/// Averaging may cost this share of the target's energy;
const LOST: f64 = 0.1;
/// and this share in any case.
const TELLING: f64 = 0.03;
/// Samples that are averaged at most.
pub(crate) const MAX_STEP: usize = 64;
/// Averaged samples that are correlated at most: the stretch in which the target moves most.
const MAX_STRETCH: usize = 8192;
/// Samples that are looked at, before averaging, at most: likewise.
const LONGEST: usize = 1 << 20;
/// How many times as far is looked where measured seems to move against target, or not along with it up to a correlation;
const FARTHER: usize = 4;
const WELL_FOLLOWED: f64 = 0.98;
/// and so little of what a correlation leaves must be left there for it to be the place.
const LEFT: f64 = 0.2;
/// A motion is narrow whose lowest correlation is as low as this share of the highest.
const NARROW: f64 = 0.7;
/// Fewest cycles of the target in the window: more than half a wave, whose delay cannot be told from an offset.
const MIN_CYCLES: f64 = 0.6;
/// Peaks that are looked at: a tone has as many as it has turns within reach.
pub(crate) const MAX_PEAKS: usize = 64;
/// A peak lower than the highest by more than this is another lag's, even at the resolution of the search.
const PEAK_MARGIN: f64 = 0.05;
/// The peak nearest to the expected delay is looked at down to this.
const EXPECTED_MARGIN: f64 = 0.2;
/// Less than this, at the best lag, is no pair: a third of the energy in the motion's own band.
const LEAST_CORRELATION: f64 = 0.6;
/// By how much the lowest correlation must outdo the highest before measured is said to move against target.
const OPPOSITE_MARGIN: f64 = 0.1;

/// A stretch of both signals, by their index in the record.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View<'a> {
    pub(crate) target: &'a [f64],
    pub(crate) measured: &'a [f64],
    /// Index in the record of the first sample of both.
    pub(crate) origin: usize,
    /// Stretches of target and of measured that are no motion, by their index in the record; a straight line stands there.
    pub(crate) gaps: [&'a [Range<usize>]; 2],
}

impl<'a> View<'a> {
    /// The whole of a record.
    pub(crate) fn whole(pair: &Pair<'a>) -> Self {
        Self { target: pair.target(), measured: pair.measured(), origin: 0, gaps: [&[], &[]] }
    }

    /// Whether some samples are no motion.
    pub(crate) fn has_gaps(&self) -> bool {
        self.gaps.iter().any(|gaps| !gaps.is_empty())
    }

    /// Index in the record past the last sample.
    pub(crate) fn end(&self) -> usize {
        self.origin + self.target.len()
    }
}

/// A place from which the delay may be refined.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Peak {
    /// In samples; positive when measured lags.
    pub(crate) lag: f64,
    pub(crate) correlation: f64,
}

/// What the search saw.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Peaks {
    peaks: [Peak; MAX_PEAKS],
    n_peaks: usize,
    /// Samples from one lag looked at to the next.
    pub(crate) step: usize,
    /// The largest lag looked at, in samples.
    pub(crate) reach: usize,
    /// Cycles that the target moves through in the window.
    pub(crate) cycles: f64,
    /// The lowest correlation seen, and at which lag.
    lowest: f64,
    lowest_lag: f64,
}

impl Peaks {
    /// Highest first; only those that may be as high as the first, and the one nearest to the expected delay.
    pub(crate) fn peaks(&self) -> &[Peak] {
        &self.peaks[..self.n_peaks]
    }

    /// The correlation swings to both sides: a motion of nearly one frequency.
    pub(crate) fn is_narrow(&self) -> bool {
        self.lowest < -NARROW * self.first().correlation
    }

    /// The highest.
    pub(crate) fn first(&self) -> Peak {
        self.peaks[0]
    }
}

/// The plan for windows of one length.
#[derive(Debug, Clone)]
pub(crate) struct Search {
    n_samples: usize,
    /// Largest number of samples averaged.
    max_step: usize,
    /// Largest lag looked at, a multiple of it.
    reach: usize,
    rate_hz: f64,
    arch: Arch,
}

/// Buffers of a search.
#[derive(Debug, Clone)]
pub(crate) struct SearchState {
    target: Vec<f64>,
    measured: Vec<f64>,
    correlations: Vec<f64>,
}

/// Correlations that stand in the state, from the largest lag to the largest lead.
#[derive(Debug, Clone, Copy)]
struct Correlated {
    /// How many there are to either side of no lag.
    lags: usize,
    /// Samples from one to the next.
    step: usize,
    /// Cycles that the target moves through.
    cycles: f64,
}

impl Correlated {
    /// How high the highest peak is of lags and leads longer than `reach` samples.
    fn highest_beyond(&self, correlations: &[f64], reach: usize) -> Option<f64> {
        let tops = (1..2 * self.lags).filter_map(|k| {
            let [before, here, after] = [correlations[k - 1], correlations[k], correlations[k + 1]];
            if here < before || here <= after {
                return None;
            }
            let (shift, top) = summit(before, here, after);
            let lag = (k as f64 + shift - self.lags as f64).abs() * self.step as f64;
            (lag > reach as f64).then_some(top)
        });
        tops.max_by(f64::total_cmp)
    }
}

impl Search {
    /// For windows of `n_samples`, lags of up to `max_delay_s` either way (the window's length at most).
    pub(crate) fn new(n_samples: usize, rate_hz: f64, max_delay_s: f64) -> Self {
        let max_delay = max_delay_s * rate_hz;
        let wanted = (max_delay.ceil() as usize).clamp(1, n_samples.max(1));
        let most = MAX_STEP.min(wanted / 4).min(n_samples / 64).max(1);
        let max_step = 1 << most.ilog2();
        Self { n_samples, max_step, reach: wanted.next_multiple_of(max_step), rate_hz, arch: Arch::new() }
    }

    /// Length of the windows.
    pub(crate) fn n_samples(&self) -> usize {
        self.n_samples
    }

    /// The largest lag looked at, in samples.
    pub(crate) fn reach(&self) -> usize {
        self.reach
    }

    pub(crate) fn state(&self) -> SearchState {
        let searched = self.n_samples.min(LONGEST);
        SearchState {
            target: vec![0.0; searched + 2 * self.reach],
            measured: vec![0.0; searched],
            correlations: vec![0.0; 2 * self.reach + 1],
        }
    }

    /// The peaks for the window that starts at sample `start` of the record. Where the record does not go on beyond the
    /// window, lags of up to a quarter of it are looked at, so that half of it is left to compare.
    pub(crate) fn peaks(
        &self,
        state: &mut SearchState,
        view: &View<'_>,
        start: usize,
        expected: Option<f64>,
    ) -> Result<Peaks, Reason> {
        let outside = start.saturating_sub(view.origin).min(view.end().saturating_sub(start + self.n_samples));
        let reach = self.reach.min(outside.max(self.n_samples / 4)) / self.max_step * self.max_step;
        let near = self.correlate(state, view, start, reach)?;
        if near.cycles < MIN_CYCLES {
            return Err(Reason::FewCycles { found: near.cycles });
        }
        let found = Peaks::collect(state, near, reach, expected);
        let (lowest, highest) = (found.lowest, found.first().correlation);
        // Upside down it leaves far less than in any place the right way up.
        let far_less = highest < WELL_FOLLOWED && 1.0 + lowest < LEFT * (1.0 - highest);
        let opposite = -lowest > LEAST_CORRELATION && (-lowest > highest + OPPOSITE_MARGIN || far_less);
        if opposite || highest < WELL_FOLLOWED {
            // Half a cycle out of reach looks like a sign, and a whole one like the delay: what lies farther away tells.
            let farther = (FARTHER.min(near.step) * reach).min(2 * self.n_samples / 5) / self.max_step * self.max_step;
            let left = 1.0 - highest.max(if opposite { -lowest } else { 0.0 });
            if farther > reach
                && let Ok(far) = self.correlate(state, view, start, farther)
                && far.highest_beyond(&state.correlations, reach).is_some_and(|there| 1.0 - there < LEFT * left)
            {
                return Err(Reason::BeyondMaxDelay { max_delay_s: reach as f64 / self.rate_hz });
            }
            if opposite {
                return Err(Reason::OppositeSign { delay_s: found.lowest_lag / self.rate_hz });
            }
        }
        if found.n_peaks > 0 && highest < LEAST_CORRELATION {
            return Err(Reason::LowCoherence { goodness: highest.max(0.0).powi(2) });
        }
        if found.n_peaks == 0 {
            return Err(Reason::Still);
        }
        Ok(found)
    }

    /// Correlates at lags of up to `reach` samples to either side.
    fn correlate(
        &self,
        state: &mut SearchState,
        view: &View<'_>,
        start: usize,
        reach: usize,
    ) -> Result<Correlated, Reason> {
        let mut from = start.max(view.origin + reach);
        let mut to = (start + self.n_samples).min(view.end().saturating_sub(reach));
        if reach == 0 || to < from + 2 * self.max_step.max(4) {
            return Err(Reason::TooShort { n_samples: to.saturating_sub(from) });
        }
        if to - from > LONGEST {
            from += liveliest(&view.target[from - view.origin..to - view.origin], LONGEST);
            to = from + LONGEST;
        }
        let SearchState { target, measured, correlations } = state;
        let asked = &view.target[from - reach - view.origin..to + reach - view.origin];
        let answered = &view.measured[from - view.origin..to - view.origin];
        let n = answered.len();
        let own = &asked[reach..reach + n];
        let line = Detrend::Linear.line(own);
        // Lines are orthogonal to what is left of them.
        let left = |energy: f64, n: usize, step: usize| energy - line.map_or(0.0, |line| line.energy(n, step as f64));
        let all = left(sums::energy(own), n, 1);
        let mut lost = |step: usize| {
            sums::block_means(own, step, &mut measured[..n / step]);
            1.0 - left(sums::energy(&measured[..n / step]), n / step, step) * step as f64 / all
        };
        let mut step = self.max_step;
        let mut less = if step > 1 { lost(step) } else { 0.0 };
        while step > 1 && less > TELLING {
            let at_half = if step > 2 { lost(step / 2) } else { 0.0 };
            // Of a narrow band half the step loses a quarter; a broad one may have its peak between two steps.
            if less <= LOST && at_half < 0.3 * less {
                break;
            }
            (step, less) = (step / 2, at_half);
        }
        let n = n / step;
        // What is looked at farther away is as much as there is room for.
        let lags = (reach / step).min(correlations.len() / 2).min((target.len() - n) / 2);
        let asked = &asked[reach - lags * step..];
        let n_target = n + 2 * lags;
        sums::block_means(asked, step, &mut target[..n_target]);
        sums::block_means(answered, step, &mut measured[..n]);
        let cycles = cycles(&target[lags..lags + n]);
        take_line(&mut target[..n_target], lags..lags + n);
        take_line(&mut measured[..n], 0..n);
        let at = liveliest(&target[lags..lags + n], MAX_STRETCH);
        let n = n.min(MAX_STRETCH);
        let (target, measured) = (&target[at..at + n + 2 * lags], &mut measured[at..at + n]);
        let mean = sums::sum(measured) / n as f64;
        measured.iter_mut().for_each(|v| *v -= mean);
        let spread = sums::energy(measured);
        let correlations = &mut correlations[..2 * lags + 1];
        self.arch.dispatch(Correlate { target, measured, out: correlations });
        let round_off = 1e-13 * sums::energy(target);
        let (mut sum, mut squares): (f64, f64) = target[..n].iter().fold((0.0, 0.0), |(s, q), v| (s + v, q + v * v));
        let mut moved = false;
        for k in 0..correlations.len() {
            let own = squares - sum * sum / n as f64;
            let comparable = own > round_off && spread > 0.0;
            moved |= comparable;
            correlations[k] = if comparable { correlations[k] / (own.sqrt() * spread.sqrt()) } else { 0.0 };
            if k + 1 < correlations.len() {
                let (leaves, enters) = (target[k], target[k + n]);
                sum += enters - leaves;
                squares += enters * enters - leaves * leaves;
            }
        }
        if !moved {
            return Err(Reason::Still);
        }
        Ok(Correlated { lags, step, cycles })
    }
}

impl Peaks {
    /// The peaks of the correlations that stand in the state, highest first.
    fn collect(state: &SearchState, searched: Correlated, reach: usize, expected: Option<f64>) -> Self {
        let Correlated { lags, step, cycles, .. } = searched;
        let correlations = &state.correlations[..2 * lags + 1];
        let mut found =
            Self { peaks: [Peak::default(); MAX_PEAKS], n_peaks: 0, step, reach, cycles, lowest: 0.0, lowest_lag: 0.0 };
        let (mut lowest, mut lowest_lag) = (0.0_f64, 0.0);
        let mut nearest: Option<Peak> = None;
        for k in 0..correlations.len() {
            let here = correlations[k];
            let outside = f64::NEG_INFINITY;
            let before = if k == 0 { outside } else { correlations[k - 1] };
            let after = if k + 1 == correlations.len() { outside } else { correlations[k + 1] };
            if here <= before && here <= after {
                let inside = before.is_finite() && after.is_finite();
                let (shift, top) = if inside { summit(-before, -here, -after) } else { (0.0, -here) };
                if -top < lowest {
                    (lowest, lowest_lag) = (-top, (lags as f64 - (k as f64 + shift)) * step as f64);
                }
            }
            if here < before || here <= after || here.is_nan() {
                continue;
            }
            let (shift, top) =
                if before.is_finite() && after.is_finite() { summit(before, here, after) } else { (0.0, here) };
            // Entry k compares with the target k - lags steps later: the lag falls with k.
            let peak = Peak { lag: (lags as f64 - (k as f64 + shift)) * step as f64, correlation: top };
            if let Some(expected) = expected
                && nearest.is_none_or(|p| (peak.lag - expected).abs() < (p.lag - expected).abs())
            {
                nearest = Some(peak);
            }
            found.keep(peak);
        }
        let best = found.first().correlation;
        found.n_peaks = found.peaks().iter().filter(|p| p.correlation >= best - PEAK_MARGIN).count();
        if let Some(peak) = nearest
            && peak.correlation >= best - EXPECTED_MARGIN
            && found.peaks().iter().all(|p| p.lag != peak.lag)
        {
            let at = found.n_peaks.min(MAX_PEAKS - 1);
            found.peaks[at] = peak;
            found.n_peaks = at + 1;
        }
        Self { lowest, lowest_lag, ..found }
    }

    /// Inserts in order, dropping the lowest.
    fn keep(&mut self, peak: Peak) {
        let at =
            self.peaks[..self.n_peaks].iter().position(|p| p.correlation < peak.correlation).unwrap_or(self.n_peaks);
        if at < MAX_PEAKS {
            self.n_peaks = (self.n_peaks + 1).min(MAX_PEAKS);
            self.peaks[at..self.n_peaks].rotate_right(1);
            self.peaks[at] = peak;
        }
    }
}

/// Where between its neighbours, and how high, the cosine through three entries around a peak is highest:
/// cos w = (b + a) / 2h,  tan(w x) = (a - b) / (2 h sin w); the parabola's where a period of it would have less than three.
fn summit(before: f64, here: f64, after: f64) -> (f64, f64) {
    let cosine = 0.5 * (before + after) / here;
    if here > 0.0 && cosine > -0.5 && cosine < 1.0 {
        let omega = cosine.acos();
        let angle = (0.5 * (after - before) / (here * omega.sin())).atan();
        let shift = angle / omega;
        if shift.abs() <= 1.0 {
            return (shift, here / angle.cos());
        }
    }
    let curvature = before + after - 2.0 * here;
    if curvature < 0.0 {
        let shift = (0.5 * (before - after) / curvature).clamp(-0.5, 0.5);
        return (shift, here + 0.25 * (after - before) * shift);
    }
    (0.0, here)
}

/// Takes from all samples the least-squares line of those in `own`.
fn take_line(samples: &mut [f64], own: std::ops::Range<usize>) {
    if let Some(line) = Detrend::Linear.line(&samples[own.clone()]) {
        samples.iter_mut().enumerate().for_each(|(i, v)| *v -= line.at_f64(i as f64 - own.start as f64));
    }
}

/// Cycles of a motion in its samples, by its rms acceleration over its rms velocity: a drift adds nothing, half a wave has 0.55.
fn cycles(samples: &[f64]) -> f64 {
    let velocity = sums::step_energy(samples);
    let bend = |w: &[f64]| w[2] - 2.0 * w[1] + w[0];
    let acceleration: f64 = samples.windows(3).map(|w| bend(w) * bend(w)).sum();
    let n = samples.len() as f64;
    if velocity > 0.0 { n * (acceleration / velocity).sqrt() / (2.0 * std::f64::consts::PI) } else { 0.0 }
}

/// Where the `most` samples of most energy start, in steps of an eighth of that.
fn liveliest(samples: &[f64], most: usize) -> usize {
    if samples.len() <= most {
        return 0;
    }
    let starts = (0..=samples.len() - most).step_by(most / 8);
    starts
        .map(|s| (s, sums::energy(&samples[s..s + most])))
        .fold((0, f64::NEG_INFINITY), |best, next| if next.1 > best.1 { next } else { best })
        .0
}

/// out[k] = sum_i measured[i] target[i + k], compiled for the processor at hand.
struct Correlate<'a> {
    target: &'a [f64],
    measured: &'a [f64],
    out: &'a mut [f64],
}

impl NullaryFnOnce for Correlate<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        const LANES: usize = 32;
        let n = self.measured.len();
        for (k, out) in self.out.iter_mut().enumerate() {
            let target = &self.target[k..k + n];
            let (a, b) = (self.measured.chunks_exact(LANES), target.chunks_exact(LANES));
            let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(x, y)| x * y).sum();
            let mut lanes = [0.0; LANES];
            for (x, y) in a.zip(b) {
                for i in 0..LANES {
                    lanes[i] += x[i] * y[i];
                }
            }
            *out = lanes.iter().sum::<f64>() + rest;
        }
    }
}
