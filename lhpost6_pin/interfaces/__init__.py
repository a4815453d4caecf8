"""The plant for other programs: over UDP and as an FMU."""
