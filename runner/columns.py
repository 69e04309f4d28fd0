"""The columns of the summary."""

#: The summary's columns that a run fills in, and what they mean.
FIGURES = {
    "method": "",
    "contact": "",
    "step": "s",
    "balls": "released",
    "steps": "of all balls together",
    "bounces": "",
    "bounces_per_ball_max": "",
    "surfaces_hit": "surfaces that some ball bounced off",
    "rest_count": "balls at rest at the end",
    "penetrations": "times a ball's centre passed through a surface",
    "energy_initial": "J, of all balls at their release",
    "energy_final": "J, of the same balls at the last frame, or when their flight ended",
    "energy_lost": "J, at impacts",
    "work": "J, done by fields without a potential",
    "energy_residual": "J, final - initial - work + lost",
    "energy_residual_rel": "its size against the initial or the largest kinetic energy, whichever is larger",
    "position_error_rms": "m, over balls at the last frame, against the reference",
    "position_error_max": "m",
    "x_min": "m, of the balls' centres over all frames", "x_max": "m", "y_min": "m", "y_max": "m", "z_min": "m", "z_max": "m",
    "speed_max": "m/s, over all frames",
    "sim_seconds": "s of the processor, the simulation alone, the fastest of the repeats",
    "ball_steps_per_second": "",
    "ns_per_ball_second": "ns of simulation per simulated second of one ball",
}  # fmt: skip

#: Columns that every summary has, the parameters that vary standing after the first three.
COLUMNS = ["run_id", "status", "error", *FIGURES, "wall_seconds", "started"]
TEXTS = {"run_id", "status", "error", "method", "contact", "started"}
WHOLE = {"balls", "steps", "bounces", "bounces_per_ball_max", "rest_count", "penetrations", "surfaces_hit"}
TIMED = {"sim_seconds", "ball_steps_per_second", "ns_per_ball_second"}  # another at each run
