//! How fast the counter advances, against the monotonic clock.

/// Relative difference from the stated rate that contradicts it.
const TOLERANCE: f64 = 0.1;
/// Seconds in a row that must contradict.
const SECONDS: u32 = 3;

/// Measures over stretches of a second or a little more.
#[derive(Debug, Clone)]
pub(crate) struct Pace {
    rate_hz: f64,
    /// Clock and position at the start of the stretch.
    mark: Option<(f64, u64)>,
    measured_hz: f64,
    off: u32,
}

impl Pace {
    pub(crate) fn new(rate_hz: f64) -> Self {
        Self { rate_hz, mark: None, measured_hz: f64::NAN, off: 0 }
    }

    /// Samples a second over the last stretch; NaN before the first.
    pub(crate) fn measured_hz(&self) -> f64 {
        self.measured_hz
    }

    /// Leaves out the stretch that had begun: nothing came for a while, or the counter started anew.
    pub(crate) fn interrupt(&mut self) {
        self.mark = None;
    }

    /// A sample came, at this place of the stream. True when the rate has been contradicted long enough, and each second after.
    pub(crate) fn arrived(&mut self, now_s: f64, position: u64) -> bool {
        let Some((since_s, from)) = self.mark else {
            self.mark = Some((now_s, position));
            return false;
        };
        if now_s - since_s < 1.0 {
            return false;
        }
        self.measured_hz = position.saturating_sub(from) as f64 / (now_s - since_s);
        self.mark = Some((now_s, position));
        let contradicts = (self.measured_hz / self.rate_hz - 1.0).abs() > TOLERANCE;
        self.off = if contradicts { self.off + 1 } else { 0 };
        self.off >= SECONDS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// When the rate of 1000 Hz is contradicted by samples that come at these times, counted by `step`.
    fn contradicted(times: impl Iterator<Item = f64>, step: u64) -> Option<f64> {
        let mut pace = Pace::new(1000.0);
        times.enumerate().find_map(|(i, t)| pace.arrived(t, i as u64 * step).then_some(t))
    }

    #[test]
    fn a_wrong_rate_is_found_within_four_seconds() {
        let found = contradicted((0..10_000).map(|i| f64::from(i) / 2000.0), 1).unwrap();
        assert!((3.0..4.0).contains(&found), "{found}");
        assert!(
            contradicted((0..10_000).map(|i| f64::from(i) / 1000.0), 2).is_some(),
            "a counter that advances by two"
        );
    }

    #[test]
    fn a_right_rate_with_jitter_and_blocks_is_not_contradicted() {
        assert_eq!(contradicted((0..20_000).map(|i| f64::from(i) / 1000.0 + 0.02 * f64::from(i).sin().abs()), 1), None);
        // Twenty samples at once.
        assert_eq!(contradicted((0..20_000).map(|i| f64::from(i / 20 * 20) / 1000.0), 1), None);
        assert_eq!(contradicted((0..20_000).map(|i| f64::from(i) / 1050.0), 1), None);
    }

    #[test]
    fn a_pause_is_not_a_slow_pace() {
        let mut pace = Pace::new(1000.0);
        for i in 0..10_000u32 {
            // Silent for a second after each half.
            if i % 500 == 0 {
                pace.interrupt();
            }
            assert!(!pace.arrived(f64::from(i) / 1000.0 + f64::from(i / 500), u64::from(i)));
        }
    }
}
