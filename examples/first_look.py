"""One pair of arrays: amplitude, delay, and both over time and frequency."""

import numpy as np

import rthstrack

# A burst at 1 Hz and what an actuator made of it: 12 ms late and 2 % too small.
t = np.arange(40 * 1024) / 1024
target = 20 * np.sin(2 * np.pi * t) * np.exp(-((t - 15) ** 2) / 30)
measured = 0.98 * np.interp(t - 0.012, t, target)

result = rthstrack.evaluate(target, measured, 1024)
print(f"A = {result.amplitude:.4f}, d = {1e3 * result.delay_s:.3f} ms at {result.equivalent_frequency_hz:.2f} Hz")

moving = rthstrack.evaluate_moving(target, measured, 1024, window_s=4, hop_s=1)
for time_s, delay_s, valid in zip(moving.time_s, moving.delay_s, moving.valid, strict=True):
    print(f"{time_s:5.1f} s: {1e3 * delay_s:6.2f} ms" if valid else f"{time_s:5.1f} s: too little motion to judge by")

response = rthstrack.frequency_response(target, measured, 1024)
at = np.argmax(response.target_psd)
print(
    f"at {response.frequency_hz[at]:.2f} Hz: gain {response.gain[at]:.4f}, "
    f"delay {1e3 * response.delay_s[at]:.3f} ms, coherence {response.coherence[at]:.4f}"
)
