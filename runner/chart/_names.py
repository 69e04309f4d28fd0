"""What the columns of a summary are called in a chart, and their units: the one place to add one."""

from __future__ import annotations

import json
from typing import Any

#: The columns every summary has: words and unit.
SUMMARY = {
    "run_id": ("run", ""),
    "status": ("status", ""),
    "error": ("error", ""),
    "method": ("method", ""),
    "contact": ("contact", ""),
    "step": ("step", "s"),
    "balls": ("balls", ""),
    "steps": ("steps", ""),
    "bounces": ("bounces", ""),
    "bounces_per_ball_max": ("most bounces of a ball", ""),
    "surfaces_hit": ("surfaces hit", ""),
    "rest_count": ("balls at rest", ""),
    "penetrations": ("penetrations", ""),
    "energy_initial": ("initial energy", "J"),
    "energy_final": ("final energy", "J"),
    "energy_lost": ("energy lost at impacts", "J"),
    "work": ("work of forces", "J"),
    "energy_residual": ("energy residual", "J"),
    "energy_residual_rel": ("relative energy residual", ""),
    "position_error_rms": ("RMS position error", "m"),
    "position_error_max": ("largest position error", "m"),
    "x_min": ("smallest x", "m"),
    "x_max": ("largest x", "m"),
    "y_min": ("smallest y", "m"),
    "y_max": ("largest y", "m"),
    "z_min": ("smallest z", "m"),
    "z_max": ("largest z", "m"),
    "speed_max": ("largest speed", "m/s"),
    "sim_seconds": ("simulation time", "s"),
    "ball_steps_per_second": ("simulation speed", "ball-steps/s"),
    "ns_per_ball_second": ("time per ball-second", "ns"),
    "wall_seconds": ("wall time", "s"),
    "started": ("start", ""),
}

#: Numerical errors with a sign: where they lie decades apart it is their size that compares methods.
SIGNED_ERRORS = ("energy_residual", "energy_residual_rel")

#: Parameters, by the last part of their dotted path.
UNITS = {
    "mass": "kg",
    "wall_mass": "kg",
    "radius": "m",
    "lifetime": "s",
    "gravity": "m/s²",
    "magnitude": "N",
    "stiffness": "N/m",
    "coefficient": "N s/m",
    "from": "s",
    "until": "s",
    "center": "m",
    "centre": "m",
    "position": "m",
    "point": "m",
    "size": "m",
    "velocity": "m/s",
    "speed": "m/s",
    "max_speed": "m/s",
    "spread": "°",
    "rotate": "°",
    "rate": "1/s",
    "step": "s",
    "duration": "s",
    "every": "s",
}

#: The parts of a path that a reader does not miss.
SECTIONS = ("scene.forces.", "scene.surfaces.", "scene.", "solver.")


def words(column: str) -> str:
    """A column in words: balls.mass -> ball mass, scene.forces.corridor.magnitude -> corridor magnitude."""
    if column in SUMMARY:
        return SUMMARY[column][0]
    section = next((start for start in SECTIONS if column.startswith(start)), "")
    parts = column.removeprefix(section).split(".")
    if parts[0] == "balls" and not section:
        parts[0:1] = ["ball"] if len(parts) == 2 else []
    return " ".join(parts).replace("_", " ")


def unit(column: str) -> str:
    """The unit of a column, empty where it has none."""
    return SUMMARY[column][1] if column in SUMMARY else UNITS.get(column.rpartition(".")[2], "")


def label(column: str, size: bool = False) -> str:
    """A column in words with its unit, as on an axis: ball mass (kg); its size, without the sign: |work| (J)."""
    text = f"|{words(column)}|" if size else words(column)
    return f"{text} ({unit(column)})" if unit(column) else text


def heading(column: str, value: Any) -> str:
    """What heads a panel: the value alone when it is a name, else ball mass = 0.1 kg."""
    if isinstance(value, str) and not value.startswith("{"):
        return value
    return f"{words(column)} = {value_text(value)} {unit(column)}".rstrip()


def sentence(text: str) -> str:
    """Text with a capital letter in front, the others left as they are."""
    return text[:1].upper() + text[1:]


def value_text(value: Any) -> str:
    """A value of a column as a legend or a tick shows it; of a mapping, which a table holds as JSON, its keys."""
    if isinstance(value, str) and value.startswith("{"):
        return ", ".join(json.loads(value)) or "none"
    if value is None:
        return "none"
    if isinstance(value, bool):
        return str(value).lower()
    return number_text(value) if isinstance(value, (int, float)) else str(value)


def number_text(value: float, powers: bool = False) -> str:
    """0.001, 20, 10⁻⁶, 2.5×10⁷: exponents as characters, so that a chart needs no mathematical typesetting.

    `powers`: those of ten even where a plain number is short, to go with others on an axis.
    """
    if value == 0 or (1 <= abs(value) < 100 if powers else 1e-3 <= abs(value) < 1e5):
        return f"{value:.12g}".replace("-", "−")
    mantissa, exponent = f"{value:.11e}".split("e")
    mantissa = mantissa.rstrip("0").rstrip(".").replace("-", "−")
    power = "10" + str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return {"1": power, "−1": "−" + power}.get(mantissa, f"{mantissa}×{power}")
