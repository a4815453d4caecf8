"""Loops around one step: runs, ensembles, the force ledger, the energy audit."""
