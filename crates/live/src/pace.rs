//! How fast the counter advances, against the monotonic clock.

/// Relative difference from the stated rate that contradicts it.
const TOLERANCE: f64 = 0.1;
/// Seconds in a row that must contradict.
const SECONDS: u32 = 3;
/// The same over a long stretch: no clock is so far off, but 1000 is not 1024.
const LONG_TOLERANCE: f64 = 0.01;
const LONG_S: f64 = 20.0;
/// So long a pause is left out of what is measured; shorter ones are how blocks of samples come.
const PAUSE_S: f64 = 1.0;
/// And so many times the usual one.
const USUAL_PAUSES: f64 = 4.0;

/// What the samples so far say of the rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// Nothing against it.
    Fits,
    /// It is wrong by far.
    Contradicts,
    /// It is not quite right.
    IsOff,
}

/// Measures over stretches of a second or a little more, and over long ones.
#[derive(Debug, Clone)]
pub(crate) struct Pace {
    rate_hz: f64,
    /// Clock and position at the start of the stretch, and of the long one.
    mark: Option<(f64, u64)>,
    long: Option<(f64, u64)>,
    /// When the latest samples came, and how far blocks of them are apart.
    latest_s: f64,
    usual_s: f64,
    measured_hz: f64,
    long_hz: f64,
    off: u32,
}

impl Pace {
    pub(crate) fn new(rate_hz: f64) -> Self {
        let (measured_hz, long_hz) = (f64::NAN, f64::NAN);
        Self { rate_hz, mark: None, long: None, latest_s: f64::NAN, usual_s: 0.0, measured_hz, long_hz, off: 0 }
    }

    /// Samples a second over the last stretch; NaN before the first.
    pub(crate) fn measured_hz(&self) -> f64 {
        self.measured_hz
    }

    /// The same over the last long one.
    pub(crate) fn long_hz(&self) -> f64 {
        self.long_hz
    }

    /// Leaves out the stretch that had begun: the counter started anew, or nothing came for a while.
    pub(crate) fn interrupt(&mut self) {
        (self.mark, self.long) = (None, None);
    }

    /// A sample came, at this place of the stream.
    pub(crate) fn arrived(&mut self, now_s: f64, position: u64) -> Verdict {
        let pause_s = now_s - self.latest_s;
        if pause_s > PAUSE_S.max(USUAL_PAUSES * self.usual_s) {
            self.interrupt();
        } else if pause_s > 0.0 {
            // The longest of late: within a block there is next to none.
            self.usual_s = pause_s.max(0.9 * self.usual_s);
        }
        self.latest_s = now_s;
        let (Some((since_s, from)), Some(long)) = (self.mark, self.long) else {
            (self.mark, self.long) = (Some((now_s, position)), Some((now_s, position)));
            return Verdict::Fits;
        };
        if now_s - since_s < 1.0 {
            return Verdict::Fits;
        }
        let pace = |since_s: f64, from: u64| position.saturating_sub(from) as f64 / (now_s - since_s);
        let off = |pace: f64| (pace / self.rate_hz - 1.0).abs();
        self.measured_hz = pace(since_s, from);
        self.mark = Some((now_s, position));
        self.off = if off(self.measured_hz) > TOLERANCE { self.off + 1 } else { 0 };
        if self.off >= SECONDS {
            return Verdict::Contradicts;
        }
        if now_s - long.0 < LONG_S {
            return Verdict::Fits;
        }
        self.long_hz = pace(long.0, long.1);
        self.long = Some((now_s, position));
        if off(self.long_hz) > LONG_TOLERANCE { Verdict::IsOff } else { Verdict::Fits }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// When the rate of 1000 Hz is first spoken against by samples that come at these times, counted by `step`.
    fn spoken_against(times: impl Iterator<Item = f64>, step: u64) -> Option<(f64, Verdict)> {
        let mut pace = Pace::new(1000.0);
        let mut found = times.enumerate().map(|(i, t)| (t, pace.arrived(t, i as u64 * step)));
        found.find(|(_, verdict)| *verdict != Verdict::Fits)
    }

    #[test]
    fn a_wrong_rate_is_found_within_four_seconds() {
        let (found, verdict) = spoken_against((0..10_000).map(|i| f64::from(i) / 2000.0), 1).unwrap();
        assert!((3.0..4.0).contains(&found) && verdict == Verdict::Contradicts, "{found}");
        assert!(
            spoken_against((0..10_000).map(|i| f64::from(i) / 1000.0), 2).is_some(),
            "a counter that advances by two"
        );
        // A thousand samples at once, each half second.
        let (found, verdict) = spoken_against((0..20_000).map(|i| f64::from(i / 1000) * 0.5), 1).unwrap();
        assert!(found < 5.0 && verdict == Verdict::Contradicts, "{found}");
    }

    #[test]
    fn a_rate_that_is_not_quite_right_is_found_over_a_long_stretch() {
        let (found, verdict) = spoken_against((0..40_000).map(|i| f64::from(i) / 1024.0), 1).unwrap();
        assert!((20.0..22.0).contains(&found) && verdict == Verdict::IsOff, "{found}");
    }

    #[test]
    fn a_right_rate_with_jitter_and_blocks_is_not_contradicted() {
        assert_eq!(
            spoken_against((0..60_000).map(|i| f64::from(i) / 1000.0 + 0.02 * f64::from(i).sin().abs()), 1),
            None
        );
        // Twenty samples at once, and five hundred.
        assert_eq!(spoken_against((0..60_000).map(|i| f64::from(i / 20 * 20) / 1000.0), 1), None);
        assert_eq!(spoken_against((0..60_000).map(|i| f64::from(i / 500 * 500) / 1000.0), 1), None);
        assert_eq!(spoken_against((0..60_000).map(|i| f64::from(i) / 1005.0), 1), None);
    }

    #[test]
    fn a_pause_is_not_a_slow_pace() {
        let mut pace = Pace::new(1000.0);
        for i in 0..60_000u32 {
            // Silent for a second and a half after each five seconds.
            let now_s = f64::from(i) / 1000.0 + 1.5 * f64::from(i / 5000);
            assert_eq!(pace.arrived(now_s, u64::from(i)), Verdict::Fits, "{now_s}");
        }
    }
}
