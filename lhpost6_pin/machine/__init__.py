"""A shake table as typed, immutable data read from TOML, with its effects and its specimen."""
