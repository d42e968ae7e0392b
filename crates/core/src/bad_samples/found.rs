//! Kinds of bad samples, what is done with them, and how many were found.

/// What is done with samples that are no motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BadSamples {
    /// They have no part in the estimate, nor in its interval.
    #[default]
    LeaveOut,
    /// They are not looked for.
    Keep,
}

impl BadSamples {
    /// All choices with their names.
    pub const NAMES: [(&'static str, BadSamples); 2] =
        [("leave_out", BadSamples::LeaveOut), ("keep", BadSamples::Keep)];
}

/// A kind of bad samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum BadKind {
    /// One sample that leaves and returns.
    Spike,
    /// A stretch of one value, to which the signal jumps.
    Dropout,
    /// A stretch of the last value, from which the signal jumps.
    Frozen,
    /// Peaks cut off at one value.
    Clipped,
    /// A value that is repeated until the next one, regularly.
    Held,
}

/// All kinds, in the order in which they are told.
pub const BAD_KINDS: [BadKind; 5] =
    [BadKind::Spike, BadKind::Dropout, BadKind::Frozen, BadKind::Clipped, BadKind::Held];

impl BadKind {
    /// The word that stands for it in files.
    pub fn code(self) -> &'static str {
        match self {
            BadKind::Spike => "spike",
            BadKind::Dropout => "dropout",
            BadKind::Frozen => "frozen",
            BadKind::Clipped => "clipped",
            BadKind::Held => "held",
        }
    }
}

/// How many samples of one kind a channel has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BadCount {
    /// Samples.
    pub count: u32,
    /// Index of the first of them.
    pub first: u32,
    /// Of `held`, samples from one fresh value to the next; else 0.
    pub every: u32,
}

/// What was found: of target, then of measured, by kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BadFound {
    counts: [[BadCount; BAD_KINDS.len()]; 2],
}

impl BadFound {
    /// Nothing.
    pub const NONE: Self = Self { counts: [[BadCount { count: 0, first: 0, every: 0 }; BAD_KINDS.len()]; 2] };

    /// The kinds that are there, of target (0) first.
    pub fn iter(&self) -> impl Iterator<Item = (usize, BadKind, BadCount)> + '_ {
        let of = |channel: usize| {
            BAD_KINDS.into_iter().map(move |kind| (channel, kind, self.counts[channel][kind as usize]))
        };
        of(0).chain(of(1)).filter(|(_, _, found)| found.count > 0)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.iter().next().is_none()
    }

    pub(super) fn add(&mut self, channel: usize, kind: BadKind, at: usize) {
        let found = &mut self.counts[channel][kind as usize];
        let at = u32::try_from(at).unwrap_or(u32::MAX);
        found.first = if found.count == 0 { at } else { found.first.min(at) };
        found.count = found.count.saturating_add(1);
    }

    pub(super) fn set(&mut self, channel: usize, kind: BadKind, found: BadCount) {
        self.counts[channel][kind as usize] = found;
    }
}
