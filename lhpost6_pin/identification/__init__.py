"""Inverse dynamics, residuals, decomposition, calibration and validation against measured tests."""
