"""Numbers with unit and source: the shipped files are complete and agree with print; bad ones are refused by key."""

import re

import numpy as np
import pint
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from machine_cases import STEWART

from lhpost6_pin.core.errors import LhpostError, ParameterError, UnknownNameError
from lhpost6_pin.core.files import models_folder
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.machine.parameters import EVIDENCE, Quantity, load_parameters, override_parameters, to_unit

SHIPPED = [p.stem for p in sorted(models_folder().glob("*.toml"))]
FILES = [*SHIPPED, str(STEWART)]
TEXT = (models_folder() / "lhpost6.toml").read_text(encoding="utf-8")
UNITS = pint.UnitRegistry()


def changed(pattern, replacement, tmp_path):
    """A machine file with one piece of text replaced."""
    text, count = re.subn(pattern, replacement, TEXT, count=1, flags=re.MULTILINE)
    assert count == 1, f"{pattern} is not in lhpost6.toml any more"
    path = tmp_path / "changed.toml"
    path.write_text(text, encoding="utf-8")
    return path


def spelled(unit):
    """A unit of the file the way pint reads it: ``kg m2`` as kg*m**2."""
    return " / ".join(
        "*".join(re.sub(r"([A-Za-z])(\d)$", r"\1**\2", word) for word in part.split()) for part in unit.split("/")
    )


# The shipped files ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("file", FILES)
def test_every_number_has_an_si_unit_an_evidence_and_a_source(file):
    for path, quantity in load_parameters(file).items():
        assert quantity.unit and quantity.evidence in EVIDENCE and len(quantity.source) > 5, path
        assert quantity.assumed == (quantity.evidence == "assumed")
        for unit in quantity.unit.split(" | "):  # of SI, whose base units are one
            if unit != "1":
                assert UNITS.Quantity(1.0, spelled(unit)).to_base_units().magnitude == pytest.approx(1.0), path


PRINTED = {path: q for path, q in load_parameters("lhpost6").items() if q.printed is not None}


@pytest.mark.parametrize("path", PRINTED)
def test_number_agrees_with_the_one_printed_in_the_report(path):
    quantity = PRINTED[path]
    values = np.atleast_1d(quantity.value)
    units = quantity.unit.split(" | ")
    groups = re.findall(r"(?:\[([^\]]*)\]|([-\d.]+))\s+([^\[,]+)", quantity.printed)
    wanted: list[float] = []
    for many, one, unit in groups:
        target = units[min(len(units) - 1, len(wanted) // 3)]
        numbers = [float(n) for n in (many.split(",") if many else [one])]
        unit = "standard_gravity" if unit.strip() == "g" else spelled(unit.strip())  # pint's g is the gram
        wanted += [UNITS.Quantity(n, unit).to(spelled(target)).magnitude for n in numbers]
    # the file keeps nine digits at most of a converted number
    assert np.allclose(values, wanted, rtol=1e-7, atol=0.0)


def test_report_values_without_print_are_those_of_table_6_1():
    machine = load_machine()
    h, v, s = machine.actuators[0], machine.actuators[4], machine.struts[0]
    assert (h.area_a, h.area_b, v.area_a) == (0.2027, 0.1297, 0.5150)
    assert (h.flow_curve, v.flow_curve) == (1.30, 1.05)
    assert (h.seal_shape, v.seal_shape, v.pad_shape) == (0.1, 0.1, 0.1)
    assert (s.area, s.gas_length, s.polytropic_index) == (0.1500, 1.9638, 1.75)
    assert s.seal_friction == 0.0


def test_nominal_platen_is_the_second_estimate_of_table_4_1():
    parameters = load_parameters("lhpost6")
    for what in ("mass", "inertia"):
        assert parameters[f"platen.{what}"].value == parameters[f"estimates.second.{what}"].value


def test_mapping_lists_paths_in_file_order_and_names_near_ones_for_a_wrong_path():
    parameters = load_parameters("lhpost6")
    assert next(iter(parameters)) == "platen.mass"
    assert len(parameters) == len(list(parameters))
    assert "platen.mass" in parameters and "platen.masss" not in parameters
    with pytest.raises(UnknownNameError, match=r"no parameter named 'platen.masss'; did you mean 'platen.mass'"):
        parameters["platen.masss"]


# Bad files: one error that names the key ------------------------------------------------------------------------------

ASSUMED = "evidence = 'assumed', source = 'x' }"

BAD = {
    "a unit of another dimension": (r'^(supply_pressure.*unit = )"Pa"', r'\1"m"', "hydraulics.supply_pressure.*'m'"),
    "a missing unit": (r'^(gas_length = .*), unit = "m"', r"\1", "hold_down.gas_length: unit is missing"),
    "a missing source": (r"^(stroke = \{ value = 0.75.*), source = .*\}", r"\1 }", "horizontal.stroke: source is miss"),
    "a missing key": (r"^bulk_modulus = .*\n", "", "hydraulics.bulk_modulus is missing"),
    "a key missing that only a bearing needs": (r"^pad_yield = .*\n", "", "vertical.pad_yield is missing; a 3-way"),
    "a negative area": (r"^(area_a = \{ value = )0.2027", r"\1-0.2027", "horizontal.area_a: -0.2027"),
    "a zero mass": (r"^(mass = \{ value = \[)168100.0", r"\g<1>0.0", "platen.mass: .*should be positive"),
    "a shape beyond 1": (r"^(seal_shape = \{ value = )0.1", r"\g<1>1.1", "seal_shape: 1.1 .*0 and 1"),
    "an unknown key": (r"^bulk_modulus = ", "bulk_moduluss = ", "unknown key hydraulics.bulk_moduluss; did"),
    "an unknown key beside the right one": (
        r"^(bulk_modulus = .*)\n",
        rf"\1\nbulk_stiffness = {{ value = 1.0, unit = 'Pa', {ASSUMED}\n",
        "unknown key hydraulics.bulk_stiffness; valid names: bulk_modulus, .*supply_pressure",
    ),
    "an unknown key of the power supply": (r"^pump_flow = ", "pump_flows = ", "unknown key power_supply.pump_flows"),
    "a pump flow in kilograms": (
        r'^(pump_flow = .*unit = )"m3/s"',
        r'\1"kg"',
        "power_supply.pump_flow.*'kg'",
    ),
    "accumulators below nothing": (
        r"^(accumulators = \{ value = )36.9",
        r"\1-36.9",
        "power_supply.accumulators: -36.9",
    ),
    "an unknown word in a quantity": (r"^gravity = \{", "gravity = { colour = 'red',", "platen.gravity: unknown col"),
    "an unknown evidence": (r'^(gravity.*)"standard"', r'\1"hearsay"', "platen.gravity: evidence 'hearsay'"),
    "not a number": (r"value = 9.80665", "value = nan", "platen.gravity: value nan is not fin"),
    "infinity in a vector": (
        r"\[6.19, 0.48, -1.25\]",
        "[6.19, inf, -1.25]",
        "H1.platen_point: value inf is not finite",
    ),
    "text for a number": (r"value = 9.80665", "value = '9.8'", "platen.gravity: value '9.8' is not a number"),
    "a truth for a number": (r"value = 9.80665", "value = true", "platen.gravity: value True is not a number"),
    "a vector for a number": (r"value = 9.80665", "value = [9.8, 0.0]", "platen.gravity: .*should be one number"),
    "a short vector": (r"\[6.19, 0.48, -1.25\]", "[6.19, 0.48]", "H1.platen_point: sd .* does not have the shape"),
    "a number without unit": (r"^gravity = .*", "gravity = 9.8", "platen.gravity = 9.8 has no unit"),
    "a negative deviation": (r"rel_sd = 0.1 ", "rel_sd = -0.1 ", "standard deviation .* is negative"),
    "a mount that is none": (r'^mount = "swivel"', 'mount = "glued"', "horizontal.mount = 'glued'; .*swivel, bearing"),
    "a valve that is none": (r'^valve = "4-way"', 'valve = "5-way"', "horizontal.valve = '5-way'"),
    "half a servovalve": (r"^valves = 1", "valves = 0", "horizontal.valves = 0"),
    "a thrust that is none": (r'^thrust = "report"', 'thrust = "up"', "machine.thrust = 'up'; .*report, normal"),
    "a kind that is not there": (r'^kind = "hold_down"', 'kind = "holdown"', "holdown.role"),
    "a stroke longer than its chamber": (r"^stroke = \{ value = 0.75", "stroke = { value = 0.85", "leaves no oil"),
    "a bearing that is not vertical": (r"\[4.624, 2.871, -2.0\]", "[4.6, 2.871, -2.0]", "V1: a bearing .* vertical"),
    "a bearing off its plane": (r"\[4.624, 2.871, -1.2\]", "[4.624, 2.871, -1.1]", "V1.platen_point must lie in"),
    "a bearing plane off the axis": (r"\[0.0, 0.0, -1.2\]", "[0.1, 0.0, -1.2]", "bearing_plane must lie straight"),
    "a return above the supply": (r"value = 550000.0", "value = 5.5e7", "return_pressure is not below"),
    "a component of no length": (r"\[4.89, 0.0, -6.0\]", "[4.89, 0.0, -2.43]", "S1: platen_point and base_point coin"),
    "a number outside any section": (r"^\[machine\]", "odd = 1\n[machine]", "odd stands outside any section"),
    "a quantity outside any section": (
        r"^\[machine\]",
        "[odd]\nvalue = 1.0\n[machine]",
        "odd stands outside any section",
    ),
    "a path in quotation marks": (
        r"^\[machine\]",
        "['kind.horizontal']\n[machine]",
        "without quotation marks, or hori",
    ),
    "a section that is a number": (r"^(\[component).H1\]", r"\1]\nH0 = 1\n\1.H1]", "component.H0 must be a sec"),
    "a path given twice": (r"^(\[kind).horizontal\]", r"\1.platen]\nmass = 1\n\1.horizontal]", "platen.mass is given"),
    "a chamber area on a 3-way valve": (
        r"^(area_a = \{ value = 0.515)",
        rf"area_b = {{ value = 0.1, unit = 'm2', {ASSUMED}\n\1",
        "vertical.area_b is given, but a 3-way valve",
    ),
    "text that is not TOML": (r"^\[machine\]", "[machine", "changed.toml: not a TOML file"),
    "an empty vector with a deviation": (r"^(size = \{ )value = .*?\]", r"\1rel_sd = 0.1, value = []", "platen.size"),
    "a number beyond any float": (r"value = 9.80665", "value = 1" + 400 * "0", "platen.gravity"),
    "a component with a dot in its name": (r"^\[component.H1\]", '[component."H.1"]', "H.1"),
    "a kind where none belongs": (r"^(\[estimates.first\])", r'\1\nkind = "horizontal"', "estimates.first.kind"),
    "a misspelt word": (r"^thrust = ", 'thrst = "normal"\nthrust = ', "machine.thrst"),
    "a misspelt word of a component": (r"^\[component.H1\]", "[component.H1]\nvalvez = 2", "H1.valvez"),
    "a wrong limit": (r"^bandwidth = ", rf"bandwith = {{ value = 1, unit = 'Hz', {ASSUMED}\n\g<0>", "limits.bandwith"),
    "a misspelt section": (r"^\[hydraulics\]", "[hydraulic]\nodd = 'x'\n[hydraulics]", "hydraulic"),
}


@pytest.mark.parametrize("fault", BAD)
def test_bad_file_is_refused_with_file_and_key(fault, tmp_path):
    pattern, replacement, message = BAD[fault]
    path = changed(pattern, replacement, tmp_path)
    with pytest.raises(ParameterError, match=message) as caught:
        load_machine(path)
    assert "changed.toml" in str(caught.value)


def test_file_that_is_not_there_or_not_text_is_refused(tmp_path):
    (tmp_path / "folder.toml").mkdir()
    (tmp_path / "image.toml").write_bytes(b"\xff\xd8\xff\xe0")
    (tmp_path / "empty.toml").write_text("", encoding="utf-8")
    words = {"none": "no such file", "folder": "cannot be read", "image": "not a TOML file", "empty": "empty"}
    for name, message in words.items():
        with pytest.raises(ParameterError, match=message):
            load_machine(tmp_path / f"{name}.toml")


# Changed copies -------------------------------------------------------------------------------------------------------


def test_override_by_keyword_mapping_and_file_are_the_same(tmp_path):
    machine = load_machine()
    file = tmp_path / "small.toml"
    file.write_text("[hydraulics]\nsupply_pressure = { value = 20.0, unit = 'MPa', source = 'a test' }\n")
    by_keyword = machine.with_params(hydraulics__supply_pressure=20e6)
    by_mapping = machine.with_params({"hydraulics.supply_pressure": 20e6})
    by_file = machine.with_params(file)
    for changed_machine in (by_keyword, by_mapping, by_file, load_machine("lhpost6", file)):
        assert changed_machine.hydraulics.supply_pressure == pytest.approx(20e6, rel=1e-15)
    assert machine.hydraulics.supply_pressure == 20.7e6  # the original is as it was
    assert by_mapping.parameters["hydraulics.supply_pressure"].evidence == "override"
    assert "was 20700000.0" in by_mapping.parameters["hydraulics.supply_pressure"].source
    assert by_file.parameters["hydraulics.supply_pressure"].source == "a test"
    assert by_file.parameters["hydraulics.supply_pressure"].unit == "Pa"
    assert by_file.parameters.origin == "lhpost6.toml + small.toml"


def test_override_with_another_unit_of_the_same_dimension_is_converted():
    machine = load_machine()
    table = {"value": 1000.0, "unit": "l/min/MPa", "source": "a test", "sd": 10.0}
    leakage = machine.with_params({"horizontal.leakage": table}).parameters["horizontal.leakage"]
    assert leakage.value == pytest.approx(1000.0 / 60e3 / 1e6)
    assert leakage.sd == pytest.approx(10.0 / 60e3 / 1e6)
    mm = machine.with_params({"H1.platen_point": {"value": [6190, 480, -1250], "unit": "mm"}})
    assert mm.actuators[0].platen_point == pytest.approx((6.19, 0.48, -1.25))


def test_a_number_without_unit_far_from_the_stated_one_is_doubted(caplog):
    """5 l/min/MPa by hand is 5 m3/s/Pa without its unit, eleven decades off; twice the stated number is a change."""
    machine = load_machine()
    machine.with_params({"horizontal.leakage": 5.0})
    assert "horizontal.leakage: 5.0 has no unit and is taken in m3/s/Pa" in caplog.text
    caplog.clear()
    machine.with_params({"horizontal.leakage": {"value": 5.0, "unit": "l/min/MPa"}, "horizontal.seal_friction": 0.0})
    machine.with_params({"horizontal.leakage": 9e-11, "platen.mass": [1e5, 1e5, 1e5]})
    centre = machine.parameters["platen.centre_of_gravity"].value
    machine.with_params({"platen.centre_of_gravity": (centre[0], 1e-3, centre[2])})  # a fit's; of -4.8e-7 m
    assert not caplog.text
    machine.with_params({"platen.centre_of_gravity": tuple(1e3 * x for x in centre)})
    assert "platen.centre_of_gravity" in caplog.text


def test_one_component_can_have_more_servovalves_open_than_its_kind():
    assert [a.valves for a in load_machine().with_params({"H1.valves": 2}).actuators[:2]] == [2, 1]


def test_one_component_can_differ_from_its_kind():
    machine = load_machine().with_params({"H3.seal_friction": 5e3})
    assert [a.seal_friction for a in machine.actuators[:4]] == [9250.0, 9250.0, 5e3, 9250.0]
    quantity = machine.parameters["H3.seal_friction"]
    assert quantity.unit == "N"
    # and again: the component's own is now what is changed
    assert machine.with_params({"H3.seal_friction": 6e3}).actuators[2].seal_friction == 6e3


def test_words_are_options_that_can_be_changed_too():
    machine = load_machine()
    assert machine.with_params(platen__mass=np.full(3, 1e5)).platen.mass == (1e5, 1e5, 1e5)  # arrays too
    assert machine.with_params({"machine.thrust": "normal"}).thrust == "normal"
    assert machine.with_params({"horizontal.valves": 2}).actuators[0].valves == 2
    with pytest.raises(ParameterError, match=r"machine.thrust = 'sideways'"):
        machine.with_params({"machine.thrust": "sideways"})
    with pytest.raises(ParameterError, match=r"horizontal.valves: 1.5"):
        machine.with_params({"horizontal.valves": 1.5})


@pytest.mark.parametrize(
    "change, message",
    [
        ({"platen.masss": 1.0}, "no parameter named 'platen.masss'"),
        ({"H9.seal_friction": 1.0}, "no parameter named 'H9.seal_friction'"),
        ({"H1.pad_friction": 1.0}, "no parameter named 'H1.pad_friction'"),
        ({"machine.thurst": "normal"}, "no parameter named 'machine.thurst'"),
        ({"platen.mass": 1.0}, "platen.mass: 1.0 does not have the shape"),
        ({"platen.mass": [1.0, 2.0]}, "platen.mass: .* does not have the shape"),
        ({"platen.gravity": float("nan")}, "platen.gravity: value nan is not finite"),
        ({"platen.gravity": "9.81"}, "platen.gravity"),
        ({"platen.gravity": None}, "platen.gravity: value None is not a number"),
        ({"platen.gravity": -1.0}, "platen.gravity: -1.0 is impossible"),
        ({"platen.gravity": {"value": 9.8, "unit": "kg"}}, "platen.gravity: unit 'kg' cannot be converted to 'm/s2'"),
        ({"platen.gravity": {"unit": "m/s2"}}, "platen.gravity: value is missing"),
        ({"platen.gravity": {"value": 9.8, "units": "m/s2"}}, "platen.gravity: unknown units"),
    ],
)
def test_override_that_cannot_be_is_refused_by_key(change, message):
    with pytest.raises(LhpostError, match=message):
        load_machine().with_params(change)


def test_standard_deviation_is_in_the_units_of_the_value():
    parameters = load_parameters("lhpost6")
    assert parameters["hydraulics.bulk_modulus"].sd == pytest.approx(89.6e6)  # rel_sd 0.1
    assert parameters["platen.centre_of_gravity"].sd == (0.01, 0.01, 0.05)
    assert parameters["platen.mass"].sd == pytest.approx((2521.5, 2520.9, 2616.3))
    assert parameters["platen.gravity"].sd is None


@pytest.mark.parametrize(
    "unit, wanted, factor",
    [("l/min", "m3/s", 1.0 / 60e3), ("kN s/m", "N s/m", 1e3), ("t m2", "kg m2", 1e3), ("mm", "m", 1e-3)],
)
def test_units_are_converted_as_written_in_the_report(unit, wanted, factor):
    assert to_unit(2.0, unit, wanted, "key") == pytest.approx(2.0 * factor)
    assert to_unit((1.0, 2.0), unit, wanted, "key") == pytest.approx((factor, 2.0 * factor))


# Anything at all: an answer or one of our errors, never another ------------------------------------------------------

KEYS = ("value", "unit", "evidence", "source", "sd", "rel_sd", "printed")


values = st.one_of(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.lists(st.floats(), max_size=4),
    st.dictionaries(st.sampled_from(KEYS), st.floats() | st.text(max_size=5) | st.lists(st.floats(), max_size=3)),
)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.sampled_from(sorted(load_parameters("lhpost6"))), values)
def test_any_override_gives_a_machine_or_one_of_our_errors(path, value):
    try:
        machine = load_machine().with_params({path: value})
    except LhpostError as error:
        assert path.split(".")[-1] in str(error) or path.split(".")[0] in str(error)
    else:
        assert isinstance(machine.parameters[path], Quantity)


@pytest.mark.parametrize("entry", ["5.0", "{ value = 5.0 }", "{ value = 5.0, source = 'ours' }"])
def test_an_override_file_must_give_units(tmp_path, entry, caplog):
    path = tmp_path / "ours.toml"
    path.write_text(f"[kind.horizontal]\nleakage = {entry}\n")
    with pytest.raises(ParameterError, match=r"ours.toml: horizontal.leakage: has no unit; write .* unit = 'm3/s/Pa'"):
        override_parameters(load_parameters("lhpost6"), path)
    assert not caplog.text  # nothing is taken in SI
    path.write_text("[kind.horizontal]\nflow_curve = 1.2\n")  # a pure number
    assert override_parameters(load_parameters("lhpost6"), path).number("horizontal.flow_curve") == 1.2
