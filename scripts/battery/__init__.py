"""A generator of test campaigns with hidden effects, written without sight of the search it is meant to judge."""
