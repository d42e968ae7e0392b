"""What a careful engineer says of the numbers: everything known of one pair, in numbers and in words."""

from rthstrack.verdict.argument import reason
from rthstrack.verdict.assessment import Assessment, Limits, assess

__all__ = ["Assessment", "Limits", "assess", "reason"]
