//! Advisory alarms: limits on readings, on lost samples and on silence. No clock of its own.
//!
//! An alarm is raised when its value has been over the limit for the minimum duration, and is over when the value has fallen
//! below the limit by the hysteresis. A latched alarm is then held until it is reset. Readings without numbers neither raise nor end
//! one, but they break off what had lasted; that an actuator has not been judged for long is an alarm of its own.

mod config;
mod kind;

use rthstrack::Reading;

use crate::names::Names;

pub use config::AlarmConfig;
pub use kind::{Kind, Observed, Row, Source};

/// One alarm as it stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alarm {
    /// What it watches.
    pub kind: Kind,
    /// Of which actuator; `None` for the stream itself.
    pub actuator: Option<usize>,
    /// Over its limit.
    pub active: bool,
    /// Held, though no longer over its limit, until it is reset.
    pub latched: bool,
    /// When it was raised, in seconds of the stream.
    pub since_s: f64,
    /// The value that went farthest since it was raised, with its sign; before that, the last one.
    pub value: f64,
    /// What it must not exceed.
    pub limit: f64,
    /// Since when the value has been over the limit without a raised alarm.
    pending_s: Option<f64>,
    reset_while_active: bool,
    /// Nothing is known of it now: the latest reading had no numbers.
    blind: bool,
}

impl Alarm {
    fn new(kind: Kind, actuator: Option<usize>, limit: f64) -> Self {
        Self {
            kind,
            actuator,
            active: false,
            latched: false,
            since_s: f64::NAN,
            value: f64::NAN,
            limit,
            pending_s: None,
            reset_while_active: false,
            blind: true,
        }
    }

    /// Whether it is raised: over its limit or held.
    pub fn is_raised(&self) -> bool {
        self.active || self.latched
    }

    /// What it says, as advice.
    pub fn text(&self, names: &Names) -> String {
        self.kind.raised_text(self.actuator, self.value, self.limit, names)
    }

    fn compared(&self, value: f64) -> f64 {
        (self.kind.row().compared)(value)
    }

    /// Compares; tells whether it was raised or ended by this.
    fn compare(&mut self, time_s: f64, value: f64, config: &AlarmConfig) -> bool {
        self.blind = false;
        if self.active {
            return self.go_on(value, config);
        }
        // What is held shows the value that it is held for.
        self.value = if self.latched { self.farther(value) } else { value };
        if self.compared(value) <= self.limit {
            self.pending_s = None;
            return false;
        }
        let wait_s = if self.kind.row().is_time { 0.0 } else { config.minimum_duration_s };
        let since_s = *self.pending_s.get_or_insert(time_s);
        // Half a nanosecond for what counting in binary fractions loses.
        if time_s - since_s < wait_s - 5e-10 {
            return false;
        }
        self.pending_s = None;
        self.active = true;
        self.reset_while_active = false;
        // One that is held and goes over its limit once more is told once more.
        self.since_s = time_s;
        true
    }

    fn farther(&self, value: f64) -> f64 {
        if self.compared(value) > self.compared(self.value) { value } else { self.value }
    }

    /// A reading had no numbers: how long the value has been over its limit is not known.
    fn break_off(&mut self) {
        self.pending_s = None;
        self.blind = true;
    }

    /// Tells whether it ended by this value.
    fn go_on(&mut self, value: f64, config: &AlarmConfig) -> bool {
        if self.compared(value) > self.limit * (1.0 - config.hysteresis) {
            self.value = self.farther(value);
            return false;
        }
        self.active = false;
        self.latched = config.latch && !self.reset_while_active;
        if !self.latched {
            self.value = value;
        }
        !self.latched
    }

    /// Tells whether it ended by this. One that is over its limit goes on, and ends by itself; of one that is not judged any more
    /// nobody knows.
    fn reset(&mut self) -> bool {
        let was_raised = self.is_raised();
        self.active &= !self.blind;
        self.latched = false;
        self.reset_while_active = self.active;
        was_raised && !self.active
    }
}

/// An alarm that was raised, or ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// As it stands now.
    pub alarm: Alarm,
    /// Raised, or ended.
    pub raised: bool,
    /// When, in seconds of the stream.
    pub time_s: f64,
}

/// All alarms of a stream.
#[derive(Debug, Clone)]
pub struct Alarms {
    config: AlarmConfig,
    alarms: Vec<Alarm>,
}

impl Alarms {
    /// The alarms that a configuration without mistakes asks for.
    pub fn new(config: AlarmConfig, n_actuators: usize) -> Self {
        let watched = |is_of_actuators| {
            let kinds = Kind::ALL.iter().filter(move |kind| kind.row().source.is_of_actuators() == is_of_actuators);
            kinds.filter_map(move |kind| Some((*kind, (kind.row().limit)(&config)?)))
        };
        let of = |actuator| move |(kind, limit)| Alarm::new(kind, actuator, limit);
        let of_actuators = (0..n_actuators).flat_map(|actuator| watched(true).map(of(Some(actuator))));
        let alarms = of_actuators.chain(watched(false).map(of(None))).collect();
        Self { config, alarms }
    }

    /// As they stand.
    pub fn all(&self) -> &[Alarm] {
        &self.alarms
    }

    /// Which are raised for an actuator, and for the stream: the sum of their bits.
    pub fn raised(&self, actuator: usize) -> u32 {
        let concerned = self.alarms.iter().filter(|a| a.is_raised() && a.actuator.is_none_or(|of| of == actuator));
        concerned.fold(0, |set, alarm| set | alarm.kind.bit())
    }

    /// Compares a reading with the limits of its actuator.
    pub fn read(&mut self, reading: &Reading, tell: impl FnMut(Change)) {
        if !reading.is_valid() {
            return self.break_off(Some(reading.actuator));
        }
        let (config, judged) = (self.config, Observed { unjudged_s: Some(0.0), ..Observed::default() });
        let value = |source| match source {
            Source::Reading(of) => Some(of(reading, &config)),
            Source::Actuator(of) | Source::Stream(of) => of(&judged),
        };
        self.compare(Some(reading.actuator), reading.time_s, value, tell);
    }

    /// Nothing is known of an actuator now, or of any (`None`): its readings have no numbers, or there are none.
    pub fn break_off(&mut self, actuator: Option<usize>) {
        let concerned = |a: &&mut Alarm| {
            matches!(a.kind.row().source, Source::Reading(_))
                && a.actuator.is_some_and(|of| actuator.is_none_or(|a| a == of))
        };
        self.alarms.iter_mut().filter(concerned).for_each(Alarm::break_off);
    }

    /// Compares what is observed of an actuator, or of the stream (`None`).
    pub fn observe(&mut self, actuator: Option<usize>, time_s: f64, observed: &Observed, tell: impl FnMut(Change)) {
        let value = |source| match source {
            Source::Reading(_) => None,
            Source::Actuator(of) | Source::Stream(of) => of(observed),
        };
        self.compare(actuator, time_s, value, tell);
    }

    /// Ends what is held; what is over its limit goes on.
    pub fn reset(&mut self, time_s: f64, mut tell: impl FnMut(Change)) {
        for alarm in &mut self.alarms {
            if alarm.reset() {
                tell(Change { alarm: *alarm, raised: false, time_s });
            }
        }
    }

    fn compare(
        &mut self,
        actuator: Option<usize>,
        time_s: f64,
        value: impl Fn(Source) -> Option<f64>,
        mut tell: impl FnMut(Change),
    ) {
        for alarm in self.alarms.iter_mut().filter(|a| a.actuator == actuator) {
            // NaN compares as nothing.
            let Some(value) = value(alarm.kind.row().source).filter(|v| !v.is_nan()) else { continue };
            if alarm.compare(time_s, value, &self.config) {
                tell(Change { alarm: *alarm, raised: alarm.active, time_s });
            }
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use rthstrack::{EvaluatorConfig, Monitor, MonitorConfig};

    /// Of a tone, of which only the published average tells a delay.
    fn config() -> MonitorConfig {
        let evaluator = EvaluatorConfig::published();
        MonitorConfig { rate_hz: 64.0, window_s: 1.0, update_hz: 1.0, evaluator, ..MonitorConfig::default() }
    }

    /// A reading with these numbers, as the core would give it.
    pub(crate) fn reading(actuator: usize, time_s: f64, amplitude: f64, delay_s: f64) -> Reading {
        let monitor = Monitor::new(config()).unwrap();
        let mut state = monitor.state();
        let sample = |i: usize| [(i as f64 * 0.7).sin()];
        let mut made = (0..64).find_map(|i| monitor.step(&mut state, &sample(i), &sample(i)).map(|r| r[0])).unwrap();
        assert!(made.is_valid());
        (made.actuator, made.time_s, made.tracking.amplitude, made.tracking.delay_s) =
            (actuator, time_s, amplitude, delay_s);
        made
    }

    fn invalid(time_s: f64) -> Reading {
        let monitor = Monitor::new(config()).unwrap();
        let mut state = monitor.state();
        let mut made = (0..64).find_map(|_| monitor.step(&mut state, &[0.0], &[0.0]).map(|r| r[0])).unwrap();
        assert!(!made.is_valid());
        made.time_s = time_s;
        made
    }

    fn delays(config: AlarmConfig, series: &[(f64, f64)]) -> (Vec<(f64, bool)>, Alarms) {
        let mut alarms = Alarms::new(AlarmConfig { limit_delay_s: Some(0.010), ..config }, 1);
        let mut changes = Vec::new();
        for (time_s, delay_s) in series {
            let reading = if delay_s.is_nan() { invalid(*time_s) } else { reading(0, *time_s, 1.0, *delay_s) };
            alarms.read(&reading, |c| changes.push((c.time_s, c.raised)));
        }
        (changes, alarms)
    }

    #[test]
    fn an_alarm_is_raised_over_its_limit_and_ends_below_the_hysteresis() {
        let config = AlarmConfig { latch: false, ..AlarmConfig::default() };
        let series = [(1.0, 0.009), (2.0, 0.010), (3.0, 0.0101), (4.0, 0.0095), (5.0, 0.0089), (6.0, 0.011)];
        assert_eq!(delays(config, &series).0, [(3.0, true), (5.0, false), (6.0, true)]);
    }

    #[test]
    fn a_lead_is_over_the_limit_of_delay_as_a_lag_is() {
        assert_eq!(delays(AlarmConfig::default(), &[(1.0, -0.011)]).0, [(1.0, true)]);
    }

    #[test]
    fn a_lead_is_never_a_share_of_the_critical_delay() {
        let config = AlarmConfig { critical_delay_s: Some(0.008), ..AlarmConfig::default() };
        let mut alarms = Alarms::new(config, 1);
        let mut raised = Vec::new();
        for (time_s, delay_s) in [(1.0, -0.020), (2.0, 0.0039), (3.0, 0.0041)] {
            alarms.read(&reading(0, time_s, 1.0, delay_s), |c| raised.push((c.time_s, c.alarm.kind)));
        }
        assert_eq!(raised, [(3.0, Kind::CriticalDelay)]);
    }

    #[test]
    fn a_latched_alarm_is_held_until_reset() {
        let (changes, mut alarms) =
            delays(AlarmConfig::default(), &[(1.0, 0.02), (2.0, 0.001), (3.0, 0.018), (4.0, 0.001)]);
        assert_eq!(changes, [(1.0, true), (3.0, true)], "once more over its limit, once more told");
        assert!(alarms.all()[0].latched && !alarms.all()[0].active);
        assert_eq!(alarms.all()[0].value, 0.02, "it shows what it is held for");
        let mut ended = Vec::new();
        alarms.reset(5.0, |c| ended.push((c.alarm.kind, c.raised)));
        assert_eq!(ended, [(Kind::Delay, false)]);
        assert!(!alarms.all()[0].is_raised());
    }

    #[test]
    fn a_reset_does_not_silence_what_is_still_over_its_limit() {
        let (_, mut alarms) = delays(AlarmConfig::default(), &[(1.0, 0.02)]);
        alarms.reset(1.5, |_| panic!("still over"));
        assert!(alarms.all()[0].active);
        let mut changes = Vec::new();
        alarms.read(&reading(0, 2.0, 1.0, 0.001), |c| changes.push(c.raised));
        assert_eq!(changes, [false], "it ends by itself: it has been seen");
    }

    #[test]
    fn a_short_excess_is_no_alarm_where_a_minimum_duration_is_asked() {
        let config = AlarmConfig { minimum_duration_s: 1.0, ..AlarmConfig::default() };
        let series = [(1.0, 0.02), (1.5, 0.02), (1.6, 0.001), (2.0, 0.02), (2.5, 0.02), (3.0, 0.02)];
        assert_eq!(delays(config, &series).0, [(3.0, true)]);
    }

    #[test]
    fn what_was_not_judged_is_not_counted_as_over_the_limit() {
        let config = AlarmConfig { minimum_duration_s: 1.0, ..AlarmConfig::default() };
        let series = [(1.0, 0.02), (1.5, 0.02), (1.6, f64::NAN), (20.0, 0.02), (20.5, 0.02), (21.0, 0.02)];
        assert_eq!(delays(config, &series).0, [(21.0, true)]);
    }

    #[test]
    fn a_reset_ends_an_alarm_of_which_nothing_is_known_any_more() {
        let (_, mut alarms) = delays(AlarmConfig::default(), &[(1.0, 0.02), (2.0, f64::NAN)]);
        assert!(alarms.all()[0].active);
        let mut ended = Vec::new();
        alarms.reset(3.0, |c| ended.push((c.alarm.kind, c.raised)));
        assert_eq!(ended, [(Kind::Delay, false)]);
        assert!(!alarms.all()[0].is_raised());
    }

    #[test]
    fn a_lead_is_told_as_one_and_compared_by_its_size() {
        let (_, alarms) = delays(AlarmConfig::default(), &[(1.0, -0.02), (2.0, -0.03), (3.0, -0.025)]);
        let text = alarms.all()[0].text(&Names::new(&[], 1));
        assert!(text.contains("lead of up to 30.000 ms"), "{text}");
        let config = AlarmConfig { limit_amplitude: Some(0.1), ..AlarmConfig::default() };
        let mut alarms = Alarms::new(config, 1);
        alarms.read(&reading(0, 1.0, 0.7, 0.0), |c| {
            let text = c.alarm.text(&Names::new(&[], 1));
            assert!(text.contains("too small by up to 0.300"), "{text}");
        });
    }

    #[test]
    fn readings_without_numbers_neither_raise_nor_clear() {
        let config = AlarmConfig { latch: false, ..AlarmConfig::default() };
        let series = [(1.0, f64::NAN), (2.0, 0.02), (3.0, f64::NAN), (4.0, f64::NAN)];
        let (changes, alarms) = delays(config, &series);
        assert_eq!(changes, [(2.0, true)]);
        assert!(alarms.all()[0].active);
    }

    #[test]
    fn every_text_says_that_it_is_advisory() {
        let names = Names::new(&["north".to_owned()], 2);
        for kind in Kind::ALL.iter().copied() {
            for (actuator, called) in [(0, "north"), (1, "actuator 2")] {
                let alarm = Alarm { value: 2.0, active: true, ..Alarm::new(kind, Some(actuator), 1.0) };
                for text in [alarm.text(&names), kind.over_text(Some(actuator), &names)] {
                    assert!(text.starts_with(&format!("advisory: {called}: ")), "{text}");
                }
                assert!(kind.over_text(Some(actuator), &names).contains(kind.name()));
            }
        }
    }

    #[test]
    fn the_set_of_raised_alarms_is_that_of_the_actuator_and_the_stream() {
        let config = AlarmConfig { limit_amplitude: Some(0.1), limit_lost: Some(3), ..AlarmConfig::default() };
        let mut alarms = Alarms::new(config, 2);
        alarms.read(&reading(1, 1.0, 1.2, 0.0), |_| ());
        alarms.observe(None, 1.0, &Observed { lost: Some(4), ..Observed::default() }, |_| ());
        let waited = Observed { silent_s: Some(0.5), ..Observed::default() };
        alarms.observe(None, 1.0, &waited, |_| panic!("not silent yet"));
        assert_eq!(alarms.raised(0), Kind::Lost.bit());
        assert_eq!(alarms.raised(1), Kind::Lost.bit() | Kind::Amplitude.bit());
    }

    #[test]
    fn all_mistakes_are_told_at_once() {
        let config = AlarmConfig {
            limit_delay_s: Some(-1.0),
            limit_amplitude: Some(f64::NAN),
            hysteresis: 1.0,
            minimum_duration_s: f64::INFINITY,
            silence_s: Some(0.0),
            ..AlarmConfig::default()
        };
        assert_eq!(config.mistakes().len(), 5, "{:#?}", config.mistakes());
        assert!(AlarmConfig::default().mistakes().is_empty());
    }
}
