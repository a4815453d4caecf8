"""Units as files spell them."""

import pytest

from lhpost6_pin.core import units
from lhpost6_pin.core.units import numbers_in, parse_unit, quantity_unit


@pytest.mark.parametrize("spelled", sorted(set(units._PLAIN) - {"1"}))
def test_units_that_need_no_pint_are_those_of_pint(spelled):
    assert units._PLAIN[spelled] == units._by_pint(spelled)


@pytest.mark.parametrize(
    ("text", "factor", "si"),
    [
        ("g", 9.80665, "m/s2"),
        ("m_s2", 1.0, "m/s2"),
        ("cm/sec^2", 0.01, "m/s2"),
        ("Gal", 0.01, "m/s2"),
        ("kips", 4448.2216152605, "N"),
        ("N/m2", 1.0, "Pa"),
        ("deg", 0.017453292519943295, "rad"),
        ("°/s", 0.017453292519943295, "rad/s"),
        ("%", 0.01, "1"),
        ("-", 1.0, "1"),
        ("ms", 0.001, "s"),
    ],
)
def test_a_spelling_has_its_factor_and_quantity(text, factor, si):
    assert parse_unit(text).factor == pytest.approx(factor, rel=1e-12)
    assert quantity_unit(text) == si


def test_units_of_us_data_sheets_are_known():
    gallon, pound = 231 * 0.0254**3, 0.45359237  # by definition
    assert parse_unit("gpm").factor == pytest.approx(gallon / 60.0, rel=1e-12)
    assert parse_unit("lbm").factor == pytest.approx(pound, rel=1e-12)


@pytest.mark.parametrize("text", ["dB", "degC", "furlongs per fortnight", "", "m^9", "__import__('os')"])
def test_what_is_no_unit_with_a_factor_is_none(text):
    assert parse_unit(text) is None and quantity_unit(text) is None


@pytest.mark.parametrize(
    ("text", "unit", "numbers"),
    [
        ("50mm", "m", [0.05]),
        ("-3 cm", "m", [-0.03]),
        ("0.05", "m", [0.05]),
        ("100, 200, 300 mm", "m", [0.1, 0.2, 0.3]),
        ("1 cm, 2 mm", "m", [0.01, 0.002]),
        ("180 deg", "rad", [3.141592653589793]),
        ("1 cm, 2", "m", None),  # of the second it is not known
        ("1 deg", "m", None),
        ("1 furlong per fortnight", "m", None),
        ("many", "m", None),
        ("", "m", None),
    ],
)
def test_numbers_of_a_text_are_read_with_their_units(text, unit, numbers):
    assert numbers_in(text, unit) == (numbers if numbers is None else pytest.approx(numbers, rel=1e-12))
