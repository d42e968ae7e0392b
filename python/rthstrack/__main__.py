"""`python -m rthstrack`."""

import sys

from rthstrack.cli import main

sys.exit(main())
