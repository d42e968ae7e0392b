//! States of a plan that threads share: each call takes one and gives it back.

use std::sync::{Mutex, PoisonError};

pub(crate) struct Pool<S>(Mutex<Vec<S>>);

impl<S> Pool<S> {
    pub(crate) fn new() -> Self {
        Self(Mutex::default())
    }

    /// Runs `call` on a state that no other thread uses; `make` makes one where all are taken.
    pub(crate) fn with<T>(&self, make: impl FnOnce() -> S, call: impl FnOnce(&mut S) -> T) -> T {
        let mut state = self.lock().pop().unwrap_or_else(make);
        let result = call(&mut state);
        self.lock().push(state);
        result
    }

    /// A state holds nothing between calls, so one left by a panic is as good as new.
    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<S>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
