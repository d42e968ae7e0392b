"""The published average, for tests of its sums: what `evaluate` and the others do with estimator "fei"."""

from __future__ import annotations

from typing import Any

import rthstrack


def published(*arguments: Any, **settings: Any) -> Any:
    return rthstrack.evaluate(*arguments, **{"estimator": "fei"} | settings)


def published_moving(*arguments: Any, **settings: Any) -> Any:
    return rthstrack.evaluate_moving(*arguments, **{"estimator": "fei"} | settings)


def published_evaluator(*arguments: Any, **settings: Any) -> Any:
    return rthstrack.Evaluator(*arguments, **{"estimator": "fei"} | settings)
