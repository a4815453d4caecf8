"""The demonstration: what it hides is found by a search that was not told, and pages are left to look at."""

import json
import re

import pytest

from lhpost6_pin.data.campaign import load_campaign
from lhpost6_pin.discovery.demonstration import hidden_effect
from lhpost6_pin.machine.machine import load_machine

pytestmark = pytest.mark.long


def test_the_demonstration_finds_what_it_hides(lhpost6, tmp_path):
    ended = lhpost6("demo", "--no-open", "--out", tmp_path)
    assert ended.code == 0, ended
    family, component, numbers = hidden_effect()
    verdict = json.loads((tmp_path / "verdict.json").read_text())
    (effect,) = verdict["effects"]
    assert verdict["verdict"] == "named" and effect["family"] == family and effect["components"] == [component]
    (number,) = effect["parameters"].values()
    assert number["ci90"][0] < numbers["leakage"] < number["ci90"][1] or (
        # one draw of noise in ten is outside of a 90 % interval: then not by far
        abs(number["value"] - numbers["leakage"]) < 2 * (number["ci90"][1] - number["ci90"][0])
    )
    before, after = map(float, re.search(r"ends ([\d.]+) mm .*?\s([\d.]+) mm with", ended.out, re.DOTALL).groups())
    assert after < 0.1 * before
    machine = load_machine()
    assert len(load_campaign(tmp_path / "measured", machine).records) == 3
    assert f"{family}_{component}" in {e.name for e in load_machine(str(tmp_path / "model.toml")).modifiers}
    for page in ("report.html", "view.html"):
        assert (tmp_path / page).read_text().startswith("<!DOCTYPE html>")
