"""Measured and simulated tests: records, sensors, import, alignment, fusion, checks."""
