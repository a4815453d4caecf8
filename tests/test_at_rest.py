"""Axes at rest but for rounding have no relative error, wherever one is stated."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import xarray as xr

from lhpost6_pin.core.extremes import extremes, finite_peaks
from lhpost6_pin.core.names import AXES
from lhpost6_pin.data.at_rest import at_rest
from lhpost6_pin.data.metrics import commanded_axes, peaks, track
from lhpost6_pin.data.replay_comparison import compare
from lhpost6_pin.data.signals import Band
from lhpost6_pin.identification.decompose.agreement import _match
from lhpost6_pin.identification.validation.phase_agreement import ComparedQuantity, agree
from lhpost6_pin.identification.validation.prepare_tests import validation_numbers
from lhpost6_pin.show.report.decompose_report import _match_row
from lhpost6_pin.show.report.open_loop_report import comparison_table

pytestmark = pytest.mark.fast

DT = 1 / 512
T = np.arange(2048) * DT
SINE = np.sin(2 * np.pi * T)
ROUNDING = 1e-17 * np.cos(40 * T)
"""Of a double at a length of 0.1 m."""


def motion(*columns):
    return np.stack([*columns, *[0.0 * T] * (6 - len(columns))], axis=1)


def record(**channels):
    dims = ("time", "axis")
    return xr.Dataset({k: (dims, v) for k, v in channels.items()}, {"time": T, "axis": list(AXES)})


def test_rounding_is_at_rest_beside_the_largest_column_and_beside_lengths_of_metres():
    np.testing.assert_array_equal(at_rest(motion(SINE, 1e-3 * SINE, ROUNDING)), [False, False, *[True] * 4])
    assert not at_rest(motion(ROUNDING))[0] and at_rest(motion(ROUNDING), place=True).all()
    assert at_rest(motion(SINE), largest=1e7).all()
    assert at_rest(np.zeros((0, 6))).all() and at_rest(np.full((3, 1), np.nan)).all()


def test_a_target_of_rounding_alone_has_no_tracking_error():
    still = record(reference_displacement=motion(ROUNDING), platen_displacement=motion(1e-9 * SINE))
    assert commanded_axes(still) == [] and all(np.isnan(one.rrmse) for one in track(still, "displacement"))
    moved = record(reference_displacement=motion(SINE, ROUNDING), platen_displacement=motion(1.1 * SINE, 1e-9 * SINE))
    assert commanded_axes(moved) == ["x"]


def test_a_replay_of_a_record_at_rest_has_differences_and_no_relative_errors():
    found = compare(record(platen_displacement=motion(ROUNDING)), record(platen_displacement=motion(1e-9 * SINE)))
    assert all(np.isnan(one.rrmse) for one in found)
    assert found[0].largest_difference == pytest.approx(1e-9, rel=1e-4)
    assert "at rest" in comparison_table(found).rows[0]


def test_a_validation_of_a_test_at_rest_judges_no_axis():
    quiet = np.zeros(6)
    pairs = [
        ComparedQuantity(quantity, AXES, motion(ROUNDING), motion(1e-9 * SINE), quiet, quiet)
        for quantity in ("velocity", "displacement", "acceleration")
    ]
    pairs.append(
        ComparedQuantity("actuator_force", ("V1",), 1e6 + 1e-4 * SINE[:, None], 1e6 + SINE[:, None], *quiet[:2, None])
    )
    rows = agree(pairs, DT, validation_numbers())
    assert not any(one.moves for one in rows) and all(np.isnan(one.rrmse) for one in rows)
    assert rows[6].error == pytest.approx(np.sqrt(0.5) * 1e-9, rel=1e-3)  # displacement x


def test_forces_of_an_axis_at_rest_are_stated_as_a_difference_in_newtons():
    measured, modelled = motion(1e5 * SINE, 1e-12 * SINE), motion(1.1e5 * SINE, 1e-8 * SINE)
    found: Any = SimpleNamespace(comparison=SimpleNamespace(band=Band(high=33.0)), dt=DT)
    found.forces = SimpleNamespace(measured=measured)
    match = _match(found, measured, modelled, 0.5)
    assert match.rrmse[0] == pytest.approx(0.1) and np.isnan(match.rrmse[1:]).all()
    assert match.difference[1] == pytest.approx(np.sqrt(0.5) * 1e-8, rel=1e-3)
    np.testing.assert_array_equal(match.at_rest, [False, *[True] * 5])
    static = _match(found, measured + 1e7, modelled + 1e7, 0.5)  # of y nothing varies but rounding
    assert static.rrmse[1] < 1e-12 and np.isnan(static.rrmse_varying[1])
    row = _match_row(match, 1)
    assert row[:2] == ("y", "at rest") and "differs by 0" in row[2] and "%" not in "".join(row)
    larger = _match(found, measured, motion(1e5 * SINE, 2e3 * SINE), 0.5)
    assert "1.41\N{NO-BREAK SPACE}kN rms" in cast(str, _match_row(larger, 1)[2])


@pytest.mark.parametrize("shape", [(1, 6), (63, 2), (64, 6), (1000, 3), (200,), (130, 2, 4)])
@pytest.mark.parametrize("gaps", [False, True])
def test_peaks_are_those_of_all_rows(shape, gaps):
    """Rows are reduced side by side, by 64: the largest of each column is found wherever it is."""
    rng = np.random.default_rng(len(shape))
    for _ in range(20):
        values = rng.standard_normal(shape)
        if gaps:
            values[rng.random(shape) < 0.1] = np.nan
        finite = np.where(np.isnan(values), -1.0, np.abs(values)).max(axis=0)
        np.testing.assert_array_equal(peaks(values), np.where(finite < 0.0, np.nan, finite))


@pytest.mark.parametrize("count", [1, 63, 64, 65, 1000])
@pytest.mark.parametrize("shape", [(), (1,), (3,), (2, 3)])
def test_peaks_of_long_arrays_are_those_of_all_their_finite_samples(count, shape):
    rng = np.random.default_rng(count)
    for bad in (0, count // 3):
        values = rng.standard_normal((count, *shape))
        values.reshape(-1)[rng.choice(values.size, bad, replace=False)] = rng.choice([np.nan, np.inf, -np.inf], bad)
        expected = np.where(np.isfinite(values), np.abs(values), -np.inf).max(axis=0)
        np.testing.assert_array_equal(finite_peaks(values), expected)
        if not bad:
            np.testing.assert_array_equal(extremes(values).min(axis=0), values.min(axis=0))
            np.testing.assert_array_equal(extremes(values).max(axis=0), values.max(axis=0))
