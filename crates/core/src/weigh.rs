//! The sums of Eqs 7 and 12 over the kept bins, and what follows from them.

use std::ops::RangeInclusive;

use num_complex::Complex;

use crate::reason::Reason;
use crate::spectrum::{Bins, LANES, Sink, Spectrum};
use crate::tracking::{Tracking, delay};

/// Sums that lie well within double precision, with room for their smallest terms.
pub(crate) const SUMS: RangeInclusive<f64> = 1e-250..=1e280;

/// |I|^l from |I|^2.
#[inline(always)]
pub(crate) fn weight(squared: f64, power: u32) -> f64 {
    let even = squared.powi((power / 2) as i32);
    if power.is_multiple_of(2) { even } else { even * squared.sqrt() }
}

/// The sums of Eqs 7 and 12, frequency in bins.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sums {
    pub(crate) cross: Complex<f64>,
    pub(crate) power: f64,
    pub(crate) moment: f64,
    /// sum |I|^2, which is `power` for l = 2.
    pub(crate) energy: f64,
}

impl Sums {
    /// Adds what bin `k` holds.
    #[inline(always)]
    pub(crate) fn add_term(&mut self, term: &Term, k: usize) {
        self.cross.re += term.re;
        self.cross.im += term.im;
        self.power += term.power;
        self.moment += k as f64 * term.power;
        self.energy += term.squared;
    }

    /// Adds the sums over other bins.
    pub(crate) fn add(&mut self, other: &Sums) {
        self.cross += other.cross;
        self.power += other.power;
        self.moment += other.moment;
        self.energy += other.energy;
    }

    pub(crate) fn cross_size(&self) -> f64 {
        self.cross.re.abs().max(self.cross.im.abs())
    }

    /// Whether what measured adds lies well within double precision.
    pub(crate) fn measured_fits(&self, found: &Tracking) -> bool {
        SUMS.contains(&self.cross_size()) && SUMS.contains(&found.amplitude)
    }

    /// Eqs 10 and 11; `None` where the sums leave double precision or hold no more than `round_off`.
    pub(crate) fn tracking(&self, delta_f_hz: f64, round_off: f64) -> Option<Tracking> {
        let Self { cross, power, moment, energy } = *self;
        let in_range = SUMS.contains(&power) && SUMS.contains(&energy) && moment.is_finite();
        if !in_range || energy <= round_off {
            return None;
        }
        let fei = cross / power;
        let equivalent_frequency_hz = moment / power * delta_f_hz;
        // A sensor that reports nothing is not in time: it has no phase.
        // And -0 of an antiphase is pi, not -pi.
        let phase_rad = if self.cross_size() == 0.0 { f64::NAN } else { (fei.im + 0.0).atan2(fei.re) };
        Some(Tracking {
            fei,
            amplitude: fei.norm(),
            phase_rad,
            delay_s: delay(phase_rad, equivalent_frequency_hz),
            equivalent_frequency_hz,
            reason: None,
            ..Tracking::undetermined(Reason::Still)
        })
    }
}

/// What one bin adds to the sums.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Term {
    /// O conj(I) |I|^(l-2)
    pub(crate) re: f64,
    pub(crate) im: f64,
    /// |I|^l
    pub(crate) power: f64,
    /// |I|^2
    pub(crate) squared: f64,
}

impl Term {
    /// Of target (ir, ii) and measured (or, oi). `L` = 2 is compiled apart; 0 stands for any power.
    #[inline(always)]
    pub(crate) fn new<const L: u32>(weight_power: u32, (ir, ii): (f64, f64), (or, oi): (f64, f64)) -> Self {
        let squared = ir * ir + ii * ii;
        let (mut re, mut im) = (or * ir + oi * ii, oi * ir - or * ii);
        let mut power = squared;
        if L != 2 {
            power = weight(squared, weight_power);
            // l = 1: O conj(I) / |I| goes to zero with I.
            let factor = if squared > 0.0 { power / squared } else { 0.0 };
            re *= factor;
            im *= factor;
        }
        Self { re, im, power, squared }
    }
}

/// Sums over the kept bins of a pair of packed transforms, target first.
pub(crate) fn weigh(
    spectrum: &Spectrum,
    correction: Option<&[f64]>,
    weight_power: u32,
    pair: [&[Complex<f64>]; 2],
) -> Sums {
    fn sum<const L: u32, const CORRECT: bool>(
        spectrum: &Spectrum,
        pair: [&[Complex<f64>]; 2],
        mut weigh: Weigh<'_, L, CORRECT>,
    ) -> Sums {
        spectrum.visit_pair(pair, &mut weigh);
        weigh.sums()
    }
    let first = spectrum.first();
    match (weight_power, correction) {
        (2, None) => sum(spectrum, pair, Weigh::<2, false>::new(&[], 0, 2)),
        (2, Some(correction)) => sum(spectrum, pair, Weigh::<2, true>::new(correction, first, 2)),
        (power, None) => sum(spectrum, pair, Weigh::<0, false>::new(&[], 0, power)),
        (power, Some(correction)) => sum(spectrum, pair, Weigh::<0, true>::new(correction, first, power)),
    }
}

/// sum |I|^2 and sum k |I|^2 over the kept bins of one packed transform.
pub(crate) fn centroid(spectrum: &Spectrum, correction: Option<&[f64]>, bins: &[Complex<f64>]) -> (f64, f64) {
    fn sums<const CORRECT: bool>(
        spectrum: &Spectrum,
        bins: &[Complex<f64>],
        mut weigh: Weigh<'_, 2, CORRECT>,
    ) -> (f64, f64) {
        spectrum.visit_one(bins, &mut weigh);
        let Sums { power, moment, .. } = weigh.sums();
        (power, moment)
    }
    match correction {
        None => sums(spectrum, bins, Weigh::<2, false>::new(&[], 0, 2)),
        Some(correction) => sums(spectrum, bins, Weigh::<2, true>::new(correction, spectrum.first(), 2)),
    }
}

/// Adds up O conj(I) |I|^(l-2), |I|^l and k |I|^l. `L` = 2 is compiled apart; 0 stands for any power.
struct Weigh<'a, const L: u32, const CORRECT: bool> {
    correction: &'a [f64],
    first: usize,
    weight_power: u32,
    re: [f64; LANES],
    im: [f64; LANES],
    power: [f64; LANES],
    moment: [f64; LANES],
    energy: [f64; LANES],
}

impl<'a, const L: u32, const CORRECT: bool> Weigh<'a, L, CORRECT> {
    fn new(correction: &'a [f64], first: usize, weight_power: u32) -> Self {
        let zero = [0.0; LANES];
        Self { correction, first, weight_power, re: zero, im: zero, power: zero, moment: zero, energy: zero }
    }

    fn sums(&self) -> Sums {
        let total = |lanes: &[f64; LANES]| lanes.iter().sum::<f64>();
        Sums {
            cross: Complex::new(total(&self.re), total(&self.im)),
            power: total(&self.power),
            moment: total(&self.moment),
            energy: if L == 2 { total(&self.power) } else { total(&self.energy) },
        }
    }
}

impl<const L: u32, const CORRECT: bool> Sink for Weigh<'_, L, CORRECT> {
    #[inline(always)]
    fn take<const W: usize>(&mut self, bins: &Bins<W>) {
        for i in 0..W {
            let (mut ir, mut ii) = (bins.target_re[i], bins.target_im[i]);
            let (mut or, mut oi) = (bins.measured_re[i], bins.measured_im[i]);
            if CORRECT {
                let factor = self.correction[bins.first - self.first + i];
                (ir, ii, or, oi) = (ir * factor, ii * factor, or * factor, oi * factor);
            }
            let term = Term::new::<L>(self.weight_power, (ir, ii), (or, oi));
            if L != 2 {
                self.energy[i] += term.squared;
            }
            self.re[i] += term.re;
            self.im[i] += term.im;
            self.power[i] += term.power;
            self.moment[i] += (bins.first + i) as f64 * term.power;
        }
    }
}
