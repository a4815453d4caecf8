"""Settings of all tests: hypothesis draws the same examples each time.

`pytest --hypothesis-profile=explore` draws new ones, to look for what nobody has thought of.
"""

import pytest
from hypothesis import settings

from lhpost6_pin.equilibrium import find_equilibrium
from lhpost6_pin.machine import load_machine
from lhpost6_pin.plant import make_plant

settings.register_profile("fixed", derandomize=True, deadline=None)
settings.register_profile("explore", max_examples=1000, deadline=None)
settings.load_profile("fixed")


@pytest.fixture(scope="session")
def plant():
    """The nominal LHPOST6, made ready; its arrays are read only by agreement."""
    return make_plant(load_machine())


@pytest.fixture(scope="session")
def rest(plant):
    """Its equilibrium in the control zero-position."""
    return find_equilibrium(plant)
