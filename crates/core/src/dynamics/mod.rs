//! Virtual tests: a structure of which part is computed and part is a specimen, moved by actuators that lag:
//! M x'' + C x' + K x + sum of restoring forces = -M i a_g. Or actuators alone, along a target that is given.
//!
//! Data flows through the modules in this order:
//!
//! 1. [`structure`]: M, C, K of the whole structure, elastic.
//! 2. [`law`]: restoring forces of specimens and of members that yield.
//! 3. `compensator`, `history`, `delay`, [`plant`], `converter`: from target to command to measured motion and force;
//!    [`actuator`] is one of each with its specimen.
//! 4. [`virtual_test`]: what is tested, checked whole (`check`), and split into its two parts.
//! 5. `continuous`: the delay equation in continuous time; `sampled`: the loop of a laboratory's computer, whose actuators
//!    move once a sample (`sampled_actuator`).
//! 6. [`stability`]: the delay that a loop bears, and what a delay costs in damping.
//! 7. `running`: all of that asked of a test.
//!
//! Degrees of freedom are numbered from 1; 0 is the ground. A positive delay means that measured lags target. SI units. Knows
//! nothing of the evaluation, which knows nothing of it.

pub mod actuator;
mod check;
mod compensator;
mod continuous;
mod converter;
mod delay;
mod history;
pub mod law;
pub mod plant;
mod running;
mod sampled;
mod sampled_actuator;
pub mod stability;
pub mod structure;
pub mod virtual_test;

pub use crate::error::Mistake;
pub use actuator::Actuator;
pub use compensator::Compensation;
pub use converter::Converter;
pub use delay::Delay;
pub use history::Motion;
pub use law::{BoucWen, Law, Memory};
pub use plant::{Dynamics, ServoHydraulic};
pub use sampled_actuator::{SampledActuator, SampledActuatorState};
pub use stability::{CriticalDelay, DelayDamping};
pub use structure::{Damping, Structure};
pub use virtual_test::{Element, Noise, Run, Stepping, TestConfig, VirtualTest};
