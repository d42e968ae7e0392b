//! Why a number or its interval is not there: data, not an error.

use std::ffi::CStr;
use std::fmt;

/// What is known of every reason of a kind, whatever its values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReasonKind {
    /// Its name in programs and files, which never changes.
    pub code: &'static str,
    /// Its number in the C interface, which never changes; from 100 on only the interval is missing.
    pub number: i32,
    /// What it says without its values.
    pub words: &'static CStr,
}

/// The reasons, a row each: number, code, words without values. A reason's values are its fields, in their order.
macro_rules! reasons {
    ($($(#[$doc:meta])* $variant:ident $({ $($(#[$field_doc:meta])* $field:ident: $type:ty),+ })?
        = $number:literal, $code:literal, $words:literal;)+) => {
        /// Why gain and delay could not be determined, or no interval is given with them.
        #[derive(Debug, Clone, Copy, PartialEq)]
        #[non_exhaustive]
        pub enum Reason {
            $($(#[$doc])* $variant $({ $($(#[$field_doc])* $field: $type),+ })?),+
        }

        impl Reason {
            /// All kinds.
            pub const KINDS: &'static [ReasonKind] =
                &[$(ReasonKind { code: $code, number: $number, words: $words }),+];

            /// Its kind.
            pub fn kind(&self) -> ReasonKind {
                match self {
                    $(Reason::$variant { .. } => ReasonKind { code: $code, number: $number, words: $words }),+
                }
            }

            /// What it says in numbers, in SI units, the rest NaN.
            #[allow(clippy::unnecessary_cast, reason = "one row counts samples")]
            pub fn values(&self) -> [f64; 2] {
                match *self {
                    $(Reason::$variant $({ $($field),+ })? => {
                        let mut values = [f64::NAN; 2];
                        let found: &[f64] = &[$($($field as f64),+)?];
                        values[..found.len()].copy_from_slice(found);
                        values
                    })+
                }
            }
        }
    };
}

reasons! {
    /// The target moves too little in the window, or one signal not at all.
    Still = 1, "still",
        c"not determined: too little motion to judge by";
    /// The window holds samples that are NaN or infinite.
    NotFinite = 2, "not_finite",
        c"not determined: the window holds samples that are NaN or infinite";
    /// The window holds samples so large or so small that their powers leave the range of double precision.
    Range = 3, "range",
        c"not determined: magnitudes leave the range of double precision; scale the signals to a usual unit";
    /// Too few samples are left for which the shifted target is known.
    TooShort {
        /// How many are left.
        n_samples: usize
    } = 4, "too_short",
        c"not determined: too few samples are left to compare once target is shifted by the delay; lower max_delay_s \
             or take a longer window";
    /// The target goes through too little of a cycle.
    FewCycles {
        /// Cycles in the window, by its rms acceleration over its rms velocity.
        found: f64
    } = 5, "few_cycles",
        c"not determined: the window holds too little of a cycle of target's motion, at least 0.6 of one is needed; \
             take a longer window";
    /// Too little of measured follows the target.
    LowCoherence {
        /// Share that follows.
        goodness: f64
    } = 6, "low_coherence",
        c"not determined: too little of measured follows target; is this the right pair?";
    /// The delay's interval is wider than half a turn of the motion.
    Uncertain {
        /// From the delay to either end of its interval, in seconds.
        reach_s: f64
    } = 7, "uncertain",
        c"not determined: because of noise the delay is uncertain by more than half a cycle of the motion; take a \
             longer window or a band with less noise";
    /// Too many samples are bad: spikes, dropouts, frozen or clipped stretches.
    BadSamples {
        /// Share of the samples that would be left out.
        share: f64
    } = 13, "bad_samples",
        c"not determined: too many samples are bad (spikes, dropouts, frozen or clipped); look at the sensors";
    /// Two delays fit equally well.
    Ambiguous {
        /// One of them, in seconds.
        delay_s: f64,
        /// The other.
        other_s: f64
    } = 8, "ambiguous",
        c"not determined: ambiguous, two delays fit equally well; say about which one is expected (expected_delay_s)";
    /// The best delay lies outside what was searched.
    BeyondMaxDelay {
        /// The largest delay taken, in seconds.
        max_delay_s: f64
    } = 9, "beyond_max_delay",
        c"not determined: the delay seems to lie beyond max_delay_s, or beyond a quarter of the window; raise it or \
             take a longer window";
    /// Measured moves against the target.
    OppositeSign {
        /// The delay that it would have with the opposite sign, in seconds, to a step of the search.
        delay_s: f64
    } = 10, "opposite_sign",
        c"not determined: measured moves against target; does one of them have the opposite sign?";
    /// The iteration did not settle.
    NoConvergence = 11, "no_convergence",
        c"not determined: the search for the delay did not converge";
    /// What the target holds is mostly noise of its own.
    NoisyTarget {
        /// Share of noise in the energy of its displacement or velocity, whichever is larger.
        share: f64
    } = 12, "noisy_target",
        c"not determined: target is mostly noise; take a longer window or a band with less noise";
    /// No interval: the residual follows the target, so that gain and delay are not one number each.
    ResidualFollowsTarget {
        /// Coherence of residual and target.
        coherence: f64
    } = 100, "residual_follows_target",
        c"no interval: one gain and one delay do not explain measured (the residual follows target), so they change with \
             frequency or over time";
    /// No interval: the target moves too fast to be read between samples.
    TooFast {
        /// Share of the target's energy that lies above about 0.35 of the rate.
        share: f64
    } = 103, "too_fast",
        c"no interval: target moves too fast for the sampling rate; sample faster";
    /// No interval: the noise is coloured, and how much of it is the target's own is not known.
    ColouredTargetNoise {
        /// Share of the energy of the target, or of its velocity, that may be noise.
        share: f64
    } = 104, "coloured_target_noise",
        c"no interval: the noise is coloured, so how much of it is in target is not known; take a band with less noise";
    /// No interval: too few frequency bins to know the noise by.
    FewBins = 101, "few_bins",
        c"no interval: too few frequency bins to estimate the noise";
    /// No interval: it is known for weight power 2 only.
    WeightPower = 102, "weight_power",
        c"no interval: it can be computed for weight power 2 only";
}

impl Reason {
    /// The same without the rest.
    pub fn told(&self) -> impl Iterator<Item = f64> {
        self.values().into_iter().filter(|value| !value.is_nan())
    }

    /// Whether there is no number either.
    pub fn is_undetermined(&self) -> bool {
        self.kind().number < 100
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Reason::TooShort { n_samples } => write!(
                f,
                "not determined: only {n_samples} samples are left to compare once target is shifted by the delay; \
                 lower max_delay_s or take a longer window"
            ),
            Reason::FewCycles { found } => write!(
                f,
                "not determined: the window holds {found:.2} of a cycle of target's motion, at least 0.6 of one is needed; take a \
                 longer window"
            ),
            Reason::LowCoherence { goodness } if goodness.is_nan() => {
                write!(f, "not determined: measured does not move")
            }
            Reason::LowCoherence { goodness } => write!(
                f,
                "not determined: only {:.0} % of measured follows target; is this the right pair?",
                100.0 * goodness.max(0.0)
            ),
            Reason::Uncertain { reach_s } if *reach_s > 1.0 => write!(
                f,
                "not determined: because of noise the delay is uncertain by more than 1 s; take a longer window or a band with \
                 less noise"
            ),
            Reason::Uncertain { reach_s } => write!(
                f,
                "not determined: because of noise the delay is uncertain by {:.3} ms, more than half a cycle of the motion; take \
                 a longer window or a band with less noise",
                1e3 * reach_s
            ),
            Reason::BadSamples { share } => write!(
                f,
                "not determined: {:.0} % of the samples are bad (spikes, dropouts, frozen or clipped); look at the sensors \
                 and their cables",
                100.0 * share
            ),
            Reason::Ambiguous { delay_s, other_s } => write!(
                f,
                "not determined: ambiguous, delays of {:.4} and {:.4} ms fit equally well; say about which one is expected \
                 (expected_delay_s)",
                1e3 * delay_s,
                1e3 * other_s
            ),
            Reason::BeyondMaxDelay { max_delay_s } => {
                write!(
                    f,
                    "not determined: the delay seems to lie beyond max_delay_s, or beyond a quarter of the samples ({max_delay_s} s \
                 are searched); raise it or take a longer window"
                )
            }
            Reason::OppositeSign { delay_s } => write!(
                f,
                "not determined: measured moves against target; with its sign reversed it would {} by about {:.3} ms; does one \
                 of them have the opposite sign?",
                if *delay_s < 0.0 { "lead" } else { "lag" },
                1e3 * delay_s.abs()
            ),
            Reason::NoisyTarget { share } => write!(
                f,
                "not determined: target is mostly noise ({:.0} % of it or of its velocity); take a longer window or a band with \
                 less noise",
                100.0 * share
            ),
            Reason::ResidualFollowsTarget { coherence } => write!(
                f,
                "no interval: one gain and one delay do not explain measured (the residual follows target, coherence \
                 {coherence:.2}), so they change with frequency or over time"
            ),
            Reason::TooFast { share } => write!(
                f,
                "no interval: {:.2} % of target's motion is too fast for the sampling rate, above a third of it; sample faster",
                100.0 * share
            ),
            Reason::ColouredTargetNoise { share } => write!(
                f,
                "no interval: the noise is coloured, so how much of it is in target is not known (up to {:.0} % of target's \
                 velocity); take a band with less noise",
                100.0 * share
            ),
            Reason::Still
            | Reason::NotFinite
            | Reason::Range
            | Reason::NoConvergence
            | Reason::FewBins
            | Reason::WeightPower => f.write_str(self.kind().words.to_str().unwrap_or_default()),
        }
    }
}
