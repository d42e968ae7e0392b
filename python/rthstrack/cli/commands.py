"""The commands in the order in which they are listed, each with its line there."""

COMMANDS = {
    "simulate": "run a virtual test: part of a structure computed, part a specimen behind an actuator that lags",
    "evaluate": "judge how measured followed target in recorded tests",
    "channels": "list what is in a file: channels, units, sampling rate, likely target and measured",
    "study": "what data decimation P and frequency decimation Q do to amplitude, delay and computing time",
    "monitor": "gain and delay while the test runs, with alarms, a log and a live page",
    "replay": "send a recorded or virtual test as datagrams, at its own pace",
    "reproduce": "the published study: its figures, tables and statements, computed anew",
}
