"""Simulated campaigns: their tests against the limits of the table, their control loop, names in their warnings."""

import json
import logging
import re
from dataclasses import replace

import numpy as np
import pytest
from commands import refused

from lhpost6_pin.control import load_controller
from lhpost6_pin.core.errors import OutOfRangeError, SimulationError, UnknownNameError
from lhpost6_pin.core.names import SAMPLE_RATE
from lhpost6_pin.core.rounding import rounded_down
from lhpost6_pin.data.alignment import due_spools
from lhpost6_pin.data.records import load_record
from lhpost6_pin.data.sensors import load_sensors
from lhpost6_pin.data.signals import Band
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.simulation import simulated_campaign as module
from lhpost6_pin.simulation.rehearse import rehearse
from lhpost6_pin.simulation.simulated_campaign import check_campaign, simulate_campaign


def never(*_, **__):
    pytest.fail("a test was simulated")


def changed(numbers, values):
    """A procedure with other values of some of its numbers."""
    known = numbers.quantities
    return replace(numbers, quantities={**known, **{p: replace(known[p], value=v) for p, v in values.items()}})


def test_a_campaign_within_the_limits_passes_and_one_beyond_them_names_its_tests_and_the_scale_that_fits_all(machine):
    check_campaign(machine)
    with pytest.raises(OutOfRangeError) as found:
        check_campaign(machine, tests=("TX", "TY", "TZ"), scale=3.2)
    said = str(found.value)
    assert (
        said.startswith("TY: triangle at scale 3.2 exceeds the capacity") and "TX" not in said and ". TZ: tri" in said
    )
    # the triangle of TY has 0.12 m against 0.38 m of the table (Table 2.2), that of TZ 0.04 m against 0.127 m
    usable = 1.0 - machine.limits.stroke_reserve
    assert found.value.largest_scale == rounded_down(usable * min(0.38 / 0.12, 0.127 / 0.04), 3)
    assert said.endswith("The largest scale of the campaign with which all of these tests fit is 2.97")
    assert found.value.exceeded == ("displacement", "actuator stroke")


def test_the_scale_that_fits_is_a_factor_on_a_test_with_a_scale_of_its_own(machine):
    with pytest.raises(OutOfRangeError) as found:
        check_campaign(machine, tests=("EQ",), scale=5.0)
    fits = found.value.largest_scale
    check_campaign(machine, tests=("EQ",), scale=fits)  # three digits, rounded down
    with pytest.raises(OutOfRangeError, match="EQ: "):
        check_campaign(machine, tests=("EQ",), scale=1.02 * fits)


def test_what_more_flow_admits_is_stated_as_a_scale_of_the_campaign(machine):
    """EQ is Ridgecrest at 0.5; horizontal valves are exceeded at 2.5 of it, and within their flow with both open."""
    with pytest.raises(OutOfRangeError, match="actuator velocity") as found:
        check_campaign(machine, tests=("TZ", "EQ"), scale=2.5)
    words = re.search(r"--valves 2, .*? the largest scale of the campaign is ([\d.]+)\.", str(found.value))
    both, fits = machine.with_valves(2), float(words.group(1))
    assert fits > 2.5 > found.value.largest_scale and str(found.value).count("With ") == 2
    check_campaign(both, tests=("TZ", "EQ"), scale=fits)
    with pytest.raises(OutOfRangeError) as found:
        check_campaign(both, tests=("TZ", "EQ"), scale=1.02 * fits)
    assert "--valves" not in str(found.value)


def test_the_command_opens_the_valves_that_its_refusal_proposes(lhpost6, tmp_path, monkeypatch):
    def simulated(table, *_, **__):
        raise SimulationError(
            f"open: {[actuator.valves for actuator in table.actuators if actuator.area_b is not None]}"
        )

    monkeypatch.setattr(module, "simulate_campaign", simulated)
    asked = ("campaign", "--tests", "TZ", "--out", tmp_path / "c")
    for more, valves in (((), "[1, 1, 1, 1]"), (("--valves", "2"), "[2, 2, 2, 2]")):
        assert refused(lhpost6(*asked, *more), f"open: {valves}")


def test_a_test_is_checked_as_far_as_it_is_run(machine, monkeypatch):
    """Of the triangle of TY, 0.12 m, what follows 0.06 m is not run here: 0.38 m of the table allow a scale above 6."""
    numbers = module.load_procedure("campaign")
    target = module._target(numbers, "TY", machine, 1.0)
    first = int(np.argmax(np.abs(target.displacement[:, 1]) > 0.06))
    monkeypatch.setattr(module, "load_procedure", lambda name: changed(numbers, {"TY.seconds": first / SAMPLE_RATE}))
    check_campaign(machine, tests=("TY",), scale=5.0)
    with pytest.raises(OutOfRangeError, match=r"y displacement 0\.4\d* m against 0.38 m less the reserve of 6 %"):
        check_campaign(machine, tests=("TY",), scale=7.0)


def test_tests_without_a_scale_that_fits_are_refused_as_they_are(machine):
    with pytest.raises(UnknownNameError, match="no test of a campaign named 'TQ'"):
        check_campaign(machine, tests=("TQ",))
    aside = machine.with_specimen("block_4_9MN", (8.0, 5.0, 0.0))  # its weight tips the platen
    with pytest.raises((OutOfRangeError, SimulationError)) as found:
        check_campaign(aside, tests=("TX",))
    assert "largest scale of the campaign" not in str(found.value)


def test_the_command_refuses_a_campaign_beyond_the_limits_before_it_is_run(lhpost6, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "simulate_campaign", never)
    asked = ("campaign", "--tests", "TX,TY", "--scale", "3.2", "--out", tmp_path / "c")
    assert refused(lhpost6(*asked), "TY: triangle at scale 3.2 exceeds", "with which all of these tests fit is 2.97")
    assert not list(tmp_path.rglob("*.nc"))
    error = json.loads(lhpost6(*asked, "--json").out)["error"]
    assert error["kind"] == "OutOfRangeError" and error["largest_scale"] == 2.97

    def simulated(*_, scale, **__):
        raise SimulationError(f"simulated at {scale:g}")

    monkeypatch.setattr(module, "simulate_campaign", simulated)
    assert refused(lhpost6(*asked, "--beyond-limits"), "simulated at 3.2")


@pytest.mark.long
def test_the_command_warns_of_an_unstable_loop_and_states_it_in_records_and_result(lhpost6, tmp_path, caplog):
    mounted = ("--specimen", "block_4_9MN", "--out", tmp_path / "c", "--json")
    with caplog.at_level(logging.WARNING):
        ended = lhpost6("campaign", "--tests", "TZ", "--scale", "0.5", *mounted)
    assert ended.code == 0
    attrs = load_record(tmp_path / "c" / "TZ.nc").attrs
    remedy = "lhpost6 tune --specimen block_4_9MN"
    assert attrs["loop"] == "unstable" and attrs["loop_summary"].startswith(
        "The control loop is unstable by the linear"
    )
    assert attrs["loop_remedy"] == remedy
    assert f"{attrs['loop_summary']}. Tune the controller for this table: `{remedy}`" in caplog.messages
    entries = json.loads(ended.out)
    assert {key: entries[key] for key in ("loop", "loop_summary", "loop_remedy")} == {
        key: attrs[key] for key in ("loop", "loop_summary", "loop_remedy")
    }


@pytest.mark.long
def test_warnings_of_a_campaign_begin_with_the_name_of_their_test(caplog):
    """A triangle faster than the valve of the small table can feed, within its stroke."""
    uniaxial, sensors = load_machine("uniaxial"), load_sensors("lhpost6")
    fast = {"TX.velocity": 1.0, "TX.amplitude": 0.12, "TX.corner_acceleration": 20.0}
    numbers = module.load_procedure("campaign")
    with pytest.MonkeyPatch.context() as patch, caplog.at_level(logging.WARNING):
        patch.setattr(module, "load_procedure", lambda name: changed(numbers, fast))
        simulate_campaign(uniaxial, load_controller("uniaxial"), sensors, seed=0, tests=("TX",))
    assert caplog.messages and all(message.startswith("TX: ") for message in caplog.messages)
    assert any("spool values beyond full stroke were clipped" in message for message in caplog.messages)


def test_a_spool_held_over_each_sample_is_recorded_at_the_instants_of_the_samples():
    """Cubics exactly; a sine of 60 Hz but for the fourth power of its angle in a sample, over thirty."""
    edges = np.arange(257) / 2048.0
    cubic = np.diff(edges**4) * 2048.0 / 4.0
    np.testing.assert_allclose(module._at_instants(cubic[:, None])[2:-1, 0], edges[2:-2] ** 3, rtol=1e-9)
    omega = 2.0 * np.pi * 60.0
    means = np.diff(-np.cos(omega * edges)) * 2048.0 / omega
    found = module._at_instants(means[:, None])[2:-1, 0]
    np.testing.assert_allclose(found, np.sin(omega * edges[2:-2]), atol=1.1 * (omega / 2048.0) ** 4 / 30.0)


def test_spools_of_the_machine_itself_follow_their_recorded_commands_to_within_noise():
    """Both at the instants of the samples: of a sine of 5 Hz, half a controller sample between them is beyond noise."""
    sensors = load_sensors()
    target = make_target(find_motion("sine", amplitude=0.01, period=0.2, cycles=20.0), rate=float(SAMPLE_RATE))
    run = rehearse(load_machine(), target, load_controller("lhpost6"), attrs={}, engine="fused").record
    record = module.as_sensed(run, sensors, module.SensorErrors({}, {}, {}), 512.0, np.random.default_rng(0))
    command, spool = record["spool_command"].values, record["spool_position"].values
    rest = Band(high=33.0).apply(spool - due_spools(make_plant(load_machine()), command, 1.0 / 512.0), 1.0 / 512.0)
    noise = sensors.noise["spool_position"] * np.sqrt(33.0 / (0.5 * SAMPLE_RATE))  # white up to half the run's rate
    assert np.abs(np.diff(spool[:, 0])).max() > 5e-3
    assert np.all(rest[100:-100].std(axis=0) < 1.15 * noise)  # of some 400 independent values: three deviations
