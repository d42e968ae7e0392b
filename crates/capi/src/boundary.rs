//! What crosses between C and Rust: pointers, messages, and no panic.

use std::ffi::c_char;
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::status::rthstrack_status::{self, RTHSTRACK_PANIC};

/// Runs what a function does; a panic becomes a status.
pub(crate) fn guarded(call: impl FnOnce() -> rthstrack_status) -> rthstrack_status {
    catch_unwind(AssertUnwindSafe(call)).unwrap_or(RTHSTRACK_PANIC)
}

/// The same for what steps an object: once a panic has left it half changed, only `mend` makes it of use again.
#[derive(Debug, Default)]
pub(crate) struct Soundness {
    broken: bool,
}

impl Soundness {
    pub(crate) fn guarded(&mut self, call: impl FnOnce() -> rthstrack_status) -> rthstrack_status {
        if self.broken {
            return RTHSTRACK_PANIC;
        }
        let status = guarded(call);
        self.broken = status == RTHSTRACK_PANIC;
        status
    }

    pub(crate) fn mend(&mut self) {
        self.broken = false;
    }
}

/// What may go from thread to thread, as the header says of the objects.
pub(crate) const fn may_change_threads<T: Send>() {}

/// Whether a pointer can be read from, as far as that can be seen.
pub(crate) fn is_sound<T>(pointer: *const T) -> bool {
    !pointer.is_null() && pointer.is_aligned()
}

/// Whether a pointer can be written to, as far as that can be seen.
pub(crate) fn is_sound_out<T>(pointer: *mut T) -> bool {
    is_sound(pointer.cast_const())
}

/// Writes one line, ended by a zero and cut where the room ends; nothing where there is none.
///
/// # Safety
/// `message` is null or has room for `capacity` bytes.
pub(crate) unsafe fn write_message(message: *mut c_char, capacity: usize, line: &str) {
    if message.is_null() || capacity == 0 {
        return;
    }
    let mut length = line.len().min(capacity - 1);
    while !line.is_char_boundary(length) {
        length -= 1;
    }
    // SAFETY: `length` is below the capacity and not above the line's; the two do not overlap, for the line is ours.
    unsafe {
        message.cast::<u8>().copy_from_nonoverlapping(line.as_ptr(), length);
        message.add(length).write(0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::status::rthstrack_status::RTHSTRACK_OK;

    #[test]
    fn a_panic_becomes_a_status() {
        assert_eq!(guarded(|| panic!("as intended by a test")), RTHSTRACK_PANIC);
        assert_eq!(guarded(|| RTHSTRACK_OK), RTHSTRACK_OK);
    }

    #[test]
    fn an_object_that_panicked_is_refused_until_it_is_mended() {
        let mut soundness = Soundness::default();
        let mut steps = 0;
        assert_eq!(soundness.guarded(|| panic!("as intended by a test")), RTHSTRACK_PANIC);
        let mut step = |soundness: &mut Soundness| {
            soundness.guarded(|| {
                steps += 1;
                RTHSTRACK_OK
            })
        };
        assert_eq!(step(&mut soundness), RTHSTRACK_PANIC);
        soundness.mend();
        assert_eq!(step(&mut soundness), RTHSTRACK_OK);
        assert_eq!(steps, 1);
    }

    #[test]
    fn a_message_is_cut_between_characters_and_always_ends() {
        let mut room = [1 as c_char; 8];
        // SAFETY: the capacities are within the array.
        unsafe {
            write_message(room.as_mut_ptr(), 4, "ab\u{b5}m");
            assert_eq!(room[..5], [b'a' as c_char, b'b' as c_char, 0, 1, 1]);
            write_message(room.as_mut_ptr(), 8, "abc");
            assert_eq!(room[..4], [b'a' as c_char, b'b' as c_char, b'c' as c_char, 0]);
            write_message(room.as_mut_ptr(), 0, "xyz");
            write_message(std::ptr::null_mut(), 8, "xyz");
        }
        assert_eq!(room[0], b'a' as c_char);
    }
}
