"""Reports of the control tools: what they conclude from good and bad findings, complete, self-contained."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from page_cases import NO_NUMBER, Reader, numbers

from lhpost6_pin.control import load_controller
from lhpost6_pin.data.signals import rrmse
from lhpost6_pin.data.transfer import Transfer
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.show.report.charts import Curve, Panel, XAxis, chart_figure, matrix_figure
from lhpost6_pin.show.report.iterate_plots import compare
from lhpost6_pin.show.report.iterate_report import target_demands, write_iterate_report
from lhpost6_pin.show.report.scales import decibels, degrees
from lhpost6_pin.show.report.sine_report import write_sine_report
from lhpost6_pin.show.report.tune_report import headlines, trades, write_tune_report
from lhpost6_pin.show.result_tables import print_tuning
from lhpost6_pin.show.results import tuning_entries
from lhpost6_pin.tuning.iterate import identify_inverse, iterate
from lhpost6_pin.tuning.margins import LoopModel, Margin
from lhpost6_pin.tuning.sine import sine_test
from lhpost6_pin.tuning.tune import AxisTuning, Tuning, TuningStep

pytestmark = pytest.mark.long

DELAY = 0.006
LINE = {"color": "#000000"}


@pytest.fixture(scope="module")
def machine():
    """A table of one axis: its runs take a second."""
    return load_machine("uniaxial")


@pytest.fixture(scope="module")
def settings():
    return load_controller("uniaxial")


@pytest.fixture(scope="module")
def iterated(machine, settings):
    """Two iterations on six seconds of noise."""
    noise = find_motion("white-noise", duration=6.0, rms=0.5, low=0.5, high=30.0, seed=3)
    target = make_target(noise, axes="x")
    return iterate(machine, target, settings, table=identify_inverse(machine, settings), most=2)


@pytest.fixture(scope="module")
def sine(machine, settings):
    """A sine that the valves can follow."""
    return sine_test(machine, settings, axis="x", amplitude=0.05, frequency=1.0)


def delayed(gain: float = 1.0, coherence: float = 1.0) -> Transfer:
    """Return a table that only delays, from 1/16 to 64 Hz."""
    f = np.arange(1, 1025) / 16
    response = gain * np.exp(-2j * np.pi * f * DELAY)
    return Transfer(f, response[:, None, None], np.full((len(f), 1), coherence), ("x",))


def make_tuning(machine, settings, **changes) -> Tuning:
    """Return a tuning whose axis follows from 1/16 to 40 Hz, but for what `changes` its axis."""
    good = {
        "axis": "x",
        "before": delayed(0.5),
        "after": delayed(),
        "band_before": (np.nan, np.nan),
        "band_after": (0.0625, 40.0),
        "delay_before": np.nan,
        "delay_after": DELAY,
        "margin_before": Margin(np.inf, np.nan, np.inf, np.nan),
        "margin_after": Margin(4.0, 48.0, 1.0, 5.0),
        "limited_by": "follows to 33 Hz and beyond",
    }
    axis = AxisTuning(**(good | changes))
    model = LoopModel(delayed().frequency, delayed().response, delayed().response)
    tuned = replace(settings, velocity_feedforward=tuple(1.5 * g for g in settings.velocity_feedforward))
    step = TuningStep("Kvf", "x", 1.0, 1.5, "expected error 0.05 <b>")
    return Tuning(machine, settings, tuned, DELAY, (axis,), (step,), 3.0, 0.8, True, model, delayed().response)


def test_every_page_is_complete_self_contained_and_says_no_nan(tmp_path, machine, settings, iterated, sine):
    pages = {
        write_tune_report(make_tuning(machine, settings), tmp_path / "t.html", "lhpost6 tune --out <x>"): (
            ("Bands and margins", "Bandwidth limitation, 20 to 33 Hz", "Bode plots", "Chosen settings", "Tuning steps"),
            {"overview", "bode-x"},
        ),
        write_iterate_report(iterated, tmp_path / "i.html", "lhpost6 iterate noise --out <x>"): (
            ("Error per iteration", "Target and achieved", "Spectra of the error", "Drive and reference", "stopped"),
            {"errors", "motion-x", "close-x", "error-x", "drive-x", "table", "coherence"},
        ),
        write_sine_report(sine, tmp_path / "s.html", "lhpost6 sine --out <x>"): (
            ("Amplitude, phase and distortion", "Harmonics", "The last cycles", "Convergence", "Spool commands"),
            {"harmonics", "cycles", "convergence", "spool-1"},
        ),
    }
    for page, (titles, figures) in pages.items():
        words = Reader(page).words
        for title in (*titles, "Assumptions and sources", "Versions and command", "--out <x>", "numpy"):
            assert title in words, (page.name, title)
        assert not NO_NUMBER.search(words), page.name
        assert Reader(page).figures.keys() == figures
        assert page.stat().st_size < 5e6
        assert "default-src 'none'" in page.read_text(encoding="utf-8")


# ------------------------------------------------------------------------------------------ tuning
def test_a_tuning_that_follows_with_margin_is_good_and_shows_what_changed(tmp_path, machine, settings):
    page = Reader(write_tune_report(make_tuning(machine, settings), tmp_path / "t.html"))
    level, verdict = page.verdict
    assert level == "good" and "Every axis is within 3 dB" in verdict
    assert "at least 6 dB" in verdict and "stable" in verdict
    old = settings.velocity_feedforward[0]
    assert f"velocity feedforward {old:#.3g} → {1.5 * old:#.3g}" in page.words


def test_a_band_that_ends_at_a_mode_of_the_specimen_is_referred_to_the_iteration(tmp_path, capsys, machine, settings):
    ends = make_tuning(machine, settings, band_after=(0.0625, 2.44), limited_by_specimen=True)
    page = Reader(write_tune_report(ends, tmp_path / "t.html"))
    level, verdict = page.verdict
    words = "In x the band ends near a mode of the specimen"
    assert level == "attention" and words in verdict and "lhpost6 iterate" in verdict
    print_tuning(ends)
    assert words in " ".join(capsys.readouterr().out.split())
    beyond = make_tuning(machine, settings, limited_by_specimen=True)  # follows beyond 20 Hz: nothing to correct
    assert words not in Reader(write_tune_report(beyond, tmp_path / "b.html")).verdict[1]


@pytest.mark.parametrize(
    ("changes", "level", "said"),
    [
        (
            {"margin_after": Margin(1.9, 48.0, 1.0, 5.0)},
            "attention",
            "Gain margin below 6 dB: x 5.6\N{NO-BREAK SPACE}dB",
        ),
        ({"margin_after": Margin(np.nan, 48.0, 1.0, 5.0)}, "attention", "Gain margin below 6 dB: x –"),
        ({"band_after": (0.0625, 19.0)}, "attention", "Not all axes are within 3 dB"),
        ({"band_after": (0.25, 40.0)}, "attention", "x 0.25 to 40.0\N{NO-BREAK SPACE}Hz"),
        ({"band_after": (np.nan, np.nan), "limited_by": ""}, "bad", "x no band"),
        (
            {"band_before": (0.0625, 40.0), "margin_before": Margin(19.3, 45.0, 1.51, 1.0)},
            "attention",
            "Worse than before in x: gain margin 25.7 dB before, 12.0 dB after; phase margin 87 deg before, 57 deg",
        ),
        ({"band_before": (0.0625, 60.0)}, "attention", "Worse than before in x: band 0.062 to 60 Hz before,"),
        ({"band_before": (0.0625, 40.0)}, "attention", "gain margin unlimited before, 12.0 dB after"),
    ],
)
def test_a_tuning_that_falls_short_says_where(tmp_path, machine, settings, changes, level, said):
    page = write_tune_report(make_tuning(machine, settings, **changes), tmp_path / "t.html")
    assert Reader(page).verdict[0] == level
    assert said in Reader(page).verdict[1]
    assert not NO_NUMBER.search(Reader(page).words)


def test_a_margin_that_pays_for_a_wider_band_is_stated_and_the_card_compares_the_smallest_margins(
    tmp_path, capsys, machine, settings
):
    """Of two axes, the one with the smallest margin afterwards had a large one: the other's was the smallest before."""
    known = {"margin_before": Margin(19.3, 45.0, 1.51, 1.0), "margin_after": Margin(3.0, 48.0, 1.0, 5.0)}
    wider = make_tuning(machine, settings, **known, band_before=(0.0625, 30.0))
    other = replace(
        wider.axes[0], axis="y", margin_before=Margin(1.22, 9.0, 0.2, 5.0), margin_after=Margin(4.0, 9.0, 1.0, 5.0)
    )
    tuning = replace(wider, axes=(*wider.axes, other))
    words = (
        "For a band at least a tenth wider the margin is smaller than before in x: gain margin 25.7 dB before, 9.5 dB"
    )
    assert tuning_entries(wider)["axes"]["x"]["traded"] == wider.axes[0].traded != ()
    (sentence,) = trades(tuning)
    assert sentence.startswith(words) and "y:" not in sentence
    print_tuning(wider)
    assert words in " ".join(capsys.readouterr().out.split())
    page = Reader(write_tune_report(wider, tmp_path / "t.html"))
    assert page.verdict[0] == "good" and words in page.verdict[1]
    (card,) = (one for one in headlines(tuning) if one.label == "Smallest gain margin")
    assert "axis x" in card.note and card.note.endswith(f"smallest before: {decibels(1.22)}, axis y")


def test_a_margin_that_pays_for_a_wider_band_or_hardly_changes_is_no_loss(machine, settings):
    """Before: no band at all, a narrower band, or margins as after within what is judged a loss."""
    known = {"margin_before": Margin(19.3, 45.0, 1.51, 1.0)}
    for changes in ({}, known, {**known, "band_before": (0.0625, 30.0)}):
        tuning = make_tuning(machine, settings, **changes)
        assert tuning.axes[0].worse == () and tuning_entries(tuning)["axes"]["x"]["worse"] == ()
    near = {"band_before": (0.0625, 41.0), "margin_before": Margin(4.2, 48.0, 1.02, 5.0)}
    assert make_tuning(machine, settings, **near).axes[0].worse == ()
    traded = make_tuning(machine, settings, **known, band_before=(0.0625, 30.0)).axes[0].traded
    assert traded == ("gain margin 25.7 dB before, 12.0 dB after", "phase margin 87 deg before, 57 deg after")
    assert make_tuning(machine, settings, **known).axes[0].traded == ()  # no band before
    both = {"band_before": (0.0625, 40.0), "margin_after": Margin(np.inf, np.nan, np.inf, np.nan)}
    assert make_tuning(machine, settings, **both).axes[0].worse == ()


def test_settings_that_were_unstable_before_are_called_so_and_have_no_curve(tmp_path, machine, settings):
    nothing = replace(delayed(), response=np.nan * delayed().response, coherence=0.0 * delayed().coherence)
    lost = {"before": nothing, "margin_before": Margin(*(np.nan,) * 4), "delay_after": np.nan}
    page = Reader(
        write_tune_report(replace(make_tuning(machine, settings, **lost), was_stable=False), tmp_path / "t.html")
    )
    assert f"With the settings before, {settings.name}, the loop is unstable." in page.verdict[1]
    assert "before: unstable" in page.words and "– to –" not in page.words and not NO_NUMBER.search(page.words)
    assert {t["name"] for t in page.figures["bode-x"]["traces"]} == {"after", "linear model"}
    assert len([k for k in page.figures["overview"]["layout"] if k.startswith("yaxis")]) == 1


def test_a_response_measured_with_clipped_commands_is_not_passed_off_as_linear(tmp_path, capsys, machine, settings):
    tuning = make_tuning(machine, settings, doubt="2195 spool commands were clipped")
    level, verdict = Reader(write_tune_report(tuning, tmp_path / "t.html")).verdict
    sentence = "The response measured is not that of a linear table in x: 2195 spool commands were clipped."
    assert level == "attention" and sentence in verdict
    print_tuning(tuning)
    assert sentence in " ".join(capsys.readouterr().out.split())
    assert tuning_entries(tuning)["axes"]["x"]["doubt"] == "2195 spool commands were clipped"


def test_a_loop_that_is_unstable_with_doubled_gains_is_pointed_out(tmp_path, machine, settings):
    page = write_tune_report(replace(make_tuning(machine, settings), doubled=False), tmp_path / "t.html")
    level, verdict = Reader(page).verdict
    assert level == "attention" and "unstable with all master gains doubled" in verdict


def test_a_pure_delay_has_no_phase_left_without_it(tmp_path, machine, settings):
    page = write_tune_report(make_tuning(machine, settings), tmp_path / "t.html")
    rows = [t for t in Reader(page).figures["bode-x"]["traces"] if t["name"] == "after"]
    size, left, raw, coherence = (numbers(t["y"]) for t in rows)
    frequency = numbers(rows[0]["x"])
    # single precision of values up to 90
    np.testing.assert_allclose(size, 0.0, atol=1e-5)
    np.testing.assert_allclose(left, 0.0, atol=1e-5)
    np.testing.assert_allclose(raw, -360.0 * DELAY * frequency, atol=1e-4)
    np.testing.assert_array_equal(coherence, 1.0)
    assert frequency[0] == 0.125 and frequency[-1] == 40.0  # what is measured of 0.1 to 40 Hz


# --------------------------------------------------------------------------------------- iteration
def test_an_iteration_that_reaches_its_goal_is_good(tmp_path, iterated):
    level, verdict = Reader(write_iterate_report(iterated, tmp_path / "i.html")).verdict
    assert iterated.history[iterated.best].acceleration[0] < 0.05  # else the verdict is right to differ
    assert level == "good" and "at most 5 % after iterating: x" in verdict


def with_best(iterated, **changes):
    history = [i._replace(**changes) if i.number == iterated.best else i for i in iterated.history]
    return replace(iterated, history=tuple(history))


@pytest.mark.parametrize(
    ("changes", "level", "said"),
    [
        ({"acceleration": np.array([0.3, *[np.nan] * 5])}, "attention", "More than half of the initial error"),
        ({"acceleration": np.array([0.06, *[np.nan] * 5])}, "attention", "above 5 % after iterating: x 6.00"),
        ({"clipped": 7}, "bad", "7 spool commands of the best drive were clipped"),
    ],
)
def test_an_iteration_that_falls_short_says_how(tmp_path, iterated, changes, level, said):
    found = Reader(write_iterate_report(with_best(iterated, **changes), tmp_path / "i.html")).verdict
    assert found[0] == level and said in found[1]


def test_an_iteration_that_never_improved_says_so(tmp_path, iterated):
    page = write_iterate_report(replace(iterated, best=0, best_run=iterated.first_run), tmp_path / "i.html")
    level, verdict = Reader(page).verdict
    assert level == "attention" and "No iteration improved on the reference" in verdict


def test_the_drawn_error_is_the_one_judged(iterated):
    (one,) = compare(iterated, 33.0)
    # what is drawn is low-passed and aligned in the other order than what is judged: the ends differ
    assert float(rrmse(one.target, one.first)) == pytest.approx(one.errors[0], rel=0.01)
    assert float(rrmse(one.target, one.best)) == pytest.approx(one.errors[1], rel=0.01)


# -------------------------------------------------------------------------------------------- sine
def test_a_sine_within_its_goals_is_good(tmp_path, sine):
    assert sine.after.run.clipped == 0 and sine.after.distortion < 0.5 * sine.before.distortion
    level, verdict = Reader(write_sine_report(sine, tmp_path / "s.html")).verdict
    assert level == "good" and "within 1 % and 2°" in verdict and "by half or more" in verdict


@pytest.mark.parametrize(
    ("changes", "level", "said"),
    [
        ({"amplitude_error": -0.05}, "attention", "not within 1 %"),
        ({"phase_error": 0.1}, "attention", "5.73°, not within"),
        ({"distortion": 1.0}, "bad", "rises from"),
        ({"distortion": np.nan}, "attention", "is not judged"),
    ],
)
def test_a_sine_off_its_goals_says_which(tmp_path, sine, changes, level, said):
    page = write_sine_report(replace(sine, after=replace(sine.after, **changes)), tmp_path / "s.html")
    assert Reader(page).verdict[0] == level and said in Reader(page).verdict[1]
    assert not NO_NUMBER.search(Reader(page).words)


@pytest.mark.parametrize(
    ("before", "after", "level", "said"),
    [
        (0.2, 0.15, "attention", "falls from 20.0 % to 15.0 %, by less than half."),
        (0.2, 0.3, "attention", "rises from 20.0 % to 30.0 %, by a factor of 1.50."),
        (0.148, 1.05, "bad", "rises from 14.8 % to 105 %, by a factor of 7.09."),
        (0.0, 0.1, "bad", "rises from 0 % to 10.0 %."),
    ],
)
def test_the_verdict_on_a_sine_states_how_far_its_distortion_falls_or_rises(tmp_path, sine, before, after, level, said):
    results = {name: replace(getattr(sine, name), distortion=d) for name, d in (("before", before), ("after", after))}
    found = Reader(write_sine_report(replace(sine, **results), tmp_path / "s.html")).verdict
    assert found[0] == level
    assert f"The distortion of the acceleration to 33 Hz {said.rstrip('.')}; at all" in found[1].replace("\xa0", " ")


def test_an_acceleration_far_above_its_target_is_in_the_verdict_of_a_sine(tmp_path, sine):
    run = replace(sine.after.run, a=3.0 * sine.after.run.a)
    level, verdict = Reader(
        write_sine_report(replace(sine, after=replace(sine.after, run=run)), tmp_path / "s.html")
    ).verdict
    # a sine of 0.05 m at 1 Hz has 0.05 (2 pi)^2 m/s2 = 0.2013 g
    found = re.search(r"The acceleration reaches ([\d.]+).g for a target of ([\d.]+).g\.", verdict)
    assert level == "bad" and float(found[2]) == pytest.approx(0.2013, rel=0.01)
    assert float(found[1]) == pytest.approx(3 * 0.2013, rel=0.05)  # with its distortion
    assert "The acceleration reaches" not in Reader(write_sine_report(sine, tmp_path / "s.html")).verdict[1]


LOOP = {"loop_summary": "The control loop is what it is", "loop_remedy": "lhpost6 tune --x"}


@pytest.mark.parametrize(("loop", "level"), [("stable", "good"), ("thin", "attention"), ("unstable", "bad")])
def test_the_verdicts_of_a_sine_and_an_iteration_begin_with_a_loop_that_is_not_stable(
    tmp_path, sine, iterated, loop, level
):
    facts = {"loop": loop, **LOOP}
    for page in (
        write_sine_report(sine, tmp_path / "s.html", loop=facts),
        write_iterate_report(iterated, tmp_path / "i.html", loop=facts),
    ):
        found = Reader(page).verdict
        assert found[0] == level
        start = "The control loop is what it is (mend it by “lhpost6 tune --x”). "
        assert found[1].startswith(start) == (loop != "stable")


def test_growing_errors_of_an_unstable_loop_are_not_blamed_on_the_cancellers(tmp_path, sine):
    growing = np.exp(0.2 * np.arange(len(sine.after.run.a)) / 2048)[:, None]
    run = replace(sine.after.run, a=sine.after.run.a * growing)
    test = replace(sine, after=replace(sine.after, run=run))
    verdict = Reader(write_sine_report(test, tmp_path / "s.html", loop={"loop": "unstable", **LOOP})).verdict[1]
    assert "grows from cycle to cycle." in verdict and "cancellers are unstable" not in verdict


@pytest.mark.parametrize("command", ["sine", "iterate"])
def test_the_commands_state_an_unstable_loop_on_their_page_and_in_their_result(
    lhpost6, tmp_path, monkeypatch, sine, iterated, command
):
    unstable = SimpleNamespace(verdict="unstable", summary="The control loop is unstable, it is said", falls=False)
    monkeypatch.setattr("lhpost6_pin.cli.control.checked_loop", lambda *_, **__: unstable)
    monkeypatch.setattr("lhpost6_pin.tuning.sine.sine_test", lambda *_, **__: sine)
    monkeypatch.setattr("lhpost6_pin.tuning.iterate.iterate", lambda *_, **__: iterated)
    options = ("--amplitude", "0.05") if command == "sine" else ("white-noise", "--scale", "0.1", "--set", "duration=6")
    ended = lhpost6(command, *options, "--machine", "uniaxial", "--out", tmp_path, "--json")
    entries = json.loads(ended.out)
    assert (entries["loop"], entries["loop_summary"]) == ("unstable", unstable.summary)
    assert entries["loop_remedy"] == "lhpost6 tune --machine uniaxial"
    level, verdict = Reader(tmp_path / "report.html").verdict
    assert level == "bad" and verdict.startswith("The control loop is unstable, it is said (mend it by")


def test_the_iteration_shows_the_demand_of_its_target_in_the_units_of_a_run(iterated, tmp_path):
    table = target_demands(iterated)
    assert table.caption == "Demand over capacity, target; actuator forces beyond rest"
    peaks = {row[0]: row[2].replace("\xa0", " ") for row in table.rows}
    wanted = np.abs(iterated.target.displacement[:, 0]).max()
    # of the one actuator along x its stroke is the displacement
    assert peaks["Displacement"] == peaks["Actuator stroke"] == f"{1e3 * wanted:#.3g} mm"
    assert all(re.fullmatch(r"[\d.]+ (mm|m/s|g|kN)", peak) for peak in peaks.values()), peaks
    assert {"Actuator velocity", "Actuator push", "Actuator pull", "Axis force"} <= set(peaks)
    words = Reader(write_iterate_report(iterated, tmp_path / "i.html")).words
    assert "The quantity of the drive is acceleration" in words
    assert "Fraction of the axis's motion explained linearly by the reference;" in words


def test_errors_too_small_to_matter_are_rounded_with_their_sign(tmp_path, sine):
    after = replace(sine.after, amplitude_error=6.9e-6, phase_error=-1e-5, distortion_displacement=6.6e-7)
    words = Reader(write_sine_report(replace(sine, after=after), tmp_path / "s.html")).words.replace("\xa0", " ")
    assert "amplitude error is +0.001 % and the phase error 0.00°" in words
    assert "< 0.0001 %" in words


def test_saturated_valves_are_bad_and_shaded(tmp_path, sine):
    command = sine.after.run.command.copy()
    command[sine.measured, 0] = np.clip(5.0 * command[sine.measured, 0] / np.abs(command).max(), -1.0, 1.0)
    run = replace(sine.after.run, command=command, clipped=int((np.abs(command) >= 1.0).sum()))
    page = write_sine_report(replace(sine, after=replace(sine.after, run=run)), tmp_path / "s.html")
    assert Reader(page).verdict[0] == "bad" and f"{run.clipped} with them" in Reader(page).verdict[1]
    assert [s for s in Reader(page).figures["spool-1"]["layout"]["shapes"] if s["type"] == "rect"]


def test_cancellers_that_diverge_are_found_out(tmp_path, sine):
    growing = np.exp(0.2 * np.arange(len(sine.after.run.a)) / 2048)[:, None]  # two thirds more after 2.5 s
    run = replace(sine.after.run, a=sine.after.run.a * growing)
    page = write_sine_report(replace(sine, after=replace(sine.after, run=run)), tmp_path / "s.html")
    assert Reader(page).verdict[0] == "bad" and "grows from cycle to cycle" in Reader(page).verdict[1]


def test_runs_without_spool_commands_say_what_is_missing(tmp_path, sine):
    bare = [replace(found, run=replace(found.run, command=None)) for found in (sine.before, sine.after)]
    page = write_sine_report(replace(sine, before=bare[0], after=bare[1]), tmp_path / "s.html")
    assert "The runs have no spool commands" in Reader(page).words
    assert "spool-1" not in Reader(page).figures


# ------------------------------------------------------------------------------------------ charts
def test_logarithmic_axes_get_their_ranges_in_decades():
    panel = Panel("p", [Curve("c", [1, 10], [0.1, 100], LINE)], log=True, span=(0.1, 100), lines={"two": 2.0})
    layout = chart_figure("n", "t", "d", [panel], XAxis("f", log=True, span=(1, 10)), marks=[5.0]).layout
    assert layout["yaxis"]["range"] == [-1.0, 2.0] and layout["xaxis"]["range"] == [0.0, 1.0]
    level, mark = layout["shapes"]
    assert level["y0"] == 2.0 and mark["x0"] == 5.0  # plotly's shapes are placed by value
    label = next(a for a in layout["annotations"] if a["text"] == "two")
    assert label["y"] == pytest.approx(np.log10(2.0), rel=1e-12)  # and its annotations by decade


def test_a_logarithmic_value_axis_names_1_2_5_over_few_decades_and_powers_of_ten_else():
    def axis(*values):
        panel = Panel("p", [Curve("c", range(len(values)), values, LINE)], log=True)
        return chart_figure("n", "t", "d", [panel], XAxis("f")).layout["yaxis"]

    assert {0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0} <= set(axis(0.2, 30.0)["tickvals"])
    assert axis(1e-4, 1.0)["dtick"] == 1 and axis(0.0, 0.0)["dtick"] == 1  # nothing to take a logarithm of


def test_a_curve_has_one_legend_entry_however_many_panels_show_it():
    panel = Panel("p", [Curve("c", [1], [1], LINE)])
    traces = chart_figure("n", "t", "d", [panel, panel], XAxis("f")).traces
    assert [t["showlegend"] for t in traces] == [True, False]


def test_each_cell_of_a_matrix_has_axes_of_its_own_in_its_own_place():
    y = np.arange(3 * 4.0).reshape(3, 2, 2)
    layout = matrix_figure("n", "t", "d", ["a", "b"], np.array([1.0, 2.0, 3.0]), y, LINE, (-1.0, 1.0)).layout
    places = {(tuple(layout[f"xaxis{k}"]["domain"]), tuple(layout[f"yaxis{k}"]["domain"])) for k in ("", "2", "3", "4")}
    assert len(places) == 4
    assert all(0.0 <= low < high <= 1.0 for place in places for low, high in place)


@pytest.mark.parametrize(
    ("factor", "said"),
    [(2.0, "6.0\N{NO-BREAK SPACE}dB"), (0.5, "−6.0\N{NO-BREAK SPACE}dB"), (np.inf, "∞"), (np.nan, "–"), (0.0, "–")],
)
def test_factors_in_decibels_are_always_words(factor, said):
    assert decibels(factor) == said
    assert (degrees(np.pi), degrees(np.inf), degrees(np.nan)) == ("180°", "∞", "–")
