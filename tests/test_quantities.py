"""Options that are one number with a unit: which texts are one, and what is refused."""

import pytest
from commands import refused

from lhpost6_pin.cli.quantities import quantity_option
from lhpost6_pin.core.errors import ParameterError


@pytest.mark.parametrize(
    "unit, text, value", [("s", "10ms", 0.01), ("s", "0.01", 0.01), ("1", "50%", 0.5), ("1", "2", 2.0), ("1", 0.5, 0.5)]
)
def test_a_number_with_its_unit_is_that_number_in_si(unit, text, value):
    assert quantity_option("--dt", unit, "10ms", "").parser(text) == pytest.approx(value, rel=1e-15)  # one rounding


@pytest.mark.parametrize("unit, text", [("s", "10mm"), ("s", "1,2"), ("1", "half"), ("1", "2 s"), ("s", "")])
def test_a_text_that_is_no_such_number_is_refused(unit, text):
    with pytest.raises(ParameterError, match=f"--dt {text}: write one number"):
        quantity_option("--dt", unit, "10ms", "").parser(text)


@pytest.mark.parametrize(
    "option, text, example",
    [
        ("--high-pass", "2s", "0.2Hz"),
        ("--low-pass", "25mm", "25Hz"),
        ("--taper", "2Hz", "500ms"),
        ("--cutoff", "1s", "33Hz"),
    ],
)
def test_an_option_in_another_unit_is_refused_with_an_example(lhpost6, option, text, example):
    command = ("decompose", "absent.nc") if option == "--cutoff" else ("run", "sine")
    assert refused(lhpost6(*command, option, text), f"{option} {text}: write one number", f"as {example}")


def test_a_run_says_how_a_scale_is_written(lhpost6):
    assert refused(lhpost6("run", "sine", "--scale", "half"), "--scale half", "as 50%")
