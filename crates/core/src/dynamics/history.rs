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

    #[inline]
    pub(crate) fn newest(&self) -> Motion {
        self.back(0)
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
