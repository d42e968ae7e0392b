"""The main job: a recorded test in, a verdict and an interactive report out."""

import os
import sys
from pathlib import Path

from rthstrack.cli import main

root = Path(__file__).resolve().parent.parent
report = root / "build" / "demo.html"
report.parent.mkdir(exist_ok=True)
record = Path(__file__).resolve().parent / "data" / "utfsm_chirp_0A.csv"
sys.exit(main(["evaluate", os.path.relpath(record), "--report", os.path.relpath(report)]))
