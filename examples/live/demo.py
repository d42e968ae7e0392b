"""A test watched while it runs: the delay of its actuator jumps from 6 to 20 ms, and the monitor sees it.

A virtual test is simulated (examples/delay_change.toml), then sent as a rig would send it, at its own pace, to
`rthstrack monitor`, which shows a table here and a live page in the browser, writes a log, and warns. At the end the
log is judged as any recording is.

    python examples/live/demo.py [--seconds S] [--page PORT] [--no-browser] [--quiet]
"""

import argparse
import os
import socket
import subprocess
import sys
import time
import webbrowser
from pathlib import Path

from rthstrack.cli import main

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--seconds", type=float, default=60.0, help="of the test that are sent (%(default)s)")
parser.add_argument("--page", type=int, default=8765, help="port of the live page (%(default)s)")
parser.add_argument("--no-browser", action="store_true", help="only print the page's address")
parser.add_argument("--quiet", action="store_true", help="no table in the terminal")
args = parser.parse_args()


def reachable(port: int, process: subprocess.Popen) -> bool:
    """Whether the monitor serves its page, so that it listens; False where it has ended instead."""
    while process.poll() is None:
        try:
            socket.create_connection(("127.0.0.1", port), timeout=1).close()
            return True
        except OSError:
            time.sleep(0.05)
    return False


here = Path(__file__).resolve().parent
build = here.parent.parent / "build"
build.mkdir(exist_ok=True)
run, log, readings = (os.path.relpath(build / f"demo-live{end}") for end in (".h5", ".arrows", ".readings.arrows"))
for old in (log, readings):
    Path(old).unlink(missing_ok=True)
status = main(["simulate", os.path.relpath(here.parent / "delay_change.toml"), "-o", run])
if status:
    sys.exit(status)
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
    free.bind(("127.0.0.1", 0))
    address = f"udp://127.0.0.1:{free.getsockname()[1]}"

rthstrack = [sys.executable, "-m", "rthstrack"]
# The structure bears 15.6 ms; the alarm comes at half of that. Windows that move less than 1 mm are not judged.
monitor = [*rthstrack, "monitor", "--listen", address, "--rate", "1024", "--window", "2",
           "--minimum-amplitude", "0.001", "--critical-delay", "0.0156", "--limit-amplitude", "0.1", "--silence", "5",
           "--log", log, "--page", str(args.page), "--duration", str(args.seconds + 4),
           *(["--quiet"] if args.quiet else [])]  # fmt: skip
replay = [*rthstrack, "replay", run, "--to", address, "--end", str(args.seconds)]
with subprocess.Popen(monitor) as watching:
    try:
        if not reachable(args.page, watching):
            sys.exit(watching.wait())
        if not args.no_browser:
            webbrowser.open(f"http://127.0.0.1:{args.page}/")
        subprocess.run(replay, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
        status = watching.wait()
    except KeyboardInterrupt:
        # The monitor was interrupted, too, and ends in good order.
        status = watching.wait()
sys.exit(status or main(["evaluate", log]))
