"""What the errors say about a name that does not exist."""

import re
from collections.abc import Iterator

import pytest

from lhpost6_pin.control import load_controller
from lhpost6_pin.core.errors import UnknownNameError
from lhpost6_pin.core.files import shipped, shipped_specimens
from lhpost6_pin.data.sensors import load_sensors
from lhpost6_pin.machine.library import families, find_family
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.machine.specimen import find_specimen
from lhpost6_pin.motions import find_motion, list_motions

LOOKED_UP = {
    "machine": (load_machine, list(shipped())),
    "controller": (load_controller, list(shipped("controllers"))),
    "sensors": (load_sensors, list(shipped("sensors"))),
    "specimen": (find_specimen, sorted(shipped_specimens())),
    "motion": (find_motion, [name for entry in list_motions() for name in (entry.name, *entry.aliases)]),
    "family": (find_family, list(families())),
    "parameter": (lambda path: load_machine().parameters[path], ["platen.mass", "hydraulics.supply_pressure"]),
}
"""What looks a name up, and names that it knows."""


def slips(name: str) -> Iterator[str]:
    """A name typed in a hurry: a letter left out, struck twice, or before its time; in capitals."""
    for k in range(len(name) - 1):
        yield name[:k] + name[k + 1 :]
        yield name[:k] + name[k] + name[k:]
        yield name[:k] + name[k + 1] + name[k] + name[k + 2 :]
    yield name.upper() + "S"


@pytest.mark.parametrize("what", LOOKED_UP)
def test_whoever_mistypes_a_name_is_asked_whether_it_was_meant(what):
    find, names = LOOKED_UP[what]
    for name in names:
        for slip in set(slips(name)) - set(names):
            with pytest.raises(UnknownNameError) as caught:
                find(slip)
            said = str(caught.value)
            asked = said.partition("did you mean ")[2].partition("?")[0]
            assert name in re.findall("'(.*?)'", asked), said
            assert len(said.splitlines()) == 1


@pytest.mark.parametrize("what", ["machine", "controller", "sensors", "specimen"])
def test_few_names_are_all_listed_whether_or_not_one_is_near(what):
    find, names = LOOKED_UP[what]
    for wrong in ("quite another", names[0][:-1]):
        with pytest.raises(UnknownNameError, match=f"valid names: {', '.join(names)}$"):
            find(wrong)


def test_many_names_are_not_listed_where_one_is_near_or_a_command_lists_them():
    for wrong in ("ridgecrest-cc", "quite another"):
        with pytest.raises(UnknownNameError, match=r"`lhpost6 motions` lists them$") as caught:
            find_motion(wrong)
        assert len(str(caught.value)) < 160
    with pytest.raises(UnknownNameError, match="did you mean 'stribeck_friction'") as caught:
        find_family("stribeck_fricton")
    assert "valve_deadband" not in str(caught.value)
    with pytest.raises(UnknownNameError, match="valve_deadband"):
        find_family("quite another")
    with pytest.raises(UnknownNameError, match=r"no effect of this machine named 'leak'; there are none$"):
        load_machine().without_effect("leak")
