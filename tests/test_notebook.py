"""Reports of results in a notebook."""

import html
import re

import numpy as np
import pytest
from machine_cases import PRACTICE
from run_cases import driven

from lhpost6_pin.core.shown import Shown
from lhpost6_pin.data.records import load_record
from lhpost6_pin.data.sensors import load_sensors
from lhpost6_pin.identification.decompose import decompose_record
from lhpost6_pin.show.notebook import _write, show_report, show_summary
from lhpost6_pin.show.report.run_limits import NOT_EVALUATED
from lhpost6_pin.simulation.outputs import record_of_run
from lhpost6_pin.simulation.rehearse import SimulatedTest


def test_a_record_and_its_decomposition_are_shown_as_their_reports(machine, tmp_path):
    record = load_record(PRACTICE).isel(time=slice(0, 4096))
    decomposed = decompose_record(machine, record, load_sensors("lhpost6"))
    for result, kind in ((record, "Run report"), (decomposed, "Inverse dynamics")):
        picture = show_report(result)
        assert kind in picture.page and "iframe" in picture._repr_html_()
        picture.save(tmp_path / "page.html")
        assert (tmp_path / "page.html").read_text(encoding="utf-8") == picture.page


def test_a_run_is_judged_in_a_notebook_by_all_that_the_command_judges_by(machine):
    spool = np.zeros((600, len(machine.actuators)))
    spool[:, 0] = 0.2  # against the other three: chambers fall below the return pressure
    run = driven(machine, spool)
    page = show_report(SimulatedTest(run, record_of_run(run, {"test": "hard"}))).page
    assert "below the return pressure" in page or "below zero" in page  # a remark on the run
    assert "Performance curves" in page and "limits.valve_reserve" in page  # its loads and its numbers


def test_a_bare_record_is_judged_by_the_machine_that_it_names(machine):
    own = machine.with_params({"horizontal.leakage": {"value": 5.0, "unit": "l/min/MPa"}})
    run = driven(own, np.full((600, len(machine.actuators)), 0.01))
    record = record_of_run(run, {"test": "by name"})
    page = show_report(record).page
    assert "Performance curves" in page and "limits.valve_reserve" in page and NOT_EVALUATED not in page
    assert "Limits are those of the shipped LHPOST6; the record was made with overrides: horizontal.leakage" in page
    for attrs in ({"machine": "another"}, {"specimen": "gone", "specimen_file": "gone.urdf"}):
        assert NOT_EVALUATED in show_report(record.assign_attrs(attrs)).page


def test_what_has_no_report_is_refused():
    with pytest.raises(TypeError, match="int has no report"):
        show_report(3)


def test_a_result_shows_its_report_and_the_head_of_it(machine):
    decomposed = decompose_record(machine, load_record(PRACTICE).isel(time=slice(0, 4096)), load_sensors("lhpost6"))
    run = driven(machine, np.zeros((200, len(machine.actuators))))
    for result in (decomposed, SimulatedTest(run, record_of_run(run, {"test": "rest"}))):
        page, head = result.plot().page, show_summary(result).page
        title = page[page.index("<h1>") : page.index("</h1>")]
        assert title in head and 'class="verdict' in head and 'class="tiles"' in head
        assert "<script" not in head and len(head) < 0.02 * len(page)  # a notebook keeps it for every cell
        assert result._repr_html_() == show_summary(result)._repr_html_()


def test_a_result_prints_the_head_of_its_report_and_never_its_arrays(machine):
    """Oracle: the summary in a notebook, read by the parser of the pages' tests, has every line."""
    decomposed = decompose_record(machine, load_record(PRACTICE).isel(time=slice(0, 4096)), load_sensors("lhpost6"))
    run = driven(machine, np.zeros((200, len(machine.actuators))))
    for result in (decomposed, SimulatedTest(run, record_of_run(run, {"test": "at <rest> & \u201cquiet\u201d"}))):
        lines = str(result).splitlines()
        shown = " ".join(html.unescape(re.sub(r"<[^>]*>", " ", show_summary(result).page)).split())
        assert 3 <= len(lines) <= 10 and max(map(len, lines)) < 1000
        kind, _, title = lines[0].partition(": ")
        assert kind in shown and title in shown and lines[1] in shown
        for line in lines[2:]:
            assert line.startswith("- ") and line[2:].partition(": ")[0] in shown
        assert "array(" not in str(result) and "<span" not in str(result)
        assert repr(result) == f"<{type(result).__name__}: print() gives its verdict, plot() its report>"
    assert "at <rest> & \u201cquiet\u201d" in lines[0]


def test_every_result_with_a_report_has_the_short_repr():
    """A dataclass without repr=False makes its own, which prints all arrays."""
    kinds = [kind for kind in _write.registry if issubclass(kind, Shown)]
    assert len(kinds) == 7 and all(kind.__repr__ is Shown.__repr__ for kind in kinds)
