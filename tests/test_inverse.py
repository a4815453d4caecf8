"""The inverse of a table against plants known in closed form: T⁻¹ T is one in the band, stable and honest outside."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from plant_cases import TwoAxes
from scipy import signal

from lhpost6_pin.control.inverse import TAPER, InverseFilter, apply_inverse, load_inverse, make_inverse, save_inverse
from lhpost6_pin.core.errors import RecordError
from lhpost6_pin.data.signals import align, rrmse
from lhpost6_pin.data.transfer import Transfer, estimate_transfer

pytestmark = pytest.mark.long

RATE = 256.0
LOW, HIGH = 0.5, 30.0
F = np.arange(1, 1025) / 8.0  # [Hz]
T = np.arange(int(60 * RATE)) / RATE


PLANT = TwoAxes((25, 0.4), (12, 0.3, 0.2), (15, 0.3, -0.2), (40, 0.5))
"""Two axes that resonate, roll off and couple."""


def true_transfer(frequency: np.ndarray = F, axes: tuple[str, ...] = ("x", "yaw")) -> Transfer:
    """The plant in closed form, trusted everywhere."""
    return Transfer(frequency, PLANT.response(frequency), np.ones((len(frequency), 2)), axes)


def one_axis(response: np.ndarray) -> Transfer:
    return Transfer(F, response[:, None, None], np.ones((len(F), 1)), ("x",))


def response(inverse: InverseFilter, frequency: np.ndarray) -> np.ndarray:
    """Frequency response of a filter without its delay, (m, n, n)."""
    t = (np.arange(len(inverse.taps)) - len(inverse.taps) // 2) / inverse.rate
    return np.tensordot(np.exp(-2j * np.pi * np.multiply.outer(frequency, t)), inverse.taps, axes=(1, 0))


def reference(*columns: int, seed: int = 0) -> np.ndarray:
    """Band-limited noise in some of the six axes that starts and ends at rest."""
    sos = signal.butter(8, [1.5, 15], "bandpass", fs=RATE, output="sos")
    r = np.zeros((len(T), 6))
    r[:, columns] = np.random.default_rng(seed).standard_normal((len(T), len(columns)))
    return signal.sosfiltfilt(sos, r * np.clip(np.minimum(T, T[-1] - T) / 5 - 1, 0, 1)[:, None], axis=0)


# ------------------------------------------------------------------------------------------- the filter
def test_inverse_times_table_is_one_in_the_band():
    f = np.arange(0.7, 29, 0.0371)  # between the frequencies of either grid
    product = true_transfer(f).response @ response(make_inverse(true_transfer(), RATE, LOW, HIGH), f)
    # 4 s of taps blur the edges of the band over 2 / 4 s; inside, what they cut off has died out
    inside = (f > 1.5) & (f < 28)
    np.testing.assert_allclose(product[inside], np.tile(np.eye(2), (inside.sum(), 1, 1)), atol=2e-3)
    np.testing.assert_allclose(product, np.tile(np.eye(2), (len(f), 1, 1)), atol=0.05)


def test_the_gain_is_one_at_rest_and_nothing_above_the_band():
    inverse = make_inverse(true_transfer(), RATE, LOW, HIGH)
    np.testing.assert_allclose(inverse.taps.sum(axis=0), np.eye(2), atol=1e-12)  # rounding
    # slowly the plant follows but for its coupling of 0.2, which the inverse leaves alone an octave below the band
    slow = response(make_inverse(true_transfer(), RATE, 4, HIGH), np.arange(0.2, 1.6, 0.2))
    np.testing.assert_allclose(np.abs(slow), np.tile(np.eye(2), (len(slow), 1, 1)), atol=5e-3)  # blur of 2 / 4 s
    above = response(inverse, np.linspace(HIGH * TAPER + 1, RATE / 2, 200))
    np.testing.assert_allclose(above, 0, atol=1e-3)  # the same blur, of a drive of order one


def test_a_table_that_was_measured_can_be_driven_to_follow():
    x = np.random.default_rng(1).standard_normal((int(150 * RATE), 2))
    measured = estimate_transfer(x, PLANT.respond(x), RATE, axes=("x", "yaw"))
    r = reference(0, 5)
    drive = apply_inverse(make_inverse(measured, RATE, LOW, HIGH), r)
    before, after = (
        rrmse(r[:, [0, 5]], PLANT.respond(r[:, [0, 5]])),
        rrmse(r[:, [0, 5]], PLANT.respond(drive[:, [0, 5]])),
    )
    assert (before > 0.9).all()  # 20 ms late at 8 Hz is a radian
    assert (after < 0.01).all()  # of the response, 2e-3 noise of the estimate from 36 segments


def test_the_inverse_does_not_grow_where_the_table_does_not_move():
    notch = np.abs(1 - 1 / (1 + ((F - 10) / 2) ** 2))  # no response at all at 10 Hz
    inverse = make_inverse(one_axis(notch + 0j), RATE, LOW, HIGH, floor=0.1)
    gain = np.abs(response(inverse, np.linspace(5, 15, 401))[:, 0, 0])
    assert 8 < gain.max() < 10.5  # 1 / floor, rounded off or overshot a little by the finite length
    far = np.abs(response(inverse, np.array([20.0, 25.0]))[:, 0, 0])
    np.testing.assert_allclose(far, [1 + 4 / 100, 1 + 4 / 225], rtol=2e-3)  # 1 / notch, untouched by the floor


def test_an_axis_that_was_measured_badly_gets_its_reference_and_does_not_spoil_the_other():
    good = true_transfer()
    rubbish = np.random.default_rng(2).standard_normal((len(F), 2))
    bad = replace(good, response=good.response.copy(), coherence=good.coherence * [1.0, 0.3])
    bad.response[:, 1, :] = 30 * rubbish
    inverse = response(make_inverse(bad, RATE, LOW, HIGH), np.arange(1.5, 28, 0.1))
    # the drives are (r_x - T_xy r_y) / T_xx, all delays but that of x unknown, and r_y itself
    np.testing.assert_allclose(inverse[:, 1, 1], 1, atol=2e-3)  # as in the first test
    np.testing.assert_allclose(inverse[:, 1, 0], 0, atol=2e-3)
    np.testing.assert_allclose(
        inverse[:, 0, 0], 1 / true_transfer(np.arange(1.5, 28, 0.1)).response[:, 0, 0], atol=5e-3
    )


def test_frequencies_that_do_not_cohere_are_bridged_by_the_plain_delay():
    late = np.exp(-2j * np.pi * F * 0.02)
    hole = (F > 9) & (F < 12)
    deaf = replace(one_axis(np.where(hole, 0, 0.5 * late)), coherence=np.where(hole, 0.2, 1.0)[:, None])
    inverse = response(make_inverse(deaf, RATE, LOW, HIGH), f := np.array([5.0, 10.5, 20.0]))[:, 0, 0]
    expected = np.array([2, 1, 2]) * np.exp(2j * np.pi * f * 0.02)
    np.testing.assert_allclose(inverse, expected, atol=0.02)  # blur of the steps at 9 and 12 Hz by the finite length


@settings(max_examples=20)
@given(st.floats(-0.1, 0.1))
def test_the_inverse_of_a_delay_is_an_advance(tau: float):
    inverse = make_inverse(one_axis(np.exp(-2j * np.pi * F * tau)), RATE, LOW, HIGH)
    r = reference(0)
    error = rrmse(align(r[:, 0], tau, 1 / RATE), apply_inverse(inverse, r)[:, 0])
    assert error < 1e-3  # unit gain down to rest: only the taps' fading and the fade above the band are left


# ------------------------------------------------------------------------------------------- applying it
def test_axes_without_an_inverse_pass_unchanged():
    inverse = make_inverse(true_transfer(axes=("roll", "z")), RATE, LOW, HIGH)
    r = reference(0, 2, 3)
    drive = apply_inverse(inverse, r)
    np.testing.assert_array_equal(drive[:, [0, 1, 4, 5]], r[:, [0, 1, 4, 5]])
    swapped = apply_inverse(make_inverse(true_transfer(axes=("z", "roll")), RATE, LOW, HIGH), r[:, [0, 1, 3, 2, 4, 5]])
    np.testing.assert_allclose(drive[:, [3, 2]], swapped[:, [2, 3]], atol=1e-12)  # rounding of the transform


def test_the_record_is_filtered_as_if_silence_stood_around_it():
    inverse = make_inverse(true_transfer(), RATE, LOW, HIGH)
    r = reference(0, 5)[: 10 * int(RATE)]
    framed = apply_inverse(inverse, np.pad(r, [(3000, 3000), (0, 0)]))[3000:-3000]
    np.testing.assert_allclose(apply_inverse(inverse, r), framed, atol=1e-12)  # rounding: nothing wraps around
    half = len(inverse.taps) // 2
    late = np.stack([signal.fftconvolve(r[:, 0], inverse.taps[:, k, 0]) for k in range(2)], axis=1)
    only_x = np.where(np.arange(6) == 0, r, 0)
    np.testing.assert_allclose(apply_inverse(inverse, only_x)[:, [0, 5]], late[half : half + len(r)], atol=1e-12)
    assert half / RATE == 2.0  # half of 4 s


@pytest.mark.parametrize(
    ("low", "high", "rate"), [(0.1, 30, RATE), (30, 0.5, RATE), (0.5, 110, RATE), (0.5, 30, 64.0), (-1, 30, RATE)]
)
def test_a_band_beyond_the_transfer_function_or_the_rate_is_refused(low: float, high: float, rate: float):
    with pytest.raises(ValueError, match="needs the transfer function from"):
        make_inverse(true_transfer(), rate, low, high)


def test_what_is_not_square_has_no_inverse_and_what_is_not_six_finite_columns_is_not_filtered():
    wide = true_transfer()
    with pytest.raises(ValueError, match="square"):
        make_inverse(replace(wide, response=wide.response[:, :1]), RATE, LOW, HIGH)
    inverse = make_inverse(wide, RATE, LOW, HIGH)
    for wrong in (np.zeros((100, 2)), np.zeros(100), np.full((100, 6), np.nan)):
        with pytest.raises(ValueError, match="6 columns of finite samples"):
            apply_inverse(inverse, wrong)


# ------------------------------------------------------------------------------------------- disk
def test_a_saved_inverse_comes_back_the_same(tmp_path: Path):
    inverse = make_inverse(true_transfer(), RATE, LOW, HIGH)
    save_inverse(inverse, tmp_path / "table.nc")
    back = load_inverse(tmp_path / "table.nc")
    np.testing.assert_array_equal(back.taps, inverse.taps)
    assert (back.rate, back.band, back.axes) == (inverse.rate, inverse.band, inverse.axes)
    assert back.made_with == {}
    save_inverse(replace(inverse, made_with={"machine": "mine"}), tmp_path / "table.nc")
    assert load_inverse(tmp_path / "table.nc").made_with == {"machine": "mine"}


def test_a_file_that_is_no_inverse_is_refused_by_name(tmp_path: Path):
    inverse = make_inverse(true_transfer(), RATE, LOW, HIGH)
    with pytest.raises(RecordError, match=r"gone.nc: no such file"):
        load_inverse(tmp_path / "gone.nc")
    xr.Dataset({"other": ("tap", np.zeros(3))}).to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
    with pytest.raises(RecordError, match=r"other.nc: is not a saved inverse"):
        load_inverse(tmp_path / "other.nc")
    for wrong in ({"taps": inverse.taps * np.nan}, {"taps": inverse.taps[1:]}, {"axes": ("x", "surge")}, {"rate": 0.0}):
        save_inverse(replace(inverse, **wrong), tmp_path / "wrong.nc")
        with pytest.raises(RecordError, match=r"wrong.nc: holds an inverse"):
            load_inverse(tmp_path / "wrong.nc")
