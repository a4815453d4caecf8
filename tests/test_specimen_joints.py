"""Specimens: what speaks against them is said before a run, what their joints did after it."""

import numpy as np
import pytest

from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.plant import Plant, make_plant
from lhpost6_pin.mechanics.specimen_joints import joints_beyond, specimen_doubts, specimen_joints, specimen_positions

URDF = """<robot name="tower">
  <link name="base">
    <inertial><mass value="{mass}"/><inertia ixx="4e4" iyy="4e4" izz="4e4" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="hinge" type="revolute">
    <parent link="base"/><child link="arm"/><origin xyz="0 0 3"/><axis xyz="0 1 0"/>
    <limit lower="-0.1" upper="0.2" effort="0" velocity="1"/><dynamics friction="{friction}" damping="100"/>
  </joint>
  <link name="arm">
    <inertial><origin xyz="0 0 -2"/><mass value="500"/>
      <inertia ixx="20" iyy="25" izz="10" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="turntable" type="continuous">
    <parent link="base"/><child link="slider"/><origin xyz="0 0 4"/><axis xyz="0 0 1"/>
  </joint>
  <link name="slider">
    <inertial><mass value="10"/><inertia ixx="2" iyy="2" izz="2" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="lift" type="prismatic">
    <parent link="slider"/><child link="load"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="0" velocity="1"/>
  </joint>
  <link name="load">
    <inertial><mass value="10"/><inertia ixx="2" iyy="2" izz="2" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
</robot>
"""


@pytest.fixture
def tower(tmp_path):
    """Writes a specimen and returns the plant that carries it."""

    def make(mass: float = 2e4, friction: float = 0.0, at=(0.0, 0.0, 0.0), locked: bool = False) -> Plant:
        path = tmp_path / "tower.urdf"
        path.write_text(URDF.format(mass=mass, friction=friction))
        return make_plant(load_machine().with_specimen(path, at, locked=locked))

    return make


def test_a_specimen_that_the_table_can_carry_raises_no_doubt(tower, plant):
    assert specimen_doubts(plant) == specimen_doubts(tower()) == specimen_doubts(tower(locked=True)) == []


def test_weight_place_and_friction_that_speak_against_a_specimen_are_said(tower):
    capacity = 20e6 / load_machine().platen.gravity - 520.0  # payload of Table 2.2 less the moving links
    assert specimen_doubts(tower(mass=0.999 * capacity)) == []
    (heavy,) = specimen_doubts(tower(mass=1.01 * capacity))
    assert "more than the payload of 20 MN" in heavy
    assert specimen_doubts(tower(at=(6.0, -3.7, 0.0))) == []
    (beside,) = specimen_doubts(tower(at=(0.0, 3.9, 0.0)))
    assert "beside the platen, which is 12.2 by 7.6 m" in beside
    (rubs,) = specimen_doubts(tower(friction=3.0))
    assert "friction of hinge" in rubs
    assert specimen_doubts(tower(friction=3.0, locked=True)) == []  # no joint is left to rub


def test_joints_have_their_names_units_and_unwrapped_positions(tower):
    loaded = tower()
    joints = specimen_joints(loaded)
    assert [(j.name, j.unit) for j in joints] == [("hinge", "rad"), ("turntable", "rad"), ("lift", "m")]
    turned = np.linspace(0.0, 12.0, 50)  # almost two turns
    q = np.tile(loaded.zero_state().q, (50, 1))
    for joint, values in zip(joints, (0.1 * turned, turned, 0.05 * turned), strict=True):
        cosine = len(joint.places) == 2
        q[:, list(joint.places)] = np.stack([np.cos(values), np.sin(values)], axis=1) if cosine else values[:, None]
    expected = np.stack([0.1 * turned, turned, 0.05 * turned], axis=1)
    np.testing.assert_allclose(specimen_positions(loaded, q), expected, rtol=0.0, atol=1e-12)  # rounding
    (beyond,) = joints_beyond(loaded, np.arange(50.0), q)
    assert beyond.startswith("specimen joint hinge went to 1.2 rad at 49.00 s, beyond -0.1 to 0.2 rad")
    assert joints_beyond(loaded, np.arange(8.0), q[:8]) == []


def test_a_run_warns_before_and_reports_what_the_joints_did(lhpost6, tower, tmp_path, caplog):
    tower(friction=3.0)
    asked = ("run", "sine", "--set", "amplitude=0.005", "--set", "cycles=1", "--rate", "2048")
    assert lhpost6(*asked, "--specimen", "tower.urdf", "--out", tmp_path).code == 0
    assert "friction of hinge is in its URDF and not simulated" in caplog.text
    page = (tmp_path / "report.html").read_text()
    assert "Specimen joints over time" in page and "friction of hinge" in page and "specimen joint lift" in page
