//! The monitor.

use std::ffi::c_char;
use std::slice;

use rthstrack::{Monitor, MonitorState};

use crate::boundary::{Soundness, guarded, is_sound, is_sound_out, may_change_threads, write_message};
use crate::config::rthstrack_monitor_config;
use crate::reading::rthstrack_reading;
use crate::status::rthstrack_status::{self, *};

/// Gain and delay of actuators, sample by sample, over a moving window.
///
/// One thread at a time may use a monitor; different ones are independent of each other.
pub struct rthstrack_monitor {
    plan: Monitor,
    state: MonitorState,
    soundness: Soundness,
}

const _: () = may_change_threads::<rthstrack_monitor>();

/// Room for readings in the caller's memory.
struct Room {
    first: *mut rthstrack_reading,
    capacity: usize,
    written: usize,
}

impl Room {
    fn left(&self) -> usize {
        self.capacity - self.written
    }

    fn write(&mut self, readings: &[rthstrack::Reading]) {
        assert!(readings.len() <= self.left());
        for reading in readings {
            // SAFETY: below the capacity, which the caller has stated; `first` is not null and aligned.
            unsafe { self.first.add(self.written).write(rthstrack_reading::of(reading)) };
            self.written += 1;
        }
    }
}

/// Makes a monitor and writes it to `*monitor`; null there when it fails. One line that says what is wrong is written
/// to `message`, which has room for `capacity` bytes, the final zero included; 256 are plenty. `message` may be null.
///
/// Any thread. Uses the heap: not real-time safe; where memory runs out the process ends, as Rust's programs do. The
/// monitor lives until rthstrack_monitor_destroy.
///
/// RTHSTRACK_BAD_POINTER, RTHSTRACK_ABI_MISMATCH, RTHSTRACK_BAD_SETTING, RTHSTRACK_PANIC.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rthstrack_monitor_create(
    config: *const rthstrack_monitor_config,
    monitor: *mut *mut rthstrack_monitor,
    message: *mut c_char,
    capacity: usize,
) -> rthstrack_status {
    // SAFETY: what the caller promises of `message`.
    let say = |line: &str| unsafe { write_message(message, capacity, line) };
    say("");
    guarded(|| {
        if !is_sound_out(monitor) {
            say("monitor must point to where the new monitor is to be written, not be null");
            return RTHSTRACK_BAD_POINTER;
        }
        // SAFETY: not null and aligned.
        unsafe { monitor.write(std::ptr::null_mut()) };
        if !is_sound(config) {
            say("config must point to settings, not be null");
            return RTHSTRACK_BAD_POINTER;
        }
        // SAFETY: not null and aligned. What other headers call settings begins with these two numbers as well.
        let (size, abi_version) = unsafe { ((*config).size, (*config).abi_version) };
        if !rthstrack_monitor_config::fits(size, abi_version) {
            say(&rthstrack_monitor_config::misfit(size, abi_version));
            return RTHSTRACK_ABI_MISMATCH;
        }
        // SAFETY: not null, aligned, and as long as the library's.
        let made = unsafe { *config }.read().and_then(|config| Monitor::new(config).map_err(|e| e.to_string()));
        match made {
            Ok(plan) => {
                let state = plan.state();
                let made = Box::new(rthstrack_monitor { plan, state, soundness: Soundness::default() });
                // SAFETY: not null and aligned.
                unsafe { monitor.write(Box::into_raw(made)) };
                RTHSTRACK_OK
            }
            Err(line) => {
                say(&line);
                RTHSTRACK_BAD_SETTING
            }
        }
    })
}

/// Frees a monitor; null is taken and nothing done.
///
/// Any thread, when no other uses the monitor. Uses the heap: not real-time safe. The monitor may not be used after.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rthstrack_monitor_destroy(monitor: *mut rthstrack_monitor) {
    guarded(|| {
        if is_sound_out(monitor) {
            // SAFETY: the caller has it from `create` and gives it up.
            drop(unsafe { Box::from_raw(monitor) });
        }
        RTHSTRACK_OK
    });
}

/// Takes one sample of every actuator: n_actuators values of `target` and of `measured`. When a window is complete,
/// the readings of all actuators are written to `readings`, which has room for `capacity` of them, at least
/// n_actuators at any time; `*n_readings` is how many were written, 0 or n_actuators. Samples may be any number: one
/// that is NaN or infinite makes the readings invalid whose window holds it.
///
/// One thread at a time. Real-time safe: no heap, no lock, no system call (but for RTHSTRACK_PANIC, which means a
/// mistake in the library and is told on standard error); the steps with a reading take the longest.
///
/// RTHSTRACK_BAD_POINTER, RTHSTRACK_NO_ROOM (the sample was not taken), RTHSTRACK_PANIC.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rthstrack_monitor_step(
    monitor: *mut rthstrack_monitor,
    target: *const f64,
    measured: *const f64,
    readings: *mut rthstrack_reading,
    capacity: usize,
    n_readings: *mut usize,
) -> rthstrack_status {
    if !is_sound_out(n_readings) {
        return RTHSTRACK_BAD_POINTER;
    }
    // SAFETY: not null and aligned.
    unsafe { n_readings.write(0) };
    if !(is_sound_out(monitor) && is_sound(target) && is_sound(measured) && is_sound_out(readings)) {
        return RTHSTRACK_BAD_POINTER;
    }
    // SAFETY: the caller has it from `create` and lets no other thread use it now.
    let rthstrack_monitor { plan, state, soundness } = unsafe { &mut *monitor };
    let n = plan.config().n_actuators;
    let mut room = Room { first: readings, capacity, written: 0 };
    let status = soundness.guarded(|| {
        if capacity < n {
            return RTHSTRACK_NO_ROOM;
        }
        // SAFETY: not null, aligned, and of n_actuators values.
        let (target, measured) = unsafe { (slice::from_raw_parts(target, n), slice::from_raw_parts(measured, n)) };
        if let Some(readings) = plan.step(state, target, measured) {
            room.write(readings);
        }
        RTHSTRACK_OK
    });
    // SAFETY: not null and aligned.
    unsafe { n_readings.write(room.written) };
    status
}

/// Takes a block of `n_samples` samples of every actuator, side by side: sample 0 of all actuators, then sample 1 of
/// all. Gives the readings, to the last bit, of as many calls of rthstrack_monitor_step. Ends early where `readings`
/// has no room for the next window's: `*n_taken` is how many samples were taken, `*n_readings` how many readings were
/// written. See rthstrack_monitor_readings_in. With `n_samples` 0, `target` and `measured` may be null; with
/// `capacity` 0, `readings`.
///
/// One thread at a time. Real-time safe, in time proportional to n_samples.
///
/// RTHSTRACK_BAD_POINTER, RTHSTRACK_BAD_LENGTH, RTHSTRACK_NO_ROOM (go on from sample *n_taken), RTHSTRACK_PANIC.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rthstrack_monitor_process(
    monitor: *mut rthstrack_monitor,
    target: *const f64,
    measured: *const f64,
    n_samples: usize,
    readings: *mut rthstrack_reading,
    capacity: usize,
    n_taken: *mut usize,
    n_readings: *mut usize,
) -> rthstrack_status {
    if !(is_sound_out(monitor) && is_sound_out(n_taken) && is_sound_out(n_readings)) {
        return RTHSTRACK_BAD_POINTER;
    }
    // SAFETY: not null and aligned.
    unsafe {
        n_taken.write(0);
        n_readings.write(0);
    }
    if (n_samples > 0 && !(is_sound(target) && is_sound(measured))) || (capacity > 0 && !is_sound_out(readings)) {
        return RTHSTRACK_BAD_POINTER;
    }
    // SAFETY: the caller has it from `create` and lets no other thread use it now.
    let rthstrack_monitor { plan, state, soundness } = unsafe { &mut *monitor };
    let values = n_samples.checked_mul(plan.config().n_actuators);
    let Some(values) = values.filter(|n| *n <= isize::MAX as usize / size_of::<f64>()) else {
        return RTHSTRACK_BAD_LENGTH;
    };
    let mut room = Room { first: readings, capacity, written: 0 };
    let mut taken = 0;
    let status = soundness.guarded(|| {
        if n_samples > 0 {
            // SAFETY: not null, aligned, and of n_samples * n_actuators values, a size that memory can hold.
            let signal = |first: *const f64| unsafe { slice::from_raw_parts(first, values) };
            let (target, measured) = (signal(target), signal(measured));
            taken = plan.process_with(state, target, measured, capacity, |readings| room.write(readings)).samples;
        }
        if taken < n_samples { RTHSTRACK_NO_ROOM } else { RTHSTRACK_OK }
    });
    // SAFETY: not null and aligned.
    unsafe {
        n_taken.write(taken);
        n_readings.write(room.written);
    }
    status
}

/// Forgets all samples; the next one has this index. Makes a monitor that answered RTHSTRACK_PANIC useful again.
///
/// One thread at a time. Real-time safe.
///
/// RTHSTRACK_BAD_POINTER, RTHSTRACK_PANIC.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rthstrack_monitor_restart(monitor: *mut rthstrack_monitor, index: u64) -> rthstrack_status {
    if !is_sound_out(monitor) {
        return RTHSTRACK_BAD_POINTER;
    }
    // SAFETY: the caller has it from `create` and lets no other thread use it now.
    let rthstrack_monitor { plan, state, soundness } = unsafe { &mut *monitor };
    soundness.mend();
    soundness.guarded(|| {
        plan.restart(state, index);
        RTHSTRACK_OK
    })
}

/// What a monitor says of itself; `otherwise` where there is none, or where that panics.
///
/// # Safety
/// `monitor` is null, or from `create` and changed by no other thread now.
unsafe fn told<T>(monitor: *const rthstrack_monitor, otherwise: T, tell: impl FnOnce(&rthstrack_monitor) -> T) -> T {
    let mut answer = otherwise;
    guarded(|| {
        if is_sound(monitor) {
            // SAFETY: not null, and what the caller promises.
            answer = tell(unsafe { &*monitor });
        }
        RTHSTRACK_OK
    });
    answer
}

/// Actuators that are stepped together; 0 if `monitor` is null.
///
/// One thread at a time. Real-time safe.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rthstrack_monitor_n_actuators(monitor: *const rthstrack_monitor) -> usize {
    // SAFETY: what the caller promises.
    unsafe { told(monitor, 0, |m| m.plan.config().n_actuators) }
}

/// Readings a second as they come: a whole number of decimated samples apart. NaN if `monitor` is null.
///
/// One thread at a time. Real-time safe.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rthstrack_monitor_update_hz(monitor: *const rthstrack_monitor) -> f64 {
    // SAFETY: what the caller promises.
    unsafe { told(monitor, f64::NAN, |m| m.plan.update_hz()) }
}

/// The decimator's delay, in seconds: by how much the newest sample of a window is older than the sample that brings
/// the reading. NaN if `monitor` is null.
///
/// One thread at a time. Real-time safe.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rthstrack_monitor_latency_s(monitor: *const rthstrack_monitor) -> f64 {
    // SAFETY: what the caller promises.
    unsafe { told(monitor, f64::NAN, |m| m.plan.latency_s()) }
}

/// From the centre of a window to the sample that brings its reading, in seconds. NaN if `monitor` is null.
///
/// One thread at a time. Real-time safe.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rthstrack_monitor_age_s(monitor: *const rthstrack_monitor) -> f64 {
    // SAFETY: what the caller promises.
    unsafe { told(monitor, f64::NAN, |m| m.plan.age_s()) }
}

/// Samples until the next reading, the one that brings it included; 0 if `monitor` is null.
///
/// One thread at a time. Real-time safe.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rthstrack_monitor_samples_until_reading(monitor: *const rthstrack_monitor) -> usize {
    // SAFETY: what the caller promises.
    unsafe { told(monitor, 0, |m| m.plan.samples_until_reading(&m.state)) }
}

/// How many readings the next `n_samples` samples bring, of all actuators; 0 if `monitor` is null.
///
/// One thread at a time. Real-time safe.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rthstrack_monitor_readings_in(monitor: *const rthstrack_monitor, n_samples: usize) -> usize {
    // SAFETY: what the caller promises.
    unsafe { told(monitor, 0, |m| m.plan.readings_in(&m.state, n_samples)) }
}
