//! The evaluation while the test runs: one sample of every actuator in, now and then gain and delay out.
//!
//! ```text
//! incoming samples -> [P: CausalDecimator] -> the latest window -> Evaluator -> Reading
//! ```
//!
//! A reading is the batch evaluation of the samples that stand in the window, computed anew each time: nothing is added to or taken
//! from running sums, so nothing drifts, and a sample that is no number is forgotten when it leaves the window. The estimators
//! that shift the target also see what came just before the window; after it there is nothing yet, so a lead costs them the
//! window's last samples.

use crate::causal::{CausalDecimator, CausalState, Ring};
use crate::error::{Error, Result};
use crate::evaluator::{Evaluator, EvaluatorState};
use crate::pair::{MIN_SAMPLES, Pair, check_rate, is_fourth_power};
use crate::reason::Reason;
use crate::setting::concerns::{MONITOR, REQUIRED};
use crate::setting::{Configuration, Kind};
use crate::settings::{Estimator, EvaluatorConfig, check_expected_delay};
use crate::sums;
use crate::tracking::Tracking;

/// Samples after decimation that the windows of all actuators may hold.
const MAX_SAMPLES: f64 = 4_194_304.0;
/// P times the number of actuators: some 500 bytes each.
const MAX_DECIMATION: usize = 262_144;

crate::configuration! {
    /// The user's numbers.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct MonitorConfig for MONITOR => {
        /// Incoming samples a second.
        rate_hz: f64 = 1024.0, Kind::Positive, "Hz", "Rate", MONITOR | REQUIRED;
        /// Length of the window.
        window_s: f64 = 4.0, Kind::Positive, "s", "Window", MONITOR;
        /// Readings a second, of each actuator.
        update_hz: f64 = 64.0, Kind::Positive, "Hz", "Readings", MONITOR;
        /// A window is judged where the target's amplitude in it is at least this: sqrt(2) times its standard deviation, which is the
        /// amplitude of a sine. In the unit of the signals.
        minimum_amplitude: f64 = 0.0, Kind::NotNegative, "", "Least amplitude judged", MONITOR;
        /// Actuators that are stepped together.
        n_actuators: usize = 1, Kind::Whole(1, u32::MAX as u64), "", "Actuators", MONITOR;
        with
        /// How each window is evaluated. P is carried out as samples come ([`CausalDecimator`]), and the window evaluated at rate / P.
        /// With P above 1 the band's upper end is rate / (4 P) at most, and that where none is given; least squares leaves an upper
        /// end of just this, with a lower end of 0, to the decimator's slope.
        evaluator: EvaluatorConfig = EvaluatorConfig::default();
    }
}

/// Gain and delay of one actuator over the latest window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Index of the incoming sample that completed the window.
    pub index: u64,
    /// When that sample came, in seconds from sample 0: index / rate.
    pub time_s: f64,
    /// Centre of the window, in the same time; the decimator's delay is taken out.
    pub centre_s: f64,
    /// From 0.
    pub actuator: usize,
    /// A, d, phase, f_eq, their intervals where the estimator gives some, and the reason where there is no number.
    pub tracking: Tracking,
}

impl Reading {
    /// A place for a reading, which says nothing yet.
    pub const EMPTY: Self =
        Self { index: 0, time_s: 0.0, centre_s: 0.0, actuator: 0, tracking: Tracking::undetermined(Reason::Still) };

    /// Whether there are numbers.
    pub fn is_valid(&self) -> bool {
        self.tracking.is_valid()
    }
}

/// The checked plan: one for any number of streams of this rate.
///
/// ```
/// use rthstrack::{EvaluatorConfig, Monitor, MonitorConfig};
/// let evaluator = EvaluatorConfig { data_decimation: 8, ..EvaluatorConfig::default() };
/// let monitor = Monitor::new(MonitorConfig { update_hz: 16.0, evaluator, ..Default::default() })?;
/// let mut state = monitor.state();
/// // Measured comes 20 ms later and 5 % too small.
/// let motion = |t: f64| (9.0 * t).sin() + 0.3 * (23.0 * t).sin() + 0.2 * (41.0 * t).cos();
/// let mut last = None;
/// for i in 0..8192 {
///     let t = f64::from(i) / 1024.0;
///     if let Some([reading]) = monitor.step(&mut state, &[motion(t)], &[0.95 * motion(t - 0.020)]) {
///         last = Some(*reading);
///     }
/// }
/// let tracking = last.unwrap().tracking;
/// assert!((tracking.amplitude - 0.95).abs() < 1e-5 && (tracking.delay_s - 0.020).abs() < 1e-6);
/// # Ok::<(), rthstrack::Error>(())
/// ```
pub struct Monitor {
    config: MonitorConfig,
    decimator: CausalDecimator,
    evaluator: Evaluator,
    /// Samples of the window, and those before it that are kept, after decimation.
    window: usize,
    before: usize,
    /// From one reading to the next, after decimation.
    hop: usize,
}

/// What changes per sample: the latest samples of every actuator, and room for one evaluation. It belongs to one thread.
#[derive(Debug, Clone)]
pub struct MonitorState {
    actuators: Vec<ActuatorState>,
    evaluator: EvaluatorState,
    readings: Vec<Reading>,
    /// Of the next incoming sample.
    index: u64,
    /// Decimated samples until the next reading.
    wait: usize,
}

#[derive(Debug, Clone)]
struct ActuatorState {
    filters: [CausalState; 2],
    target: Ring,
    measured: Ring,
}

/// What [`Monitor::process`] did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Processed {
    /// Samples taken, of every actuator.
    pub samples: usize,
    /// Readings written.
    pub readings: usize,
}

impl Monitor {
    /// Checks the settings and plans.
    ///
    /// # Errors
    /// [`Error::Rate`]; [`Error::Setting`] for a window, update or amplitude out of range; [`Error::Band`] and [`Error::NoBin`], also for
    /// a band that the decimator does not keep; whatever [`Evaluator::new`] refuses.
    pub fn new(config: MonitorConfig) -> Result<Self> {
        check_rate(config.rate_hz)?;
        config.check_each()?;
        let setting = |name, expected: String, found| Err(Error::Setting { name, expected, found });
        let data_decimation = config.evaluator.data_decimation;
        // The filters of all actuators must fit into memory, too.
        let most = MAX_DECIMATION / config.n_actuators.min(MAX_DECIMATION);
        if data_decimation > most {
            let expected = format!("at most {most} with {} actuators", config.n_actuators);
            return setting("data_decimation", expected, data_decimation as f64);
        }
        let decimator = CausalDecimator::new(data_decimation)?;
        let rate_hz = config.rate_hz / data_decimation as f64;
        let samples = (config.window_s * rate_hz).round();
        let most = MAX_SAMPLES / config.n_actuators as f64;
        if !(samples >= MIN_SAMPLES as f64 && samples <= most) {
            let (least_s, most_s) = (MIN_SAMPLES as f64 / rate_hz, most / rate_hz);
            let expected = format!("from {least_s} to {most_s} s ({MIN_SAMPLES} to {most} samples at {rate_hz} Hz)");
            return setting("window_s", expected, config.window_s);
        }
        if !(config.update_hz > 0.0 && config.update_hz <= rate_hz * (1.0 + 1e-9)) {
            let expected = format!("above 0 and at most {rate_hz} Hz, the rate after decimation by P");
            return setting("update_hz", expected, config.update_hz);
        }
        let window = samples as usize;
        let evaluator = Evaluator::new(window, rate_hz, config.decimated()?)?;
        // `fei` has not seen it.
        check_expected_delay(config.evaluator.expected_delay_s, config.evaluator.max_delay_s)?;
        let before = evaluator.samples_before();
        let hop = (rate_hz / config.update_hz).round().max(1.0) as usize;
        Ok(Self { config, decimator, evaluator, window, before, hop })
    }

    /// The settings.
    pub fn config(&self) -> &MonitorConfig {
        &self.config
    }

    /// The plan of each reading: of [`Monitor::window_len`] samples at [`Monitor::evaluated_rate_hz`].
    pub fn evaluator(&self) -> &Evaluator {
        &self.evaluator
    }

    /// rate / P, in hertz.
    pub fn evaluated_rate_hz(&self) -> f64 {
        self.evaluator.rate_hz()
    }

    /// Samples of a window, after decimation.
    pub fn window_len(&self) -> usize {
        self.window
    }

    /// Readings a second as they come: a whole number of decimated samples apart.
    pub fn update_hz(&self) -> f64 {
        self.evaluated_rate_hz() / self.hop as f64
    }

    /// By how much the newest sample of a window is older than the sample that brings the reading: the decimator's delay, in seconds.
    pub fn latency_s(&self) -> f64 {
        self.decimator.delay() as f64 / self.config.rate_hz
    }

    /// From the centre of a window to the sample that brings its reading, in seconds.
    pub fn age_s(&self) -> f64 {
        self.latency_s() + 0.5 * (self.window - 1) as f64 / self.evaluated_rate_hz()
    }

    /// Incoming samples before the first reading, that one included.
    pub fn first_reading_len(&self) -> u64 {
        (2 * self.decimator.delay() + 1 + (self.window - 1) * self.decimator.factor()) as u64
    }

    /// Nothing seen yet. Only this allocates.
    pub fn state(&self) -> MonitorState {
        let ring = || Ring::new(self.before + self.window);
        let actuator = || ActuatorState {
            filters: [self.decimator.state(), self.decimator.state()],
            target: ring(),
            measured: ring(),
        };
        let reading = |actuator| Reading { actuator, ..Reading::EMPTY };
        let mut evaluator = self.evaluator.state();
        evaluator.reserve(self.window + self.evaluator.samples_before());
        MonitorState {
            actuators: (0..self.config.n_actuators).map(|_| actuator()).collect(),
            evaluator,
            readings: (0..self.config.n_actuators).map(reading).collect(),
            index: 0,
            wait: self.window,
        }
    }

    /// Forgets all samples; the next one has this index.
    pub fn restart(&self, state: &mut MonitorState, index: u64) {
        for actuator in &mut state.actuators {
            actuator.filters.iter_mut().for_each(CausalState::clear);
            actuator.target.clear();
            actuator.measured.clear();
        }
        state.index = index;
        state.wait = self.window;
    }

    /// Takes one sample of every actuator, `n_actuators` of each signal; gives their readings where a window is complete.
    ///
    /// Allocates nothing, locks nothing, and takes any number: one that is not finite makes the readings whose window holds it
    /// invalid. Samples missing from a slice that is too short count as not a number; surplus ones are left alone.
    pub fn step<'s>(&self, state: &'s mut MonitorState, target: &[f64], measured: &[f64]) -> Option<&'s [Reading]> {
        let index = state.index;
        state.index = state.index.wrapping_add(1);
        let mut complete = false;
        for (a, actuator) in state.actuators.iter_mut().enumerate() {
            let sample = |signal: &[f64]| signal.get(a).copied().unwrap_or(f64::NAN);
            let [first, second] = &mut actuator.filters;
            let shorter = (self.decimator.step(first, sample(target)), self.decimator.step(second, sample(measured)));
            // Both filters have seen as many samples.
            let (Some(x), Some(y)) = shorter else { continue };
            actuator.target.push(x);
            actuator.measured.push(y);
            complete = true;
        }
        if !complete {
            return None;
        }
        state.wait -= 1;
        if state.wait > 0 {
            return None;
        }
        state.wait = self.hop;
        let time_s = index as f64 / self.config.rate_hz;
        for (actuator, reading) in state.actuators.iter().zip(&mut state.readings) {
            let tracking = self.judge(&mut state.evaluator, actuator);
            *reading = Reading { index, time_s, centre_s: time_s - self.age_s(), actuator: reading.actuator, tracking };
        }
        Some(&state.readings)
    }

    /// Takes blocks of samples, actuators side by side (sample 0 of all, sample 1 of all, ...), and writes the readings into
    /// `out`. Stops early where `out` cannot hold those of the next window: see [`Monitor::readings_in`].
    pub fn process(
        &self,
        state: &mut MonitorState,
        target: &[f64],
        measured: &[f64],
        out: &mut [Reading],
    ) -> Processed {
        let (capacity, mut rest) = (out.len(), out.iter_mut());
        self.process_with(state, target, measured, capacity, |readings| {
            rest.by_ref().zip(readings).for_each(|(out, reading)| *out = *reading);
        })
    }

    /// The same with a function that takes the readings of each window, up to `capacity` of them in all.
    pub fn process_with(
        &self,
        state: &mut MonitorState,
        target: &[f64],
        measured: &[f64],
        capacity: usize,
        mut take: impl FnMut(&[Reading]),
    ) -> Processed {
        let n = self.config.n_actuators;
        let mut done = Processed { samples: 0, readings: 0 };
        for (target, measured) in target.chunks_exact(n).zip(measured.chunks_exact(n)) {
            if capacity - done.readings < n && self.samples_until_reading(state) == 1 {
                break;
            }
            if let Some(readings) = self.step(state, target, measured) {
                take(readings);
                done.readings += n;
            }
            done.samples += 1;
        }
        done
    }

    /// How many readings the next `n_samples` samples bring, of all actuators.
    pub fn readings_in(&self, state: &MonitorState, n_samples: usize) -> usize {
        let first = self.samples_until_reading(state);
        let hop = self.hop * self.decimator.factor();
        if n_samples < first { 0 } else { ((n_samples - first) / hop + 1) * self.config.n_actuators }
    }

    /// Samples until the next reading, the one that brings it included.
    pub fn samples_until_reading(&self, state: &MonitorState) -> usize {
        let filter = state.actuators.first().map_or(0, |a| a.filters[0].wait());
        filter + (state.wait - 1) * self.decimator.factor()
    }

    /// The latest samples of one actuator as they are evaluated, target and measured, oldest first: one window at most.
    pub fn window<'s>(&self, state: &'s MonitorState, actuator: usize) -> (&'s [f64], &'s [f64]) {
        let of = |ring: &'s Ring| ring.last(ring.len().min(self.window));
        state.actuators.get(actuator).map_or((&[], &[]), |a| (of(&a.target), of(&a.measured)))
    }

    /// The reading of what stands in an actuator's window.
    fn judge(&self, state: &mut EvaluatorState, actuator: &ActuatorState) -> Tracking {
        let n = actuator.target.len();
        let (target, measured) = (actuator.target.last(n), actuator.measured.last(n));
        let own = &target[n - self.window..];
        // What came before the window is a help, and no reason to refuse it: only what follows the last bad sample is shown.
        let bad = |signal: &[f64]| signal[..n - self.window].iter().rposition(|x| !is_fourth_power(*x));
        let from = bad(target).max(bad(measured)).map_or(0, |last| last + 1);
        let (target, measured) = (&target[from..], &measured[from..]);
        if self.config.minimum_amplitude > 0.0 && amplitude(own) < self.config.minimum_amplitude {
            return Tracking::undetermined(Reason::Still);
        }
        let found = Pair::new(target, measured, self.evaluated_rate_hz())
            .and_then(|pair| self.evaluator.evaluate_last(state, &pair));
        match found {
            Ok(tracking) => tracking,
            Err(Error::NotFinite { .. }) => Tracking::undetermined(Reason::NotFinite),
            Err(Error::Range { .. }) => Tracking::undetermined(Reason::Range),
            // A target that stands still, at every frequency or at those that are kept.
            Err(_) => Tracking::undetermined(Reason::Still),
        }
    }
}

impl MonitorConfig {
    /// What evaluates a window of decimated samples.
    fn decimated(&self) -> Result<EvaluatorConfig> {
        let EvaluatorConfig { estimator, data_decimation, band_hz, .. } = self.evaluator;
        let kept_hz = self.rate_hz / (4 * data_decimation) as f64;
        let decimated = data_decimation > 1;
        if let Some((low_hz, high_hz)) = band_hz
            && decimated
            && high_hz > kept_hz * (1.0 + 1e-9)
        {
            let expected = format!("at most {kept_hz} Hz at its upper end, rate / (4 P); lower P");
            return Err(Error::Setting { name: "band_hz", expected, found: high_hz.max(low_hz) });
        }
        let band_hz = match (estimator, band_hz) {
            (Estimator::Fei | Estimator::Aligned, None) if decimated => Some((0.0, kept_hz)),
            // What the decimator cuts off needs no bins to be cut off again: sums over samples are cheaper.
            (Estimator::LeastSquares, Some((low_hz, high_hz)))
                if decimated && low_hz == 0.0 && high_hz >= kept_hz * (1.0 - 1e-9) =>
            {
                None
            }
            (_, band_hz) => band_hz,
        };
        Ok(EvaluatorConfig {
            data_decimation: 1,
            band_hz,
            // `fei` looks for no delay; a monitor may change its estimator and keep the rest.
            expected_delay_s: self.evaluator.expected_delay_s.filter(|_| estimator != Estimator::Fei),
            ..self.evaluator
        })
    }
}

/// sqrt(2) times the standard deviation.
fn amplitude(samples: &[f64]) -> f64 {
    let n = samples.len() as f64;
    let mean = sums::sum(samples) / n;
    let squares: f64 = sums::spread(samples, mean);
    (2.0 * squares / n).sqrt()
}
