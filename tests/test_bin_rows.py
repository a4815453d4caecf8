"""Rows of derivatives by column of the residuals, against full matrices."""

import numpy as np
import pytest

from lhpost6_pin.identification.calibration.bin_rows import (
    bin_rows,
    dense_rows,
    row_by_column,
    side_by_side,
    sparse_bins,
    squares_of,
)

M, C, P = 12, 5, 7
FIRST = np.array([0, 1, 5])


@pytest.fixture
def bins(rng):
    """Bins (m, c, p) of which every quantity shows in some columns only."""
    values = rng.normal(size=(M, C, P)) + 1j * rng.normal(size=(M, C, P))
    return values * (rng.random((C, P)) < 0.5)


@pytest.fixture
def rng():
    return np.random.default_rng(3)


def real(bins: np.ndarray, root: np.ndarray) -> np.ndarray:
    """The same as a full real matrix (2 m c, p)."""
    scaled = bins * np.sqrt(2.0) / root[..., None]
    flat = scaled.reshape(-1, bins.shape[-1])
    return np.concatenate([flat.real, flat.imag])


def test_products_are_those_of_full_matrices(bins, rng):
    other, rest, root = bins[..., ::-1] * 2.0, bins[..., 0] + 1.0, 1.0 + rng.random((M, C))
    rows, more = dense_rows(bins).weighed(root), dense_rows(other).weighed(root)
    x = rng.normal(size=P)
    full, beside = real(bins, root), real(other, root)
    np.testing.assert_allclose(rows.squares(), full.T @ full, atol=1e-12)  # rounding of sums of order one
    np.testing.assert_allclose(rows.products(more), full.T @ beside, atol=1e-12)
    right = real(rest[..., None], root)[:, 0]
    np.testing.assert_allclose(rows.dot(row_by_column(rest, root)), full.T @ right, atol=1e-12)
    explained = (full @ x).reshape(2, M, C)
    np.testing.assert_allclose(squares_of(rows.times(x)), 0.5 * (explained**2).sum(axis=0), atol=1e-12)


def test_rows_of_sparse_quantities_are_those_of_dense_ones(bins):
    one = bin_rows([sparse_bins(bins[..., p]) for p in range(P)], C)
    np.testing.assert_allclose(one.squares(), dense_rows(bins).squares(), atol=1e-12)


def test_differences_sums_and_neighbours(bins, rng):
    ones, parts = np.ones((M, C)), rng.normal(size=(P, 3))
    changed = bins + 0.1 * (rng.random((C, P)) < 0.3)
    less = dense_rows(changed).less(dense_rows(bins))
    np.testing.assert_allclose(less.squares(), real(changed - bins, ones).T @ real(changed - bins, ones), atol=1e-12)
    full = real(bins @ parts, ones)
    np.testing.assert_allclose(dense_rows(bins).select(parts).squares(), full.T @ full, atol=1e-12)
    both = real(np.concatenate([bins, changed], axis=-1), ones)
    np.testing.assert_allclose(
        side_by_side([dense_rows(bins), dense_rows(changed)]).squares(), both.T @ both, atol=1e-12
    )
    sparse = sparse_bins(changed[..., 0]).less(sparse_bins(bins[..., 0]), C)
    out = np.zeros((C, M), complex)
    out[sparse.columns] = sparse.bins
    np.testing.assert_allclose(out.T, changed[..., 0] - bins[..., 0], atol=1e-15)


def test_products_by_band_are_weighed_again(bins, rng):
    power = 1.0 + rng.random((len(FIRST), C))
    whole = np.repeat(power, np.diff([*FIRST, M]), axis=0)
    full = real(bins, np.sqrt(whole))
    squares = dense_rows(bins).squares_by_band(FIRST)
    np.testing.assert_allclose(squares.over(power), full.T @ full, atol=1e-12)
    some = np.arange(C) % 2 == 0
    part = real(bins[:, some], np.sqrt(whole[:, some]))
    np.testing.assert_allclose(squares.over(power, some), part.T @ part, atol=1e-12)


def test_products_by_band_reuse_those_of_rows_that_stay(bins, rng):
    """Two quantities change, one goes and one comes: the others' products are taken over."""
    known = dense_rows(bins).squares_by_band(FIRST)
    place = np.array([5, -1, 0, 3, -1, 4])  # in what was known
    fresh = rng.normal(size=(M, C, 2)) + 0j
    again = np.stack([bins[..., k] if k >= 0 else fresh[..., i % 2] for i, k in enumerate(place)], axis=-1)
    rows = dense_rows(again)
    found, wanted = rows.squares_by_band(FIRST, known, place), rows.squares_by_band(FIRST)
    ones = np.ones((len(FIRST), C))
    np.testing.assert_allclose(found.over(ones), wanted.over(ones), atol=1e-12)
