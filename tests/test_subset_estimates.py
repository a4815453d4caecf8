"""Estimates by one group of residuals: their deviations are those of their scatter, with noise in the derivatives."""

import numpy as np
import pytest

from lhpost6_pin.identification.calibration.subset_estimates import estimate_by

DRAWS = 2  # of the correction


def estimates(seed: int, runs: int, size: np.ndarray, noise: np.ndarray, rows: int = 400) -> tuple[np.ndarray, ...]:
    """Errors over deviations (runs, p), and deviations: linear residuals with noise of 1, derivatives with `noise`.

    The true unknowns are drawn from their priors, one; derivatives of `size` (p,) are correlated among each other.
    """
    rng, p = np.random.default_rng(seed), len(size)
    mix = np.linalg.cholesky(np.full((p, p), 0.5) + 0.5 * np.eye(p))
    off, sd = np.zeros((2, runs, p))
    for k in range(runs):
        truth = rng.standard_normal(p)
        clean = rng.standard_normal((rows, p)) @ mix.T * size
        residual = rng.standard_normal(rows) - clean @ truth  # at x = 0; zero but for noise at x = truth
        slope = clean + noise * rng.standard_normal((rows, p))
        more = noise * rng.standard_normal((DRAWS, rows, p))
        correction = np.mean([m.T @ m for m in more], axis=0)
        found, sd[k] = estimate_by(
            slope.T @ slope - correction, slope.T @ residual, correction, DRAWS, np.zeros(p), np.ones(p)
        )
        off[k] = (found - truth) / sd[k]
    return off, sd


def test_without_noise_in_the_derivatives_deviations_are_those_of_least_squares():
    rng = np.random.default_rng(0)
    slope, residual, x, prior = rng.standard_normal((50, 3)), rng.standard_normal(50), np.ones(3), np.full(3, 0.5)
    matrix = slope.T @ slope
    estimate, sd = estimate_by(matrix, slope.T @ residual, np.zeros((3, 3)), DRAWS, x, prior)
    whole = np.linalg.inv(matrix + np.eye(3) / 0.25)  # normal equations with priors, solved directly
    np.testing.assert_allclose(estimate, x - whole @ (slope.T @ residual + x / 0.25), rtol=1e-9)
    np.testing.assert_allclose(sd, np.sqrt(np.diag(whole)), rtol=1e-9)


def test_deviations_are_those_of_the_scatter_where_noise_is_half_of_a_derivative_s_power():
    size, noise = np.array([0.3, 0.3, 0.3]), np.array([0.3, 0.0, 0.1])
    off, _ = estimates(1, 1000, size, noise)
    # a deviation of 1000 draws is known within 2 %; the covariance is one of first order, within 15 %
    assert np.std(off, axis=0) == pytest.approx(1.0, abs=0.15)


def test_an_unknown_seen_by_noise_alone_stays_at_its_prior_and_its_deviation_is_not_small():
    """Half of the draws are corrected below zero: a step there, by noise over the prior alone, takes others along."""
    off, sd = estimates(2, 400, np.array([1e-3, 0.5, 0.5]), np.array([0.5, 0.0, 0.0]))
    assert np.abs(off).max() < 5.0  # 1200 normal values exceed 4 once in thirteen sets, 5 once in 1500
    assert np.std(off, axis=0) == pytest.approx(1.0, abs=0.15)  # as above
    assert np.median(sd[:, 0]) > 0.9 and (np.median(sd[:, 1:], axis=0) < 0.2).all()  # the others are well known
