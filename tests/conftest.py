"""Settings of all tests: hypothesis draws the same examples each time.

`pytest --hypothesis-profile=explore` draws new ones, to look for what nobody has thought of; `long` draws so many that
the readers of `test_fuzz` take some ten minutes.
"""

import sys
from functools import cache

import numpy as np
import pytest
import typer.main
from commands import Ended
from hypothesis import settings
from machine_cases import machine_named
from run_cases import measured_of, shaken
from sensor_cases import measured

from lhpost6_pin import cli
from lhpost6_pin.control import load_controller, make_controller
from lhpost6_pin.data.sensors import SensorSet, add_noise, load_sensors
from lhpost6_pin.identification.prepare import MeasuredTest
from lhpost6_pin.machine.machine import Machine, load_machine
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.motions import process
from lhpost6_pin.show.bodies import load_bodies

settings.register_profile("fixed", derandomize=True, deadline=None, max_examples=50)
settings.register_profile("explore", max_examples=1000, deadline=None)
settings.register_profile("long", max_examples=4000, deadline=None)
settings.load_profile("fixed")


FIRST = ("test_discover", "test_cli", "test_panel_page", "test_law_battery", "test_ensemble", "test_calibration")
"""The files that take longest: begun first, they leave no worker alone at the end."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the longest files first; a test that is neither `long` nor `slow` is `fast`."""
    place = {name: k for k, name in enumerate(FIRST)}
    items.sort(key=lambda item: place.get(item.path.stem, len(place)))
    for item in items:
        if not any(item.iter_markers("long")) and not any(item.iter_markers("slow")):
            item.add_marker("fast")


commands_of = cache(typer.main.get_command)
"""All commands of an application, which typer makes anew at each call: a fifth of a second."""


@pytest.fixture
def lhpost6(capsys, monkeypatch, tmp_path):
    """Run a command as the entry point does, in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(typer.main, "get_command", commands_of)

    def run(*arguments: object) -> Ended:
        monkeypatch.setattr(sys, "argv", ["lhpost6", *map(str, arguments)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            cli.main()
        code = end.value.code
        return Ended(code if isinstance(code, int) else 0 if code is None else 1, *capsys.readouterr())

    return run


@pytest.fixture
def brief(monkeypatch):
    """Half a second of rest before and after a motion in place of four, which is most of a short run."""
    known = process.processing()
    monkeypatch.setattr(process, "processing", lambda: {**known, "pad": 0.5})


@pytest.fixture(scope="session")
def machine() -> Machine:
    """The LHPOST6."""
    return load_machine()


@pytest.fixture(scope="session")
def sensors() -> SensorSet:
    """Its sensors."""
    return load_sensors()


@pytest.fixture(scope="session")
def plant(machine):
    """The nominal LHPOST6, made ready; its arrays are read only by agreement."""
    return make_plant(machine)


@pytest.fixture(scope="session")
def rest(plant):
    """Its equilibrium in the control zero-position."""
    return find_equilibrium(plant)


@pytest.fixture(scope="session")
def bodies(plant):
    """Its bodies to look at."""
    return load_bodies(plant.machine)


@pytest.fixture(scope="session")
def poses():
    """Two hundred poses (n, 6) of C and Euler angles [m, rad] within most of Table 2.2, legs within their lengths."""
    travel = np.array([0.6, 0.38, 0.127, 0.038, 0.025, 0.066])
    return np.random.default_rng(6).uniform(-travel, travel, (200, 6))


@pytest.fixture(scope="session")
def redundant(plant, sensors):
    """Two records of all sensors with noise and nothing wrong."""
    return [add_noise(measured(plant, seed)[0], sensors, np.random.default_rng(seed)) for seed in (0, 10)]


@pytest.fixture(scope="session")
def table() -> Machine:
    """One axis, a piston of equal areas."""
    return machine_named("uniaxial")


@pytest.fixture(scope="session")
def test(table) -> MeasuredTest:
    """It, shaken, with all that a simulation knows, free of noise; its arrays are read only by agreement."""
    return measured_of(shaken(table, samples=600))


@pytest.fixture(scope="session")
def controller(plant, rest):
    """The shipped 469D for it."""
    return make_controller(plant, rest, load_controller("lhpost6"))
