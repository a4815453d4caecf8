"""Effects at a place, in a direction, of a frequency or of a range of their own, hidden in simulated campaigns."""

import numpy as np
import pinocchio as pin
import pytest

from lhpost6_pin.control import load_controller
from lhpost6_pin.discovery import Discovery, discover
from lhpost6_pin.discovery.verdict_file import summary
from lhpost6_pin.machine.machine import Machine
from lhpost6_pin.simulation.simulated_campaign import simulate_campaign

pytestmark = pytest.mark.slow  # a minute each

TESTS = ("TX", "TY", "TZ", "WN")
SPRING = {f"{kind}_{axis}": 0.0 for kind in ("stiffness", "damping") for axis in "xyz"}


def searched(hiding: Machine, machine: Machine, sensors, hold_out: str = "TY") -> Discovery:
    campaign = simulate_campaign(hiding, load_controller("lhpost6"), sensors, seed=3, tests=TESTS)
    return discover(machine, campaign, sensors, hold_out=[hold_out], phases=(1,), jobs=1, propose=False)


@pytest.mark.parametrize("tilt", [0.0, 0.6])
def test_a_spring_is_found_on_its_line_of_action(machine, sensors, tilt):
    """At a point and in a direction of its own; where along its line it is fixed moves no force."""
    place, turn = np.array([5.0, 3.0, 0.0]), 0.6
    values = {"stiffness_x": 3e6, "x": place[0], "y": place[1], "height": place[2], "turn": turn, "tilt": tilt}
    found = searched(machine.with_effect("placed_spring", ("platen",), **{**SPRING, **values}), machine, sensors)
    (one,) = found.verdict.effects
    assert (one.family, one.form) == ("stray_spring", "placed_spring")
    told = {name: estimate.value for name, estimate in one.parameters.items()}
    stiffness = np.array([told[f"stiffness_{axis}"] for axis in "xyz"])
    axis = int(np.argmax(stiffness))  # which of its axes is the spring's, turned by a right angle, is the same spring
    assert stiffness[axis] == pytest.approx(3e6, rel=0.02)  # twice its interval
    assert np.delete(stiffness, axis).max() < 0.02 * 3e6
    along = pin.rpy.rpyToMatrix(0.0, tilt, turn)[:, 0]
    assert abs(pin.rpy.rpyToMatrix(0.0, told["tilt"], told["turn"])[:, axis] @ along) > 1.0 - 1e-4  # 0.01 rad
    apart = np.cross(np.array([told["x"], told["y"], told["height"]]) - place, along)
    assert np.linalg.norm(apart) < 0.3  # as wanted of a corner
    (gap,) = found.proof.gaps
    assert gap.after < 1.3 < gap.refitted  # near noise


def test_a_specimen_with_a_frequency_of_its_own_along_each_axis_is_two_effects(machine, sensors):
    values = {"mass": 4e3, "damping": 0.03, "height": 2.5, "x": 1.0, "y": -0.5}
    hiding = machine
    for axis, frequency in (("platen.x", 3.1), ("platen.y", 5.2)):
        hiding = hiding.with_effect("swaying_specimen", (axis,), name=f"sway {axis[-1]}", frequency=frequency, **values)
    found = searched(hiding, machine, sensors)
    told = {one.components: one for one in found.verdict.effects}
    assert set(told) == {("platen.x",), ("platen.y",)} and found.verdict.word in ("named", "ambiguous")
    for axis, frequency in (("platen.x", 3.1), ("platen.y", 5.2)):
        one = told[axis,]
        assert one.family == "specimen_resonance"
        assert one.parameters["frequency"].value == pytest.approx(frequency, rel=0.005)
        assert one.parameters["mass"].value == pytest.approx(4e3, rel=0.03)
    assert not found.verdict.withdrawn


def test_a_stop_is_named_though_a_test_that_goes_farther_contradicts_its_numbers(machine, sensors):
    """Its second stage begins behind all that was searched: TY moves H1 by 0.07 m, TX by 0.16 m."""
    hiding = machine
    for name, force, start in (("soft", 1.5e5, 0.045), ("hard", 2e6, 0.09)):
        values = {"force": force, "start": start, "exponent": 1.0}
        hiding = hiding.with_effect("end_stop_stiffening", ("H1",), name=name, **values)
    found = searched(hiding, machine, sensors, hold_out="TX")
    assert [(one.family, one.components) for one in found.verdict.effects] == [("end_stop_stiffening", ("H1",))]
    assert not found.verdict.withdrawn
    (gap,) = found.proof.gaps
    assert gap.after > 5.0  # extrapolated, it is far from right
    (beyond,) = found.beyond
    assert (beyond.component, beyond.test) == ("H1", "TX") and 0.06 < beyond.searched < 0.09 < beyond.reached
    assert "TX moves H1" in summary(found) and "extrapolated" in summary(found)
