"""Rows of derivatives by column of the residuals, against full matrices."""

import numpy as np
import pytest

from lhpost6_pin.identification.calibration.bin_rows import bin_rows, row_by_column, squares_of
from lhpost6_pin.identification.calibration.sparse_bins import sparse_bins

M, C, P = 12, 5, 7


@pytest.fixture
def bins(rng):
    """Bins (m, c, p) of which every quantity shows in some columns only."""
    values = rng.normal(size=(M, C, P)) + 1j * rng.normal(size=(M, C, P))
    return values * (rng.random((C, P)) < 0.5)


@pytest.fixture
def rng():
    return np.random.default_rng(3)


def rows_of(bins: np.ndarray):
    """Rows of quantities (m, c, p) given together."""
    return bin_rows([sparse_bins(bins)], C)


def real(bins: np.ndarray, root: np.ndarray) -> np.ndarray:
    """The same as a full real matrix (2 m c, p)."""
    scaled = bins * np.sqrt(2.0) / root[..., None]
    flat = scaled.reshape(-1, bins.shape[-1])
    return np.concatenate([flat.real, flat.imag])


def test_products_are_those_of_full_matrices(bins, rng):
    other, rest, root = bins[..., ::-1] * 2.0, bins[..., 0] + 1.0, 1.0 + rng.random((M, C))
    rows, more = rows_of(bins).weighed(root), rows_of(other).weighed(root)
    x = rng.normal(size=P)
    full, beside = real(bins, root), real(other, root)
    np.testing.assert_allclose(rows.squares(), full.T @ full, atol=1e-12)  # rounding of sums of order one
    np.testing.assert_allclose(rows.products(more), full.T @ beside, atol=1e-12)
    right = real(rest[..., None], root)[:, 0]
    np.testing.assert_allclose(rows.dot(row_by_column(rest, root)), full.T @ right, atol=1e-12)
    explained = (full @ x).reshape(2, M, C)
    np.testing.assert_allclose(squares_of(rows.times(x)), 0.5 * (explained**2).sum(axis=0), atol=1e-12)


def test_rows_of_quantities_given_one_by_one_are_those_of_all_together(bins):
    one = bin_rows([sparse_bins(bins[..., p]) for p in range(P)], C)
    np.testing.assert_allclose(one.squares(), rows_of(bins).squares(), atol=1e-12)


def test_differences_sums_and_neighbours(bins, rng):
    ones, parts = np.ones((M, C)), rng.normal(size=(P, 3))
    changed = bins + 0.1 * (rng.random((C, P)) < 0.3)
    less = rows_of(changed).less(rows_of(bins))
    np.testing.assert_allclose(less.squares(), real(changed - bins, ones).T @ real(changed - bins, ones), atol=1e-12)
    full = real(bins @ parts, ones)
    np.testing.assert_allclose(rows_of(bins).select(parts).squares(), full.T @ full, atol=1e-12)
    both = rows_of(np.concatenate([bins, changed], axis=-1))
    places = np.arange(bins.shape[2], both.count)
    np.testing.assert_array_equal(both.only(places).squares(), rows_of(changed).squares())
    sparse = sparse_bins(changed[..., 0]).less(sparse_bins(bins[..., 0]), C)
    out = np.zeros((C, M), complex)
    out[sparse.columns] = sparse.bins
    np.testing.assert_allclose(out.T, changed[..., 0] - bins[..., 0], atol=1e-15)


def test_products_are_weighed_by_a_power_that_is_constant_in_a_band(bins, rng):
    starts = np.array([0, 1, 7])  # the mean alone, then bands of six and five bins
    by_band = 1.0 + rng.random((len(starts), C))
    power = np.repeat(by_band, np.diff([*starts, M]), axis=0)
    full = real(bins, np.sqrt(power))
    squares = rows_of(bins).squares_by_band(starts)
    np.testing.assert_allclose(squares.over(by_band), full.T @ full, atol=1e-12)
    some = np.arange(C) % 2 == 0
    part = real(bins[:, some], np.sqrt(power[:, some]))
    np.testing.assert_allclose(squares.over(by_band, some), part.T @ part, atol=1e-12)
