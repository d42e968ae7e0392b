//! The amplitude spectrum of the current window, made in the thread of whoever asks, about twice a second for all of them.

use rthstrack::{Evaluator, EvaluatorState, Pair};

use crate::board::Board;
use crate::json;

/// From one spectrum to the next.
const PERIOD_S: f64 = 0.5;
/// Most frequencies shown; of more, each shows the largest of its neighbours.
const MAX_BINS: usize = 1024;

/// The last spectrum made, as JSON.
#[derive(Debug)]
pub(crate) struct Spectra {
    made_s: f64,
    state: EvaluatorState,
    /// Version of the board, and text; empty before the first.
    pub(crate) latest: (u64, String),
}

/// The samples of a window of every actuator.
pub(crate) type Windows = Vec<(Vec<f64>, Vec<f64>)>;

/// The current window, where the board holds a whole one.
pub(crate) fn windows(board: &Board, evaluator: &Evaluator, n_actuators: usize) -> Option<Windows> {
    (0..n_actuators).map(|a| board.scope.last(evaluator.n_samples(), a)).collect()
}

impl Spectra {
    pub(crate) fn new(evaluator: &Evaluator) -> Self {
        Self { made_s: f64::NEG_INFINITY, state: evaluator.state(), latest: (0, String::new()) }
    }

    pub(crate) fn is_due(&self, now_s: f64) -> bool {
        now_s - self.made_s >= PERIOD_S
    }

    /// Makes it of these windows, of that version.
    pub(crate) fn make(&mut self, now_s: f64, version: u64, evaluator: &Evaluator, windows: &Windows) {
        self.made_s = now_s;
        let full_scale = full_scale(evaluator);
        let mut frequencies = Vec::new();
        let mut amplitudes: [Vec<Vec<f64>>; 2] = Default::default();
        for (target, measured) in windows {
            let found = Pair::new(target, measured, evaluator.rate_hz())
                .and_then(|pair| evaluator.evaluate_with_spectra(&mut self.state, &pair));
            // A window that cannot be judged has no spectrum.
            let spectra = found.map(|(_, spectra)| spectra).unwrap_or_default();
            for (signal, bins) in [spectra.target, spectra.measured].into_iter().enumerate() {
                let all: Vec<f64> = bins.iter().map(|bin| full_scale * bin.norm()).collect();
                amplitudes[signal].push(shown(&all, |group| group.iter().copied().fold(0.0, f64::max)));
            }
            if frequencies.is_empty() {
                frequencies = shown(&spectra.frequency_hz, |group| group.iter().sum::<f64>() / group.len() as f64);
            }
        }
        let text = &mut self.latest.1;
        self.latest.0 = version;
        text.clear();
        text.push('{');
        json::key(text, "frequency_hz");
        json::list(text, frequencies, json::coarse);
        for (name, signal) in ["target", "measured"].into_iter().zip(amplitudes) {
            json::key(text, name);
            json::list(text, signal, |out, one| json::list(out, one, json::coarse));
        }
        text.push('}');
    }
}

/// The amplitude of a sine over the height of its bin: 2 / sum of the window.
fn full_scale(evaluator: &Evaluator) -> f64 {
    let n = evaluator.n_samples();
    let sum = evaluator.config().window.coefficients(n).map_or(n as f64, |w| w.iter().sum());
    2.0 / sum
}

fn shown(values: &[f64], one: impl Fn(&[f64]) -> f64) -> Vec<f64> {
    let size = values.len().div_ceil(MAX_BINS).max(1);
    values.chunks(size).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rthstrack::EvaluatorConfig;
    use serde_json::Value;

    #[test]
    fn a_sine_has_its_amplitude_at_its_frequency() {
        let evaluator = Evaluator::new(8192, 1024.0, EvaluatorConfig::published()).unwrap();
        let sine = |i: usize, a: f64| a * (std::f64::consts::TAU * 16.0 * i as f64 / 1024.0).sin();
        let column = |a: f64| (0..8192).map(|i| sine(i, a)).collect::<Vec<f64>>();
        let mut spectra = Spectra::new(&evaluator);
        assert!(spectra.is_due(0.0));
        spectra.make(0.0, 7, &evaluator, &vec![(column(3.0), column(2.0)), (vec![0.0; 8192], vec![0.0; 8192])]);
        assert!(!spectra.is_due(0.4));
        let value: Value = serde_json::from_str(&spectra.latest.1).unwrap();
        let bins = value["frequency_hz"].as_array().unwrap();
        assert_eq!(bins.len(), MAX_BINS);
        let largest = |name: &str| {
            let one = value[name][0].as_array().unwrap();
            let (at, peak) =
                one.iter().map(|v| v.as_f64().unwrap()).enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
            (bins[at].as_f64().unwrap(), peak)
        };
        let ((f, target), (_, measured)) = (largest("target"), largest("measured"));
        assert!((f - 16.0).abs() < 0.5 && (target - 3.0).abs() < 1e-6 && (measured - 2.0).abs() < 1e-6);
        assert_eq!(value["target"][1].as_array().unwrap().len(), 0);
    }
}
