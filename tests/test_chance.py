"""Student's t, Fisher's F and fast lengths beside SciPy's."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.fft
from scipy import special

from rthstrack.evaluation.chance import f_above, t_975
from rthstrack.evaluation.dependence import _fast_length


def test_students_t_has_the_bits_of_scipys() -> None:
    assert all(t_975(free) == float(special.stdtrit(free, 0.975)) for free in range(2, 200))


@pytest.mark.parametrize("p", [1, 2, 3, 4, 7])
def test_fishers_f_is_scipys_to_twelve_digits(p: int) -> None:
    for q in (1, 2, 3, 10, 57, 118):
        for f in np.geomspace(1e-6, 1e4, 61):
            assert f_above(p, q, float(f)) == pytest.approx(float(special.fdtrc(p, q, f)), rel=1e-11, abs=1e-250)


def test_fishers_f_at_its_ends() -> None:
    assert f_above(2, 5, 0.0) == 1.0
    assert f_above(2, 5, math.inf) == 0.0
    assert math.isnan(f_above(2, 5, math.nan))


def test_fast_lengths_are_scipys() -> None:
    lengths = [*range(1, 2000), *np.random.default_rng(1).integers(2000, 2_000_000, 300).tolist()]
    assert [_fast_length(n) for n in lengths] == [scipy.fft.next_fast_len(n, real=True) for n in lengths]


@pytest.mark.parametrize("n", [60, 1000, 4096, 16200, 51200])
def test_transforms_of_numpy_have_the_bits_of_scipys(n: int) -> None:
    rows = np.random.default_rng(n).standard_normal((8, n - 3))
    found = np.fft.rfft(rows, n, axis=1)
    assert np.array_equal(found, scipy.fft.rfft(rows, n, axis=1))
    assert np.array_equal(np.fft.irfft(found, n, axis=1), scipy.fft.irfft(found, n, axis=1))
    assert np.array_equal(np.fft.ifft(found[0], n), scipy.fft.ifft(found[0], n))
