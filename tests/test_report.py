"""Run reports: complete, self-contained, safe against hostile names, light, and drawn by a real browser."""

import base64
import io
import re
import zlib
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from browser import BROWSER, Tab, browse
from hypothesis import given, settings
from hypothesis import strategies as st
from page_cases import Reader, numbers
from plotly.offline import get_plotlyjs
from rich.console import Console
from scipy.constants import g

from lhpost6_pin.core.errors import RecordError, UnknownNameError
from lhpost6_pin.data.metrics import QUANTITIES
from lhpost6_pin.mechanics.specimen_modes import SpecimenMode
from lhpost6_pin.show.report.interaction_section import interaction_blocks
from lhpost6_pin.show.report.page import Page, Section, Table, bar, number, packed_plotly, render_page, save_page, text
from lhpost6_pin.show.report.plots import ACHIEVED, Row, Trace, envelope, time_figure
from lhpost6_pin.show.report.run_limits import limit_table
from lhpost6_pin.show.report.run_report import RunSummary, lead_summary, write_run_report
from lhpost6_pin.show.report.run_verdict import FOLLOWED, _against
from lhpost6_pin.show.report.scales import SCALES, Scale, percent, scaled_number, shown_as
from lhpost6_pin.show.report.specimen_section import response_blocks
from lhpost6_pin.show.terminal import _rich
from lhpost6_pin.simulation.limit_use import LimitUse
from lhpost6_pin.tuning.interaction import Cut, Interaction

AXES = ["x", "y", "z", "roll", "pitch", "yaw"]
ACTUATORS = ["H1", "H2", "H3", "H4", "V1", "V2", "V3", "V4", "V5", "V6"]
DELAY = 0.025
PEAKS = np.array([0.1, 0.08, 0.02, 0.0, 0.0, 0.0])


def make_record(duration: float = 8.0, rate: float = 512.0) -> xr.Dataset:
    """Return a record whose platen follows a sine burst exactly, 25 ms late; three axes are asked to move."""
    t = np.arange(int(duration * rate)) / rate

    def burst(time: np.ndarray) -> list[np.ndarray]:
        """Displacement, velocity and acceleration of a unit sine of 1.5 Hz under a Gaussian envelope."""
        w, s, u = 2 * np.pi * 1.5, duration / 12, time - duration / 2
        bell = np.exp(-(u**2) / (2 * s**2)) * np.exp(1j * w * u)
        rate_of = 1j * w - u / s**2
        return [bell.imag, (rate_of * bell).imag, ((rate_of**2 - 1 / s**2) * bell).imag]

    variables = {}
    for who, late in (("reference", 0.0), ("platen", DELAY)):
        for quantity, shape in zip(("displacement", "velocity", "acceleration"), burst(t - late), strict=True):
            variables[f"{who}_{quantity}"] = (("time", "axis"), np.outer(shape, PEAKS))
    wave = burst(t)[0]
    by_actuator = np.outer(wave, np.linspace(0.2, 0.6, 10))
    for name, scale, mean in (
        ("actuator_displacement", 0.1, 0.0),
        ("actuator_force", 1e6, 1e5),
        ("chamber_pressure_a", 2e6, 8e6),
        ("spool_command", 1.0, 0.0),
        ("spool_position", 0.99, 0.0),
    ):
        variables[name] = (("time", "actuator"), mean + scale * by_actuator)
    variables["chamber_pressure_b"] = (("time", "horizontal"), 8e6 - 2e6 * by_actuator[:, :4])
    variables["strut_pressure"] = (("time", "strut"), 15e6 + 1e5 * by_actuator[:, :3])
    coords = {"time": t, "axis": AXES, "actuator": ACTUATORS, "horizontal": ACTUATORS[:4], "strut": ["S1", "S2", "S3"]}
    attrs = {"title": "Sine burst", "test": "burst", "kind": "simulated", "specimen": "none"}
    return xr.Dataset(variables, coords, attrs)


LIMITS = {
    "displacement": [0.89, 0.38, 0.127, 0.04, 0.03, 0.07],
    "velocity": [3.0, 2.0, 0.45, 0.2, 0.1, 0.3],
    "acceleration": [36.0, 18.0, 35.0, 13.0, 8.0, 6.0],
    "actuator_stroke": [0.75] * 4 + [0.127] * 6,
    "supply_pressure": 20.7e6,
    "strut_area": [0.15] * 3,
}
MACHINE = [
    ("vertical.chamber_a", 0.3, "m", "dead volume not published", True),
    ("horizontal.area_a", [0.2, 0.1], "m2", "Table 6.1", False),
]


def report(folder: Path, record: xr.Dataset, **given: object) -> tuple[RunSummary, str]:
    summary = write_run_report(record, folder / "report.html", **given)  # type: ignore[arg-type]
    return summary, summary.path.read_text(encoding="utf-8")


def curve(trace: dict) -> tuple[np.ndarray, np.ndarray]:
    """Return times and values of a drawn channel, decoded as the page's script does."""
    samples = np.cumsum(numbers(trace["x"]).astype(np.int64))
    return trace["x"]["start"] + trace["x"]["step"] * samples, numbers(trace["y"])


# ------------------------------------------------------------------------------------------ decimation
@given(st.integers(1, 3000), st.integers(1, 400), st.integers(0, 2**32 - 1))
@settings(deadline=None)
def test_the_envelope_keeps_both_extremes_and_both_ends_of_any_channel(n, buckets, seed):
    values = np.random.default_rng(seed).normal(size=n)
    kept = envelope(values, buckets)
    assert values[kept].max() == values.max() and values[kept].min() == values.min()
    assert kept[0] == 0 and kept[-1] == n - 1
    assert np.all(np.diff(kept) > 0)
    assert len(kept) <= 2 * buckets + 2  # two extremes a bucket and the two ends


def test_every_drawn_point_is_a_recorded_sample_and_spikes_are_kept_beside_what_is_no_number():
    values = np.random.default_rng(1).normal(size=81_920)
    values[31_337], values[31_338:31_341] = 25.0, np.nan
    row = Row("Force", [Trace("V1", values, ACHIEVED)], SCALES["ratio"])
    drawing = time_figure("f", "Force", "", [row], start=1.0, step=1 / 2048)
    times, drawn = curve(dict(drawing.traces[0]))
    places = ((times - 1.0) * 2048).astype(int)  # multiples of 1/2048 s: exact in binary
    np.testing.assert_array_equal(drawn, values[places].astype("f4"))  # values travel in single precision
    assert np.nanmax(drawn) == 25.0 and len(drawn) < 3100


# ------------------------------------------------------------------------------------------ content
def test_the_page_shows_all_that_a_run_is_judged_by(tmp_path):
    given_notes = ["spool V6 was clipped 3 times"]
    given = {"limits": LIMITS, "notes": given_notes, "command": "lhpost6 run burst", "machine_table": MACHINE}
    summary, page = report(tmp_path, make_record(), **given)
    reader = Reader(page)
    words = reader.words
    titles = (
        "Target and achieved",
        "Intensity and response spectra",
        "Actuator forces",
        "Chamber pressures",
        "Servovalve spools",
    )
    for title in (*titles, "Hold-down struts", "Drift", "Table of metrics", "Assumptions and sources", "Versions and"):
        assert title in words
    for said in (*given_notes, "lhpost6 run burst", "dead volume not published", "Table 6.1", "numpy", "0.2, 0.1"):
        assert said in words
    assert len(summary.headlines) == 3 and all(h.value in words and h.label in words for h in summary.headlines)
    assert summary.verdict in words
    assert set(reader.figures) >= {f"axis-{axis}" for axis in AXES}
    assert {"spectrum-x", "spectrum-y", "spectrum-z", "close-x"} <= set(reader.figures)
    assert "spectrum-yaw" not in reader.figures  # it was not commanded
    drawn = {trace["name"] for name in reader.figures for trace in reader.figures[name]["traces"]}
    assert drawn >= {"target", "achieved", "achieved, delay removed", "as recorded", "supply", "S3", *ACTUATORS}
    assert drawn >= {"command", "position"}


def test_the_delay_of_the_table_is_found_and_removing_it_removes_the_error(tmp_path):
    summary, _ = report(tmp_path, make_record())
    asked = [row for row in summary.tracking if row.axis in "xyz"]
    assert len(asked) == 9
    for row in asked:
        assert row.delay == pytest.approx(DELAY, abs=1e-6)  # the burst is band-limited: the fit is exact to rounding
        assert row.rrmse > 0.1  # 25 ms of 1.5 Hz is 0.24 rad
        assert row.rrmse_aligned < 1e-4  # what the ends of the Gaussian leave
    quiet = [row for row in summary.tracking if row.axis not in "xyz"]
    assert all(np.isnan(row.rrmse) for row in quiet)
    assert summary.level == "good"


def test_a_delay_whose_removal_does_not_reduce_the_error_is_none(tmp_path):
    """A motion that is cut off in full shaking: ahead where the fit looks most, late where it is largest."""
    record = make_record()
    time = record["time"].values
    t, whole = time - time[0], time[-1] - time[0]
    target = (t / whole) ** 2 * np.sin(2.0 * np.pi * 1.5 * t)
    moved = np.where(t < 0.85 * whole, 6e-3, -12e-3)  # [s] ahead, then late
    achieved = (t / whole) ** 2 * np.sin(2.0 * np.pi * 1.5 * (t + moved))
    for who, values in (("reference", target), ("platen", achieved)):
        columns = record[f"{who}_displacement"].values.copy()
        columns[:, 0] = 0.1 * values
        record[f"{who}_displacement"] = record[f"{who}_displacement"].copy(data=columns)
    summary, page = report(tmp_path, record)
    row = next(row for row in summary.tracking if (row.axis, row.quantity) == ("x", "displacement"))
    assert np.isnan(row.delay) and row.rrmse_aligned == row.rrmse > 0.05
    assert "nan" not in page[: page.index("<script")]


@pytest.mark.parametrize("ahead", [False, True])
def test_a_negative_delay_is_explained_and_only_that(tmp_path, ahead):
    record = make_record()
    if ahead:  # what was the target is achieved, DELAY before what was achieved
        pairs = [(f"platen_{q}", f"reference_{q}") for q in QUANTITIES]
        swapped = {a: record[b].values for one in pairs for a, b in (one, one[::-1])}
        record = record.assign({name: record[name].copy(data=values) for name, values in swapped.items()})
    summary, page = report(tmp_path, record)
    assert bool(lead_summary(summary.tracking)) == ahead
    assert ("A negative delay: the achieved motion is ahead of its target (x displacement," in page) == ahead
    assert ("25.0\N{NO-BREAK SPACE}ms ahead of the target" in page) == ahead
    assert ("delay 25.0\N{NO-BREAK SPACE}ms" in page) != ahead


def test_figures_hold_the_recorded_peaks_in_the_unit_they_name(tmp_path):
    record = make_record()
    _, page = report(tmp_path, record)
    figure = Reader(page).figures["axis-x"]
    titles = [note["text"] for note in figure["layout"]["annotations"]]
    units = ("Displacement [mm]", "Velocity [m/s]", "Acceleration [g]")
    assert all(title.startswith(f"<b>{unit}, RRMSE ") for title, unit in zip(titles, units, strict=True))
    drawn = [curve(trace)[1].max() for trace in figure["traces"] if trace["name"] == "as recorded"]
    peaks = [record[f"platen_{q}"].values[:, 0].max() for q in ("displacement", "velocity", "acceleration")]
    expected = np.array(peaks) * [1e3, 1.0, 1.0 / g]
    np.testing.assert_array_equal(np.array(drawn), expected.astype("f4"))


def test_the_achieved_motion_is_drawn_without_its_delay_and_judged_in_the_title_of_each_plot(tmp_path):
    summary, page = report(tmp_path, make_record())
    figures = Reader(page).figures
    for axis in ("x", "y", "z"):
        figure = figures[f"axis-{axis}"]
        rows = [row for row in summary.tracking if row.axis == axis]
        for row, note in zip(rows, figure["layout"]["annotations"], strict=True):
            assert note["text"].endswith(f", RRMSE {number(100 * row.rrmse_aligned)}\N{NO-BREAK SPACE}%</b>")
        names = ("target", "achieved, delay removed", "as recorded")
        target, achieved, recorded = (next(t for t in figure["traces"] if t["name"] == name) for name in names)
        assert recorded["visible"] == "legendonly" and "visible" not in achieved
        times = [curve(trace)[0][curve(trace)[1].argmax()] for trace in (target, achieved, recorded)]
        assert times[0] == times[1]
        assert times[2] - times[0] == pytest.approx(DELAY, abs=1 / 512)  # a sample
    assert "RRMSE" not in figures["axis-yaw"]["layout"]["annotations"][0]["text"]  # it had no target
    assert {trace["name"] for trace in figures["axis-yaw"]["traces"]} == {"target", "achieved"}


def test_each_actuator_has_a_plot_of_its_spool_on_one_scale_with_both_limits(tmp_path):
    record = make_record()
    _, page = report(tmp_path, record)
    figures = Reader(page).figures
    spans = set()
    for k in range(10):
        figure = figures[f"plot-spool-{k + 1}"]
        assert [trace["name"] for trace in figure["traces"]] == ["command", "position"]
        largest = curve(figure["traces"][0])[1].max()
        assert largest == np.float32(record["spool_command"].values[:, k].max())
        assert [shape["y0"] for shape in figure["layout"]["shapes"]] == [1.0, -1.0]  # and none is shaded
        spans.add(tuple(figure["layout"]["yaxis"]["range"]))
    (span,) = spans
    assert span[0] < -1.0 and span[1] > 1.0
    assert "plot-spool-11" not in figures


def test_a_spool_at_its_limit_is_shaded_where_it_is_and_nowhere_else(tmp_path):
    record = make_record(40.0)
    record["spool_command"][:] = 0.0
    stretches = [(5.0, 6.0), (20.0, 20.001), (39.0, 40.0)]  # the second is one sample, the third lasts to the end
    time = record["time"].values
    for sign, (begin, end) in zip((1.0, -1.0, 1.0), stretches, strict=True):
        record["spool_command"][(time >= begin) & (time < end), 2] = sign
    _, page = report(tmp_path, record)
    figures = Reader(page).figures
    shapes = [figures[f"plot-spool-{k}"]["layout"]["shapes"] for k in range(1, 11)]
    shaded = [[shape for shape in drawn if shape["type"] == "rect"] for drawn in shapes]
    assert [len(shapes) for shapes in shaded] == [0, 0, 3, *[0] * 7]
    coarse = 40.0 / 250  # a stretch is one of 300 of the record, rounded up to whole samples
    for (begin, end), shape in zip(stretches, shaded[2], strict=True):
        assert begin - coarse <= shape["x0"] <= begin and end - 1 / 512 <= shape["x1"] <= end + coarse
        assert shape["x1"] - shape["x0"] >= 40.0 / 400  # wide enough to be seen


def test_the_close_up_of_the_spools_shows_every_sample_and_says_how_late_the_position_is(tmp_path):
    record = make_record(rate=1000.0)
    late = record["spool_command"].values
    record["spool_position"] = (("time", "actuator"), np.vstack([np.zeros((5, 10)), late[:-5]]))  # 5 ms
    _, page = report(tmp_path, record)
    figures = Reader(page).figures
    closest = [name for name in figures if name.startswith("close-spool-")]
    assert closest == ["close-spool-4", "close-spool-10"]  # the largest commands of H1 to H4 and of V1 to V6
    times, values = curve(figures["close-spool-10"]["traces"][0])
    assert len(times) == 1000 and values.max() == np.float32(late[:, 9].max())
    # found within a hundredth of a millisecond on one second of a band-limited signal
    assert page.count("The position is 5.00\N{NO-BREAK SPACE}ms late.") == 2


def test_a_constant_offset_is_reported_as_drift(tmp_path):
    record = make_record()
    offset = xr.DataArray([0.0, 0.0, 0.003, 0.0, 0.0, 0.0], dims="axis")
    record["platen_displacement"] = record["reference_displacement"] + offset
    _, page = report(tmp_path, record)
    row = re.search(r'<th scope="row">z</th><td>mm</td><td>([\d.]+)</td><td>([\d.]+)</td>', page)
    assert row and row.groups() == ("3.00", "3.00")


def test_what_was_exceeded_is_named_in_the_verdict(tmp_path):
    record = make_record()
    record["spool_position"][100, 9] = 1.0
    tight = {"displacement": [0.05, 1, 1, 1, 1, 1], "actuator_stroke": [0.001] + [1.0] * 9}
    summary, page = report(tmp_path, record, limits=tight)
    assert summary.level == "bad" and 'class="bar over"' in page
    assert all(name in summary.verdict for name in ("x displacement", "H1 actuator stroke", "spool V6"))
    assert "y displacement" not in summary.verdict and "within the given limits" not in summary.verdict


def test_the_verdict_leads_with_clipped_spools(tmp_path):
    record = make_record()
    record["spool_command"][100:104, 9] = -1.0
    record.attrs["spool_values_clipped"] = 4
    summary, _ = report(tmp_path, record, limits=LIMITS)
    share = 100 * 4 / record.sizes["time"]
    said = f"4 spool commands were clipped: spool V6 {share:.3g}\N{NO-BREAK SPACE}% of the time."
    assert summary.verdict.startswith(said)
    assert "within the given limits" in summary.verdict and summary.level == "bad"
    record.attrs["spool_values_clipped"] = 0
    assert report(tmp_path, record)[0].verdict.startswith("Spools reached their full stroke: spool V6 ")
    clean, _ = report(tmp_path, make_record(), limits=LIMITS)
    assert "within the given limits" in clean.verdict and "clipped" not in clean.verdict
    assert clean.level == "good"


def test_components_of_a_wrench_that_are_round_off_beside_the_largest_are_shown_as_zero():
    """A block of 4.9 MN pulled along x: what a run leaves of y and roll, and of x at rest."""
    wrench = np.zeros((100, 6))
    wrench[:, 0], wrench[:, 1], wrench[:, 2] = np.linspace(1e-13, 1e5, 100), 2.4e-8, -4.9e6
    wrench[:, 3], wrench[:, 4] = 2.7e-7, 1.0  # 1 N m is small, but no round-off
    record = xr.Dataset({"specimen_wrench": (("time", "interface_axis"), wrench)}, {"time": np.arange(100) / 512})
    rows = {row[0]: row[2:] for row in response_blocks(record)[0].rows}
    assert rows["base shear x"] == ("100", "0", "0.193 s") and rows["base shear y"] == ("0", "0", "–")
    assert rows["overturning about x"] == rows["torsion"] == ("0", "0", "–")
    assert rows["overturning about y"][:2] == ("0.00100", "0.00100")


@pytest.mark.parametrize(("loop", "level"), [("stable", "good"), ("thin", "attention"), ("unstable", "bad")])
def test_the_verdict_names_a_loop_without_margin_and_its_remedy(tmp_path, loop, level):
    record = make_record()
    record.attrs |= {"loop": loop, "loop_summary": "The control loop is what it is", "loop_remedy": "lhpost6 tune --x"}
    summary, _ = report(tmp_path, record, limits=LIMITS)
    assert summary.level == level
    assert ("lhpost6 tune --x" in summary.verdict) == (loop != "stable")


def test_a_target_was_not_followed_with_clipped_commands(tmp_path):
    record = make_record()
    record.attrs["spool_values_clipped"] = 21900
    summary, _ = report(tmp_path, record, limits=LIMITS)
    assert "The table tracked its target" not in summary.verdict and "does not follow its target" in summary.verdict


def test_an_error_just_above_its_criterion_does_not_read_as_one_at_it():
    allowed = FOLLOWED["displacement"]
    assert _against(1.0001 * allowed, allowed) == f"just above {percent(allowed)}"
    assert _against(allowed, allowed) == percent(allowed) and _against(1.1 * allowed, allowed) == percent(0.11)


def test_the_verdict_on_a_run_that_stopped_begins_with_that_and_judges_nothing_else(tmp_path):
    record = make_record()
    record.attrs["trouble"] = "stopped at 0.1606 s: V1 left its stroke of +-0.4 m; scale the motion down"
    summary, _ = report(tmp_path, record, limits=LIMITS)
    assert summary.verdict.startswith("The run stopped at 0.1606 s: V1 left its stroke of +-0.4 m: tracking is")
    assert "RRMSE" not in summary.verdict and "limits" not in summary.verdict and summary.level == "bad"
    assert summary.headlines[0].note == "tracking is not judged"


def test_the_governing_limit_comes_first_and_every_quantity_has_its_row(tmp_path):
    record = make_record()
    t, amplitude, w = record["time"].values, 0.06, 2 * np.pi * 1.5
    sine = amplitude * np.sin(w * t)
    record["actuator_displacement"] = (("time", "actuator"), np.outer(sine, [0.1] * 3 + [1.0] + [0.1] * 6))
    speeds = {"actuator_extending": [4.0] * 10, "actuator_retracting": [0.6] * 10}
    summary, page = report(tmp_path, record, limits={**LIMITS, **speeds})
    uses = {(use.quantity, use.name): use for use in summary.limits}
    leg = uses["actuator velocity", "H4"]  # retracting: the lesser limit; central differences lose (w dt)^2 / 6 of it
    assert leg.peak == pytest.approx(amplitude * w, rel=1e-4) and leg.share == pytest.approx(leg.peak / 0.6)
    stroke = uses["actuator stroke", "H4"].share
    assert stroke == pytest.approx(amplitude / 0.75, rel=1e-4)  # the peak falls between samples
    moved = np.abs(record["platen_displacement"].values[:, 1]).max()
    assert uses["displacement", "y"].share == pytest.approx(moved / 0.38)
    assert "actuator velocity" in summary.headlines[2].note and "H4" in summary.headlines[2].note
    assert summary.headlines[2].level == "attention" and "within the given limits" in summary.verdict
    rows = page.partition("<caption><span>Demand over capacity, achieved</span>")[2].partition("</table>")[0]
    named = re.findall('<th scope="row">(.*?)</th>', rows)
    others = {"Displacement", "Velocity", "Acceleration", "Actuator stroke", "Spool"}
    assert named[0] == "Actuator velocity" and set(named[1:]) == others
    assert re.search(r">Spool</th>.{0,60}?[\d.]+ of the stroke<", rows)


def test_speeds_of_actuators_are_those_between_answered_samples(tmp_path):
    """Samples that a controller missed repeat the row before: their jump was a speed of three times the limit."""
    record = make_record()
    t, amplitude, w = record["time"].values, 0.06, 2 * np.pi * 1.5
    answered = np.arange(len(t)) % 400 < 380  # twenty in a row are missed
    last = np.maximum.accumulate(np.where(answered, np.arange(len(t)), 0))
    record["actuator_displacement"] = (("time", "actuator"), np.outer(amplitude * np.sin(w * t), np.ones(10))[last])
    record["answered"] = (("time",), answered.astype(np.int8))
    limits = {**LIMITS, "actuator_extending": [4.0] * 10, "actuator_retracting": [4.0] * 10}
    summary, _ = report(tmp_path, record, limits=limits)
    peak = next(use.peak for use in summary.limits if use.quantity == "actuator velocity")
    assert peak == pytest.approx(amplitude * w, rel=0.01)  # differences over twenty samples lose (20 w dt)^2 / 6 of it


def test_commands_in_banners_and_notes_are_set_as_code():
    page = render_page(Page("Kind", "Title", "Purpose", "Run `lhpost6 check <a>`.", "good", (), (), notes=["a `b`"]))
    assert "Run <code>lhpost6 check &lt;a&gt;</code>." in page and "<li>a <code>b</code></li>" in page


@pytest.mark.parametrize(("share", "beyond"), [(0.9995, False), (1.0005, False), (1.002, True)])
def test_a_peak_counts_as_beyond_its_limit_from_a_thousandth_on(tmp_path, share, beyond):
    record = make_record()
    peak = float(np.abs(record["platen_displacement"].values[:, 0]).max())
    summary, page = report(tmp_path, record, limits={"displacement": [peak / share] + [1.0] * 5})
    found = re.search("Limits exceeded: x displacement \\((.*) of its limit\\)", summary.verdict)
    assert bool(found) == beyond == ("within the given limits" not in summary.verdict)
    assert beyond == (summary.level == "bad") == (summary.headlines[2].level == "bad") == ("bar over" in page)
    if found:
        assert found[1] == "100.2\N{NO-BREAK SPACE}%"  # not the 100 % that it would be in three digits


PULL = {"actuator_force": [4.12e6] * 4 + [3.0e6] * 6, "actuator_pull": [2.57e6] * 4 + [0.0] * 6}


def forced(pushed: float, pulled: float, actuator: int) -> xr.Dataset:
    record = make_record()
    force = np.full_like(record["actuator_force"].values, 1e5)
    force[10, actuator], force[20, actuator] = pushed, -pulled
    record["actuator_force"] = (("time", "actuator"), force)
    return record


@pytest.mark.parametrize(
    ("actuator", "pushed", "pulled", "said"),
    [
        (0, 4.0e6, 2.5e6, ""),
        (0, 4.2e6, 2.5e6, "H1 push (101.9\N{NO-BREAK SPACE}% of its limit)"),
        (0, 4.0e6, 3.0e6, "H1 pull (116.7\N{NO-BREAK SPACE}% of its limit)"),
        (9, 2.9e6, -1e4, ""),
        (9, 2.9e6, 2e3, ""),  # a pull within a thousandth of its push is rounding
        (9, 2.9e6, 1e5, "V6 pull (no capacity)"),
        (9, 3.1e6, 0.0, "V6 push (103.3\N{NO-BREAK SPACE}% of its limit)"),
    ],
)
def test_push_and_pull_have_limits_of_their_own(tmp_path, actuator, pushed, pulled, said):
    summary, page = report(tmp_path, forced(pushed, pulled, actuator), limits=PULL)
    assert summary.verdict.partition("Limits exceeded: ")[2].removesuffix(".") == said
    table = page[page.index("Forces and strokes") :]
    row = re.search(f'<th scope="row">{ACTUATORS[actuator]}</th>(<td>.*?)</tr>', table)
    cells = re.findall("<td>(.*?)</td>", row[1])
    assert cells[0] == number(max(pushed, 1e5) / 1e6) and cells[2] == number(max(pulled, 0.0) / 1e6)
    assert ("no capacity" in cells[3]) == ("no capacity" in said)
    assert ("over" in cells[1] or "over" in cells[3]) == bool(said)


def test_force_limits_are_drawn_with_their_sign_where_the_forces_come_near_them(tmp_path):
    def drawn(record: xr.Dataset, **limits: list[float]) -> list[float]:
        layout = Reader(report(tmp_path, record, limits=limits)[1]).figures["plot-force"]["layout"]
        return [shape["y0"] for shape in layout["shapes"]]

    assert drawn(forced(4e6, 2.5e6, 0), **PULL) == pytest.approx([4.12, -2.57])
    assert drawn(forced(4e6, 1e5, 0), **PULL) == pytest.approx([4.12])
    assert drawn(forced(4e5, 1e5, 0), **PULL) == []
    assert drawn(forced(4e6, 2.5e6, 0), actuator_force=PULL["actuator_force"]) == []


def test_without_a_limit_of_pulling_the_magnitude_counts_and_without_a_number_nothing(tmp_path):
    record = forced(1e6, 4.2e6, 0)
    both, _ = report(tmp_path, record, limits={"actuator_force": [4.12e6] * 10})
    assert "H1 force (101.9" in both.verdict
    none, page = report(tmp_path, record, limits={**PULL, "actuator_pull": [np.nan] * 10})
    assert "exceeded" not in none.verdict and "nan" not in Reader(page).words.lower()
    short, _ = report(tmp_path, record, limits={"actuator_pull": [2.57e6]})
    assert "H1 pull (163.4" in short.verdict


@pytest.mark.parametrize(
    ("factor", "who", "said"), [(2.0, "platen", "did not track"), (1e-320, "reference", "cannot be judged")]
)
def test_poor_tracking_is_not_called_good_and_a_target_too_small_to_square_is_not_judged(tmp_path, factor, who, said):
    record = make_record()
    for name in ("displacement", "velocity", "acceleration")[2 * (who == "platen") :]:
        record[f"{who}_{name}"] = factor * record[f"{who}_{name}"]
    summary, _ = report(tmp_path, record)  # warnings are errors here
    assert said in summary.verdict and summary.level != "good"
    assert who == "platen" or all(np.isnan(row.rrmse) for row in summary.tracking)


def test_a_table_with_one_axis_and_one_actuator_is_reported_too(tmp_path):
    record = make_record().isel(axis=[0], actuator=[0], horizontal=[0], strut=slice(0))
    summary, page = report(tmp_path, record.drop_vars("strut_pressure"))
    assert {row.axis for row in summary.tracking} == {"x"}
    assert "axis-x" in Reader(page).figures


# ------------------------------------------------------------------------------------------ bad input
@pytest.mark.parametrize("name", sorted(map(str, make_record().data_vars)))
def test_a_missing_variable_is_named_where_it_would_have_been_shown(tmp_path, name):
    summary, page = report(tmp_path, make_record().drop_vars(name), limits=LIMITS)
    assert re.search(rf'class="missing".*<code>{name}</code>', page)
    assert summary.missing == (name,)


@pytest.mark.parametrize("samples", [2, 3, 20, 100])
def test_a_run_that_stopped_after_a_few_samples_is_reported(tmp_path, samples):
    _, page = report(tmp_path, make_record().isel(time=slice(samples)), limits=LIMITS)
    assert "plot-force" in page


@pytest.mark.parametrize("name", ["platen_displacement", "platen_acceleration", "spool_position", "actuator_force"])
def test_samples_that_are_not_numbers_are_named_with_their_time(tmp_path, name):
    record = make_record()
    record[name][512:] = np.nan
    summary, page = report(tmp_path, record, limits=LIMITS)
    assert f"{name} has non-finite samples, the first at 1.0000 s" in page
    assert summary.level != "good"
    assert "nan" not in Reader(page).words.lower()


def test_a_record_without_a_single_number_still_makes_a_page_and_one_of_time_alone_names_what_is_missing(tmp_path):
    record = make_record()
    record["supply_pressure"] = ("time", np.full(record.sizes["time"], np.nan))
    summary, page = report(tmp_path, record * np.nan, limits=LIMITS)
    assert "cannot be judged" in summary.verdict and "nan" not in Reader(page).words.lower()
    summary, page = report(tmp_path, make_record().drop_vars(list(make_record().data_vars)))
    assert set(summary.missing) == set(make_record().data_vars)
    assert all(f"<code>{name}</code>" in page for name in summary.missing)
    assert summary.level == "plain" and "cannot be judged" in summary.verdict


def test_uneven_time_and_an_unknown_limit_are_refused_by_sample_and_name(tmp_path):
    record, path = make_record(), tmp_path / "r.html"
    time = record["time"].values.copy()
    time[40:] += 0.001
    for wrong, limits, message in (
        (record.assign_coords(time=time), {}, "sample 40"),
        (record.isel(time=[0]), {}, "time"),
        (record, {"displacment": [1.0]}, r"displacment.*actuator_stroke"),
    ):
        with pytest.raises((RecordError, UnknownNameError), match=message):
            write_run_report(wrong, path, limits=limits)
    assert not path.exists()


HOSTILE = '"><img src=x onerror=alert(1)><script>alert(2)</script></script><!--'


def test_hostile_names_arrive_as_text_and_nowhere_as_markup(tmp_path):
    record = make_record().assign_coords(actuator=[HOSTILE, *ACTUATORS[1:]], axis=[HOSTILE, *AXES[1:]])
    record.attrs = {"title": HOSTILE, "kind": HOSTILE, "specimen": HOSTILE, HOSTILE: HOSTILE}
    record["platen_velocity"].attrs = {"units": HOSTILE, "long_name": HOSTILE}
    record = record.assign({HOSTILE: ("time", np.full(record.sizes["time"], np.nan))})
    rows = [(HOSTILE, HOSTILE, HOSTILE, HOSTILE, True), (HOSTILE, 1.0, HOSTILE, HOSTILE, False)]
    _, page = report(tmp_path, record, notes=[HOSTILE], command=HOSTILE, machine_table=rows, limits=LIMITS)
    _, plain = report(tmp_path, make_record(), notes=["n"], command="c", machine_table=MACHINE, limits=LIMITS)
    assert "<img" not in page and "alert(2)</script>" not in page
    reader = Reader(page)
    assert not [attributes for _, attributes in reader.tags if "onerror" in attributes]
    assert {tag for tag, _ in reader.tags} == {tag for tag, _ in Reader(plain).tags}
    assert len(reader.scripts) == len(Reader(plain).scripts)
    for figure in reader.figures.values():  # plotly reads HTML in labels
        labels = [trace["name"] for trace in figure["traces"]]
        labels += [note["text"].removeprefix("<b>").removesuffix("</b>") for note in figure["layout"]["annotations"]]
        assert not any("<" in label for label in labels)


# ------------------------------------------------------------------------------------------ the page itself
def test_the_page_loads_nothing_from_elsewhere(tmp_path):
    _, page = report(tmp_path, make_record())
    reader = Reader(page)
    assert not reader.attributes("src") and not [tag for tag, _ in reader.tags if tag in ("link", "iframe", "object")]
    assert all(href.startswith("#") for href in reader.attributes("href"))
    style = page[page.index("<style>") : page.index("</style>")]
    assert "url(" not in style and "@import" not in style
    policy = next(value for value in reader.attributes("content") if "default-src" in value)
    assert "default-src 'none'" in policy and "http" not in policy
    (packed,) = (script for script in reader.scripts if len(script) > 1_000_000)
    assert zlib.decompress(base64.b64decode(packed)).decode() == get_plotlyjs()


@pytest.mark.parametrize("cached", [True, False], ids=["cache", "no cache"])
def test_the_plotting_library_is_packed_once_where_there_is_a_cache(cached, tmp_path, monkeypatch):
    monkeypatch.setattr("lhpost6_pin.core.compiled.cache_folder", lambda: tmp_path if cached else None)
    pack = packed_plotly.__wrapped__
    first = pack()
    assert zlib.decompress(base64.b64decode(first)).decode() == get_plotlyjs()
    monkeypatch.setattr("plotly.offline.get_plotlyjs", lambda: "not this one")
    assert (pack() == first) == cached and len(list(tmp_path.iterdir())) == cached


def test_headings_navigation_and_figures_can_be_reached_without_a_mouse(tmp_path):
    _, page = report(tmp_path, make_record())
    reader = Reader(page)
    names = set(reader.attributes("id"))
    assert len(names) == len(reader.attributes("id"))  # every id is used once
    assert {href[1:] for href in reader.attributes("href")} <= names
    assert {name for value in reader.attributes("aria-labelledby") for name in value.split()} <= names
    plots = [attributes for _, attributes in reader.tags if attributes.get("class") == "plot"]
    assert plots and all(p["tabindex"] == "0" and p["aria-labelledby"] for p in plots)
    assert [tag for tag, _ in reader.tags].count("h1") == 1
    tables = [tag for tag, _ in reader.tags if tag in ("table", "caption")]
    assert tables.count("table") == tables.count("caption") > 0
    assert next(a for t, a in reader.tags if t == "a")["class"] == "skip"


def test_a_40_second_test_at_2048_hz_stays_below_6_megabytes(tmp_path):
    rng = np.random.default_rng(2)
    record = make_record(40.0, 2048.0)
    for name in record.data_vars:  # noise on every channel: nothing compresses by chance
        record[name] = record[name] + float(record[name].std()) * rng.normal(size=record[name].shape)
    summary, _ = report(tmp_path, record, limits=LIMITS, machine_table=MACHINE)
    assert summary.path.stat().st_size < 6e6


def test_a_page_of_another_kind_has_the_same_skeleton():
    page = render_page(Page("Tuning report", "T", "asked", "verdict", "plain", (), (), command="lhpost6 tune"))
    assert "Tuning report" in page and "lhpost6 tune" in page and 'id="repeat"' in page


@given(st.text())
def test_escaped_text_holds_no_markup(words):
    assert not set("<>\"'") & set(text(words))


def test_numbers_read_as_an_engineer_writes_them():
    shown = {0.0: "0", 0.0123456: "0.0123", 1.0: "1.00", -12.34: "−12.3", 123.4: "123", 20_700.0: "20,700"}
    shown |= {3e-7: "3.00e−07", float("inf"): "–"}
    assert {value: number(value) for value in shown} == shown and number(float("nan")) == "–"


def test_a_bar_never_runs_over_its_box_and_says_its_per_cent():
    assert "width:100.0%" in bar(1.7) and "170 %" in bar(1.7) and "over" in bar(1.7)
    assert "width:50.0%" in bar(0.5) and "within" in bar(0.5)
    assert bar(float("nan")) == "–"
    assert "no capacity" in bar(float("inf")) and "width:100.0%" in bar(float("inf"))
    assert "bar over" in bar(1.0) and "bar near" in bar(1.0, 1e-3) and "bar over" in bar(1.002, 1e-3)


SEEN = """(async () => {
  const frame = () => new Promise((done) => requestAnimationFrame(done));
  const until = async (true_) => { for (let k = 0; k < 5000 && !true_(); k++) await frame(); };
  const drawn = (plot) => Array.from(plot.querySelectorAll(".js-line")).some((l) => l.getTotalLength() > 100);
  const plots = Array.from(document.querySelectorAll(".plot"));
  document.querySelectorAll("details").forEach((folded) => { folded.open = true; });
  await until(() => drawn(plots[0]));
  const found = { plots: plots.length, early: plots.filter(drawn).length, empty: 0 };
  for (const plot of plots) {
    plot.scrollIntoView({ behavior: "instant" });
    await until(() => drawn(plot));
    found.empty += !drawn(plot);
  }
  const [first, other] = ["axis-x", "plot-force"].map((id) => document.getElementById(id));
  const range = async (plot, act) => {
    const before = String(plot.layout.xaxis.range);
    await act();
    plot.scrollIntoView({ behavior: "instant" });
    await until(() => String(plot.layout.xaxis.range) !== before);
    return plot.layout.xaxis.range.slice();
  };
  const press = (plot, key) => () => plot.dispatchEvent(new KeyboardEvent("keydown", { key }));
  found.linked = await range(other, () => Plotly.relayout(first, { "xaxis.range": [2, 4] }));
  found.moved = await range(first, press(other, "ArrowRight"));
  found.reset = await range(other, press(first, "0"));
  return found;
})()"""


@pytest.mark.long
@pytest.mark.skipif(BROWSER is None, reason="no chromium on this machine")
def test_a_browser_draws_every_plot_without_an_error_and_zooms_all_time_axes_together(tmp_path):
    summary, _ = report(tmp_path, make_record(), limits=LIMITS, machine_table=MACHINE)

    async def look(tab: Tab):
        return await tab.evaluate(SEEN), tab.faults

    found, faults = browse(tmp_path, summary.path.as_uri(), look, (1400, 1000))
    assert faults == []
    assert found["plots"] == 31  # 6 axes, 3 close-ups, 6 of spectra, force, pressure, struts, drift, 10 spools and 2
    assert found["early"] < 6 and found["empty"] == 0  # those out of sight wait
    assert found["linked"] == [2, 4]
    assert found["moved"] == pytest.approx([2.4, 4.4])  # a fifth of the window
    assert found["reset"] == pytest.approx([0.0, 8.0 - 1 / 512])


def test_round_off_is_shown_as_zero_and_small_quantities_are_not():
    assert shown_as(6.2e-9, Scale(1e-6, "MN m")).split() == ["0", "MN", "m"]  # a moment that symmetry makes zero
    assert percent(1.09e-14).split() == ["0", "%"] and percent(float("nan")) == "–"
    assert shown_as(2.4e-6, Scale(1e3, "mm")).startswith("0.0024")
    assert scaled_number(float("nan"), Scale(1.0, "N")) == "–"
    wave = np.sin(np.arange(50.0))
    for size, all_zero in ((1e-10, True), (1e-7, False)):  # 1e-13 and 1e-10 kN
        row = Row("Base shear y", [Trace("", size * wave, ACHIEVED)], Scale(1e-3, "kN"))
        drawn = time_figure("f", "f", "f", [row], start=0.0, step=0.1).traces[0]["y"]["bdata"]
        assert (not np.frombuffer(base64.b64decode(drawn), "<f4").any()) == all_zero


@pytest.mark.long
@pytest.mark.skipif(BROWSER is None, reason="no chromium on this machine")
def test_no_column_of_a_table_is_cut_on_a_screen_of_1200_pixels(tmp_path):
    """Nine columns of long titles, such as forms of friction: cells wrap before the last column is hidden."""
    header = ("Test", *(f"backlash in series with friction of form {k}" for k in range(7)), "numbers fitted")
    wide = Table("Wide", header, [("0.25Hz_1in", *(["0.968 (18.0 %)"] * 7), "12")])
    sections = [Section("wide", "Wide", [wide])]
    page = Page(
        kind="Test", title="Tables", purpose="Width.", verdict="Fits.", level="good", headlines=[], sections=sections
    )
    path = save_page(page, tmp_path / "page.html")

    async def look(tab: Tab) -> float:
        return await tab.evaluate("(s => s.scrollWidth - s.clientWidth)(document.querySelector('#wide .scroll'))")

    assert browse(tmp_path, Path(path).as_uri(), look, (1200, 800)) <= 0


@pytest.mark.parametrize("width", [60, 80, 160])
def test_no_column_of_a_table_is_lost_in_a_narrow_terminal(width):
    """All words of a long last column are printed, though numbers before it would fill the line."""
    words = [f"source{k}" for k in range(12)]
    row = ("hydraulics.root_regularisation", "0.15, 0.25, 0.35, 0.45", "m/s2 | rad/s2", "assumed", " ".join(words))
    table = Table("", ("quantity", "value", "unit", "evidence", "source"), [row])
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(_rich(table, width))
    printed = console.export_text()
    columns = [line.split("\N{BOX DRAWINGS LIGHT VERTICAL}") for line in printed.splitlines() if line.startswith("│")]
    assert "".join(line[-2] for line in columns).replace(" ", "") == "".join(words)
    assert "".join(line[2] for line in columns).replace(" ", "") == row[1].replace(" ", "")


@pytest.mark.parametrize("rigid", [True, False])
def test_modes_of_a_specimen_are_listed_and_only_a_rigid_one_is_called_rigid(rigid):
    modes = () if rigid else (SpecimenMode(1.6, 0.03, np.array([44e3, 0.0, 0.0, 0.0, 0.0, 0.0])),)
    f = np.geomspace(0.1, 40.0, 50)
    flat = np.ones((50, 6), complex)
    cuts = {"with specimen": tuple(Cut(axis, 1.0, 1.0, 1.0, 1.0) for axis in AXES)}
    found = Interaction(f, tuple(AXES), {"bare table": flat, "with specimen": flat}, cuts, modes, rigid)
    blocks = interaction_blocks(make_record(), found)
    captions = [block.caption for block in blocks if isinstance(block, Table)]
    assert ("Modes of the specimen on a fixed base" in captions) is not rigid
    assert any("at the specimen's periods" in caption for caption in captions) is not rigid
    assert any("rigid" in block for block in blocks if isinstance(block, str)) is rigid


def test_a_report_of_a_record_alone_says_that_limits_were_not_evaluated(tmp_path):
    summary = write_run_report(make_record(), tmp_path / "report.html")
    assert {use.quantity for use in summary.limits} == {"spool"}
    assert summary.headlines[2].label == "Largest spool demand; limits were not evaluated"
    page = (tmp_path / "report.html").read_text()
    assert "Limits of the machine were not evaluated" in page and "Unloading is the loss" not in page


@pytest.mark.parametrize(
    ("factor", "shown"), [(1e3, ["1.43 MN", "0.429 MN", "0 MN m"]), (1.0, ["1.43 kN", "0.429 kN", "0 kN m"])]
)
def test_forces_of_a_small_table_are_shown_in_kilonewtons(factor, shown):
    uses = [LimitUse("push", "A1", 1430.0 * factor, 0.5), LimitUse("pull", "A2", 429.0 * factor, 0.1)]
    uses.append(LimitUse("axis yaw moment", "yaw", 1e-6, 0.0))  # round-off of a sum
    peaks = [row[2].replace("\N{NO-BREAK SPACE}", " ") for row in limit_table(uses).rows]
    assert peaks == shown
