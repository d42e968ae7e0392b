//! What a signal was a moment ago, between its samples too.

use std::ops::{Add, Mul};

/// Displacement, velocity and acceleration of one point, SI units.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Motion {
    /// m
    pub displacement: f64,
    /// m/s
    pub velocity: f64,
    /// m/s^2
    pub acceleration: f64,
}

impl Add for Motion {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        Self {
            displacement: self.displacement + other.displacement,
            velocity: self.velocity + other.velocity,
            acceleration: self.acceleration + other.acceleration,
        }
    }
}

impl Mul<f64> for Motion {
    type Output = Self;

    #[inline]
    fn mul(self, factor: f64) -> Self {
        Self {
            displacement: self.displacement * factor,
            velocity: self.velocity * factor,
            acceleration: self.acceleration * factor,
        }
    }
}

/// Cubic Hermite interpolation over one step h at the fraction s: value and slope.
#[inline]
pub(crate) fn hermite(s: f64, h: f64, p0: f64, d0: f64, p1: f64, d1: f64) -> (f64, f64) {
    let (a, b) = (p1 - p0 - h * d0, h * d1 - (p1 - p0));
    let (c2, c3) = (2.0 * a - b, b - a);
    (p0 + s * (h * d0 + s * (c2 + s * c3)), d0 + s * (2.0 * c2 + 3.0 * s * c3) / h)
}

/// The polynomial of fifth degree through two motions h apart, at the fraction s: with its own velocity and acceleration.
#[inline]
pub(crate) fn quintic(s: f64, h: f64, from: Motion, to: Motion) -> Motion {
    let (v, a) = (h * from.velocity, 0.5 * h * h * from.acceleration);
    // What is missing at the end of displacement, velocity and acceleration.
    let d = to.displacement - from.displacement - v - a;
    let e = h * to.velocity - v - 2.0 * a;
    let f = h * h * to.acceleration - 2.0 * a;
    let (c3, c4, c5) = (10.0 * d - 4.0 * e + 0.5 * f, -15.0 * d + 7.0 * e - f, 6.0 * d - 3.0 * e + 0.5 * f);
    Motion {
        displacement: from.displacement + s * (v + s * (a + s * (c3 + s * (c4 + s * c5)))),
        velocity: (v + s * (2.0 * a + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))) / h,
        acceleration: (2.0 * a + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))) / (h * h),
    }
}

/// How far rounding may take the time of a sample from it, in samples.
const ROUNDING: f64 = 1e-9;

/// A target that is given, sample by sample; at rest before its first.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Course<'a> {
    samples: &'a [Motion],
    step_s: f64,
}

impl<'a> Course<'a> {
    pub(crate) fn new(samples: &'a [Motion], rate_hz: f64) -> Self {
        Self { samples, step_s: 1.0 / rate_hz }
    }

    /// The motion at a place counted in samples: between two of them the polynomial through both.
    #[inline]
    pub(crate) fn at(&self, place: f64) -> Motion {
        if place < -ROUNDING {
            return Motion::default();
        }
        // A sample is itself, however its time was rounded.
        let whole = (place + ROUNDING) as usize;
        let s = place - whole as f64;
        match (self.samples.get(whole), self.samples.get(whole + 1)) {
            (Some(from), _) if s < ROUNDING => *from,
            (Some(from), Some(to)) => quintic(s, self.step_s, *from, *to),
            _ => Motion::default(),
        }
    }
}

/// A constant distance behind the newest motion: the steps and the Hermite weights of the motions on either side.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tap {
    whole: usize,
    /// Motions that must have been.
    reach: usize,
    value: [f64; 4],
    slope: [f64; 4],
}

impl Tap {
    /// `steps` >= 0 of `step_s` behind the newest.
    pub(crate) fn new(steps: f64, step_s: f64) -> Self {
        let whole = steps as usize;
        let s = 1.0 - (steps - whole as f64);
        // The interpolant is linear in what it passes through: its weights are what it makes of ones.
        let [p0, d0, p1, d1] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
            .map(|[p0, d0, p1, d1]| hermite(s, step_s, p0, d0, p1, d1));
        Self {
            whole,
            reach: whole + usize::from(s < 1.0),
            value: [p0.0, d0.0, p1.0, d1.0],
            slope: [p0.1, d0.1, p1.1, d1.1],
        }
    }
}

/// The last motions of a point on a grid of steps, in a ring; at rest before the first.
#[derive(Debug, Clone)]
pub(crate) struct History {
    ring: Vec<Motion>,
    mask: usize,
    n_pushed: usize,
    step_s: f64,
}

impl History {
    /// Keeps at least `reach` steps.
    pub(crate) fn new(reach: f64, step_s: f64) -> Self {
        let len = (reach.ceil() as usize + 4).next_power_of_two();
        Self { ring: vec![Motion::default(); len], mask: len - 1, n_pushed: 0, step_s }
    }

    #[inline]
    pub(crate) fn push(&mut self, motion: Motion) {
        self.ring[self.n_pushed & self.mask] = motion;
        self.n_pushed += 1;
    }

    /// Pushes a motion whose acceleration is not known yet: until then it is the last one's.
    #[inline]
    pub(crate) fn open(&mut self, displacement: f64, velocity: f64) {
        let acceleration = self.ring[self.n_pushed.wrapping_sub(1) & self.mask].acceleration;
        self.push(Motion { displacement, velocity, acceleration });
    }

    /// Sets the acceleration of the newest motion, which is known only once its force is.
    #[inline]
    pub(crate) fn accelerate(&mut self, acceleration: f64) {
        self.ring[self.n_pushed.wrapping_sub(1) & self.mask].acceleration = acceleration;
    }

    /// The motion `n` steps behind the newest.
    #[inline]
    pub(crate) fn back(&self, n: usize) -> Motion {
        if n >= self.n_pushed { Motion::default() } else { self.ring[(self.n_pushed - 1 - n) & self.mask] }
    }

    /// The motion `steps` >= 0 behind the newest, on a grid whose accelerations are known.
    ///
    /// Displacement is the cubic Hermite interpolant of displacement and velocity; velocity and acceleration are that of
    /// velocity and acceleration. Where `newest_is_open` (its acceleration is yet unknown), the last step's velocity is
    /// the slope of the first interpolant.
    #[inline]
    pub(crate) fn behind(&self, steps: f64, newest_is_open: bool) -> Motion {
        let whole = steps as usize;
        let s = steps - whole as f64;
        if s == 0.0 {
            return self.back(whole);
        }
        // Before the first motion there was rest, however it began.
        if whole + 1 >= self.n_pushed {
            return Motion::default();
        }
        let (new, old) = (self.back(whole), self.back(whole + 1));
        let (s, h) = (1.0 - s, self.step_s);
        let (displacement, slope) = hermite(s, h, old.displacement, old.velocity, new.displacement, new.velocity);
        if whole == 0 && newest_is_open {
            return Motion { displacement, velocity: slope, acceleration: (new.velocity - old.velocity) / h };
        }
        let (velocity, acceleration) = hermite(s, h, old.velocity, old.acceleration, new.velocity, new.acceleration);
        Motion { displacement, velocity, acceleration }
    }

    /// The same at a constant distance, on a grid whose newest acceleration is known; acceleration only where wanted.
    #[inline]
    pub(crate) fn at(&self, tap: &Tap, accelerated: bool) -> Motion {
        if tap.reach >= self.n_pushed {
            return Motion::default();
        }
        let new = self.n_pushed - 1 - tap.whole;
        let old = self.ring[new.wrapping_sub(1) & self.mask];
        let new = self.ring[new & self.mask];
        let (p, d) = (&tap.value, &tap.slope);
        let mix = |w: &[f64; 4], p0, d0, p1, d1| w[0] * p0 + w[1] * d0 + w[2] * p1 + w[3] * d1;
        Motion {
            displacement: mix(p, old.displacement, old.velocity, new.displacement, new.velocity),
            velocity: mix(p, old.velocity, old.acceleration, new.velocity, new.acceleration),
            acceleration: if accelerated {
                mix(d, old.velocity, old.acceleration, new.velocity, new.acceleration)
            } else {
                0.0
            },
        }
    }

    /// The same on a grid of samples, whose accelerations are only differences: velocity is the interpolant's slope,
    /// acceleration is linear between the samples.
    #[inline]
    pub(crate) fn behind_samples(&self, steps: f64) -> Motion {
        let whole = steps as usize;
        let s = steps - whole as f64;
        let new = self.back(whole);
        if s == 0.0 {
            return new;
        }
        let old = self.back(whole + 1);
        let (displacement, velocity) =
            hermite(1.0 - s, self.step_s, old.displacement, old.velocity, new.displacement, new.velocity);
        Motion { displacement, velocity, acceleration: new.acceleration + s * (old.acceleration - new.acceleration) }
    }
}

#[cfg(test)]
mod tests {
    use super::{Course, Motion, quintic};

    /// 1 + 2 t - t^2 + 3 t^3 - 2 t^4 + t^5 with its derivatives.
    fn polynomial(t: f64) -> Motion {
        Motion {
            displacement: 1.0 + t * (2.0 + t * (-1.0 + t * (3.0 + t * (-2.0 + t)))),
            velocity: 2.0 + t * (-2.0 + t * (9.0 + t * (-8.0 + t * 5.0))),
            acceleration: -2.0 + t * (18.0 + t * (-24.0 + t * 20.0)),
        }
    }

    fn assert_close(found: Motion, expected: Motion) {
        for (a, b) in [
            (found.displacement, expected.displacement),
            (found.velocity, expected.velocity),
            (found.acceleration, expected.acceleration),
        ] {
            assert!((a - b).abs() < 1e-12, "{found:?}, {expected:?}");
        }
    }

    #[test]
    fn a_polynomial_of_fifth_degree_is_found_again_between_its_ends() {
        for s in [0.0, 0.1, 0.5, 0.93, 1.0] {
            assert_close(quintic(s, 0.5, polynomial(1.0), polynomial(1.5)), polynomial(1.0 + 0.5 * s));
        }
    }

    #[test]
    fn a_given_target_is_itself_at_its_samples_and_rests_before_them() {
        let samples: Vec<Motion> = (0..5).map(|i| polynomial(f64::from(i) * 0.25)).collect();
        let course = Course::new(&samples, 4.0);
        assert_eq!(course.at(3.0 - 1e-12), samples[3]);
        assert_eq!(course.at(4.0), samples[4]);
        assert_eq!(course.at(-0.5), Motion::default());
        assert_close(course.at(2.6), polynomial(0.65));
    }
}
