"""Loops around one step: runs, demand over capacity, the force ledger, the energy audit."""
