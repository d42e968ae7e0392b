"""What several tests share: where the twins, the golden files, the shared records and the browser are."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).resolve().parent.parent
for folder in (ROOT / "reference", ROOT / "tests"):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

# The same examples at every run: a failure is then the change's doing. No deadline: nothing here is a timed test.
settings.register_profile(
    "rthstrack", deadline=None, derandomize=True, print_blob=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("rthstrack")


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository's root."""
    return ROOT


@pytest.fixture(scope="session")
def golden() -> Path:
    """The folder of golden files, written by reference/make_golden.py."""
    return ROOT / "tests" / "golden"


@pytest.fixture(scope="session")
def shared() -> Path:
    """Records and reference values kept beside the repository; a test that needs them is skipped where they are not."""
    folder = ROOT.parent / "shared"
    if not (folder / "reference" / "expected.json").is_file():
        pytest.skip("../shared (records and reference values) is not beside the repository")
    return folder


@pytest.fixture(scope="session")
def chromium() -> str:
    """Path of a Chromium or Chrome; a test that opens a page is skipped where there is none."""
    for name in ("chromium", "chromium-browser", "google-chrome"):
        path = shutil.which(name)
        if path is not None:
            return path
    pytest.skip("no chromium on the PATH: browser tests are skipped")
