"""Choices of the report by name: the first estimate of the inertia, the factor of test SFU's rotations, bodies."""

import json

import numpy as np
import pytest
from commands import refused

from lhpost6_pin.core.errors import MotionError, ParameterError
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.motions import find_motion, load_motion


def test_the_first_estimate_by_name_is_that_of_table_4_1():
    machine = load_machine()
    first = machine.with_inertia("first")
    assert first.platen.mass == (165750.0, 165570.0, 172380.0)
    assert first.platen.inertia == (939100.0, 2860890.0, 3508040.0)
    assert "M_eff,1" in first.parameters["platen.mass"].source
    second = first.with_inertia("second")
    assert second.platen == machine.platen
    with pytest.raises(ParameterError, match="no estimate 'third'; choose first or second"):
        machine.with_inertia("third")
    with pytest.raises(ParameterError, match="its file states no estimates of the platen's inertia"):
        load_machine("hexapod").with_inertia("first")


def test_commands_take_it_with_an_override_on_top(lhpost6, tmp_path):
    override = tmp_path / "own.toml"
    override.write_text('[platen]\nmass = { value = [1.6e5, 1.6e5, 1.7e5], unit = "kg" }\n')
    found = json.loads(lhpost6("info", "--inertia", "first", "--override", override, "--json").out)["quantities"]
    assert found["platen.mass"]["value"] == [1.6e5, 1.6e5, 1.7e5]
    assert found["platen.inertia"]["value"] == [939100.0, 2860890.0, 3508040.0]
    assert refused(lhpost6("info", "--inertia", "none"), "no estimate 'none'")


def test_info_prints_the_bodies_and_their_difference_from_the_lump(lhpost6):
    found = json.loads(lhpost6("info", "--bodies", "full", "--json").out)["moving_parts"]
    assert set(found["bodies"]) >= {"H1", "V6", "S3"} and found["bodies"]["H1"]["rod_mass"] == 3025.0
    zero, along = found["against_lump"][:2]
    assert np.abs(zero["inertia"]).max() < 1e-9 and along["displacement"][0] == 0.89
    assert 0.001 < along["mass_share"] < 0.01
    words = lhpost6("info", "--bodies", "full").words
    assert "moving parts full" in words and "Moving parts as bodies less their lump" in words
    assert "moving_parts" not in json.loads(lhpost6("info", "--json").out)
    assert refused(lhpost6("info", "--bodies", "half"), "it should be one of lumped, full")


@pytest.fixture
def sfu(tmp_path):
    time = np.arange(200) * 0.01
    wave = 0.05 * np.sin(2 * np.pi * time)
    rows = [",".join(f"{v:.6g}" for v in (t, *(w * np.arange(1, 7)))) for t, w in zip(time, wave, strict=True)]
    path = tmp_path / "sfu.csv"
    path.write_text("\n".join(["time_s,x_m,y_m,z_m,roll_rad,pitch_rad,yaw_rad", *rows]))
    return path


def test_the_rotation_factor_multiplies_the_rotations_of_a_file_alone(sfu, lhpost6):
    plain, larger = find_motion("sfu", sfu), find_motion("sfu", sfu, rotation_factor=1000.0)
    np.testing.assert_array_equal(larger.samples[:, :3], plain.samples[:, :3])
    np.testing.assert_array_equal(larger.samples[:, 3:], 1000.0 * plain.samples[:, 3:])
    assert larger.source.endswith("rotations times 1000")
    with pytest.raises(MotionError, match="rotation factor inf"):
        load_motion(sfu, rotation_factor=np.inf)
    assert refused(lhpost6("run", "sfu"), "lhpost6 run sfu FILE --rotation-factor 1000")
    assert refused(lhpost6("run", "ridgecrest", "--rotation-factor", "2"), "are for motions from files")
    assert refused(lhpost6("run", sfu, "--rotation-factor", "1e9"), "exceeds")


def test_a_file_without_rotations_has_none_to_multiply(tmp_path):
    path = tmp_path / "flat.csv"
    path.write_text("time_s,x_m\n" + "\n".join(f"{0.01 * k},{0.001 * k}" for k in range(50)))
    with pytest.raises(MotionError, match="has no rotations to multiply by 1000; leave --rotation-factor out"):
        load_motion(path, rotation_factor=1000)
