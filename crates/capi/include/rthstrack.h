/* rthstrack: did the actuator do what the simulation asked? The on-line monitor for real-time programs.
 *
 *     rthstrack_monitor_config config;
 *     rthstrack_monitor *monitor;
 *     char message[256];
 *     rthstrack_monitor_config_default(&config, sizeof config, RTHSTRACK_ABI_VERSION);
 *     if (rthstrack_monitor_create(&config, &monitor, message, sizeof message) != RTHSTRACK_OK) { puts(message); ... }
 *     ... once a sample:
 *     rthstrack_monitor_step(monitor, target, measured, readings, capacity, &n_readings);
 *     ... at the end:
 *     rthstrack_monitor_destroy(monitor);
 *
 * Only _create and _destroy use the heap. All other functions are real-time safe: no heap, no lock, no wait, no
 * log, no system call, bounded work. No function lets a panic or an exception out. Pointers must be null (and are
 * then refused), or point to memory of the stated type and length that nothing else changes during the call; what
 * is written to may not overlap what is read. A pointer to a monitor or an actuator comes from _create and has not
 * been through _destroy. Each such object may be used by one thread at a time, not always the same; functions
 * without one may be called from any.
 *
 * Numbers of statuses, reasons and choices never change their meaning. Whatever else a program can see of a
 * structure or a function changes only together with RTHSTRACK_ABI_VERSION.
 *
 * Made by cbindgen from the sources of crates/capi. Do not edit, but:
 * RTHSTRACK_BLESS=1 cargo test -p rthstrack-capi --test header */

#ifndef RTHSTRACK_H
#define RTHSTRACK_H

#include <stddef.h>
#include <stdint.h>

// The interface that this header describes; see rthstrack_abi_version.
#define RTHSTRACK_ABI_VERSION 2

// What a call answers.
enum rthstrack_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Done.
    RTHSTRACK_OK = 0,
    // A pointer is null, or not aligned as its type asks for. Nothing was done.
    RTHSTRACK_BAD_POINTER = 1,
    // The program was compiled with a header of another interface than the library's, or the settings were not
    // filled by rthstrack_monitor_config_default. Nothing was done.
    RTHSTRACK_ABI_MISMATCH = 2,
    // A setting is refused; `message` says which, what it must be and what it was. Nothing was made.
    RTHSTRACK_BAD_SETTING = 3,
    // `readings` has no room for the readings of a window, one an actuator. The samples from there on were not taken.
    RTHSTRACK_NO_ROOM = 4,
    // A block has more samples than memory can hold. Nothing was taken.
    RTHSTRACK_BAD_LENGTH = 5,
    // A command is NaN or infinite. Nothing was moved.
    RTHSTRACK_NOT_FINITE = 6,
    // A mistake in the library, which says where on standard error. The object refuses all further steps until it is
    // restarted; what the call was to write may be unwritten.
    RTHSTRACK_PANIC = 7,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum rthstrack_status rthstrack_status;
#else
typedef int32_t rthstrack_status;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Why a reading has no numbers, or no intervals.
enum rthstrack_reason
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Nothing is missing, unless the estimator gives no intervals.
    RTHSTRACK_REASON_NONE = 0,
    // The target moves too little in the window, or one signal not at all.
    RTHSTRACK_REASON_STILL = 1,
    // The window holds samples that are NaN or infinite.
    RTHSTRACK_REASON_NOT_FINITE = 2,
    // Magnitudes leave the range of double precision.
    RTHSTRACK_REASON_RANGE = 3,
    // Too few samples are left to compare once the target is shifted by the delay: `reason_values[0]` of them.
    RTHSTRACK_REASON_TOO_SHORT = 4,
    // The window holds too little of a cycle of the target's motion: `reason_values[0]` cycles.
    RTHSTRACK_REASON_FEW_CYCLES = 5,
    // Too little of measured follows the target: the share `reason_values[0]`.
    RTHSTRACK_REASON_LOW_COHERENCE = 6,
    // Because of noise the delay is uncertain by more than half a cycle of the motion: `reason_values[0]` seconds.
    RTHSTRACK_REASON_UNCERTAIN = 7,
    // Two delays fit equally well: `reason_values`, in seconds.
    RTHSTRACK_REASON_AMBIGUOUS = 8,
    // The best delay lies beyond `reason_values[0]` seconds, the largest taken.
    RTHSTRACK_REASON_BEYOND_MAX_DELAY = 9,
    // Measured moves against the target; with its sign reversed it would lag by about `reason_values[0]` seconds.
    RTHSTRACK_REASON_OPPOSITE_SIGN = 10,
    // The search for the delay did not converge.
    RTHSTRACK_REASON_NO_CONVERGENCE = 11,
    // The target is mostly noise: the share `reason_values[0]` of it, or of its velocity.
    RTHSTRACK_REASON_NOISY_TARGET = 12,
    // Too many samples are bad (spikes, dropouts, frozen or clipped): the share `reason_values[0]`.
    RTHSTRACK_REASON_BAD_SAMPLES = 13,
    // Another reason without numbers.
    RTHSTRACK_REASON_OTHER = 99,
    // No interval: the residual follows the target with coherence `reason_values[0]`.
    RTHSTRACK_REASON_RESIDUAL_FOLLOWS_TARGET = 100,
    // No interval: too few frequency bins to estimate the noise.
    RTHSTRACK_REASON_FEW_BINS = 101,
    // No interval: it can be computed for weight power 2 only.
    RTHSTRACK_REASON_WEIGHT_POWER = 102,
    // No interval: the share `reason_values[0]` of the target's motion lies above a third of the rate, which is too
    // fast for it.
    RTHSTRACK_REASON_TOO_FAST = 103,
    // No interval: the noise is coloured, and how much of it is in the target, up to the share `reason_values[0]` of
    // its velocity, is not known.
    RTHSTRACK_REASON_COLOURED_TARGET_NOISE = 104,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum rthstrack_reason rthstrack_reason;
#else
typedef int32_t rthstrack_reason;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Window over the samples.
enum rthstrack_window
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // No window: every sample counts alike.
    RTHSTRACK_WINDOW_BOXCAR = 0,
    // 0.5 - 0.5 cos.
    RTHSTRACK_WINDOW_HANN = 1,
    // 0.54 - 0.46 cos.
    RTHSTRACK_WINDOW_HAMMING = 2,
    // 0.42 - 0.5 cos + 0.08 cos 2.
    RTHSTRACK_WINDOW_BLACKMAN = 3,
    // The five-term flat-top window.
    RTHSTRACK_WINDOW_FLATTOP = 4,
    // Flat with cosine ends, a quarter of the window at either end.
    RTHSTRACK_WINDOW_TUKEY = 5,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum rthstrack_window rthstrack_window;
#else
typedef int32_t rthstrack_window;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What is subtracted before the window.
enum rthstrack_detrend
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // The mean; with RTHSTRACK_ESTIMATOR_FEI nothing.
    RTHSTRACK_DETREND_USUAL = -1,
    // Nothing.
    RTHSTRACK_DETREND_NONE = 0,
    // The mean.
    RTHSTRACK_DETREND_MEAN = 1,
    // The straight line of least squares.
    RTHSTRACK_DETREND_LINEAR = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum rthstrack_detrend rthstrack_detrend;
#else
typedef int32_t rthstrack_detrend;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// How gain and delay are estimated.
enum rthstrack_estimator
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // The published weighted average; gives no intervals.
    RTHSTRACK_ESTIMATOR_FEI = 0,
    // The same on the target shifted by the delay, until no phase is left.
    RTHSTRACK_ESTIMATOR_ALIGNED = 1,
    // One gain and one delay by least squares on the shifted target.
    RTHSTRACK_ESTIMATOR_LEAST_SQUARES = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum rthstrack_estimator rthstrack_estimator;
#else
typedef int32_t rthstrack_estimator;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// The servo-hydraulic actuator of the RTHS benchmark problem (Silva et al. 2020) with its specimen, nominal values:
// a plant that lags by some 20 ms, to try a monitor with. Displacement in metres, force in newtons.
//
// One thread at a time may use an actuator; different ones are independent of each other.
typedef struct rthstrack_actuator rthstrack_actuator;

// Gain and delay of actuators, sample by sample, over a moving window.
//
// One thread at a time may use a monitor; different ones are independent of each other.
typedef struct rthstrack_monitor rthstrack_monitor;

// The settings of a monitor. Fill it by rthstrack_monitor_config_default, then change what is to differ.
typedef struct rthstrack_monitor_config {
    // sizeof(rthstrack_monitor_config); do not change it.
    uint32_t size;
    // RTHSTRACK_ABI_VERSION; do not change it.
    uint32_t abi_version;
    // Incoming samples a second. Default 1024.
    double rate_hz;
    // Length of the window, in seconds. Default 4.
    double window_s;
    // Readings a second; the rate kept may differ, see rthstrack_monitor_update_hz. Default 64.
    double update_hz;
    // Lowest frequency kept, in hertz. Default NaN: both NaN keep all, with data_decimation above 1 up to rate / (4
    // P).
    double band_low_hz;
    // Highest frequency kept, in hertz. Default NaN.
    double band_high_hz;
    // Largest delay or lead looked for by the estimators that shift the target, in seconds. Default 0.25.
    double max_delay_s;
    // Of delays that fit equally well (the target is one tone), the one nearest to this is taken, in seconds.
    // Default NaN: not known.
    double expected_delay_s;
    // A window is judged where the target's amplitude in it, sqrt(2) times its standard deviation, is at least this.
    // Default 0.
    double minimum_amplitude;
    // A rthstrack_window. Default RTHSTRACK_WINDOW_BOXCAR.
    int32_t window;
    // A rthstrack_detrend. Default RTHSTRACK_DETREND_USUAL.
    int32_t detrend;
    // A rthstrack_estimator. Default RTHSTRACK_ESTIMATOR_LEAST_SQUARES.
    int32_t estimator;
    // Actuators that are stepped together. Default 1.
    uint32_t n_actuators;
    // P, a power of two: samples are decimated as they come. Readings cost less, and speak of a window that ends
    // rthstrack_monitor_latency_s earlier. Default 1.
    uint32_t data_decimation;
    // Q, a power of two: keeps every Q-th frequency bin. Default 1.
    uint32_t frequency_decimation;
} rthstrack_monitor_config;

// Gain and delay of one actuator over the latest window. NaN where there is no number.
typedef struct rthstrack_reading {
    // Index of the incoming sample that completed the window.
    uint64_t index;
    // From 0.
    uint64_t actuator;
    // When that sample came, in seconds from sample 0: index / rate.
    double time_s;
    // Centre of the window, in the same time; the decimator's delay is taken out.
    double centre_s;
    // A: measured over target; 1 is perfect.
    double amplitude;
    // d, in seconds; positive when measured lags target.
    double delay_s;
    // phi, in radians; negative when measured lags.
    double phase_rad;
    // f_eq, in hertz: d = -phi / (2 pi f_eq).
    double equivalent_frequency_hz;
    // 95 % interval of A, lower and upper end; NaN where there is none.
    double amplitude_interval[2];
    // 95 % interval of d, in seconds.
    double delay_interval_s[2];
    // What the reason says in numbers; NaN where it says none.
    double reason_values[2];
    // A rthstrack_reason: why there are no numbers, or no intervals.
    int32_t reason;
    // 1 where there are numbers, else 0.
    int32_t valid;
} rthstrack_reading;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The interface that the library speaks. A program and a library fit together where this is RTHSTRACK_ABI_VERSION.
//
// Any thread; real-time safe.
uint32_t rthstrack_abi_version(void);

// The library's version, such as "0.1.0". The text is the library's and lives as long as it.
//
// Any thread; real-time safe.
const char *rthstrack_version(void);

// One line for a status. The text is the library's and lives as long as it; never null.
//
// Any thread; real-time safe.
const char *rthstrack_status_text(int32_t status);

// One line for the reason of a reading. The text is the library's and lives as long as it; never null.
//
// Any thread; real-time safe.
const char *rthstrack_reason_text(int32_t reason);

// Fills the settings with their defaults. `size` is sizeof *config, `abi_version` is RTHSTRACK_ABI_VERSION, both as
// the program was compiled: if the library lays the settings out in another way, nothing is written.
//
// Any thread; real-time safe.
//
// RTHSTRACK_BAD_POINTER, RTHSTRACK_ABI_MISMATCH.
rthstrack_status rthstrack_monitor_config_default(struct rthstrack_monitor_config *config,
                                                  size_t size,
                                                  uint32_t abi_version);

// Makes a monitor and writes it to `*monitor`; null there when it fails. One line that says what is wrong is written
// to `message`, which has room for `capacity` bytes, the final zero included; 256 are plenty. `message` may be null.
//
// Any thread. Uses the heap: not real-time safe; where memory runs out the process ends, as Rust's programs do. The
// monitor lives until rthstrack_monitor_destroy.
//
// RTHSTRACK_BAD_POINTER, RTHSTRACK_ABI_MISMATCH, RTHSTRACK_BAD_SETTING, RTHSTRACK_PANIC.
rthstrack_status rthstrack_monitor_create(const struct rthstrack_monitor_config *config,
                                          struct rthstrack_monitor **monitor,
                                          char *message,
                                          size_t capacity);

// Frees a monitor; null is taken and nothing done.
//
// Any thread, when no other uses the monitor. Uses the heap: not real-time safe. The monitor may not be used after.
void rthstrack_monitor_destroy(struct rthstrack_monitor *monitor);

// Takes one sample of every actuator: n_actuators values of `target` and of `measured`. When a window is complete,
// the readings of all actuators are written to `readings`, which has room for `capacity` of them, at least
// n_actuators at any time; `*n_readings` is how many were written, 0 or n_actuators. Samples may be any number: one
// that is NaN or infinite makes the readings invalid whose window holds it.
//
// One thread at a time. Real-time safe: no heap, no lock, no system call (but for RTHSTRACK_PANIC, which means a
// mistake in the library and is told on standard error); the steps with a reading take the longest.
//
// RTHSTRACK_BAD_POINTER, RTHSTRACK_NO_ROOM (the sample was not taken), RTHSTRACK_PANIC.
rthstrack_status rthstrack_monitor_step(struct rthstrack_monitor *monitor,
                                        const double *target,
                                        const double *measured,
                                        struct rthstrack_reading *readings,
                                        size_t capacity,
                                        size_t *n_readings);

// Takes a block of `n_samples` samples of every actuator, side by side: sample 0 of all actuators, then sample 1 of
// all. Gives the readings, to the last bit, of as many calls of rthstrack_monitor_step. Ends early where `readings`
// has no room for the next window's: `*n_taken` is how many samples were taken, `*n_readings` how many readings were
// written. See rthstrack_monitor_readings_in. With `n_samples` 0, `target` and `measured` may be null; with
// `capacity` 0, `readings`.
//
// One thread at a time. Real-time safe, in time proportional to n_samples.
//
// RTHSTRACK_BAD_POINTER, RTHSTRACK_BAD_LENGTH, RTHSTRACK_NO_ROOM (go on from sample *n_taken), RTHSTRACK_PANIC.
rthstrack_status rthstrack_monitor_process(struct rthstrack_monitor *monitor,
                                           const double *target,
                                           const double *measured,
                                           size_t n_samples,
                                           struct rthstrack_reading *readings,
                                           size_t capacity,
                                           size_t *n_taken,
                                           size_t *n_readings);

// Forgets all samples; the next one has this index. Makes a monitor that answered RTHSTRACK_PANIC useful again.
//
// One thread at a time. Real-time safe.
//
// RTHSTRACK_BAD_POINTER, RTHSTRACK_PANIC.
rthstrack_status rthstrack_monitor_restart(struct rthstrack_monitor *monitor, uint64_t index);

// Actuators that are stepped together; 0 if `monitor` is null.
//
// One thread at a time. Real-time safe.
size_t rthstrack_monitor_n_actuators(const struct rthstrack_monitor *monitor);

// Readings a second as they come: a whole number of decimated samples apart. NaN if `monitor` is null.
//
// One thread at a time. Real-time safe.
double rthstrack_monitor_update_hz(const struct rthstrack_monitor *monitor);

// The decimator's delay, in seconds: by how much the newest sample of a window is older than the sample that brings
// the reading. NaN if `monitor` is null.
//
// One thread at a time. Real-time safe.
double rthstrack_monitor_latency_s(const struct rthstrack_monitor *monitor);

// From the centre of a window to the sample that brings its reading, in seconds. NaN if `monitor` is null.
//
// One thread at a time. Real-time safe.
double rthstrack_monitor_age_s(const struct rthstrack_monitor *monitor);

// Samples until the next reading, the one that brings it included; 0 if `monitor` is null.
//
// One thread at a time. Real-time safe.
size_t rthstrack_monitor_samples_until_reading(const struct rthstrack_monitor *monitor);

// How many readings the next `n_samples` samples bring, of all actuators; 0 if `monitor` is null.
//
// One thread at a time. Real-time safe.
size_t rthstrack_monitor_readings_in(const struct rthstrack_monitor *monitor, size_t n_samples);

// Makes the actuator for a loop of `rate_hz` samples a second, at rest, and writes it to `*actuator`; null there
// when it fails. `message` and `capacity` as for rthstrack_monitor_create.
//
// Any thread. Uses the heap: not real-time safe. The actuator lives until rthstrack_actuator_destroy.
//
// RTHSTRACK_BAD_POINTER, RTHSTRACK_BAD_SETTING, RTHSTRACK_PANIC.
rthstrack_status rthstrack_actuator_create(double rate_hz,
                                           struct rthstrack_actuator **actuator,
                                           char *message,
                                           size_t capacity);

// One sample: this instant's command in, the specimen's displacement and force at this instant out; either of the
// two may be null. The command is held until the next, as a converter does.
//
// One thread at a time. Real-time safe: no heap, no lock, no system call.
//
// RTHSTRACK_BAD_POINTER, RTHSTRACK_NOT_FINITE, RTHSTRACK_PANIC.
rthstrack_status rthstrack_actuator_step(struct rthstrack_actuator *actuator,
                                         double command_m,
                                         double *displacement_m,
                                         double *force_n);

// Frees an actuator; null is taken and nothing done.
//
// Any thread, when no other uses the actuator. Uses the heap: not real-time safe. The actuator may not be used after.
void rthstrack_actuator_destroy(struct rthstrack_actuator *actuator);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* RTHSTRACK_H */
