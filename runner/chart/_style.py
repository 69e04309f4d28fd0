"""How a chart looks: fonts, greys, and what tells one series from another."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib import colormaps

from runner.chart._table import numeric

INK, GREY, PALE = "#222222", "#666666", "#999999"

STYLE = {
    "font.size": 9,
    "text.color": INK,
    "text.parse_math": False,  # a name may hold a $
    "axes.edgecolor": PALE,
    "axes.labelcolor": INK,
    "axes.labelsize": 9,
    "axes.titlesize": 9,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.7,
    "xtick.color": PALE,
    "ytick.color": PALE,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "lines.markersize": 5,
    "lines.solid_capstyle": "round",
    "savefig.dpi": 200,
    "svg.fonttype": "none",  # text stays text: to be searched, selected and read aloud
    "svg.hashsalt": "carom",  # the same chart gives the same bytes
}

#: Okabe and Ito's colours for all kinds of colour vision; instead of their yellow, too light for a line on white, Tol's wine
#: and olive.
COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#555555", "#882255", "#999933"]
DASHES = ["-", (0, (5, 1.5)), (0, (1.5, 1.2)), (0, (5, 1.2, 1.2, 1.2))]
MARKERS = "osD^vPX<h"
DARK, LIGHT = 0.0, 0.85  # the part of viridis that shows on white


def looks(values: Iterable[Any]) -> dict[Any, dict[str, Any]]:
    """Colour, dash and marker of each of the values: numbers run through a scale of colours, names stand apart."""
    values = list(values)
    if numeric(values) and len(values) > 1:
        colours = [tuple(map(float, c)) for c in colormaps["viridis"](np.linspace(DARK, LIGHT, len(values)))]
        dashes = ["-"] * len(values)
    else:
        colours = [COLOURS[i % len(COLOURS)] for i in range(len(values))]
        dashes = [DASHES[i // len(COLOURS) % len(DASHES)] for i in range(len(values))]
    markers = [MARKERS[i % len(MARKERS)] for i in range(len(values))]
    return {v: {"color": c, "linestyle": d, "marker": m} for v, c, d, m in zip(values, colours, dashes, markers)}
