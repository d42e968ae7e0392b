"""Every quantitative statement of the paper, sentence by sentence, with its check: printed, ours, verdict, why.

`judge` goes through the paper in its order; what words mean stands in `TERMS`, what a verdict means in `MEANINGS`.
"""

from rthstrack.reproduction.claims.judge import judge
from rthstrack.reproduction.claims.rows import MEANINGS, TERMS, WORDS, Claim, Verdict

__all__ = ["MEANINGS", "TERMS", "WORDS", "Claim", "Verdict", "judge"]
