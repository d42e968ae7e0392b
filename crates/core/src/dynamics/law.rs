//! Restoring forces: what a spring, a damper or a yielding member answers to being moved.

use super::check::{Checks, nonnegative, positive};

/// What a law remembers of its past: z of Bouc-Wen and its dissipated energy, or the force of a Maxwell element.
pub type Memory = [f64; 2];

/// Most internal steps a sample.
const MAX_STEPS: f64 = 1e3;

/// A restoring force r(x, x'), in newtons, of displacement in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Law {
    /// r = k x
    Spring {
        /// k, N/m.
        stiffness: f64,
    },
    /// r = c x'
    Dashpot {
        /// c, N s/m.
        damping: f64,
    },
    /// r = k x + c x'
    KelvinVoigt {
        /// k, N/m.
        stiffness: f64,
        /// c, N s/m.
        damping: f64,
    },
    /// r' = k x' - (k / c) r: spring and dashpot in series.
    Maxwell {
        /// k, N/m.
        stiffness: f64,
        /// c, N s/m.
        damping: f64,
    },
    /// Eq 13 of Guo, Xu and Chen (2014).
    BoucWen(BoucWen),
    /// Bouc-Wen that degrades with the energy e it has dissipated, e' = (1 - eta) z x' / x_y (Baber and Wen 1981):
    /// x_y z' = (x' - nu (gamma |x'| z |z|^(q-1) + beta x' |z|^q)) / mu, nu = 1 + strength e, mu = 1 + stiffness e.
    BaberWen {
        /// The law without degradation.
        hysteresis: BoucWen,
        /// Growth of nu: strength lost.
        strength: f64,
        /// Growth of mu: stiffness lost.
        stiffness: f64,
    },
}

/// r = eta k x + (1 - eta) k x_y z, x_y z' = x' - gamma |x'| z |z|^(q-1) - beta x' |z|^q (Eq 13).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoucWen {
    /// k, N/m: elastic stiffness.
    pub stiffness: f64,
    /// x_y, m.
    pub yield_displacement: f64,
    /// eta: stiffness after over before yielding.
    pub post_yield_ratio: f64,
    /// beta.
    pub beta: f64,
    /// gamma.
    pub gamma: f64,
    /// q.
    pub exponent: f64,
}

impl BoucWen {
    /// z' with strength lost by the factor nu. The only division is of the velocity, which does not wait for z.
    #[inline]
    fn rate(&self, velocity: f64, z: f64, nu: f64) -> f64 {
        let pace = velocity / self.yield_displacement;
        let size = z.abs();
        let power = if self.exponent == 2.0 { size * size } else { size.powf(self.exponent) };
        // Beyond its limit z is a stage's overshoot: a power of it would only send the next stage further.
        let power = power.min(1.0 / (self.beta + self.gamma));
        pace - nu * power * (self.gamma * pace.abs().copysign(z) + self.beta * pace)
    }

    fn force(&self, displacement: f64, z: f64) -> f64 {
        self.stiffness
            * (self.post_yield_ratio * displacement + (1.0 - self.post_yield_ratio) * self.yield_displacement * z)
    }

    fn check(&self, checks: &mut Checks) {
        positive(checks, "stiffness_n_per_m", self.stiffness);
        positive(checks, "yield_displacement_m", self.yield_displacement);
        checks.demand(
            "post_yield_ratio",
            (0.0..=1.0).contains(&self.post_yield_ratio),
            "a ratio from 0 to 1",
            self.post_yield_ratio,
        );
        // z stays within (beta + gamma)^(-1/q); without a positive sum it grows without bound.
        for (key, value) in [("beta", self.beta), ("gamma", self.gamma)] {
            checks.demand(key, value.is_finite(), "a finite number", value);
        }
        let sum = self.beta + self.gamma;
        let unloads = !(self.gamma < 0.0 && sum > 0.0);
        checks.demand("gamma", unloads, "a number of at least 0, or z has no bound when it unloads", self.gamma);
        checks.demand(
            "gamma",
            sum > 0.0 || !sum.is_finite(),
            "beta + gamma to be positive, or the force has no bound",
            sum,
        );
        checks.demand("exponent", (0.5..=64.0).contains(&self.exponent), "a number from 0.5 to 64", self.exponent);
    }
}

impl Law {
    /// The memory's rate of change at this velocity.
    #[inline]
    pub fn rate(&self, velocity: f64, memory: &Memory) -> Memory {
        match self {
            Law::Spring { .. } | Law::Dashpot { .. } | Law::KelvinVoigt { .. } => [0.0; 2],
            Law::Maxwell { stiffness, damping } => [stiffness * (velocity - memory[0] / damping), 0.0],
            Law::BoucWen(law) => [law.rate(velocity, memory[0], 1.0), 0.0],
            Law::BaberWen { hysteresis, strength, stiffness } => {
                let [z, energy] = *memory;
                let (nu, mu) = (1.0 + strength * energy, 1.0 + stiffness * energy);
                let energy_rate = (1.0 - hysteresis.post_yield_ratio) * z * velocity / hysteresis.yield_displacement;
                [hysteresis.rate(velocity, z, nu) / mu, energy_rate]
            }
        }
    }

    /// The force at this displacement and velocity, N.
    #[inline]
    pub fn force(&self, displacement: f64, velocity: f64, memory: &Memory) -> f64 {
        match self {
            Law::Spring { stiffness } => stiffness * displacement,
            Law::Dashpot { damping } => damping * velocity,
            Law::KelvinVoigt { stiffness, damping } => stiffness * displacement + damping * velocity,
            Law::Maxwell { .. } => memory[0],
            Law::BoucWen(law) | Law::BaberWen { hysteresis: law, .. } => law.force(displacement, memory[0]),
        }
    }

    /// The memory after moving from one displacement to another in `dt` at constant velocity: Runge-Kutta of fourth order
    /// over steps no longer than a tenth of the yield displacement (less for a sharp yield point) or half the relaxation
    /// time. `limit` is [`Law::limit`], which takes a power and is planned for that.
    #[inline]
    pub fn advance(&self, from: f64, to: f64, dt: f64, memory: &mut Memory, limit: f64) {
        let pace = match self {
            Law::Spring { .. } | Law::Dashpot { .. } | Law::KelvinVoigt { .. } => return,
            Law::Maxwell { .. } => 2.0 * dt * self.relaxation_rate(),
            Law::BoucWen(law) | Law::BaberWen { hysteresis: law, .. } => {
                10.0 * (0.25 * law.exponent).max(1.0) * (to - from).abs() / law.yield_displacement
            }
        };
        // A motion without end is stopped by the test's bound, not here.
        let n_steps = if pace < 1.0 { 1.0 } else { pace.ceil().min(MAX_STEPS) };
        let (velocity, h) = ((to - from) / dt, dt / n_steps);
        for _ in 0..n_steps as usize {
            let ahead = |slope: &Memory, h: f64| [memory[0] + h * slope[0], memory[1] + h * slope[1]];
            let k1 = self.rate(velocity, memory);
            let k2 = self.rate(velocity, &ahead(&k1, 0.5 * h));
            let k3 = self.rate(velocity, &ahead(&k2, 0.5 * h));
            let k4 = self.rate(velocity, &ahead(&k3, h));
            for i in 0..2 {
                memory[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
            }
            memory[0] = memory[0].clamp(-limit, limit);
        }
    }

    /// The largest |z|, (beta + gamma)^(-1/q), which no motion exceeds; infinite where there is none.
    pub fn limit(&self) -> f64 {
        match self {
            Law::BoucWen(law) | Law::BaberWen { hysteresis: law, .. } => {
                (law.beta + law.gamma).powf(-1.0 / law.exponent)
            }
            _ => f64::INFINITY,
        }
    }

    /// dr/dx before yielding and without waiting, N/m; none of a Maxwell element, whose spring relaxes.
    pub fn elastic_stiffness(&self) -> f64 {
        match self {
            Law::Spring { stiffness } | Law::KelvinVoigt { stiffness, .. } => *stiffness,
            Law::Dashpot { .. } | Law::Maxwell { .. } => 0.0,
            Law::BoucWen(law) | Law::BaberWen { hysteresis: law, .. } => law.stiffness,
        }
    }

    /// dr/dx that is left when all has yielded, N/m.
    pub(crate) fn lasting_stiffness(&self) -> f64 {
        match self {
            Law::BoucWen(law) | Law::BaberWen { hysteresis: law, .. } => law.post_yield_ratio * law.stiffness,
            _ => self.elastic_stiffness(),
        }
    }

    /// dr/dx', N s/m.
    pub fn viscous_damping(&self) -> f64 {
        match self {
            Law::Dashpot { damping } | Law::KelvinVoigt { damping, .. } => *damping,
            _ => 0.0,
        }
    }

    /// Whether superposition holds.
    pub fn is_linear(&self) -> bool {
        !matches!(self, Law::BoucWen(_) | Law::BaberWen { .. })
    }

    /// The fastest rate at which the memory forgets, 1/s, whatever the motion.
    pub(crate) fn relaxation_rate(&self) -> f64 {
        match self {
            Law::Maxwell { stiffness, damping } => stiffness / damping,
            _ => 0.0,
        }
    }

    /// Whether a loop of this rate can follow the memory.
    pub(crate) fn check_rate(&self, checks: &mut Checks, rate_hz: f64) {
        let Law::Maxwell { stiffness, .. } = self else { return };
        let most = rate_hz * MAX_STEPS / 2.0;
        let expected = format!("at least {:.6e} for this stiffness and rate", stiffness / most);
        checks.demand("damping_n_s_per_m", self.relaxation_rate() <= most, &expected, "a faster relaxation");
    }

    pub(crate) fn check(&self, checks: &mut Checks) {
        match self {
            Law::Spring { stiffness } => nonnegative(checks, "stiffness_n_per_m", *stiffness),
            Law::Dashpot { damping } => nonnegative(checks, "damping_n_s_per_m", *damping),
            Law::KelvinVoigt { stiffness, damping } => {
                nonnegative(checks, "stiffness_n_per_m", *stiffness);
                nonnegative(checks, "damping_n_s_per_m", *damping);
            }
            Law::Maxwell { stiffness, damping } => {
                positive(checks, "stiffness_n_per_m", *stiffness);
                positive(checks, "damping_n_s_per_m", *damping);
            }
            Law::BoucWen(law) => law.check(checks),
            Law::BaberWen { hysteresis, strength, stiffness } => {
                hysteresis.check(checks);
                nonnegative(checks, "strength_degradation", *strength);
                nonnegative(checks, "stiffness_degradation", *stiffness);
            }
        }
    }
}
