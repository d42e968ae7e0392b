//! What people call the actuators: by their names, and by numbers from 1.

/// The number that people read for an index.
pub fn number(actuator: usize) -> usize {
    actuator + 1
}

/// One name an actuator.
#[derive(Debug, Clone, PartialEq)]
pub struct Names(Vec<String>);

impl Names {
    /// The names given; an actuator without one is called "actuator 1" and so on.
    pub fn new(given: &[String], n_actuators: usize) -> Self {
        let name = |a| given.get(a).cloned().unwrap_or_else(|| format!("actuator {}", number(a)));
        Self((0..n_actuators).map(name).collect())
    }

    /// What an actuator is called.
    pub fn of(&self, actuator: usize) -> &str {
        &self.0[actuator]
    }

    /// What stands before words about an actuator; nothing before those about the stream itself.
    pub(crate) fn before(&self, actuator: Option<usize>) -> String {
        actuator.map_or_else(String::new, |a| format!("{}: ", self.of(a)))
    }
}
