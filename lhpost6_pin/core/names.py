"""Names of axes, schemes and engines, and the sample rate."""

__all__ = ["AXES", "ENGINES", "SAMPLE_RATE", "SCHEMES"]

AXES = ("x", "y", "z", "roll", "pitch", "yaw")
"""Platen axes in the order of every record: displacement of C in {s}, Euler angles alpha, beta, gamma."""

SCHEMES = ("semi_implicit", "euler", "rk4")
"""Integration schemes (`schemes`); the first is the default."""

ENGINES = ("pinocchio", "fused")
"""Engines of `simulate`; the first is the default."""

SAMPLE_RATE = 2048
"""Rate of controller samples [Hz] (report, Chapter 5)."""
