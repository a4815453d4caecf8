"""Symbols and short names that reports use: (symbol, meaning), a table at the end of every page."""

__all__ = ["SYMBOLS"]

SYMBOLS = (
    ("x, y, z", "longitudinal, transverse, vertical; roll, pitch, yaw: rotations about them"),
    ("C", "centre of the platen's top face; displacement, velocity and acceleration of the platen are those of C"),
    ("{s}, {c}", "axes fixed in space at the control zero-position of C; the same axes, moving with C"),
    ("H1, V1, S1, ...", "actuators and struts by name; on the LHPOST6 horizontal, vertical and hold-down ones"),
    ("A, B", "chambers of an actuator: A extends it; B, of a double-acting one, retracts it"),
    ("spool", "position of the servovalve's spool over its stroke, −1 to 1; positive extends the actuator"),
    (
        "RRMSE",
        "relative root mean square error, √(Σ error² ∕ Σ reference²), over the target or over what was measured",
    ),
    ("delay", "time shift that aligns achieved motion and target; negative where the achieved motion is ahead"),
    ("demand / capacity", "peak over the limit that it is judged by; above 100 % the limit is exceeded"),
    ("PSA, PSV, SD", "pseudo-spectral acceleration and velocity, spectral displacement, of damped oscillators"),
    ("noise", "standard deviation of a sensor; an error of 1 in units of it is noise alone"),
    ("90 % interval", "confidence interval of a fitted number"),
    ("g", "standard gravity, 9.80665 m/s²"),
)
