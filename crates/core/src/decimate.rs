//! Data decimation P, in two forms.
//!
//! `Cascade` serves the `spectral` decimator: it shortens the (circular) record so that a short transform gives the bins
//! that P keeps. [`Chebyshev`] is the paper's own route, in second-order sections.
//!
//! # The cascade
//! P keeps the frequencies up to f_c = rate / (2 P). Halving the rate folds onto them only what lies within f_c of the
//! input's Nyquist frequency, so a halving needs stopband there and nowhere else, and its droop in the passband is known and
//! divided out at the bins. The shortest symmetric filter that does this has all its zeros in that interval, equally
//! rippled (Dolph-Chebyshev): with u = cos(omega), c = cos(2 pi f_c / rate_in),
//!
//! ```text
//! H(omega) = T_M(v(u)) / T_M(v(1)),    v(u) = (2 u + 1 + c) / (1 - c),    2 M + 1 taps
//! ```
//!
//! |H| = 1 / T_M(v(1)) at most where it aliases, and M is the least that keeps the alias [`ALIAS_DB`] below what passes at
//! f_c. Early halvings need 7 or 9 taps. Up to three halvings are one pass over the samples (their taps convolved), and
//! the cascade stops at the rate 4 f_c, one octave above the
//! critical one, because the halving after that would be long.

use std::f64::consts::PI;

use num_complex::Complex;
use pulp::Simd;

use crate::error::{Error, Result};

/// Rejection of what would alias onto a kept bin, relative to the gain of that bin, in decibels.
pub const ALIAS_DB: f64 = 200.0;

/// Halvings that share one pass: eight samples in, one out.
const MAX_HALVINGS: usize = 3;
/// Width of the accumulators, whatever the processor: fixes the order of the additions.
const LANES: usize = 8;
/// Vectors in flight, to cover the latency of the additions.
const IN_FLIGHT: usize = 8;
/// Samples that these take at most.
const MAX_BLOCK: usize = IN_FLIGHT * LANES;
/// Below this many points a transform is cheaper than another pass.
const SHORTEST: usize = 512;
/// A pass of fewer halvings saves little of the transform: below this many points it costs as much itself.
const SHORTEST_PARTIAL: usize = 8192;

/// How P is carried out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Decimator {
    /// Exactly the bins up to rate / (2 P) of the undecimated transform.
    #[default]
    Spectral,
    /// Chebyshev I, order 8, 0.05 dB, forwards and backwards, then every P-th sample from the first on.
    Chebyshev,
}

impl Decimator {
    /// All choices with their names.
    pub const NAMES: [(&'static str, Decimator); 2] =
        [("spectral", Decimator::Spectral), ("chebyshev", Decimator::Chebyshev)];
}

/// One halving of the rate: degree M and the interval it stops.
#[derive(Debug, Clone, Copy)]
struct Halving {
    degree: usize,
    /// cos(2 pi f_c / rate_in)
    edge: f64,
}

impl Halving {
    /// The shortest halving that keeps `kept` (f_c over its input rate, at most 1/8) clean.
    fn new(kept: f64) -> Self {
        let edge = (2.0 * PI * kept).cos();
        let wanted = 10f64.powf(ALIAS_DB / 20.0);
        let mut halving = Halving { degree: 2, edge };
        // At f_c itself the filter already droops, so the rejection is counted from there.
        while chebyshev_polynomial(halving.degree, halving.argument(edge)) < wanted {
            halving.degree += 1;
        }
        halving
    }

    fn argument(&self, u: f64) -> f64 {
        (2.0 * u + 1.0 + self.edge) / (1.0 - self.edge)
    }

    /// H at omega = 2 pi f / rate_in.
    fn gain(&self, omega: f64) -> f64 {
        chebyshev_polynomial(self.degree, self.argument(omega.cos()))
            / chebyshev_polynomial(self.degree, self.argument(1.0))
    }

    /// The 2 M + 1 taps, by inverse transform of as many samples of H.
    fn taps(&self) -> Vec<f64> {
        let n = 2 * self.degree + 1;
        (0..n)
            .map(|j| {
                let lag = j as f64 - self.degree as f64;
                let sum: f64 = (0..n)
                    .map(|k| {
                        let omega = 2.0 * PI * k as f64 / n as f64;
                        self.gain(omega) * (omega * lag).cos()
                    })
                    .sum();
                sum / n as f64
            })
            .collect()
    }
}

/// T_M(v), which grows like (2 v)^M / 2 outside [-1, 1].
fn chebyshev_polynomial(degree: usize, v: f64) -> f64 {
    let m = degree as f64;
    if v.abs() <= 1.0 {
        (m * v.acos()).cos()
    } else {
        let sign = if v < 0.0 && degree % 2 == 1 { -1.0 } else { 1.0 };
        sign * (m * v.abs().acosh()).cosh()
    }
}

/// Up to three halvings in one pass over a circular sequence.
#[derive(Debug, Clone)]
struct Pass {
    /// Samples in for one out: 2, 4 or 8.
    factor: usize,
    /// Samples before and after the centre tap.
    reach: usize,
    /// `groups[a][lane]` = tap `factor * a + lane % factor`: LANES / factor outputs side by side.
    groups: Vec<[f64; LANES]>,
}

impl Pass {
    fn new(halvings: &[Halving]) -> Self {
        let mut taps = vec![1.0];
        for (s, halving) in halvings.iter().enumerate() {
            let stride = 1 << s;
            let stage = halving.taps();
            let mut product = vec![0.0; taps.len() + (stage.len() - 1) * stride];
            for (i, a) in taps.iter().enumerate() {
                for (j, b) in stage.iter().enumerate() {
                    product[i + j * stride] += a * b;
                }
            }
            taps = product;
        }
        let factor = 1 << halvings.len();
        let groups = (0..taps.len().div_ceil(factor))
            .map(|a| std::array::from_fn(|lane| taps.get(factor * a + lane % factor).copied().unwrap_or(0.0)))
            .collect();
        Self { factor, reach: (taps.len() - 1) / 2, groups }
    }

    /// Length of the buffer that [`Pass::run`] reads: the sequence with its wrapped ends, and room for the last block.
    fn padded_len(&self, n: usize) -> usize {
        n + self.groups.len() * self.factor + 2 * MAX_BLOCK
    }

    /// y[m] = sum_j h[j] x[(factor m + j - reach) mod n] for m = 0 .. n / factor.
    ///
    /// `padded` holds x from index `reach` on; of x only `[0, filled)` may differ from zero.
    #[inline(always)]
    fn run<S: Simd>(&self, simd: S, padded: &mut [f64], n: usize, filled: usize, out: &mut [f64]) {
        let n_out = n / self.factor;
        let (before, from) = (self.reach, self.reach + n);
        // The circle: what precedes sample 0 and what follows sample n - 1.
        padded.copy_within(from - before..from, 0);
        let after = padded.len() - from;
        for i in 0..after {
            padded[from + i] = if i < before { padded[before + i] } else { 0.0 };
        }
        // Outputs that read only zeros: from past the filled samples to where the circle closes.
        let quiet_from = (filled + self.reach).div_ceil(self.factor);
        let quiet_to = (n - self.reach.min(n)) / self.factor;
        if quiet_from + LANES < quiet_to {
            self.outputs(simd, padded, out, 0, quiet_from);
            out[quiet_from..quiet_to].fill(0.0);
            self.outputs(simd, padded, out, quiet_to, n_out);
        } else {
            self.outputs(simd, padded, out, 0, n_out);
        }
    }

    /// [`Pass::run`] on the samples `x` zero-padded to `n`, for a window of a longer record whose own outputs are known:
    /// `stream[i]` is the output centred on x[factor i]. Only those near the window's ends are computed anew, in the same
    /// order of additions, so that the bits are those of [`Pass::run`]. `padded` need not be prepared.
    #[inline(always)]
    fn run_window<S: Simd>(&self, simd: S, padded: &mut [f64], n: usize, x: &[f64], stream: &[f64], out: &mut [f64]) {
        let n_out = n / self.factor;
        let inner = self.reach.div_ceil(self.factor)..(x.len() - 1 - self.reach) / self.factor + 1;
        let at = |p: usize| if p < x.len() { x[p] } else { 0.0 };
        let margin = self.groups.len() * self.factor + MAX_BLOCK;
        for i in 0..self.reach {
            padded[i] = at(n - self.reach + i);
        }
        let head = (inner.start * self.factor + margin).min(x.len());
        padded[self.reach..self.reach + head].copy_from_slice(&x[..head]);
        self.outputs(simd, padded, out, 0, inner.start);
        out[inner.clone()].copy_from_slice(&stream[inner.clone()]);
        let tail = inner.end * self.factor - self.reach;
        padded[self.reach + tail..self.reach + x.len()].copy_from_slice(&x[tail..]);
        padded[self.reach + x.len()..].fill(0.0);
        for i in 0..self.reach {
            padded[self.reach + n + i] = x[i];
        }
        self.outputs(simd, padded, out, inner.end, n_out);
    }

    /// The outputs `[from, to)`.
    #[inline(always)]
    fn outputs<S: Simd>(&self, simd: S, padded: &[f64], out: &mut [f64], from: usize, to: usize) {
        match self.factor {
            2 => self.outputs_by::<S, 2>(simd, padded, out, from, to),
            4 => self.outputs_by::<S, 4>(simd, padded, out, from, to),
            _ => self.outputs_by::<S, 8>(simd, padded, out, from, to),
        }
    }

    #[inline(always)]
    fn outputs_by<S: Simd, const D: usize>(&self, simd: S, padded: &[f64], out: &mut [f64], from: usize, to: usize) {
        const STRIP: usize = 16;
        // The lanes go through memory before they are summed: else the compiler shapes the products after the sums.
        let mut lanes = [0.0f64; MAX_BLOCK * STRIP];
        let block = IN_FLIGHT * S::F64_LANES.min(LANES);
        let per_block = block / D;
        for m in (from..to).step_by(STRIP * per_block) {
            let strip = &mut out[m..to.min(m + STRIP * per_block)];
            let blocks = strip.len().div_ceil(per_block);
            let (sums, _) = S::as_mut_simd_f64s(&mut lanes);
            for (b, sums) in sums.chunks_exact_mut(IN_FLIGHT).take(blocks).enumerate() {
                let start = D * m + b * block;
                let x = &padded[start..start + D * (self.groups.len() - 1) + block];
                let mut acc = [simd.splat_f64s(0.0); IN_FLIGHT];
                for (a, taps) in self.groups.iter().enumerate() {
                    let (taps, _) = S::as_simd_f64s(taps);
                    let (x, _) = S::as_simd_f64s(&x[D * a..D * a + block]);
                    for v in 0..IN_FLIGHT {
                        acc[v] = simd.mul_add_e_f64s(taps[v % taps.len()], x[v], acc[v]);
                    }
                }
                // Where an output spans several vectors, their sum.
                let (mut left, mut stride) = (IN_FLIGHT, D);
                while stride > S::F64_LANES {
                    let per_output = stride / S::F64_LANES;
                    for v in 0..left / 2 {
                        let (output, part) = (v / (per_output / 2), v % (per_output / 2));
                        let at = output * per_output + part;
                        acc[v] = simd.add_f64s(acc[at], acc[at + per_output / 2]);
                    }
                    (left, stride) = (left / 2, stride / 2);
                }
                sums[..left].copy_from_slice(&acc[..left]);
            }
            for (y, sums) in strip.chunks_mut(per_block).zip(lanes.chunks_exact(IN_FLIGHT * S::F64_LANES)) {
                match D.min(S::F64_LANES) {
                    1 => y.copy_from_slice(&sums[..y.len()]),
                    2 => sum_each::<2>(sums, y),
                    4 => sum_each::<4>(sums, y),
                    _ => sum_each::<8>(sums, y),
                }
            }
        }
    }
}

/// The sums of D neighbouring lanes each.
#[inline(always)]
fn sum_each<const D: usize>(lanes: &[f64], out: &mut [f64]) {
    for (y, part) in out.iter_mut().zip(lanes.chunks_exact(D)) {
        *y = sum_by_halves::<D>(part);
    }
}

/// Sum of D lanes as a tree, which vectorises and rounds less than a chain.
#[inline(always)]
fn sum_by_halves<const D: usize>(lanes: &[f64]) -> f64 {
    let mut sums: [f64; D] = std::array::from_fn(|i| lanes[i]);
    let mut width = D;
    while width > 1 {
        width /= 2;
        for i in 0..width {
            sums[i] += sums[i + width];
        }
    }
    sums[0]
}

/// The passes that bring a circular record of `n` points down to `n / factor`, with their droop.
#[derive(Debug, Clone)]
pub(crate) struct Cascade {
    n: usize,
    halvings: Vec<Halving>,
    passes: Vec<Pass>,
}

impl Cascade {
    /// The cascade for a circular sequence of `n` points of which P = `data_decimation` keeps the lowest n / (2 P) bins.
    pub(crate) fn new(n: usize, data_decimation: usize) -> Self {
        let mut halvings = Vec::new();
        // One octave of guard: the last halving sees f_c at an eighth of its input rate.
        while (4 << halvings.len()) <= data_decimation && (n >> (halvings.len() + 1)) >= SHORTEST {
            halvings.push(Halving::new((1 << halvings.len()) as f64 / (2.0 * data_decimation as f64)));
        }
        if halvings.len() < MAX_HALVINGS && n < SHORTEST_PARTIAL {
            halvings.clear();
        }
        // Full passes last would leave a short first pass over the longest data; so they come first.
        let passes = halvings.chunks(MAX_HALVINGS).map(Pass::new).collect();
        Self { n, halvings, passes }
    }

    /// Length of the shortened sequence.
    pub(crate) fn out_len(&self) -> usize {
        self.n >> self.halvings.len()
    }

    /// Where in its input buffer the sequence starts, and how long that buffer is.
    pub(crate) fn input_layout(&self) -> (usize, usize) {
        self.passes.first().map_or((0, self.n), |p| (p.reach, p.padded_len(self.n)))
    }

    /// Length of the scratch that [`Cascade::run`] takes: the input buffers of all passes after the first.
    pub(crate) fn scratch_len(&self) -> usize {
        let mut n = self.n;
        let mut total = 0;
        for (i, pass) in self.passes.iter().enumerate() {
            if i > 0 {
                total += pass.padded_len(n);
            }
            n /= pass.factor;
        }
        total
    }

    /// Bin `j` of the shortened sequence over bin `j` of the n-point circle: the filters' gain, and their length ratio.
    pub(crate) fn gain(&self, j: usize) -> f64 {
        let omega = 2.0 * PI * j as f64 / self.n as f64;
        self.halvings.iter().enumerate().map(|(s, h)| 0.5 * h.gain(omega * (1u64 << s) as f64)).product()
    }

    /// True where there is nothing to do: P is 1 or 2, or the record is short.
    pub(crate) fn is_empty(&self) -> bool {
        self.passes.is_empty()
    }

    /// Shortens `input` (laid out as [`Cascade::input_layout`] says; `filled` samples of it may be non-zero) into `out`.
    #[inline(always)]
    pub(crate) fn run<S: Simd>(&self, simd: S, input: &mut [f64], filled: usize, scratch: &mut [f64], out: &mut [f64]) {
        self.run_from(
            simd,
            #[inline(always)]
            |pass, y| pass.run(simd, input, self.n, filled, y),
            scratch,
            out,
        );
    }

    /// The same for a window of a longer record, whose first pass is known inside: see [`Cascade::stream`].
    #[inline(always)]
    pub(crate) fn run_window<S: Simd>(
        &self,
        simd: S,
        x: &[f64],
        stream: &[f64],
        input: &mut [f64],
        scratch: &mut [f64],
        out: &mut [f64],
    ) {
        self.run_from(
            simd,
            #[inline(always)]
            |pass, y| pass.run_window(simd, input, self.n, x, stream, y),
            scratch,
            out,
        );
    }

    /// All passes, the first by `first`.
    #[inline(always)]
    fn run_from<S: Simd>(&self, simd: S, first: impl FnOnce(&Pass, &mut [f64]), scratch: &mut [f64], out: &mut [f64]) {
        let Some((pass, rest)) = self.passes.split_first() else { return };
        let mut n = self.n / pass.factor;
        let Some(next) = rest.first() else { return first(pass, &mut out[..n]) };
        let (mut input, mut scratch) = scratch.split_at_mut(next.padded_len(n));
        first(pass, &mut input[next.reach..next.reach + n]);
        for (i, pass) in rest.iter().enumerate() {
            let n_out = n / pass.factor;
            match rest.get(i + 1) {
                None => pass.run(simd, input, n, n, &mut out[..n_out]),
                Some(next) => {
                    let (padded, after) = scratch.split_at_mut(next.padded_len(n_out));
                    pass.run(simd, input, n, n, &mut padded[next.reach..next.reach + n_out]);
                    (input, scratch) = (padded, after);
                }
            }
            n = n_out;
        }
    }

    /// The first pass over a whole record, for windows of `window` samples that start at multiples of `hop`: output i is
    /// centred on sample factor * i. `None` where windows cannot share it.
    pub(crate) fn stream<S: Simd>(&self, simd: S, samples: &[f64], window: usize, hop: usize) -> Option<Stream> {
        let pass = self.passes.first()?;
        if !hop.is_multiple_of(pass.factor) || window <= 2 * pass.reach + pass.factor || window > self.n {
            return None;
        }
        let n_out = samples.len().div_ceil(pass.factor);
        let mut padded = vec![0.0; pass.padded_len(n_out * pass.factor)];
        padded[pass.reach..pass.reach + samples.len()].copy_from_slice(samples);
        let mut outputs = vec![0.0; n_out];
        pass.outputs(simd, &padded, &mut outputs, 0, n_out);
        Some(Stream { factor: pass.factor, outputs })
    }
}

/// A record through the first pass.
#[derive(Debug, Clone)]
pub(crate) struct Stream {
    factor: usize,
    outputs: Vec<f64>,
}

impl Stream {
    /// The outputs from sample `start` on, a multiple of the hop.
    pub(crate) fn from(&self, start: usize) -> &[f64] {
        &self.outputs[start / self.factor..]
    }
}

/// The paper's decimation: Chebyshev I low-pass of order 8, ripple 0.05 dB, cut-off 0.8 of the new Nyquist frequency, run
/// forwards and backwards, then every P-th sample starting at the first.
///
/// Four second-order sections, because the single 8th-order transfer function loses all accuracy above P = 64. Ends are
/// extended oddly by 27 samples and the sections start in the steady state of the first sample, as scipy's `sosfiltfilt`
/// does. MATLAB's `decimate` keeps the samples that end at the last one; ours start at the first.
#[derive(Debug, Clone)]
pub struct Chebyshev {
    factor: usize,
    sections: [Section; SECTIONS],
}

const SECTIONS: usize = 4;
const ORDER: usize = 2 * SECTIONS;
const RIPPLE_DB: f64 = 0.05;
const CUTOFF: f64 = 0.8;
/// Samples of odd extension at either end: three times the filter's length.
const EXTENSION: usize = 3 * (2 * SECTIONS + 1);

/// b0 (1 + z^-1)^2 / (1 + a1 z^-1 + a2 z^-2), with its steady state for a unit step.
#[derive(Debug, Clone, Copy)]
struct Section {
    b0: f64,
    a1: f64,
    a2: f64,
    gain: f64,
    steady: [f64; 2],
}

impl Chebyshev {
    /// Plans the decimation by `factor`, a power of two from 2 on.
    ///
    /// # Errors
    /// [`Error::NotPowerOfTwo`].
    pub fn new(factor: usize) -> Result<Self> {
        if factor < 2 || !factor.is_power_of_two() {
            return Err(Error::NotPowerOfTwo { name: "data_decimation", found: factor });
        }
        // Bilinear transform at a rate of 2, so that s = 4 (z - 1) / (z + 1) and the cut-off is prewarped.
        let epsilon = (10f64.powf(RIPPLE_DB / 10.0) - 1.0).sqrt();
        let mu = (1.0 / epsilon).asinh() / ORDER as f64;
        let warped = 4.0 * (PI * CUTOFF / factor as f64 / 2.0).tan();
        // Even order: the gain at zero frequency is the bottom of the ripple.
        let dc_gain = 1.0 / (1.0 + epsilon * epsilon).sqrt();
        let per_section = dc_gain.powf(1.0 / SECTIONS as f64);
        let mut sections = [Section { b0: 0.0, a1: 0.0, a2: 0.0, gain: 0.0, steady: [0.0; 2] }; SECTIONS];
        // From the pole nearest the origin (least resonant) outwards.
        for (k, section) in sections.iter_mut().enumerate() {
            let theta = PI * (2 * (SECTIONS - 1 - k) + 1) as f64 / (2 * ORDER) as f64;
            let pole = Complex::new(-mu.sinh() * theta.sin(), mu.cosh() * theta.cos()) * warped;
            let z = (4.0 + pole) / (4.0 - pole);
            // |1 - z|^2 is formed from the pole itself: near z = 1 (large P) the difference would cancel.
            let distance = (-2.0 * pole / (4.0 - pole)).norm_sqr();
            let b0 = per_section * distance / 4.0;
            let (a1, a2) = (-2.0 * z.re, z.norm_sqr());
            // Direct form II transposed, input 1 for ever: output = gain.
            let gain = per_section;
            *section = Section { b0, a1, a2, gain, steady: [gain - b0, b0 - a2 * gain] };
        }
        Ok(Self { factor, sections })
    }

    /// P.
    pub fn factor(&self) -> usize {
        self.factor
    }

    /// Samples left of `n`: the first and every P-th after it.
    pub fn out_len(&self, n: usize) -> usize {
        n.div_ceil(self.factor)
    }

    /// Least number of samples that can be filtered forwards and backwards.
    pub const MIN_SAMPLES: usize = EXTENSION + 1;

    /// Scratch samples that [`Chebyshev::run`] takes for `n` samples.
    pub fn scratch_len(&self, n: usize) -> usize {
        n + 2 * EXTENSION
    }

    /// Filters `samples` and writes every P-th to `out` ([`Chebyshev::out_len`] of them).
    ///
    /// # Errors
    /// [`Error::TooShortForChebyshev`].
    pub fn run(&self, samples: &[f64], scratch: &mut [f64], out: &mut [f64]) -> Result<()> {
        let n = samples.len();
        if n < Self::MIN_SAMPLES {
            return Err(Error::TooShortForChebyshev { expected: Self::MIN_SAMPLES, found: n });
        }
        let extended = &mut scratch[..n + 2 * EXTENSION];
        let (first, last) = (samples[0], samples[n - 1]);
        for i in 0..EXTENSION {
            extended[i] = 2.0 * first - samples[EXTENSION - i];
            extended[EXTENSION + n + i] = 2.0 * last - samples[n - 2 - i];
        }
        extended[EXTENSION..EXTENSION + n].copy_from_slice(samples);
        let start = extended[0];
        self.filter(start, extended.iter_mut());
        let start = extended[extended.len() - 1];
        self.filter(start, extended.iter_mut().rev());
        for (y, x) in out.iter_mut().zip(extended[EXTENSION..EXTENSION + n].iter().step_by(self.factor)) {
            *y = *x;
        }
        Ok(())
    }

    /// One run through the sections, started in the steady state of the input `start`.
    fn filter<'a>(&self, start: f64, samples: impl Iterator<Item = &'a mut f64>) {
        let mut state = [[0.0; 2]; SECTIONS];
        let mut level = start;
        for (s, section) in state.iter_mut().zip(&self.sections) {
            *s = section.steady.map(|v| v * level);
            level *= section.gain;
        }
        for x in samples {
            let mut v = *x;
            for (s, section) in state.iter_mut().zip(&self.sections) {
                let y = section.b0 * v + s[0];
                s[0] = 2.0 * section.b0 * v - section.a1 * y + s[1];
                s[1] = section.b0 * v - section.a2 * y;
                v = y;
            }
            *x = v;
        }
    }
}
