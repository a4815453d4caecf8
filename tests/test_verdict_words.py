"""What a discovery says: its headline, captions and tables agree with the numbers beside them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from doc_pages import PAGES
from page_cases import numbers

from lhpost6_pin.data.summary import summarise_records
from lhpost6_pin.discovery.balances import Balance
from lhpost6_pin.discovery.demonstration import earthquake
from lhpost6_pin.discovery.discover import _sourced, discovery_numbers
from lhpost6_pin.discovery.effect_loops import squares_explained
from lhpost6_pin.discovery.finding import EffectFinding
from lhpost6_pin.discovery.held_out import Gap, GapTraces
from lhpost6_pin.discovery.verdict import Verdict
from lhpost6_pin.discovery.verdict_file import summary, worse_note
from lhpost6_pin.discovery.verdict_notes import (
    balance_note,
    before_screening,
    floor_note,
    form_note,
    interval_note,
    refit_summary,
)
from lhpost6_pin.identification.calibration.free_parameters import machine_parameters, with_parameters
from lhpost6_pin.machine.library import find_family
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.show.check_tables import campaign_entries
from lhpost6_pin.show.report.closing_plots import _percent, _trace_figure
from lhpost6_pin.show.report.discover_plots import gap_figure, held_out_errors
from lhpost6_pin.show.report.discover_report import (
    _balance_table,
    _headlines,
    _proof_table,
    _verdict_of,
    verdict_sentence,
)
from lhpost6_pin.simulation.simulated_campaign import _moves

NUMBERS, CALIBRATION = discovery_numbers()


def identified(*gaps: Gap, word: str = "named", misfit: float = 1.0, **changes) -> SimpleNamespace:
    """A discovery of backlash, as far as its words depend on it, with these gaps on held-out tests."""
    effect = EffectFinding("backlash", ("AX",), {}, 100.0, 1e-9)
    verdict = Verdict(word, (effect,), {}, (), None, (), **changes)
    problem = SimpleNamespace(kinds=("wrench",))
    search = SimpleNamespace(misfit=lambda kind: misfit, calibration=CALIBRATION, problem=problem, added=("backlash",))
    proof = SimpleNamespace(gaps=gaps)
    return SimpleNamespace(
        verdict=verdict, proof=proof, search=search, numbers=NUMBERS, beyond=(), balances=(), skipped={}
    )


def test_a_headline_states_how_much_of_the_error_an_effect_leaves():
    """Of a friction damper: 3.74 to 2.94 above a floor of 1.02 closes 29 %."""
    found = identified(Gap("inverse dynamics", "1Hz_1in", 9.0, 3.74, 2.94, 1.02))
    assert verdict_sentence(found).startswith("Effect identified, 71 % of the held-out error remains: ")
    assert "71 % of the error beyond the floor remains (inverse dynamics, 1Hz_1in: " in summary(found)
    assert _verdict_of(found)[1] == "attention"
    card = _headlines(found)[0]
    assert (card.value, card.note) == ("effect identified", "71 % of the held-out error remains")


def test_an_effect_that_closes_the_error_is_simply_identified():
    found = identified(Gap("inverse dynamics", "EQ", 9.0, 5.0, 1.1, 1.0), Gap("open loop", "EQ", 1.0, 1.0, 1.0, 1.0))
    assert _verdict_of(found) == ("effect identified", "good")
    assert "remains" not in summary(found)


def traces(phase: str) -> GapTraces:
    """A model that drifts from the record at which it starts, and one that does not."""
    time = np.arange(100) / 100.0
    measured = np.zeros(100)
    models = np.stack([3.0 * time, 3.0 * time, measured], axis=1)
    return GapTraces(phase, "EQ", "chamber_pressure_a", "H4", time, measured, models, 0.1)


def test_a_refit_that_raises_the_error_of_a_phase_says_so_and_is_no_good_news():
    """A valve delay fitted as half had raised the closed loop's error from 1.03 to 4.47 under a green verdict."""
    gap = Gap("closed loop", "TZ", 1.03, 4.47, 4.47, 1.15)
    found = identified(gap, word="none")
    found.verdict = replace(found.verdict, effects=())
    assert "(closed loop of TZ 1.03 to 4.47 times sensor noise): do not take parameters" in worse_note(found)
    assert _verdict_of(found)[1] == "attention"
    assert worse_note(identified(replace(gap, refitted=1.5))) == ""  # friction's path may do that


def test_the_error_of_a_simulation_that_starts_from_the_record_begins_at_zero():
    """Less its mean it would begin with what it drifts to."""
    figure = _trace_figure(traces("open loop"), 3)
    titles = [note["text"] for note in figure.layout["annotations"]]
    assert any("Error" in t for t in titles) and not any("mean removed" in t for t in titles)
    refitted = [trace for trace in figure.traces if trace["name"] == "refitted"][-1]
    assert numbers(refitted["y"])[0] == pytest.approx(0.0, abs=1e-6)  # rounding of what is stored


def test_the_error_of_inverse_dynamics_has_the_sensors_offsets_removed():
    titles = [note["text"] for note in _trace_figure(traces("inverse dynamics"), 3).layout["annotations"]]
    assert any("Error, mean removed" in t for t in titles)


def test_a_constant_effect_explains_the_squares_that_it_takes_away():
    """A null bias: from -1.25 L/min to nothing but noise."""
    noise = 0.02 * np.sin(np.arange(400.0))
    assert squares_explained(noise - 1.25, noise) == pytest.approx(1.0 - 0.02**2 / 2 / 1.25**2, abs=1e-4)  # mean of sin
    assert squares_explained(noise + 5.0, noise + 5.0) == 0.0  # a preload that stays is no part of it
    assert squares_explained(np.zeros(4), np.zeros(4)) == 0.0


def test_a_share_that_rounds_to_zero_has_no_sign():
    assert (_percent(-0.0002), _percent(0.0005), _percent(-0.031)) == ("0.0 %", "0.1 %", "-3.1 %")


def test_a_number_at_its_bound_is_no_calibrated_number_of_the_model():
    """Such as a yield slip smaller than the displacement transducer resolves."""
    machine = load_machine("lhpost6")
    parameters = machine_parameters(machine)
    names = [p.name for p in parameters]
    prior = np.array([p.sd for p in parameters])
    lowest, highest = np.array([(p.lowest, p.highest) for p in parameters]).T
    x, slip, force = np.zeros(len(names)), names.index("vertical.seal_yield"), names.index("vertical.seal_friction")
    x[slip], x[force] = max(-CALIBRATION.number("fit.reach") * prior[slip], lowest[slip]), prior[force]
    problem = SimpleNamespace(parameters=parameters, names=names, prior=prior, lowest=lowest, highest=highest)
    found = SimpleNamespace(problem=problem, calibration=CALIBRATION, solution=SimpleNamespace(x=x))
    fitted = with_parameters(machine, parameters, x)
    model = _sourced(fitted, found, machine, SimpleNamespace(name="lab")).parameters
    assert model["vertical.seal_yield"].evidence == "at_bound"
    assert model["vertical.seal_yield"].source.startswith(
        "at the bound of its range, no estimate; fitted to campaign lab"
    )
    assert model["vertical.seal_friction"].evidence == "calibrated"


def test_what_balances_leave_out_is_stated_below_them():
    """Other commands take all samples, and records as they are: 20 % stood beside 2 % of one table."""
    whole = Balance("wrench", "EQ", (9.0, 5.0, 1.0), (0.4, 0.1, 0.02), (0.8, 0.98, 1.0))
    assert "sensors' errors were corrected" in balance_note([whole])
    assert "slip" not in balance_note([whole])
    assert "in the 68 % of EQ where friction's slip is known" in balance_note([replace(whole, slip_known=0.68)])


def test_balances_and_phases_have_their_own_units():
    """Sensor noise alone is the unit of a phase, the expected scatter that of a balance: 248 stands beside 0.38."""
    found = identified(Gap("inverse dynamics", "1Hz_1in", 702.0, 316.0, 248.0, 15.4))
    found.balances = (Balance("wrench", "1Hz_1in", (0.85, 0.47, 0.38)),)
    assert list(held_out_errors(found)) == [
        ("inverse dynamics, 1Hz_1in", "sensor noise"),
        ("wrench, 1Hz_1in", "expected scatter"),
    ]
    assert "times sensor noise" in summary(found)
    assert _balance_table(found.balances).header[1] == "Error over expected scatter"
    assert "sensor noise alone" in _proof_table(found.proof).caption
    names = [note["text"] for note in gap_figure(found).layout["annotations"]]
    assert {"inverse dynamics, 1Hz_1in: over sensor noise", "wrench, 1Hz_1in: over expected scatter"} <= {*names}
    assert _headlines(found)[-1].note.endswith("in units of sensor noise")


def test_beside_intervals_stands_that_misfit_is_left():
    """A search with a mean square of 4 stated 387.6 to 391.2 N; the truth was 400 N."""
    closed = Gap("inverse dynamics", "EQ", 9.0, 5.0, 1.0, 1.0)
    assert interval_note(identified(closed)) == ""
    words = interval_note(identified(closed, misfit=4.0))
    assert "misfit of wrench is left" in words and "too narrow" in words
    assert "too narrow" in interval_note(identified(Gap("inverse dynamics", "EQ", 9.0, 5.0, 3.0, 1.0)))


def test_a_phase_at_its_floor_before_any_effect_is_no_evidence():
    """2.35, 1.47, 1.14 at a floor of 1.73: the refit is below what a model that lacks nothing leaves."""
    found = identified(Gap("inverse dynamics", "EQ", 2.35, 1.47, 1.14, 1.73))
    assert floor_note(found).startswith("At the floor without effects already: inverse dynamics, EQ.")
    assert floor_note(identified(Gap("inverse dynamics", "EQ", 9.0, 5.0, 1.1, 1.0))) == ""
    for after, evidence in ((0.4, "and the balances are the evidence"), (0.98, "nor do their balances show it")):
        found.balances = (Balance("wrench", "EQ", (1.2, 1.0, after)),)
        assert evidence in floor_note(found)
    found.proof = SimpleNamespace(
        gaps=(Gap("closed loop", "EQ", 1.4, 1.1, 1.0, 1.1), Gap("open loop", "EQ", 9.0, 5.0, 1.1, 1.0))
    )
    assert "and the other phases are the evidence" in floor_note(found)  # the balances, last, do not show it


def test_what_a_refit_explains_a_fall_of_the_error_by_is_stated(monkeypatch):
    """No missing effect and no parameter, yet 20.3 fell to 1.06: by errors of sensors, of those that a phase reads.

    Gains of spools, the most significant of all, were named for a fall in inverse dynamics, which reads no spools.
    """
    found = identified(Gap("inverse dynamics", "EQ", 20.3, 1.06, 1.06, 1.0), word="none")
    errors = (
        "gain actuator_force[H1]",
        "offset actuator_force[H1]",
        "gain spool_position[H4]",
        "gain chamber_pressure_a[H1]",
    )
    found.search.problem = SimpleNamespace(kinds=(), parameters=("mass",), names=("mass", *errors), delays=())
    found.search.solution = SimpleNamespace(x=np.array([0.0, 0.05, 1e-9, 0.9, 0.8]))
    monkeypatch.setattr("lhpost6_pin.discovery.verdict_notes.deviations", lambda search: np.full(5, 1e-3))
    said = "20.3 to 1.06 times sensor noise) by errors of sensors within their ranges (foremost "
    assert f"{said}gain actuator_force[H1])." in refit_summary(found)
    found.proof = SimpleNamespace(gaps=(Gap("open loop", "EQ", 20.3, 1.06, 1.06, 1.0),))
    assert f"{said}gain spool_position[H4], gain chamber_pressure_a[H1], gain actuator_force[H1])." in (
        refit_summary(found)
    )
    assert refit_summary(identified(Gap("inverse dynamics", "EQ", 1.3, 1.0, 1.0, 1.0), word="none")) == ""


def test_an_effect_added_before_the_screening_is_listed_with_the_rounds():
    """No bar of round 1 reached the least gain of 20, while the effect of the verdict had a gain of 308."""
    library = SimpleNamespace(named="backlash")
    one = SimpleNamespace(
        candidate=SimpleNamespace(family=library, components=("AX",)),
        gain=307.96, forms=("stribeck_friction", "backlash"), from_lengths=0.0,
    )  # fmt: skip
    screened = SimpleNamespace(candidate=one.candidate, gain=9.0, forms=(), from_lengths=0.0)
    (words,) = before_screening(SimpleNamespace(added=(one, screened)))
    assert "backlash on AX" in words and "308" in words and "stribeck_friction" in words


def test_a_form_that_every_fit_frees_is_explained_where_its_number_is_listed():
    """presliding_AX.share stood among the recalibrated parameters, and nowhere what it is."""
    entries = {"presliding_AX": SimpleNamespace(family="presliding")}
    machine = SimpleNamespace(parameters=SimpleNamespace(effects=entries))
    changed = {"presliding_AX.share": None, "drive.viscous": None}
    words = form_note(SimpleNamespace(verdict=SimpleNamespace(changed=changed), fitted=machine))
    assert "presliding_AX: seal friction" in words and "share" in words and "Dahl" in words
    assert form_note(SimpleNamespace(verdict=SimpleNamespace(changed={"drive.viscous": None}), fitted=machine)) == ""


@pytest.mark.parametrize("name", ["backlash", "backlash_before_friction", "presliding", "bearing_presliding"])
def test_an_equation_has_the_names_that_the_table_beside_it_has(name):
    family = find_family(name)
    assert all(shape.name in family.equation for shape in family.shapes)


def test_the_demonstration_says_which_part_of_the_earthquake_it_runs():
    """It was half of an earthquake in words, and its first 12 s at half its size in truth: less than 0.035 g."""
    seconds, scale = earthquake()
    target = make_target(find_motion("ridgecrest-ccc"), scale=scale)
    part = target.time <= seconds
    assert (
        0.025 < np.abs(target.acceleration[part]).max() / 9.81 < 0.035 < 0.1 < np.abs(target.acceleration).max() / 9.81
    )
    words = (PAGES / "start.md").read_text(encoding="utf-8")
    assert f"the first {seconds:g} s of a real earthquake" in words and "half of a real" not in words


def test_a_simulated_test_that_ends_in_motion_says_so():
    """A real one should end in a rest; a motion of two seconds is cut in its middle, or runs to its end."""
    target = make_target(find_motion("sine", amplitude=0.01, cycles=2), axes="x")
    assert _moves(target, len(target.time) // 2 - 7) and not _moves(target, len(target.time) - 1)
    record = xr.Dataset({"platen_displacement": (("time", "axis"), np.zeros((9, 6)))}, {"time": np.arange(9) / 512.0})
    (summary_of,) = summarise_records([record.assign_attrs(test="EQ", cut="ends in motion: the first 25 s of 50 s")])
    assert campaign_entries([summary_of])["summary"]["EQ"]["cut"] == "ends in motion: the first 25 s of 50 s"
