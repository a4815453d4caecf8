"""Reports of results in a notebook."""

import pytest
from machine_cases import PRACTICE

from lhpost6_pin.data.records import load_record
from lhpost6_pin.data.sensors import load_sensors
from lhpost6_pin.identification.decompose import decompose_record
from lhpost6_pin.show.notebook import _write, show_report


def test_a_record_and_its_decomposition_are_shown_as_their_reports(machine, tmp_path):
    record = load_record(PRACTICE).isel(time=slice(0, 4096))
    for result, kind in (
        (record, "Run report"),
        (decompose_record(machine, record, load_sensors("lhpost6")), "Inverse dynamics"),
    ):
        picture = show_report(result)
        assert kind in picture.page and "iframe" in picture._repr_html_()
        picture.save(tmp_path / "page.html")
        assert (tmp_path / "page.html").read_text(encoding="utf-8") == picture.page


def test_what_has_no_report_is_refused_and_every_result_has_one():
    with pytest.raises(TypeError, match="int has no report"):
        show_report(3)
    names = {kind.__name__ for kind in _write.registry}
    assert {"SimulatedTest", "Calibration", "Validation", "Discovery", "Tuning", "Iterated", "SineTest"} <= names
