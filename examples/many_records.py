"""Many records of one length: one plan, all cores. And what P and Q do to the result."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np

import rthstrack

rng = np.random.default_rng(1)
n, rate_hz, delay_s = 60 * 1024, 1024.0, 8e-3
f = np.fft.rfftfreq(n, 1 / rate_hz)


def record(_: int) -> tuple[np.ndarray, np.ndarray]:
    """A random narrow-band response that comes and goes, and itself 8 ms later."""
    shape = np.exp(-(((f - rng.uniform(0.5, 3)) / 0.3) ** 2)) * np.exp(2j * np.pi * rng.random(f.size))
    target = np.fft.irfft(shape, n) * np.hanning(n)
    return target, np.fft.irfft(np.fft.rfft(target) * np.exp(-2j * np.pi * f * delay_s), n)


records = [record(i) for i in range(16)]
for p, q in [(1, 1), (16, 1), (1, 16), (16, 16)]:
    evaluator = rthstrack.Evaluator(n, rate_hz, data_decimation=p, frequency_decimation=q)
    with ThreadPoolExecutor() as pool:
        delays = [r.delay_s for r in pool.map(lambda pair: evaluator.evaluate(*pair), records)]  # noqa: B023
    print(f"P = {p:2}, Q = {q:2}: {evaluator.n_bins:6} bins, delay {1e3 * np.mean(delays):.4f} ms on average")
