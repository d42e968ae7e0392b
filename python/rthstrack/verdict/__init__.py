"""What a careful engineer says of the numbers: everything known of one pair, in numbers and in words."""

from rthstrack.verdict.assessment import Assessment
from rthstrack.verdict.limits import Limits
from rthstrack.verdict.recorded import assess
from rthstrack.verdict.sentence import reason

__all__ = [
    "Assessment",
    "Limits",
    "assess",
    "reason",
]
