"""Controller settings as files: what comes back, what is refused and how, and never half a file."""

import re
import tomllib
from dataclasses import fields, replace
from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lhpost6_pin.control import ControllerSettings, Notch, load_controller, save_controller
from lhpost6_pin.core.errors import ParameterError, UnknownNameError
from lhpost6_pin.core.files import models_folder

PANELS = models_folder() / "controllers"
TEXT = (PANELS / "lhpost6.toml").read_text(encoding="utf-8")


@pytest.fixture
def file(tmp_path):
    def write(text):
        path = tmp_path / "panel.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize("path", sorted(PANELS.glob("*.toml")), ids=lambda path: path.stem)
def test_every_shipped_panel_comes_back_from_disk_with_its_numbers_evidence_and_sources(path, tmp_path):
    settings = load_controller(path.stem)
    again = load_controller(save_controller(settings, tmp_path / "copy.toml", changed="nothing is"))
    assert again == settings
    assert dict(again.stated) == dict(settings.stated)  # unit, evidence and source of each, not only its value


def test_a_number_that_was_changed_is_calibrated_and_says_by_whom(tmp_path):
    settings = load_controller("untuned")
    notch = replace(settings.notches[0], depth=(-0.5,) * 6)
    changed = replace(settings, displacement_gain=(6.0,) * 6, force_cut_in=0.7, notches=(notch, *settings.notches[1:]))
    again = load_controller(save_controller(changed, tmp_path / "a.toml", changed="a test"))
    assert again == changed
    for key in ("feedback.displacement_gain", "force.force_cut_in", "notch_1.depth"):
        assert (again.stated[key].evidence, again.stated[key].source) == ("calibrated", "a test")
    kept = set(settings.stated) - {"feedback.displacement_gain", "force.force_cut_in", "notch_1.depth"}
    assert all(again.stated[key] == settings.stated[key] for key in kept)


def test_numbers_of_numpy_and_texts_with_quotes_come_back_too(tmp_path):
    said = 'a "quoted"\\path\nand a second line'
    changed = replace(load_controller("untuned"), name=said, master_gain=tuple(np.linspace(0.5, 1.0, 6)))
    again = load_controller(save_controller(changed, tmp_path / "a.toml", changed=said))
    assert again.name == said and again.stated["loop.master_gain"].source == said
    assert again == changed


six = st.tuples(*[st.floats(0.01, 900.0)] * 6)


@given(six, st.lists(st.tuples(six, six, six), max_size=5), st.sampled_from(["acceleration", "velocity"]))
def test_any_settings_come_back_to_the_last_bit(tmp_path_factory, gain, notches, mode):
    changed = replace(
        load_controller("untuned"), displacement_gain=gain, mode=mode, notches=tuple(Notch(*n) for n in notches)
    )
    path = tmp_path_factory.mktemp("panel") / "a.toml"
    assert load_controller(save_controller(changed, path, changed="a test")) == changed


def test_a_panel_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ParameterError, match=r"absent.toml: no such file of controller settings"):
        load_controller(tmp_path / "absent.toml")


def test_an_unknown_panel_is_answered_with_the_names_that_exist():
    names = "biaxial, cautious, hexapod, lhpost6, uniaxial, untuned"
    with pytest.raises(UnknownNameError, match=f"no controller settings named 'nobody'; valid names: {names}"):
        load_controller("nobody")


@pytest.mark.parametrize("name", [f.name for f in fields(ControllerSettings) if f.metadata])
def test_a_missing_number_is_named_with_its_file(file, name):
    path = file(re.sub(rf"\n{name} = .*", "", TEXT))
    with pytest.raises(ParameterError, match=rf"panel.toml: \w+\.{name} is missing"):
        load_controller(path)


@pytest.mark.parametrize(
    "before, old, new, message",
    [
        ("balance_gain = { value = ", "3.0", "-3.0", "force.balance_gain: -3.0 is impossible"),
        ("spool_limit = { value = ", "1.0", "1.2", "loop.spool_limit: 1.2 is impossible"),
        ("force_cut_in = { value = 0.5, unit = ", '"Hz"', '"s"', "unit 's' should be"),
        ("master_gain = { value = [", "1.0, ", "", "loop.master_gain: .* should be 6 numbers"),
        ("force_cut_in = { value = ", "0.5", "[0.5]", "force.force_cut_in: .* should be one number"),
        ("force_cut_in = { value = ", "0.5", "nan", "force.force_cut_in: value nan is not finite"),
        ("", 'mode = "acceleration"', 'mode = "jerk"', "mode 'jerk' is not one of acceleration, velocity, disp"),
        ("", 'mode = "acceleration"', "", "mode '' is not one of"),
        ("crossover = { value = [", "1.0", "1024.0", "crossover must lie below half the controller"),
        ("_low_pass = { value = [", "200.0", "1100.0", "reference_low_pass must lie below half"),
        ("force_cut_in = { value = ", "0.5", "1024.0", "force_cut_in must lie below half"),
        ("frequency = { value = [", "100.0", "2000.0", "notch_1.frequency must lie below half"),
        ("bandwidth = { value = [", "10.0", "0.0", "notch_1.bandwidth: .* is impossible"),
        ("", "[notch_5]", "[notch_6]", r"no place for \[notch_6\]; .* there are notches, numbered from notch_1"),
        ("", "[notch_1]", "[noch_1]", r"no place for \[noch_1\]"),
        ("", "[loop]", "[loop", "not a TOML file"),
        ("", "balance_gain = {", "balance_gian = {", "force.balance_gian is not .*; did you mean 'force.balan"),
        ("[force]\n", "", 'lag = { value = 1.0, unit = "s", evidence = "assumed", source = "x" }\n', "force.lag is no"),
        ("[controller]\n", "", 'comment = "mine"\n', "controller.comment is not a controller setting"),
        ("_high_pass = { value = [", "0.05", "300.0", "high_pass must lie below reference_low_pass"),
        ("depth = { value = [", "0.0", "-1.5", "notch_1.depth is below -1"),
    ],
)
def test_a_panel_that_cannot_be_is_refused_by_file_and_key(file, before, old, new, message):
    assert before + old in TEXT
    with pytest.raises(ParameterError, match=f"panel.toml: .*{message}"):
        load_controller(file(TEXT.replace(before + old, before + new, 1)))


def test_a_write_that_fails_leaves_what_was_there(tmp_path, monkeypatch):
    path = save_controller(load_controller("untuned"), tmp_path / "panel.toml", changed="a test")
    before = path.read_bytes()
    broken = replace(load_controller("untuned"), rate=complex(1.0, 2.0))
    with pytest.raises(TypeError):
        save_controller(broken, path, changed="a test")
    monkeypatch.setattr("pathlib.Path.write_text", mock.Mock(side_effect=OSError("disk full")))
    with pytest.raises(OSError, match="disk full"):
        save_controller(load_controller("untuned"), tmp_path / "other.toml", changed="a test")
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]


def test_shipped_numbers_that_a_tuning_found_say_so():
    stated = tomllib.loads(TEXT)
    for section, name in (("feedback", "displacement_gain"), ("force", "force_damping")):
        assert stated[section][name]["evidence"] == "calibrated"
        assert stated[section][name]["source"].startswith("lhpost6 tune")
