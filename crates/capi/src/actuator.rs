//! The virtual actuator of the RTHS benchmark problem, so that a program can be tried before there is a rig.

use std::ffi::c_char;

use rthstrack::dynamics::{
    Actuator, Compensation, Converter, Delay, Dynamics, Law, Motion, SampledActuator, SampledActuatorState,
    ServoHydraulic,
};

use crate::boundary::{Soundness, guarded, is_sound_out, may_change_threads, write_message};
use crate::status::rthstrack_status::{self, *};

/// The servo-hydraulic actuator of the RTHS benchmark problem (Silva et al. 2020) with its specimen, nominal values:
/// a plant that lags by some 20 ms, to try a monitor with. Displacement in metres, force in newtons.
///
/// One thread at a time may use an actuator; different ones are independent of each other.
pub struct rthstrack_actuator {
    plan: SampledActuator,
    state: SampledActuatorState,
    soundness: Soundness,
}

const _: () = may_change_threads::<rthstrack_actuator>();

/// The nominal plant, nothing between it and the computer.
fn benchmark() -> Actuator {
    Actuator {
        dof: 1,
        from_dof: 0,
        specimen: vec![Law::KelvinVoigt { stiffness: 1.19e6, damping: 114.22 }],
        specimen_mass: 29.13,
        part_of_structure: false,
        gain: 1.0,
        delay: Delay::Constant(0.0),
        dynamics: Dynamics::ServoHydraulic(ServoHydraulic::default()),
        compensation: Compensation::NONE,
        command_converter: Converter::default(),
        displacement_sensor: Converter::default(),
        force_sensor: Converter::default(),
        force_delay_samples: 0,
    }
}

/// Makes the actuator for a loop of `rate_hz` samples a second, at rest, and writes it to `*actuator`; null there
/// when it fails. `message` and `capacity` as for rthstrack_monitor_create.
///
/// Any thread. Uses the heap: not real-time safe. The actuator lives until rthstrack_actuator_destroy.
///
/// RTHSTRACK_BAD_POINTER, RTHSTRACK_BAD_SETTING, RTHSTRACK_PANIC.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rthstrack_actuator_create(
    rate_hz: f64,
    actuator: *mut *mut rthstrack_actuator,
    message: *mut c_char,
    capacity: usize,
) -> rthstrack_status {
    // SAFETY: what the caller promises of `message`.
    let say = |line: &str| unsafe { write_message(message, capacity, line) };
    say("");
    guarded(|| {
        if !is_sound_out(actuator) {
            say("actuator must point to where the new actuator is to be written, not be null");
            return RTHSTRACK_BAD_POINTER;
        }
        // SAFETY: not null and aligned.
        unsafe { actuator.write(std::ptr::null_mut()) };
        match SampledActuator::new(&benchmark(), rate_hz) {
            Ok(plan) => {
                let state = plan.state();
                let made = Box::new(rthstrack_actuator { plan, state, soundness: Soundness::default() });
                // SAFETY: not null and aligned.
                unsafe { actuator.write(Box::into_raw(made)) };
                RTHSTRACK_OK
            }
            Err(error) => {
                say(&error.to_string());
                RTHSTRACK_BAD_SETTING
            }
        }
    })
}

/// One sample: this instant's command in, the specimen's displacement and force at this instant out; either of the
/// two may be null. The command is held until the next, as a converter does.
///
/// One thread at a time. Real-time safe: no heap, no lock, no system call.
///
/// RTHSTRACK_BAD_POINTER, RTHSTRACK_NOT_FINITE, RTHSTRACK_PANIC.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rthstrack_actuator_step(
    actuator: *mut rthstrack_actuator,
    command_m: f64,
    displacement_m: *mut f64,
    force_n: *mut f64,
) -> rthstrack_status {
    let writable = |out: *mut f64| out.is_null() || out.is_aligned();
    if !(is_sound_out(actuator) && writable(displacement_m) && writable(force_n)) {
        return RTHSTRACK_BAD_POINTER;
    }
    // SAFETY: the caller has it from `create` and lets no other thread use it now.
    let rthstrack_actuator { plan, state, soundness } = unsafe { &mut *actuator };
    soundness.guarded(|| {
        if !command_m.is_finite() {
            return RTHSTRACK_NOT_FINITE;
        }
        let command = Motion { displacement: command_m, velocity: 0.0, acceleration: 0.0 };
        let (motion, force) = plan.step(state, command);
        for (out, value) in [(displacement_m, motion.displacement), (force_n, force)] {
            if !out.is_null() {
                // SAFETY: not null and aligned.
                unsafe { out.write(value) };
            }
        }
        RTHSTRACK_OK
    })
}

/// Frees an actuator; null is taken and nothing done.
///
/// Any thread, when no other uses the actuator. Uses the heap: not real-time safe. The actuator may not be used after.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rthstrack_actuator_destroy(actuator: *mut rthstrack_actuator) {
    guarded(|| {
        if is_sound_out(actuator) {
            // SAFETY: the caller has it from `create` and gives it up.
            drop(unsafe { Box::from_raw(actuator) });
        }
        RTHSTRACK_OK
    });
}
