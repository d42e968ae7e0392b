//! How one channel lies upon the other.

use crate::lag::{Search, SearchState, View};

/// Where the other channel jumps as well, by this share, it is motion.
pub(super) const SHARED: f64 = 0.3;

/// How one channel lies upon the other: measured_(i + lag) ~ gain target_i + offset.
#[derive(Debug, Clone, Copy)]
pub(crate) struct About {
    pub(crate) lag: isize,
    pub(crate) gain: f64,
    pub(crate) offset: f64,
    /// The least distance that one in ten exceeds, in units of measured.
    pub(crate) apart: f64,
}

impl About {
    /// From the highest peak of the correlation, over the window that starts at `start`.
    pub(crate) fn find(search: &Search, state: &mut SearchState, view: &View<'_>, start: usize) -> Option<Self> {
        let lag = search.peaks(state, view, start, None).ok()?.first().lag.round() as isize;
        let n = search.n_samples() as isize;
        let own = start as isize - view.origin as isize;
        let from = own.max(lag);
        let to = (own + n).min(view.target.len() as isize + lag).min(view.measured.len() as isize);
        if to - from < 16 {
            return None;
        }
        let (from, to) = (from as usize, to as usize);
        let measured = &view.measured[from..to];
        let target = &view.target[from.wrapping_add_signed(-lag)..to.wrapping_add_signed(-lag)];
        let mut fit = Self { lag, gain: 0.0, offset: 0.0, apart: f64::INFINITY };
        // What repeats the value before may be no motion; of a converter, or held, most of all may do so.
        let moves = |i: usize| i > 0 && target[i] != target[i - 1] && measured[i] != measured[i - 1];
        let moving = 3 * (0..target.len()).filter(|&i| moves(i)).count() > target.len();
        // Once more without what is far off.
        for _ in 0..2 {
            let near = || {
                let within = move |i: &usize| (measured[*i] - fit.gain * target[*i] - fit.offset).abs() <= fit.apart;
                let pairs = (0..target.len()).filter(move |&i| !moving || moves(i));
                pairs.filter(within).map(|i| (target[i], measured[i]))
            };
            let (k, x, y) = near().fold((0.0, 0.0, 0.0), |(k, a, b), (x, y)| (k + 1.0, a + x, b + y));
            let (mean_x, mean_y) = (x / k, y / k);
            let (xx, xy) = near().fold((0.0, 0.0), |(xx, xy), (x, y)| {
                (xx + (x - mean_x) * (x - mean_x), xy + (x - mean_x) * (y - mean_y))
            });
            if !(xx > 0.0 && xy != 0.0) {
                return None;
            }
            let gain = xy / xx;
            let offset = mean_y - gain * mean_x;
            let mut apart = [0.0; 1024];
            let step = (target.len() / apart.len()).max(1);
            let mut m = 0;
            for i in (0..target.len()).step_by(step).filter(|&i| !moving || moves(i)).take(apart.len()) {
                apart[m] = (measured[i] - gain * target[i] - offset).abs();
                m += 1;
            }
            if m == 0 {
                return None;
            }
            let at = (9 * m / 10).min(m - 1);
            let tenth = *apart[..m].select_nth_unstable_by(at, f64::total_cmp).1;
            fit = Self { lag, gain, offset, apart: 2.0 * tenth };
        }
        Some(Self { apart: 0.5 * fit.apart, ..fit })
    }
}

/// The other channel, shifted and scaled to lie upon this one.
pub(super) struct Other<'a> {
    pub(super) signal: &'a [f64],
    pub(super) shift: isize,
    pub(super) scale: f64,
    offset: f64,
    pub(super) apart: f64,
}

impl<'a> Other<'a> {
    pub(super) fn of(channel: usize, signals: [&'a [f64]; 2], about: &About) -> Self {
        let About { lag, gain, offset, apart } = *about;
        if channel == 0 {
            let scale = 1.0 / gain;
            Self { signal: signals[1], shift: lag, scale, offset: -offset / gain, apart: apart / gain.abs() }
        } else {
            Self { signal: signals[0], shift: -lag, scale: gain, offset, apart }
        }
    }

    #[inline]
    pub(super) fn index(&self, i: isize) -> isize {
        i + self.shift
    }

    /// Whether it jumps by more than `least` from one sample to the next, where this channel is at sample i, or about there.
    #[inline]
    pub(super) fn jumps(&self, i: usize, least: f64) -> bool {
        let reach = 32 + 2 * self.shift.abs();
        let from = (self.index(i as isize) - reach).max(0) as usize;
        let to = ((self.index(i as isize) + reach).max(0) as usize).min(self.signal.len());
        from < to && self.signal[from..to].windows(2).any(|w| (self.scale * (w[1] - w[0])).abs() > least)
    }

    #[inline]
    pub(super) fn at(&self, i: usize) -> Option<f64> {
        let at = usize::try_from(self.index(i as isize)).ok()?;
        Some(self.scale * self.signal.get(at)? + self.offset)
    }
}
