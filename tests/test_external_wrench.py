"""A wrench on the platen from outside: both engines' accelerations, and free axes of a guided platen."""

import numpy as np
import pytest
from machine_cases import MACHINES, machine_named
from run_cases import at_rest

from lhpost6_pin.core.compiled import compiled
from lhpost6_pin.mechanics.derivatives import evaluate_derivatives
from lhpost6_pin.mechanics.forward_dynamics import platen_acceleration
from lhpost6_pin.mechanics.rigid_body import platen_inertia
from lhpost6_pin.mechanics.schemes import TAU, A
from lhpost6_pin.mechanics.workspace import make_workspace, unpack_workspace

WRENCH = np.array([3e4, -2e4, 5e4, 1e4, -4e4, 2e4])  # N, N m at B


@pytest.mark.parametrize("name", MACHINES)
def test_an_external_wrench_accelerates_the_platen_by_its_inertia(name):
    plant, rest = at_rest(machine_named(name))
    ws = make_workspace(plant, rest.state)
    assert not ws.external.any()
    ws.external[:] = WRENCH
    assert evaluate_derivatives(plant, ws, rest.spool) == 0
    _, inertia = platen_inertia(plant.model, plant.machine)
    wanted = np.linalg.solve(inertia[np.ix_(plant.axes, plant.axes)], WRENCH[plant.axes])
    # the rest itself is in balance within 1e-9 of its forces, 1e-6 N of 1e5 kg
    assert np.allclose(ws.motion[A], wanted, rtol=1e-12, atol=1e-10)
    fused = np.zeros(plant.axes.size)
    platen_acceleration(plant.tables.inertia, plant.axes, ws.frame, ws.motion[TAU], np.zeros((2, 6)), fused)
    assert np.allclose(fused, wanted, rtol=1e-12, atol=1e-10)


def test_the_external_wrench_lies_in_the_buffer_of_the_workspace():
    plant, rest = at_rest(machine_named("lhpost6"))
    ws = make_workspace(plant, rest.state)
    ws.external[:] = WRENCH
    found = np.zeros(6)
    _external(ws.buffer, found)
    assert np.array_equal(found, WRENCH)


@compiled
def _external(buffer, out):  # type: ignore[no-untyped-def]
    out[:] = unpack_workspace(buffer).external
