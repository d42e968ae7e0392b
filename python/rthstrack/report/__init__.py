"""One self-contained HTML page from one or several assessments.

The page takes what an `Assessment` holds and computes nothing. It loads nothing from a network: style, scripts and
samples are inside, and a content security policy forbids anything else. Texts from files are escaped everywhere.
"""

from rthstrack.report.page import report_html, write_report
from rthstrack.report.record import result_record

__all__ = [
    "report_html",
    "result_record",
    "write_report",
]
