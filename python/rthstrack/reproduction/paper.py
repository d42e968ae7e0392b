"""What Guo, Xu and Chen (2014) printed: tables, lists and settings, figure for figure as they stand on the page."""

from __future__ import annotations

from typing import TypeAlias

CITATION = "Guo, Xu and Chen (2014), Smart Structures and Systems 14(6), 1197-1220"

RATE_HZ = 1024.0
GAIN = 1.1
DELAY_S = {"linear": 1e-3, "nonlinear": 5e-3}
POWERS = (1, 2, 4, 8, 16, 32, 64, 128, 256, 512)
TABLE_P = (1, 2, 4, 8, 16, 32, 64)
TABLE_Q = (1, 2, 4, 8, 16, 32)
ALPHA_ES = (15, 29, 45)

#: Section 3.2: delay in ms by alpha_es; the lists are printed in this order.
EXPERIMENT_DELAY_MS = {15: -15.6, 29: -0.4, 45: 13.2}
#: The same with the list of delays reversed, as it must be (claims of section 3.2).
REVERSED_DELAY_MS = {15: 13.2, 29: -0.4, 45: -15.6}

#: Section 3.1.1: highest frequency for P = 1 to 512, Hz.
HIGHEST_FREQUENCY_HZ = ("512", "256", "128", "64", "32", "16", "8", "4", "2", "1")

#: Sections 4.1.1 and 4.2: frequency interval for Q = 1 to 512, Hz.
INTERVAL_HZ = {
    "MU2035": ("0.0313", "0.0626", "0.1252", "0.2504", "0.5008", "1.0016", "2.0032", "4.0064", "8.0128", "16.0512"),
    "CHY101-N": ("0.0078", "0.0156", "0.0313", "0.0626", "0.1252", "0.2504", "0.5008", "1.0016", "2.0032", "4.0064"),
    "CANOGA": ("0.0156", "0.0313", "0.0626", "0.1252", "0.2504", "0.5008", "1.0016", "2.0032", "4.0064", "8.0128"),
}

Rows: TypeAlias = tuple[tuple[float, ...], ...]

# Computing times in ms: a row a P of TABLE_P, a column a Q of TABLE_Q.
_TABLE_1_MU2035: Rows = (
    (16.9, 8.4, 6.4, 5.5, 5.0, 4.6),
    (13.5, 11.8, 10.7, 10.2, 10.0, 9.9),
    (9.7, 8.8, 8.4, 8.1, 8.0, 7.9),
    (8.8, 8.4, 8.2, 8.1, 8.1, 8.0),
    (10.1, 9.9, 9.8, 9.8, 9.8, 9.7),
    (10.7, 10.6, 10.6, 10.5, 10.5, 10.5),
    (12.6, 12.6, 12.5, 12.5, 12.5, 12.5),
)

#: The rows of Table 1 beside CHY101-N as printed: the first stands in the line of the Qs, the last repeats it.
TABLE_1_CHY101_LINES: Rows = (
    (39.4, 26.3, 19.7, 16.4, 14.8, 14.3),
    (40.9, 34.3, 31.5, 29.6, 28.7, 28.3),
    (29.2, 26.0, 24.4, 23.6, 23.2, 22.9),
    (25.0, 23.6, 22.6, 22.2, 21.9, 21.8),
    (20.4, 19.6, 19.2, 19.1, 18.9, 18.9),
    (20.6, 20.2, 20.1, 19.9, 19.9, 19.8),
    (21.9, 21.7, 21.6, 21.6, 21.5, 21.5),
    (39.4, 26.3, 19.7, 16.4, 14.8, 14.3),
)

_TABLE_2_MU2035: Rows = (
    (13.8, 7.0, 5.1, 4.6, 4.1, 3.8),
    (12.0, 10.3, 9.5, 9.1, 8.8, 8.7),
    (9.3, 8.5, 8.0, 7.8, 7.7, 7.7),
    (8.8, 8.4, 8.2, 8.1, 8.1, 8.0),
    (9.2, 9.0, 8.9, 8.9, 8.8, 8.8),
    (11.0, 10.8, 10.8, 10.7, 10.7, 10.7),
    (11.6, 11.6, 11.5, 11.5, 11.5, 11.5),
)
_TABLE_2_CHY101: Rows = (
    (42.9, 27.7, 20.1, 16.5, 14.6, 13.7),
    (41.4, 35.0, 31.4, 29.7, 28.9, 28.4),
    (28.4, 25.5, 23.5, 22.6, 22.1, 22.0),
    (26.9, 25.5, 24.5, 24.1, 23.8, 23.7),
    (19.8, 18.8, 18.7, 18.4, 18.2, 18.2),
    (20.9, 20.5, 20.3, 20.2, 20.2, 20.1),
    (19.6, 19.5, 19.3, 19.3, 19.2, 19.2),
)

# Table 3 has no column for Q = 1.
_TABLE_3: dict[int, Rows] = {
    15: (
        (16.1, 12.5, 10.6, 9.5, 9.0),
        (20.5, 18.7, 17.7, 17.1, 16.9),
        (17.4, 16.5, 15.9, 15.7, 15.5),
        (15.8, 15.3, 15.1, 14.9, 14.9),
        (14.6, 14.4, 14.2, 14.2, 14.1),
        (14.0, 13.8, 13.8, 13.7, 13.7),
        (15.4, 15.3, 15.2, 15.2, 15.2),
    ),
    29: (
        (15.4, 11.3, 9.4, 8.5, 8.0),
        (20.6, 18.8, 17.7, 17.1, 16.9),
        (17.6, 16.6, 16.0, 15.8, 15.6),
        (15.5, 15.0, 14.8, 14.6, 14.6),
        (13.7, 13.5, 13.3, 13.3, 13.2),
        (13.9, 13.8, 13.7, 13.6, 13.6),
        (14.1, 14.1, 14.1, 14.0, 14.0),
    ),
    45: (
        (16.3, 12.4, 10.6, 9.6, 9.1),
        (20.5, 18.6, 17.7, 17.2, 16.9),
        (17.3, 16.4, 15.8, 15.6, 15.5),
        (15.6, 15.1, 14.9, 14.7, 14.7),
        (14.1, 13.9, 13.7, 13.7, 13.6),
        (14.6, 14.4, 14.4, 14.3, 14.3),
        (14.6, 14.6, 14.5, 14.5, 14.5),
    ),
}


def _by_factors(rows: Rows, columns: tuple[int, ...] = TABLE_Q) -> dict[tuple[int, int], float]:
    return {(p, q): t for p, row in zip(TABLE_P, rows, strict=True) for q, t in zip(columns, row, strict=True)}


#: Printed computing times in ms by case and (P, Q). CHY101-N of Table 1 is read one line up, which puts it right.
TIMES_MS: dict[str, dict[tuple[int, int], float]] = {
    "linear-mu2035": _by_factors(_TABLE_1_MU2035),
    "linear-chy101-n": _by_factors(TABLE_1_CHY101_LINES[:-1]),
    "nonlinear-mu2035": _by_factors(_TABLE_2_MU2035),
    "nonlinear-chy101-n": _by_factors(_TABLE_2_CHY101),
} | {f"experiment-{alpha_es}": _by_factors(rows, TABLE_Q[1:]) for alpha_es, rows in _TABLE_3.items()}
