"""The on-line monitor beside its compiled part: layout of the input, log, terminal view."""
