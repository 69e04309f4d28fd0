"""The physics of carom: SI floats in, arrays out. No files, no clocks, no processes, no printing."""

#: Raised whenever the numbers that a run gives change; part of every run id.
ANSWERS = 8
