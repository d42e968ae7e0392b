"""The exceptions of rthstrack, all under one base class.

Every message is one line: what was wrong, what was expected, what was found, what to do.
"""


class RthstrackError(Exception):
    """Base class of every error that rthstrack raises on purpose."""


class SignalError(RthstrackError, ValueError):
    """The samples cannot be judged: lengths differ, NaN, constant target, too few samples."""


class SettingError(RthstrackError, ValueError):
    """A setting is not possible: P, Q, band, window, rate."""


class RecordingError(RthstrackError):
    """A file cannot be read as a recording, or what was asked of it is not in it."""


class ChannelError(RecordingError, LookupError):
    """A channel is unknown, ambiguous, or no target/measured pair can be proposed."""
