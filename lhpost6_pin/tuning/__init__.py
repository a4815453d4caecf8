"""The virtual 469D made ready for a test: margins, identification, tuning, iteration, sines, drives."""
