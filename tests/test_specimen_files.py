"""Files of specimens: what they state is read back, and what is wrong is refused with file and entry."""

import tomllib

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import savemat
from scipy.linalg import eigh

from lhpost6_pin.core.errors import ParameterError, UnknownNameError
from lhpost6_pin.core.files import models_folder, shipped_specimens
from lhpost6_pin.interfaces.fmi.machine_file import load_machine_file, save_machine_file
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.machine.quantity import EVIDENCE
from lhpost6_pin.machine.specimen import Specimen
from lhpost6_pin.machine.specimen_file import read_specimen
from lhpost6_pin.machine.specimen_forms import Point, RigidBody, influence_of, rigid_body_of, spatial_inertia
from lhpost6_pin.machine.specimen_matrices import Matrices, modes_of
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.show.bodies import load_specimen_bodies, specimen_poses

M = np.diag([20e3, 20e3, 20e3])
K = 25e6 * np.array([[2.0, -1, 0], [-1, 2, -1], [0, -1, 1]])
C = 63550 / 25e6 * K

MASS = """
[mass]
mass = { value = 65.0, unit = "t" }
centre_of_gravity = { value = [0, 0, 5.7], unit = "m" }
inertia = { value = [6.3e5, 6.3e5, 1.9e5], unit = "kg m2" }
"""
MODES = """
[modes]
frequency = { value = [2.5, 7.0], unit = "Hz" }
damping = { value = [0.02], unit = "1" }
participation = { value = [[200, 0, 0, 0, 1300, 0], [50, 0, 0, 0, 60, 0]], unit = "sqrt(kg)" }
"""
MATRICES = """
[matrices]
mass = { value = [[20, 0], [0, 20]], unit = "t" }
stiffness = { value = [[50, -25], [-25, 25]], unit = "kN/mm" }
damping_ratio = { value = [0.02], unit = "1" }

[[point]]
name = "1F"
direction = "x"
at = { value = [0, 0, 3.0], unit = "m" }

[[point]]
name = "2F"
direction = "x"
at = { value = [0, 0, 6.0], unit = "m" }
"""


def written(folder, text, name="own.toml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


# ---------------------------------------------------------------------------------------- what is read
def test_every_number_of_the_shipped_specimens_has_unit_evidence_and_source():
    seen = 0

    def walk(entry, where):
        nonlocal seen
        if isinstance(entry, dict) and "value" in entry:
            seen += 1
            assert entry["unit"] and entry["evidence"] in EVIDENCE and entry["source"], where
        elif isinstance(entry, dict | list):
            for key, inner in entry.items() if isinstance(entry, dict) else enumerate(entry):
                walk(inner, f"{where}.{key}")
        else:
            assert isinstance(entry, str), where

    for path in (models_folder() / "specimens").glob("*.toml"):
        walk(tomllib.loads(path.read_text(encoding="utf-8")), path.name)
    assert seen > 20


def test_all_shipped_specimens_stand_on_the_table():
    assert {"block_4_9MN", "pendulum", "shear_frame", "shear_frame_joints", "tall_column"} <= set(shipped_specimens())
    for name, path in shipped_specimens().items():
        machine = load_machine().with_specimen(name)
        assert machine.specimen.name == name and machine.specimen.file == path
        make_plant(machine)
    with pytest.raises(UnknownNameError, match=r"no specimen named 'block'.*block_4_9MN"):
        load_machine().with_specimen("block")


def test_the_block_weighs_the_payload_of_table_2_2():
    body = load_machine().with_specimen("block_4_9MN").specimen.contents.body
    assert body.mass * 9.80665 == pytest.approx(4.9e6, rel=1e-6)


def test_the_same_matrices_from_toml_npz_and_mat_are_the_same_modes(tmp_path):
    rows = {"M": M, "C": C, "K": K}
    np.savez(tmp_path / "arrays.npz", **rows)
    savemat(tmp_path / "arrays.mat", rows)
    points = "".join(
        f'[[point]]\nname = "{k}F"\ndirection = "x"\nat = {{ value = [0, 0, {3 * k}], unit = "m" }}\n'
        for k in (1, 2, 3)
    )
    named = "\n".join(
        f'{key} = {{ variable = "{v}", unit = "{unit}" }}'
        for key, v, unit in (("mass", "M", "kg"), ("damping", "C", "N s/m"), ("stiffness", "K", "N/m"))
    )
    found = []
    for suffix in (".npz", ".mat"):
        text = f'{MASS}\n[matrices]\nfile = "arrays{suffix}"\n{named}\n{points}'
        found.append(read_specimen(written(tmp_path, text)))
    lists = "\n".join(
        f"{key} = {{ value = {(a / scale).tolist()}, unit = '{unit}' }}"
        for key, a, scale, unit in (
            ("mass", M, 1e3, "t"),
            ("damping", C, 1e6, "kN s/mm"),
            ("stiffness", K, 1e6, "kN/mm"),
        )
    )
    found.append(read_specimen(written(tmp_path, f"{MASS}\n[matrices]\n{lists}\n{points}")))
    wanted = np.sqrt(eigh(K, M, eigvals_only=True))
    for contents in found:
        np.testing.assert_allclose(contents.modes.frequency, wanted, rtol=1e-12)
        np.testing.assert_allclose(abs(contents.modes.participation), abs(found[0].modes.participation), rtol=1e-9)
        np.testing.assert_allclose(
            contents.modes.damping, 63550 / 25e6 * np.diag(wanted**2), atol=1e-9 * wanted[-1] ** 2
        )
        assert [p.name for p in contents.points] == ["1F", "2F", "3F"]


def test_matrices_alone_in_npz_with_the_influence_of_all_directions(tmp_path):
    """Every mass moves in x, y and z: R^T M R is a rigid body's inertia, and nothing else needs stating."""
    at = [(0.0, 0.0, 3.0), (1.0, 0.5, 5.0), (-1.0, 0.5, 6.0), (0.3, -1.0, 4.0)]
    points = tuple(Point(f"{k}{d}", place, d) for k, place in enumerate(at) for d in "xyz")
    mass = np.repeat([4e3, 3e3, 2e3, 1e3], 3)
    stiffness = np.diag(mass) * 400.0 + 1e4 * np.ones((12, 12))
    np.savez(tmp_path / "masses.npz", M=np.diag(mass), K=stiffness, R=influence_of(points))
    contents = read_specimen(tmp_path / "masses.npz")
    centre = np.average(at, axis=0, weights=mass[::3])
    assert contents.body.mass == pytest.approx(1e4) and contents.points == ()
    np.testing.assert_allclose(contents.body.centre, centre, rtol=1e-12)
    whole = contents.modes.participation.T @ contents.modes.participation
    np.testing.assert_allclose(whole, spatial_inertia(contents.body), rtol=1e-9, atol=1e-6)  # all modes: all the mass


def test_degrees_of_freedom_without_mass_follow_statically():
    """A frame with massless rotations against the same frame condensed by hand."""
    ei, length = 2e8, 3.0
    a, b, c = 12 * ei / length**3, 6 * ei / length**2, 4 * ei / length
    k = np.array([[a, -b], [-b, c]])
    given_ = Matrices(np.diag([5e3, 0.0]), k, None, np.eye(2, 6))
    modes = modes_of(given_, np.inf, "x")
    np.testing.assert_allclose(modes.frequency, [np.sqrt((a - b * b / c) / 5e3)], rtol=1e-12)
    np.testing.assert_allclose(abs(modes.participation[0, 0]), np.sqrt(5e3), rtol=1e-12)


def test_modes_above_the_highest_frequency_stay_with_the_rigid_body(tmp_path):
    text = MASS + MATRICES.replace("damping_ratio", 'highest_frequency = { value = 5.0, unit = "Hz" }\ndamping_ratio')
    modes = read_specimen(written(tmp_path, text)).modes
    whole = read_specimen(written(tmp_path, MASS + MATRICES)).modes
    assert len(modes.frequency) == 1 and len(whole.frequency) == 2
    np.testing.assert_allclose(modes.frequency, whole.frequency[:1])


@given(st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3), st.floats(1.0, 1e6), st.integers(0, 2**32 - 1))
def test_a_rigid_body_is_recovered_from_its_spatial_inertia(centre, mass, seed):
    root = np.random.default_rng(seed).normal(size=(3, 3))
    body = RigidBody(mass, tuple(centre), mass * (root @ root.T + 0.1 * np.eye(3)))
    found = rigid_body_of(spatial_inertia(body), "x")
    assert found.mass == pytest.approx(mass)
    np.testing.assert_allclose(found.centre, centre, atol=1e-9)
    np.testing.assert_allclose(found.inertia, body.inertia, rtol=1e-9, atol=1e-9 * mass)


def test_files_of_a_specimen_are_those_that_describe_it(tmp_path):
    assert [p.name for p in Specimen(shipped_specimens()["shear_frame_joints"]).files] == [
        "shear_frame_joints.urdf",
        "shear_frame_joints.toml",
    ]
    assert [p.name for p in Specimen(shipped_specimens()["pendulum"]).files] == ["pendulum.urdf"]
    np.savez(tmp_path / "a.npz", M=M)
    path = written(tmp_path, MASS + MODES.replace("[modes]", '[modes]\nfile = "a.npz"'))
    assert [p.name for p in Specimen(path).files] == ["own.toml", "a.npz"]


def test_a_machine_s_files_carry_those_of_its_specimen(tmp_path):
    np.savez(tmp_path / "arrays.npz", K=K)
    stiffness = 'stiffness = { variable = "K", unit = "N/m" }'
    points = "".join(f'[[point]]\ndirection = "x"\nat = {{ value = [0, 0, {3 * k}], unit = "m" }}\n' for k in (1, 2, 3))
    mass = f'mass = {{ value = {M.tolist()}, unit = "kg" }}'
    path = written(tmp_path, f'{MASS}[matrices]\nfile = "arrays.npz"\n{mass}\n{stiffness}\n{points}')
    machine = load_machine().with_specimen(path, (0.1, 0.2, 0.3))
    away = tmp_path / "away"
    away.mkdir()
    files = save_machine_file(machine, away)
    assert {f.name for f in files} == {"machine.json", "own.toml", "arrays.npz"}
    back = load_machine_file(away)[0]
    assert back.specimen.file == away / "own.toml" and back.specimen.position == (0.1, 0.2, 0.3)
    np.testing.assert_array_equal(make_plant(machine).modes, make_plant(back).modes)


@pytest.mark.parametrize("name", ["block_4_9MN", "pendulum", "shear_frame", "shear_frame_joints", "tall_column"])
def test_every_form_is_drawn_on_the_platen(name):
    bodies = load_specimen_bodies(load_machine().with_specimen(name, (1.0, 0.0, 0.0)))
    poses = specimen_poses(bodies, {}, 1)[0]
    assert len(bodies.shapes) >= 1
    for shape in bodies.shapes:
        placed = pin.XYZQUATToSE3(poses[shape.parentJoint]) * shape.placement
        assert 0.0 <= placed.translation[0] <= 2.0 and placed.translation[2] > 0.0  # above B, about its base


def test_floors_of_a_modal_specimen_sway_as_its_points_do():
    machine = load_machine().with_specimen("shear_frame", (1.0, 0.0, 0.0), (0.0, 0.0, np.pi / 2))
    bodies, points = load_specimen_bodies(machine), machine.specimen.contents.points
    still, moved = (
        specimen_poses(bodies, {p.name: np.array([s * k]) for k, p in enumerate(points, 1)}, 1)[0] for s in (0.0, 0.01)
    )
    for k, point in enumerate(points, 1):
        assert point.direction == "x"
        joint = bodies.model.getJointId(point.name)
        # along x of the base, which is y of the platen
        np.testing.assert_allclose(moved[joint, :3] - still[joint, :3], [0.0, 0.01 * k, 0.0], atol=1e-12)
        assert [shape.parentJoint for shape in bodies.shapes].count(joint) == 1


# ---------------------------------------------------------------------------------------- what is refused
def changed(text, old, new):
    assert old in text
    return text.replace(old, new, 1)


REFUSED = {
    "no section": ("", r"own\.toml: \[mass\] is missing"),
    "not TOML": ("[mass", r"own\.toml: not a TOML file"),
    "unknown section": (MASS + "[mas]\n", r"own\.toml: unknown section mas; did you mean 'mass'"),
    "unknown key": (changed(MASS, "inertia", "inertias"), r"own\.toml: mass: unknown inertias"),
    "no unit": (changed(MASS, '{ value = 65.0, unit = "t" }', "65.0"), r"own\.toml: mass: mass has no unit"),
    "wrong unit": (changed(MASS, '"t"', '"m"'), r"own\.toml: mass: mass: unit 'm' cannot be converted to 'kg'"),
    "no mass": (changed(MASS, "65.0", "0.0"), r"own\.toml: mass: mass should be positive"),
    "inertia": (changed(MASS, "[6.3e5, ", "["), r"own\.toml: mass: inertia has 2 numbers; it should have 3 or 6"),
    "negative": (changed(MASS, "1.9e5", "-1.9e5"), r"own\.toml: mass: .*no principal moment of inertia negative"),
    "both": (MASS + MODES + MATRICES, r"own\.toml: state \[modes\] or \[matrices\], not both"),
    "modes without mass": (MODES, r"own\.toml: \[mass\] is missing"),
    "participation": (
        MASS + changed(MODES, "sqrt(kg)", "kg"),
        r"own\.toml: modes\.participation: unit 'kg' cannot be converted",
    ),
    "shape": (
        MASS + changed(MODES, ", 1300, 0]", ", 1300]"),
        r"own\.toml: modes\.participation: its rows should be numb",
    ),
    "count": (
        MASS + changed(MODES, "[2.5, 7.0]", "[2.5]"),
        r"own\.toml: modes: participation has shape \(2, 6\); give 1",
    ),
    "frequency": (MASS + changed(MODES, "2.5", "-2.5"), r"own\.toml: modes: frequency should be positive"),
    "infinite": (MASS + changed(MODES, "2.5", "inf"), r"own\.toml: modes\.frequency: a number is not finite"),
    "too much": (MASS + changed(MODES, "[[200,", "[[300,"), r"own\.toml: the modes' participation takes more inertia"),
    "variable": (
        MASS + changed(MODES, "value = [2.5, 7.0]", 'variable = "f"'),
        r"own\.toml: modes\.frequency: no variable 'f'",
    ),
    "no file": (MASS + changed(MODES, "[modes]", '[modes]\nfile = "b.npz"'), r"b\.npz: no such file of arrays"),
    "matrices no body": (MATRICES, r"own\.toml: matrices: the masses .* 4e\+04, 0, 0 kg .*those of no rigid body"),
    "asymmetric": (
        MASS + changed(MATRICES, "[[50, -25]", "[[50, -20]"),
        r"own\.toml: matrices: stiffness is not symmetric",
    ),
    "unstable": (MASS + changed(MATRICES, "[-25, 25]", "[-25, 5]"), r"own\.toml: matrices: stiffness has the negative"),
    "free": (MASS + changed(MATRICES, "[[50,", "[[25,"), r"own\.toml: matrices: stiffness is not positive definite"),
    "one point": (MASS + MATRICES.rsplit("[[point]]", 1)[0], r"own\.toml: 1 points for 2 rows of the stiffness"),
    "no influence": (MASS + MATRICES.split("[[point]]")[0], r"own\.toml: matrices: influence is missing"),
    "direction": (MASS + changed(MATRICES, '"x"', '"w"'), r"own\.toml: point 1: direction = 'w'"),
    "twice": (MASS + changed(MATRICES, '"2F"', '"1F"'), r"own\.toml: two points are named '1F'"),
    "rotation": (MASS + changed(MATRICES, '"x"', '"ry"'), r"own\.toml: matrices: mass in t; with rotations .* in SI"),
    "ratio": (MASS + changed(MATRICES, "[0.02]", "[0.02, 0.02, 0.02]"), r"own\.toml: matrices: damping_ratio has 3"),
    "modal per cent": (
        MASS + MODES.replace("0.02", "2"),
        r"own\.toml: modes\.damping: 2 of critical damping; .*unit = '%'",
    ),
    "per cent": (
        MASS + changed(MATRICES, "[0.02]", "[2]"),
        r"own\.toml: matrices\.damping_ratio: 2 of critical damping; .*unit = '%'",
    ),
    "below all": (
        MASS + changed(MATRICES, "damping_ratio", 'highest_frequency = { value = 1, unit = "Hz" }\ndamping_ratio'),
        r"own\.toml: matrices: highest_frequency 1 Hz is below all modes, the first of 3\.478 Hz",
    ),
    "joints": (
        '[joint.a]\nstiffness = { value = 1.0, unit = "N/m" }\n',
        r"own\.toml: \[joint\] states springs of a URDF",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_wrong_file_is_refused_with_file_and_entry(case, tmp_path):
    text, message = REFUSED[case]
    with pytest.raises(ParameterError, match=message):
        read_specimen(written(tmp_path, text))


@pytest.mark.parametrize(
    ("text", "entry"),
    [
        (MASS + MODES.replace("0.02", "0.4"), "modes.damping"),
        (MASS + changed(MATRICES, "[0.02]", "[0.4]"), "matrices.damping_ratio"),
    ],
)
def test_damping_beyond_that_of_structures_is_warned_of_and_per_cent_are_read(text, entry, tmp_path, caplog):
    as_ratio = read_specimen(written(tmp_path, text.replace("0.4", "0.3")))
    in_per_cent = text.replace("0.4", "30").replace('unit = "1" }', 'unit = "%" }', 1)
    modes = read_specimen(written(tmp_path, in_per_cent)).modes
    assert np.allclose(modes.damping, as_ratio.modes.damping, rtol=1e-12) and not caplog.messages
    read_specimen(written(tmp_path, text))
    (said,) = caplog.messages
    assert f"own.toml: {entry}: 0.4 of critical damping" in said and "unit = '%'" in said


@pytest.mark.parametrize("name", ["broken.npz", "broken.mat"])
def test_a_broken_file_of_arrays_is_refused(name, tmp_path):
    (tmp_path / name).write_bytes(b"no array in here")
    with pytest.raises(ParameterError, match=f"{name}: cannot be read"):
        read_specimen(tmp_path / name)
    with pytest.raises(ParameterError, match=r"absent\.npz: no such specimen file"):
        read_specimen(tmp_path / "absent.npz")


@given(st.data())
def test_no_change_of_one_word_of_a_file_ends_in_another_error(data):
    """Any file is read, or refused as a ParameterError."""
    import tempfile
    from pathlib import Path

    words = (MASS + MATRICES).split(" ")
    k = data.draw(st.integers(0, len(words) - 1))
    words[k] = data.draw(st.sampled_from(["", "0", "-1", "nan", "1e400", "[]", "[[1]]", '"x"', "true", "{}", "\n"]))
    with tempfile.TemporaryDirectory() as folder:
        path = written(Path(folder), " ".join(words))
        try:
            contents = read_specimen(path)
        except ParameterError as error:
            assert "own.toml" in str(error)
        else:
            assert contents.body.mass > 0.0


JOINTS = '[joint.storey_1]\nstiffness = { value = 25, unit = "MN/m" }\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (changed(JOINTS, "storey_1", "storey_9"), r"frame\.toml: joint\.storey_9: no such joint .*storey_1"),
        (changed(JOINTS, "25,", "-25,"), r"frame\.toml: joint\.storey_1: stiffness and damping should be zero or pos"),
        (changed(JOINTS, "stiffness", "spring"), r"frame\.toml: joint\.storey_1: unknown spring"),
        (changed(JOINTS, "MN/m", "MN"), r"frame\.toml: joint\.storey_1: stiffness: unit 'MN' cannot be converted"),
        ("[joint]\nstorey_1 = 3\n", r"frame\.toml: joint should be sections \[joint\.NAME\]"),
    ],
)
def test_wrong_springs_beside_a_urdf_are_refused(text, message, tmp_path):
    urdf = shipped_specimens()["shear_frame_joints"].read_text(encoding="utf-8")
    path = written(tmp_path, urdf, "frame.urdf")
    written(tmp_path, text, "frame.toml")
    with pytest.raises(ParameterError, match=message):
        make_plant(load_machine().with_specimen(path))
