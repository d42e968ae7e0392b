//! From samples to the bins that P, Q and the band keep.
//!
//! The record of L samples is detrended, windowed and zero-padded to n = 2^ceil(log2 L) points; p = n / 2 (Eq 8); bin k lies
//! at f_k = k rate / n (Eq 9). Kept are k = Q, 2 Q, 3 Q, ... up to p / P, inside the band (both ends included).
//!
//! * Every Q-th bin of an n-point transform is the (n / Q)-point transform of the record *folded*: cut into blocks of
//!   n / Q samples and added up. One pass of additions, no approximation.
//! * The lowest n / (2 P) bins come from a shorter sequence ([`crate::decimate`]), whose droop is divided out.
//! * The real sequence is transformed as half as many complex points, and unpacked while it is summed.

use std::f64::consts::PI;
use std::sync::Arc;

use num_complex::Complex;
use pulp::{Arch, NullaryFnOnce, Simd, WithSimd};
use rustfft::{Fft, FftPlanner};

use crate::decimate::{Cascade, Stream};
use crate::error::{Error, Result};
use crate::window::{Detrend, Window};

/// Lanes in which bins are unpacked and summed.
pub(crate) const LANES: usize = 4;

/// Bytes of a cache line.
const ALIGNMENT: usize = 64;

/// What decides which bins are kept and how a record becomes bins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SpectrumConfig {
    pub(crate) n_samples: usize,
    pub(crate) rate_hz: f64,
    pub(crate) data_decimation: usize,
    pub(crate) frequency_decimation: usize,
    pub(crate) window: Window,
    pub(crate) detrend: Detrend,
    pub(crate) band_hz: Option<(f64, f64)>,
}

/// Which bins are kept: what can be said, and refused, before anything is planned.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Layout {
    config: SpectrumConfig,
    fft_len: usize,
    folded_len: usize,
    /// First and last kept bin of the folded transform.
    first: usize,
    last: usize,
}

/// The checked, immutable plan: one for all records of one length.
pub(crate) struct Spectrum {
    layout: Layout,
    window: Option<Vec<f64>>,
    cascade: Cascade,
    transform: Transform,
    arch: Arch,
}

/// Buffers of one evaluation: the packed transforms of both signals and the scratch between.
#[derive(Debug, Clone, Default)]
pub(crate) struct SpectrumState {
    pub(crate) target: Vec<Complex<f64>>,
    pub(crate) measured: Vec<Complex<f64>>,
    pub(crate) scratch: Scratch,
}

impl SpectrumState {
    pub(crate) fn pair(&self) -> [&[Complex<f64>]; 2] {
        [&self.target, &self.measured]
    }
}

/// What one transform needs beside its result.
#[derive(Debug, Clone, Default)]
pub(crate) struct Scratch {
    /// Input of the cascade, and scratch of the transform: never needed at once.
    transform: Vec<Complex<f64>>,
    passes: Vec<f64>,
}

impl Layout {
    /// # Errors
    /// [`Error::NotPowerOfTwo`], [`Error::Band`], [`Error::NoBin`].
    pub(crate) fn new(config: SpectrumConfig) -> Result<Self> {
        let SpectrumConfig { n_samples, rate_hz, data_decimation, frequency_decimation, .. } = config;
        for (name, factor) in [("data_decimation", data_decimation), ("frequency_decimation", frequency_decimation)] {
            if !factor.is_power_of_two() {
                return Err(Error::NotPowerOfTwo { name, found: factor });
            }
        }
        if let Some((low_hz, high_hz)) = config.band_hz
            && !(low_hz.is_finite() && high_hz.is_finite() && 0.0 <= low_hz && low_hz <= high_hz)
        {
            return Err(Error::Band { low_hz, high_hz });
        }
        let fft_len = n_samples.next_power_of_two();
        let delta_f = rate_hz / fft_len as f64 * frequency_decimation as f64;
        let (mut first, mut last) = (1, fft_len / 2 / data_decimation / frequency_decimation);
        let available_hz = if last == 0 { (f64::NAN, f64::NAN) } else { (delta_f, last as f64 * delta_f) };
        if let Some((low, high)) = config.band_hz {
            // Compare frequencies, not quotients: an end that is a bin is kept.
            first = first.max(((low / delta_f).floor() as usize).min(last + 1).saturating_sub(1));
            while first <= last && (first as f64) * delta_f < low {
                first += 1;
            }
            last = last.min(((high / delta_f).ceil() as usize).saturating_add(1));
            while last >= first && (last as f64) * delta_f > high {
                last -= 1;
            }
            first = first.max(1);
        }
        if last < first {
            return Err(Error::NoBin {
                fft_len,
                data_decimation,
                frequency_decimation,
                available_hz,
                band_hz: config.band_hz,
            });
        }
        Ok(Self { config, fft_len, folded_len: fft_len / frequency_decimation, first, last })
    }

    /// n, the length of the zero-padded record.
    pub(crate) fn fft_len(&self) -> usize {
        self.fft_len
    }

    pub(crate) fn n_bins(&self) -> usize {
        self.last - self.first + 1
    }

    /// Spacing of the kept bins, Q rate / n, in hertz.
    pub(crate) fn delta_f_hz(&self) -> f64 {
        self.config.rate_hz / self.fft_len as f64 * self.config.frequency_decimation as f64
    }
}

impl Spectrum {
    /// # Errors
    /// Those of [`Layout::new`].
    pub(crate) fn new(config: SpectrumConfig) -> Result<Self> {
        Ok(Self::of(Layout::new(config)?))
    }

    /// The plan of bins that have been checked.
    pub(crate) fn of(layout: Layout) -> Self {
        let Layout { config, folded_len, .. } = layout;
        let cascade = Cascade::new(folded_len, config.data_decimation);
        Self {
            layout,
            window: config.window.coefficients(config.n_samples),
            transform: Transform::new(cascade.out_len() / 2),
            cascade,
            arch: Arch::new(),
        }
    }

    /// n, the length of the zero-padded record.
    pub(crate) fn fft_len(&self) -> usize {
        self.layout.fft_len
    }

    /// n / Q, the length of the folded record.
    pub(crate) fn folded_len(&self) -> usize {
        self.layout.folded_len
    }

    pub(crate) fn n_bins(&self) -> usize {
        self.layout.n_bins()
    }

    /// Spacing of the kept bins, Q rate / n, in hertz.
    pub(crate) fn delta_f_hz(&self) -> f64 {
        self.layout.delta_f_hz()
    }

    /// Index of the first kept bin in units of [`Spectrum::delta_f_hz`].
    pub(crate) fn first(&self) -> usize {
        self.layout.first
    }

    /// What makes good the droop of the cascade, a factor for each kept bin; `None` where there is no cascade.
    pub(crate) fn correction(&self) -> Option<Vec<f64>> {
        if self.cascade.is_empty() {
            return None;
        }
        Some((self.layout.first..=self.layout.last).map(|j| 1.0 / self.cascade.gain(j)).collect())
    }

    pub(crate) fn state(&self) -> SpectrumState {
        SpectrumState { target: self.packed(), measured: self.packed(), scratch: self.scratch() }
    }

    /// Room for the packed transform of one signal.
    pub(crate) fn packed(&self) -> Vec<Complex<f64>> {
        // Zeroed by the system: of what is never touched, nothing becomes resident.
        bytemuck::zeroed_vec(self.packed_len())
    }

    pub(crate) fn packed_len(&self) -> usize {
        self.cascade.out_len() / 2
    }

    pub(crate) fn scratch(&self) -> Scratch {
        let (_, input_len) = self.cascade.input_layout();
        let input_len =
            if self.cascade.is_empty() { 0 } else { (input_len + ALIGNMENT / size_of::<f64>()).div_ceil(2) };
        Scratch {
            transform: bytemuck::zeroed_vec(self.transform.fft.get_inplace_scratch_len().max(input_len)),
            passes: vec![0.0; self.cascade.scratch_len()],
        }
    }

    /// Transforms both signals into the state's packed buffers.
    pub(crate) fn transform(&self, state: &mut SpectrumState, target: &[f64], measured: &[f64]) {
        self.transform_with(state, [(target, None), (measured, None)]);
    }

    /// The same for windows of longer records whose [`Spectrum::stream`] is given from the window's start on.
    pub(crate) fn transform_with(&self, state: &mut SpectrumState, signals: [(&[f64], Option<&[f64]>); 2]) {
        let SpectrumState { target, measured, scratch } = state;
        for ((samples, stream), bins) in signals.into_iter().zip([target, measured]) {
            self.transform_one(scratch, samples, stream, bins);
        }
    }

    /// Transforms one signal into `bins`, a [`Spectrum::packed`].
    pub(crate) fn transform_one(
        &self,
        scratch: &mut Scratch,
        samples: &[f64],
        stream: Option<&[f64]>,
        bins: &mut [Complex<f64>],
    ) {
        let Scratch { transform, passes } = scratch;
        let out = bytemuck::cast_slice_mut(bins);
        self.arch.dispatch(Shorten { plan: self, samples, stream, out, scratch: transform, passes });
        self.transform.fft.process_with_scratch(bins, transform);
    }

    /// Prepares both signals as [`Spectrum::transform`] does, and stops before the transform.
    pub(crate) fn shorten_both(&self, state: &mut SpectrumState, target: &[f64], measured: &[f64]) {
        let SpectrumState { target: first, measured: second, scratch: Scratch { transform, passes } } = state;
        for (samples, out) in [(target, first), (measured, second)] {
            let out = bytemuck::cast_slice_mut(out);
            self.arch.dispatch(Shorten { plan: self, samples, stream: None, out, scratch: transform, passes });
        }
    }

    /// Length of the sequence that is transformed, and how much of it may differ from zero.
    pub(crate) fn sequence_len(&self) -> (usize, usize) {
        let len = self.cascade.out_len();
        (len, if self.cascade.is_empty() { len.min(self.layout.config.n_samples) } else { len })
    }

    /// What windows that start at multiples of `hop` share: the cascade's first pass, where nothing is done to the samples
    /// before it.
    pub(crate) fn stream(&self, samples: &[f64], hop: usize) -> Option<Stream> {
        let Layout { config, fft_len, folded_len, .. } = self.layout;
        let plain = self.window.is_none() && config.detrend == Detrend::None && folded_len == fft_len;
        if !plain {
            return None;
        }
        self.arch.dispatch(MakeStream { plan: self, samples, hop })
    }

    /// Detrends, windows, zero-pads, folds and decimates one signal into `out`.
    #[inline(always)]
    fn shorten<S: Simd>(
        &self,
        simd: S,
        samples: &[f64],
        stream: Option<&[f64]>,
        out: &mut [f64],
        scratch: &mut [Complex<f64>],
        passes: &mut [f64],
    ) {
        if self.cascade.is_empty() {
            self.fold(samples, out);
            return;
        }
        let (start, len) = self.cascade.input_layout();
        let input: &mut [f64] = bytemuck::cast_slice_mut(scratch);
        // On a cache line's start no load of the cascade straddles two.
        let skip = input.as_ptr().align_offset(ALIGNMENT).min(ALIGNMENT / size_of::<f64>());
        let input = &mut input[skip..skip + len];
        if let Some(stream) = stream {
            self.cascade.run_window(simd, samples, stream, input, passes, out);
            return;
        }
        let folded_len = self.layout.folded_len;
        self.fold(samples, &mut input[start..start + folded_len]);
        self.cascade.run(simd, input, samples.len().min(folded_len), passes, out);
    }

    /// out[i] = sum over blocks of (w x)[i + block * n / Q], zero past the last sample.
    #[inline(always)]
    fn fold(&self, samples: &[f64], out: &mut [f64]) {
        // A strip of the output stays in the nearest cache while the blocks pass by.
        const STRIP: usize = 1024;
        let block_len = out.len();
        let line = self.layout.config.detrend.line(samples);
        let window = self.window.as_deref();
        for (s, strip) in out.chunks_mut(STRIP).enumerate() {
            let mut at = s * STRIP;
            let mut added = false;
            while at < samples.len() {
                let len = strip.len().min(samples.len() - at);
                let x = &samples[at..at + len];
                match (window, line, added) {
                    (None, None, false) => strip[..len].copy_from_slice(x),
                    (None, None, true) => strip[..len].iter_mut().zip(x).for_each(|(y, x)| *y += x),
                    (Some(w), None, _) => {
                        let w = &w[at..at + len];
                        if added {
                            strip[..len].iter_mut().zip(x.iter().zip(w)).for_each(|(y, (x, w))| *y += w * x);
                        } else {
                            strip[..len].iter_mut().zip(x.iter().zip(w)).for_each(|(y, (x, w))| *y = w * x);
                        }
                    }
                    (None, Some(line), _) if line.is_level() => {
                        let level = line.at_f64(0.0);
                        if added {
                            strip[..len].iter_mut().zip(x).for_each(|(y, x)| *y += x - level);
                        } else {
                            strip[..len].iter_mut().zip(x).for_each(|(y, x)| *y = x - level);
                        }
                    }
                    (w, Some(line), _) => {
                        for i in 0..len {
                            let v = x[i] - line.at(at + i);
                            let v = w.map_or(v, |w| w[at + i] * v);
                            strip[i] = if added { strip[i] + v } else { v };
                        }
                    }
                }
                if !added {
                    strip[len..].fill(0.0);
                    added = true;
                }
                at += block_len;
            }
            if !added {
                strip.fill(0.0);
            }
        }
    }

    /// Hands every kept bin to `sink`, some in groups of [`LANES`] neighbours, in no particular order.
    pub(crate) fn visit<S: Sink>(&self, state: &SpectrumState, sink: &mut S) {
        self.visit_pair(state.pair(), sink);
    }

    /// The same for one packed transform, in the target's place; what stands in measured's is zero.
    pub(crate) fn visit_one<S: Sink>(&self, bins: &[Complex<f64>], sink: &mut S) {
        self.arch.dispatch(Visit::<S, false> { plan: self, pair: [bins, bins], sink });
    }

    /// The same for any two packed transforms, the first in the target's place.
    pub(crate) fn visit_pair<S: Sink>(&self, pair: [&[Complex<f64>]; 2], sink: &mut S) {
        self.arch.dispatch(Visit::<S, true> { plan: self, pair, sink });
    }
}

/// [`Spectrum::shorten`] compiled for the processor at hand. (A closure would not be inlined into the dispatch.)
struct Shorten<'a> {
    plan: &'a Spectrum,
    samples: &'a [f64],
    stream: Option<&'a [f64]>,
    out: &'a mut [f64],
    scratch: &'a mut [Complex<f64>],
    passes: &'a mut [f64],
}

impl WithSimd for Shorten<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.plan.shorten(simd, self.samples, self.stream, self.out, self.scratch, self.passes);
    }
}

/// [`Cascade::stream`] compiled for the processor at hand.
struct MakeStream<'a> {
    plan: &'a Spectrum,
    samples: &'a [f64],
    hop: usize,
}

impl WithSimd for MakeStream<'_> {
    type Output = Option<Stream>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Option<Stream> {
        self.plan.cascade.stream(simd, self.samples, self.plan.layout.config.n_samples, self.hop)
    }
}

/// [`Unpack::visit`] compiled for the processor at hand, of both signals or of the first.
struct Visit<'a, S, const BOTH: bool> {
    plan: &'a Spectrum,
    pair: [&'a [Complex<f64>]; 2],
    sink: &'a mut S,
}

impl<S: Sink, const BOTH: bool> NullaryFnOnce for Visit<'_, S, BOTH> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Spectrum { layout: Layout { first, last, .. }, transform, .. } = self.plan;
        let [target, measured] = self.pair;
        transform.unpack.visit::<S, BOTH>(target, measured, *first, *last, self.sink);
    }
}

/// The transform of a length with its tables.
struct Transform {
    fft: Arc<dyn Fft<f64>>,
    unpack: Unpack,
}

impl Transform {
    /// Of `half` complex points.
    fn new(half: usize) -> Self {
        Self { fft: FftPlanner::new().plan_fft_forward(half), unpack: Unpack::new(half) }
    }
}

/// Takes bins of target and measured as they are unpacked.
pub(crate) trait Sink {
    /// Bins at `indices` (of the folded transform): real and imaginary parts of target and measured.
    fn take<const W: usize>(&mut self, bins: &Bins<W>);
}

/// W bins of both signals.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bins<const W: usize> {
    /// Index of the lowest of them; they are neighbours, in ascending order.
    pub(crate) first: usize,
    pub(crate) target_re: [f64; W],
    pub(crate) target_im: [f64; W],
    pub(crate) measured_re: [f64; W],
    pub(crate) measured_im: [f64; W],
}

/// The packed transform of a real sequence of N = 2 H points, z_i = x_2i + j x_2i+1, is unpacked by
///
/// ```text
/// X_k = E_k + W^k D_k,   E_k = (Z_k + conj Z_(H-k)) / 2,   D_k = -j (Z_k - conj Z_(H-k)) / 2,   W = exp(-2 pi j / N)
/// X_(H-k) = conj(E_k - W^k D_k)
/// ```
struct Unpack {
    half: usize,
    /// W^k for k = 1, 1 + LANES, 1 + 2 LANES, ...
    coarse: Vec<Complex<f64>>,
    /// W^0 .. W^(LANES-1)
    fine: [Complex<f64>; LANES],
    /// W^k of the bins in the middle that the groups leave, from the first of them on.
    middle: Vec<Complex<f64>>,
}

impl Unpack {
    fn new(half: usize) -> Self {
        let twiddle = |k: usize| Complex::from_polar(1.0, -PI * k as f64 / half as f64);
        let groups = (half / 2).saturating_sub(1) / LANES;
        let grouped = groups * LANES;
        Self {
            half,
            coarse: (0..groups).map(|g| twiddle(1 + g * LANES)).collect(),
            fine: std::array::from_fn(twiddle),
            middle: (grouped + 1..half - grouped).map(twiddle).collect(),
        }
    }

    /// Bin `k` alone, 0 < k <= H, with its W^k.
    #[inline(always)]
    fn bin(&self, z: &[Complex<f64>], k: usize, twiddle: Complex<f64>) -> Complex<f64> {
        let half = self.half;
        let (a, b) = (z[k % half], z[half - k].conj());
        let difference = a - b;
        (a + b) * 0.5 + twiddle * Complex::new(difference.im, -difference.re) * 0.5
    }

    #[inline(always)]
    fn single<S: Sink, const BOTH: bool>(
        &self,
        target: &[Complex<f64>],
        measured: &[Complex<f64>],
        k: usize,
        twiddle: Complex<f64>,
        sink: &mut S,
    ) {
        let t = self.bin(target, k, twiddle);
        let m = if BOTH { self.bin(measured, k, twiddle) } else { Complex::new(0.0, 0.0) };
        sink.take(&Bins::<1> {
            first: k,
            target_re: [t.re],
            target_im: [t.im],
            measured_re: [m.re],
            measured_im: [m.im],
        });
    }

    #[inline(always)]
    fn visit<S: Sink, const BOTH: bool>(
        &self,
        target: &[Complex<f64>],
        measured: &[Complex<f64>],
        first: usize,
        last: usize,
        sink: &mut S,
    ) {
        let half = self.half;
        // Pairs (k, H - k), 0 < k < H / 2, in groups; the lower of each pair always, the upper where it is kept.
        let grouped = self.coarse.len() * LANES;
        let kept = |k: usize| first <= k && k <= last;
        for (g, &coarse) in self.coarse.iter().enumerate() {
            let k = 1 + g * LANES;
            let upper = half - k - (LANES - 1);
            let lower_needed = k <= last && k + LANES > first;
            let upper_needed = upper <= last && upper + LANES > first;
            if !(lower_needed || upper_needed) {
                continue;
            }
            let mut twiddle = [Complex::new(0.0, 0.0); LANES];
            for i in 0..LANES {
                twiddle[i] = coarse * self.fine[i];
            }
            let (t_low, t_high) = unpack_group(target, half, k, &twiddle);
            let zero = ([0.0; LANES], [0.0; LANES]);
            let (m_low, m_high) = if BOTH { unpack_group(measured, half, k, &twiddle) } else { (zero, zero) };
            if lower_needed {
                hand_over(first, last, &group(k, t_low, m_low), sink);
            }
            if upper_needed {
                hand_over(first, last, &group(upper, t_high, m_high), sink);
            }
        }
        // What the groups leave: the middle bins and the Nyquist bin (k = H).
        for k in first.max(grouped + 1)..(half - grouped).min(last + 1) {
            self.single::<S, BOTH>(target, measured, k, self.middle[k - grouped - 1], sink);
        }
        if kept(half) {
            self.single::<S, BOTH>(target, measured, half, Complex::new(-1.0, 0.0), sink);
        }
    }
}

type Lanes = ([f64; LANES], [f64; LANES]);

/// Bins of both signals from `first` on.
#[inline(always)]
fn group(first: usize, (target_re, target_im): Lanes, (measured_re, measured_im): Lanes) -> Bins<LANES> {
    Bins { first, target_re, target_im, measured_re, measured_im }
}

/// Gives the bins to `sink`, those that are kept.
#[inline(always)]
fn hand_over<S: Sink>(first: usize, last: usize, bins: &Bins<LANES>, sink: &mut S) {
    if first <= bins.first && bins.first + LANES - 1 <= last {
        sink.take(bins);
    } else {
        hand_over_some(first, last, bins, sink);
    }
}

/// The same at an end of what is kept. Apart, so that the loop over the others stays short.
#[cold]
#[inline(never)]
fn hand_over_some<S: Sink>(first: usize, last: usize, bins: &Bins<LANES>, sink: &mut S) {
    for i in (0..LANES).filter(|i| (first..=last).contains(&(bins.first + i))) {
        sink.take(&Bins::<1> {
            first: bins.first + i,
            target_re: [bins.target_re[i]],
            target_im: [bins.target_im[i]],
            measured_re: [bins.measured_re[i]],
            measured_im: [bins.measured_im[i]],
        });
    }
}

/// Bins k .. k + LANES and H - k - LANES + 1 ..= H - k of one packed transform.
#[inline(always)]
fn unpack_group(z: &[Complex<f64>], half: usize, k: usize, twiddle: &[Complex<f64>; LANES]) -> (Lanes, Lanes) {
    let low = &z[k..k + LANES];
    let high = &z[half - k - (LANES - 1)..half - k + 1];
    let mut lower = ([0.0; LANES], [0.0; LANES]);
    let mut upper = ([0.0; LANES], [0.0; LANES]);
    for i in 0..LANES {
        let (a, b) = (low[i], high[LANES - 1 - i]);
        let (even_re, even_im) = (0.5 * (a.re + b.re), 0.5 * (a.im - b.im));
        // -j (a - conj b) / 2
        let (odd_re, odd_im) = (0.5 * (a.im + b.im), -0.5 * (a.re - b.re));
        let (t_re, t_im) =
            (twiddle[i].re * odd_re - twiddle[i].im * odd_im, twiddle[i].re * odd_im + twiddle[i].im * odd_re);
        lower.0[i] = even_re + t_re;
        lower.1[i] = even_im + t_im;
        upper.0[LANES - 1 - i] = even_re - t_re;
        upper.1[LANES - 1 - i] = t_im - even_im;
    }
    (lower, upper)
}
