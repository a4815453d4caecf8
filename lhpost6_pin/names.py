"""Names that every module shares."""

__all__ = ["AXES", "ENGINES", "SCHEMES"]

AXES = ("x", "y", "z", "roll", "pitch", "yaw")
"""Platen axes in the order of every record: displacement of C in {s}, Euler angles alpha, beta, gamma."""

SCHEMES = ("semi_implicit", "euler", "rk4")
"""Integration schemes (`schemes`); the first is the default."""

ENGINES = ("pinocchio", "fused")
"""Engines of `simulate`; the first is the default."""
