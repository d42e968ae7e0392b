//! What a call answers, and why a reading has no numbers: fixed numbers with texts.

use std::ffi::{CStr, c_char};

use rthstrack::Reason;

/// What a call answers.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum rthstrack_status {
    /// Done.
    RTHSTRACK_OK = 0,
    /// A pointer is null, or not aligned as its type asks for. Nothing was done.
    RTHSTRACK_BAD_POINTER = 1,
    /// The program was compiled with a header of another interface than the library's, or the settings were not
    /// filled by rthstrack_monitor_config_default. Nothing was done.
    RTHSTRACK_ABI_MISMATCH = 2,
    /// A setting is refused; `message` says which, what it must be and what it was. Nothing was made.
    RTHSTRACK_BAD_SETTING = 3,
    /// `readings` has no room for the readings of a window, one an actuator. The samples from there on were not taken.
    RTHSTRACK_NO_ROOM = 4,
    /// A block has more samples than memory can hold. Nothing was taken.
    RTHSTRACK_BAD_LENGTH = 5,
    /// A command is NaN or infinite. Nothing was moved.
    RTHSTRACK_NOT_FINITE = 6,
    /// A mistake in the library, which says where on standard error. The object refuses all further steps until it is
    /// restarted; what the call was to write may be unwritten.
    RTHSTRACK_PANIC = 7,
}

use rthstrack_status as Status;

impl Status {
    pub(crate) const ALL: [Status; 8] = [
        Status::RTHSTRACK_OK,
        Status::RTHSTRACK_BAD_POINTER,
        Status::RTHSTRACK_ABI_MISMATCH,
        Status::RTHSTRACK_BAD_SETTING,
        Status::RTHSTRACK_NO_ROOM,
        Status::RTHSTRACK_BAD_LENGTH,
        Status::RTHSTRACK_NOT_FINITE,
        Status::RTHSTRACK_PANIC,
    ];

    fn text(self) -> &'static CStr {
        match self {
            Status::RTHSTRACK_OK => c"done",
            Status::RTHSTRACK_BAD_POINTER => c"a pointer is null or not aligned",
            Status::RTHSTRACK_ABI_MISMATCH => {
                c"program and library do not fit together: compile the program with the library's own rthstrack.h, and \
                  fill the settings by rthstrack_monitor_config_default"
            }
            Status::RTHSTRACK_BAD_SETTING => c"a setting is refused",
            Status::RTHSTRACK_NO_ROOM => c"no room for the readings: one an actuator is needed for every window",
            Status::RTHSTRACK_BAD_LENGTH => c"more samples than memory can hold",
            Status::RTHSTRACK_NOT_FINITE => c"a command is NaN or infinite",
            Status::RTHSTRACK_PANIC => c"a mistake in the library; restart or destroy the object, and report it",
        }
    }
}

/// Why a reading has no numbers, or no intervals.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum rthstrack_reason {
    /// Nothing is missing, unless the estimator gives no intervals.
    RTHSTRACK_REASON_NONE = 0,
    /// The target moves too little in the window, or one signal not at all.
    RTHSTRACK_REASON_STILL = 1,
    /// The window holds samples that are NaN or infinite.
    RTHSTRACK_REASON_NOT_FINITE = 2,
    /// Magnitudes leave the range of double precision.
    RTHSTRACK_REASON_RANGE = 3,
    /// Too few samples are left to compare once the target is shifted by the delay: `reason_values[0]` of them.
    RTHSTRACK_REASON_TOO_SHORT = 4,
    /// The window holds too little of a cycle of the target's motion: `reason_values[0]` cycles.
    RTHSTRACK_REASON_FEW_CYCLES = 5,
    /// Too little of measured follows the target: the share `reason_values[0]`.
    RTHSTRACK_REASON_LOW_COHERENCE = 6,
    /// Because of noise the delay is uncertain by more than half a cycle of the motion: `reason_values[0]` seconds.
    RTHSTRACK_REASON_UNCERTAIN = 7,
    /// Two delays fit equally well: `reason_values`, in seconds.
    RTHSTRACK_REASON_AMBIGUOUS = 8,
    /// The best delay lies beyond `reason_values[0]` seconds, the largest taken.
    RTHSTRACK_REASON_BEYOND_MAX_DELAY = 9,
    /// Measured moves against the target; with its sign reversed it would lag by about `reason_values[0]` seconds.
    RTHSTRACK_REASON_OPPOSITE_SIGN = 10,
    /// The search for the delay did not converge.
    RTHSTRACK_REASON_NO_CONVERGENCE = 11,
    /// The target is mostly noise: the share `reason_values[0]` of it, or of its velocity.
    RTHSTRACK_REASON_NOISY_TARGET = 12,
    /// Too many samples are bad (spikes, dropouts, frozen or clipped): the share `reason_values[0]`.
    RTHSTRACK_REASON_BAD_SAMPLES = 13,
    /// Another reason without numbers.
    RTHSTRACK_REASON_OTHER = 99,
    /// No interval: the residual follows the target with coherence `reason_values[0]`.
    RTHSTRACK_REASON_RESIDUAL_FOLLOWS_TARGET = 100,
    /// No interval: too few frequency bins to estimate the noise.
    RTHSTRACK_REASON_FEW_BINS = 101,
    /// No interval: it can be computed for weight power 2 only.
    RTHSTRACK_REASON_WEIGHT_POWER = 102,
    /// No interval: the share `reason_values[0]` of the target's motion lies above a third of the rate, which is too
    /// fast for it.
    RTHSTRACK_REASON_TOO_FAST = 103,
    /// No interval: the noise is coloured, and how much of it is in the target, up to the share `reason_values[0]` of
    /// its velocity, is not known.
    RTHSTRACK_REASON_COLOURED_TARGET_NOISE = 104,
}

use rthstrack_reason as Code;

impl Code {
    const ALL: [Code; 20] = [
        Code::RTHSTRACK_REASON_NONE,
        Code::RTHSTRACK_REASON_STILL,
        Code::RTHSTRACK_REASON_NOT_FINITE,
        Code::RTHSTRACK_REASON_RANGE,
        Code::RTHSTRACK_REASON_TOO_SHORT,
        Code::RTHSTRACK_REASON_FEW_CYCLES,
        Code::RTHSTRACK_REASON_LOW_COHERENCE,
        Code::RTHSTRACK_REASON_UNCERTAIN,
        Code::RTHSTRACK_REASON_AMBIGUOUS,
        Code::RTHSTRACK_REASON_BEYOND_MAX_DELAY,
        Code::RTHSTRACK_REASON_OPPOSITE_SIGN,
        Code::RTHSTRACK_REASON_NO_CONVERGENCE,
        Code::RTHSTRACK_REASON_NOISY_TARGET,
        Code::RTHSTRACK_REASON_BAD_SAMPLES,
        Code::RTHSTRACK_REASON_OTHER,
        Code::RTHSTRACK_REASON_RESIDUAL_FOLLOWS_TARGET,
        Code::RTHSTRACK_REASON_FEW_BINS,
        Code::RTHSTRACK_REASON_WEIGHT_POWER,
        Code::RTHSTRACK_REASON_TOO_FAST,
        Code::RTHSTRACK_REASON_COLOURED_TARGET_NOISE,
    ];

    /// The code, and what the reason says in numbers; NaN where it says none.
    pub(crate) fn of(reason: Option<Reason>) -> (Code, [f64; 2]) {
        let Some(reason) = reason else { return (Code::RTHSTRACK_REASON_NONE, [f64::NAN; 2]) };
        let number = reason.kind().number;
        let code = Code::ALL.into_iter().find(|code| *code as i32 == number);
        (code.unwrap_or(Code::RTHSTRACK_REASON_OTHER), reason.values())
    }
}

/// One line for a status. The text is the library's and lives as long as it; never null.
///
/// Any thread; real-time safe.
#[unsafe(no_mangle)]
pub extern "C" fn rthstrack_status_text(status: i32) -> *const c_char {
    let known = Status::ALL.into_iter().find(|s| *s as i32 == status);
    known.map_or(c"unknown status", Status::text).as_ptr()
}

/// One line for the reason of a reading. The text is the library's and lives as long as it; never null.
///
/// Any thread; real-time safe.
#[unsafe(no_mangle)]
pub extern "C" fn rthstrack_reason_text(reason: i32) -> *const c_char {
    let words = match reason {
        _ if reason == Code::RTHSTRACK_REASON_NONE as i32 => c"nothing is missing",
        _ if reason == Code::RTHSTRACK_REASON_OTHER as i32 => c"not determined",
        _ => Reason::KINDS.iter().find(|kind| kind.number == reason).map_or(c"unknown reason", |kind| kind.words),
    };
    words.as_ptr()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reason_of_the_core_has_its_code_here() {
        let own = [Code::RTHSTRACK_REASON_NONE as i32, Code::RTHSTRACK_REASON_OTHER as i32];
        let mut here: Vec<i32> = Code::ALL.iter().map(|code| *code as i32).filter(|n| !own.contains(n)).collect();
        let mut core: Vec<i32> = Reason::KINDS.iter().map(|kind| kind.number).collect();
        here.sort_unstable();
        core.sort_unstable();
        assert_eq!(here, core);
    }

    #[test]
    fn texts_say_whether_there_is_a_number() {
        for kind in Reason::KINDS {
            // SAFETY: never null, and lives as long as the library.
            let text = unsafe { CStr::from_ptr(rthstrack_reason_text(kind.number)) }.to_str().unwrap();
            assert_eq!(text.starts_with("not determined: "), kind.number < 100, "{text}");
            assert_eq!(text.starts_with("no interval: "), kind.number >= 100, "{text}");
        }
    }

    #[test]
    fn numbers_of_a_reason_go_with_its_code() {
        let (code, values) = Code::of(Some(Reason::Ambiguous { delay_s: 0.5, other_s: 0.75 }));
        assert_eq!((code, values), (Code::RTHSTRACK_REASON_AMBIGUOUS, [0.5, 0.75]));
        let (code, values) = Code::of(Some(Reason::TooShort { n_samples: 3 }));
        assert_eq!((code, values[0], values[1].is_nan()), (Code::RTHSTRACK_REASON_TOO_SHORT, 3.0, true));
    }

    #[test]
    fn codes_and_statuses_are_all_listed_once() {
        let distinct = |mut numbers: Vec<i32>| {
            numbers.sort_unstable();
            numbers.windows(2).all(|n| n[0] < n[1])
        };
        assert!(distinct(Status::ALL.iter().map(|s| *s as i32).collect()));
        assert!(distinct(Code::ALL.iter().map(|r| *r as i32).collect()));
    }
}
