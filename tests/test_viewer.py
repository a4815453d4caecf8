"""The machine's bodies to look at: they follow the record, from a page that loads nothing and from loopback only."""

import asyncio
import json
import logging
import re
import shutil
import socket
import subprocess
import sys
from http.client import HTTPConnection
from importlib import util
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import umsgpack
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from tornado.websocket import websocket_connect

from lhpost6_pin.bodies import body_name, body_poses, joint_positions, load_bodies
from lhpost6_pin.errors import LhpostError, ParameterError, RecordError
from lhpost6_pin.files import models_folder
from lhpost6_pin.machine import Machine, load_machine
from lhpost6_pin.plant import make_plant
from lhpost6_pin.pose import leg_displacements, rotation
from lhpost6_pin.records import AXES, load_record, make_record
from lhpost6_pin.rigid_body import lumped_inertia
from lhpost6_pin.urdf import drawing_sizes, legs, urdf_text
from lhpost6_pin.viewer import draw_animation, live_animation, make_frames, record_frames, save_animation
from lhpost6_pin.viewer_page import LoopbackWindow, Recorder

RECORD = Path(__file__).parent / "data" / "records" / "practice_a_EQ_ridgecrest2019_ccc.nc"
SCRIPTS = Path(__file__).parents[1] / "scripts"
TRAVEL = np.array([0.6, 0.38, 0.127, 0.038, 0.025, 0.066])  # [m, rad] most of Table 2.2, legs within their lengths


@pytest.fixture(scope="module")
def machine() -> Machine:
    return load_machine()


@pytest.fixture(scope="module")
def bodies(machine):
    return load_bodies(machine)


@pytest.fixture(scope="module")
def poses():
    return np.random.default_rng(6).uniform(-TRAVEL, TRAVEL, (200, 6))


def link_poses(bodies, machine, poses) -> dict[str, list[pin.SE3]]:
    """Placement in {s} of every link at every pose."""
    data = bodies.model.createData()
    out: dict[str, list[pin.SE3]] = {f.name: [] for f in bodies.model.frames}
    for q in joint_positions(machine, bodies.model, poses):
        pin.framesForwardKinematics(bodies.model, data, q)
        for frame, placement in zip(bodies.model.frames, data.oMf, strict=True):
            out[frame.name].append(placement.copy())
    return out


# --------------------------------------------------------------------------------------------------- URDF
def test_the_urdf_has_a_link_for_the_platen_and_for_every_barrel_and_rod(machine, bodies):
    links = {f.name for f in bodies.model.frames if f.type == pin.FrameType.BODY}
    names = [leg.name for leg in legs(machine)]
    assert len(names) == 13
    assert {"platen"} | {f"{n}_{part}" for n in names for part in ("barrel", "rod")} <= links
    assert {f"{a.name}_plate" for a in machine.actuators if a.mount == "bearing"} <= links


def test_the_shipped_urdf_is_what_the_shipped_machine_gives(machine):
    shipped = models_folder() / "lhpost6.urdf"
    assert shipped.read_text() == urdf_text(machine), "run scripts/make_urdf.py"
    assert pin.buildModelFromUrdf(str(shipped)).existBodyName("H1_rod")


def test_all_joints_are_zero_in_the_control_zero_position(machine, bodies):
    q = joint_positions(machine, bodies.model, np.zeros((1, 6)))[0]
    assert np.abs(q - pin.neutral(bodies.model)).max() < 1e-14  # rounding of 15 printed digits over 5 m


def test_moving_parts_and_platen_alone_compose_to_the_effective_mass_of_table_4_1(machine, bodies):
    model, data = bodies.model, bodies.model.createData()
    neutral = pin.neutral(model)
    M = pin.crba(model, data, neutral)
    M = np.triu(M) + np.triu(M, 1).T
    h = 1e-4  # central differences of lengths of order 1 m: error h^2 = 1e-8
    lever = -np.array(machine.platen.centre_of_gravity)
    G = np.zeros((model.nv, 6))  # joint rates per twist of the platen at B
    for k in range(6):
        step = h * np.eye(6)[k]  # at zero Euler angles their rates are the angular velocity
        step[:3] += np.cross(step[3:], lever)
        ends = joint_positions(machine, model, np.stack([step, -step]))
        G[:, k] = (pin.difference(model, neutral, ends[0]) - pin.difference(model, neutral, ends[1])) / (2 * h)
    alone = [machine.parameters[f"estimates.platen_alone.{what}"].value for what in ("mass", "inertia")]
    lumped = sum(lumped_inertia(*alone, machine).values())
    difference = G.T @ M @ G - lumped
    assert np.abs(difference).max() < 1e-7 * np.abs(lumped).max()
    # and so the printed first estimate, to the rounding of the table's contributions: 10 kg each
    first = machine.parameters["estimates.first.mass"].value
    np.testing.assert_allclose(np.diag(G.T @ M @ G)[:3], first, atol=30.0)


def test_bodies_stay_what_they_are_when_an_override_moves_a_swivel(machine):
    moved = machine.with_params({"H1.base_point": [10.5, 3.9, -1.3]})
    at = link_poses(load_bodies(moved), moved, np.zeros((1, 6)))["H1_barrel"][0]
    np.testing.assert_allclose(at.translation, [10.5, 3.9, -1.3], atol=1e-12)


def test_every_drawn_size_is_a_ratio_that_says_it_is_assumed():
    assert {(q.unit, q.evidence) for q in drawing_sizes().values()} == {("1", "assumed")}


def test_a_table_with_one_guided_actuator_has_bodies_too():
    uniaxial = load_machine("uniaxial")
    (actuator,) = uniaxial.actuators
    bodies = load_bodies(uniaxial)
    assert bodies.model.nv == 1 + 3
    at = link_poses(bodies, uniaxial, np.array([[0.1, 9.0, 9.0, 1.0, 1.0, 1.0]]))  # the guides hold all but x
    x, y, z = uniaxial.platen.centre_of_gravity
    np.testing.assert_allclose(at["platen"][0].translation, [x + 0.1, y, z], atol=1e-12)
    x, y, z = actuator.platen_point
    np.testing.assert_allclose(at[f"{actuator.name}_rod"][0].translation, [x + 0.1, y, z], atol=1e-12)


def test_any_title_makes_a_readable_urdf(machine):
    odd = machine.with_params({"machine.title": 'a -- <b> & "c" --', "machine.name": '<&">'})
    assert load_bodies(odd).model.name == '<&">'


# --------------------------------------------------------------------------------------------- kinematics
def test_rod_tips_coincide_with_the_platen_points(machine, bodies, poses):
    at = link_poses(bodies, machine, poses)
    turn = rotation(poses[:, 3:])
    for leg in legs(machine):
        if getattr(leg, "mount", "swivel") == "swivel":
            points = poses[:, :3] + turn @ np.array(leg.platen_point)
            tips = np.array([x.translation for x in at[f"{leg.name}_rod"]])
            assert np.abs(tips - points).max() < 1e-9  # asked for; rounding gives 1e-14
            on_platen = [x.act(np.array(leg.platen_point) - machine.platen.centre_of_gravity) for x in at["platen"]]
            assert np.abs(tips - on_platen).max() < 1e-9


def test_barrels_turn_about_their_base_points_and_point_at_the_rod_tips(machine, bodies, poses):
    at = link_poses(bodies, machine, poses)
    for leg in legs(machine):
        barrels, rods = at[f"{leg.name}_barrel"], at[f"{leg.name}_rod"]
        assert max(np.abs(b.translation - leg.base_point).max() for b in barrels) < 1e-12  # rounding
        reach = np.array([b.actInv(r.translation) for b, r in zip(barrels, rods, strict=True)])
        assert np.abs(reach[:, :2]).max() < 1e-9 and reach[:, 2].min() > 0.0


def test_vertical_actuators_stay_vertical_and_their_plates_lie_in_the_bearing_plane(machine, bodies, poses):
    at = link_poses(bodies, machine, poses)
    vertical = [a for a in machine.actuators if a.mount == "bearing"]
    assert len(vertical) == 6
    for actuator in vertical:
        for k, platen in enumerate(at["platen"]):
            rod, plate = at[f"{actuator.name}_rod"][k], at[f"{actuator.name}_plate"][k]
            np.testing.assert_allclose(rod.rotation, np.eye(3), atol=1e-15)
            np.testing.assert_allclose(rod.translation[:2], actuator.base_point[:2], atol=1e-12)
            np.testing.assert_allclose(plate.rotation[:, 2], platen.rotation[:, 2], atol=1e-9)
            assert abs(plate.rotation[1, 0]) < 1e-12  # {n} does not turn about its normal: its x stays in the XZ plane
            height = platen.actInv(plate.translation)[2] + machine.platen.centre_of_gravity[2]
            assert abs(height - machine.platen.bearing_plane[2]) < 1e-9


def test_rods_extend_as_the_compiled_kinematics_says(machine, bodies, poses):
    elongation, _ = leg_displacements(make_plant(machine), poses)
    q = joint_positions(machine, bodies.model, poses)
    for leg, wanted in zip(legs(machine), elongation.T, strict=True):
        drawn = q[:, bodies.model.idx_qs[bodies.model.getJointId(f"{leg.name}_extension")]]
        assert np.abs(drawn - wanted).max() < 1e-12  # two ways to the same length of 5 m: rounding


def test_rods_stay_in_their_barrels_within_the_stroke(machine, bodies):
    shapes = {g.name: g for g in bodies.shapes.geometryObjects}
    for actuator in machine.actuators:
        barrel, rod = shapes[f"{actuator.name}_barrel_0"], shapes[f"{actuator.name}_rod_0"]
        length = np.linalg.norm(np.subtract(actuator.platen_point, actuator.base_point))
        inner_end = rod.placement.translation[2] - rod.geometry.halfLength
        assert length + actuator.stroke + inner_end < 2 * barrel.geometry.halfLength
        assert length - actuator.stroke + inner_end >= -1e-12  # may touch the barrel's bottom
        assert rod.geometry.radius < barrel.geometry.radius


# ------------------------------------------------------------------------------------------------- frames
def test_frames_sample_the_record_uniformly_and_amplify_it():
    time = np.linspace(2.0, 4.0, 1025)
    motion = np.outer(np.sin(time - 2.0), [0.1, 0, 0, 0, 0, 0])
    frames = make_frames(time, motion, 2 * motion, rate=30.0, amplify=5.0)
    assert frames.displacement.shape == (61, 6) and frames.reference is not None
    # linear interpolation over 2 ms of 0.5 m sin t: 0.5 h^2 / 8
    np.testing.assert_allclose(frames.displacement[:, 0], 0.5 * np.sin(np.arange(61) / 30.0), atol=3e-7)
    np.testing.assert_allclose(frames.reference, 2 * frames.displacement, atol=1e-15)


def test_a_record_without_platen_is_drawn_from_its_actuators(machine):
    record = load_record(RECORD).isel(time=slice(0, 2048))
    whole = record_frames(machine, record)
    legs_only = record_frames(machine, record.drop_vars("platen_displacement"))
    # noise of 20 um on each length and 5 urad on each angle, and gains to 0.5 % of 0.1 m
    np.testing.assert_allclose(legs_only.displacement, whole.displacement, atol=1e-3)
    with pytest.raises(RecordError, match="actuator_displacement"):
        record_frames(machine, record[["actuator_force"]])


@settings(deadline=None, max_examples=60)
@given(
    rate=st.floats(-10, 60),
    amplify=st.floats(allow_nan=True),
    bad=st.sampled_from([0.0, np.nan, np.inf, 1e300]),
    columns=st.integers(0, 7),
)
def test_what_cannot_be_drawn_is_refused_in_words(rate, amplify, bad, columns):
    motion = np.zeros((10, columns))
    motion[3:4, :1] = bad
    try:
        frames = make_frames(np.arange(10) / 10.0, motion, rate=rate, amplify=amplify)
    except LhpostError as error:
        assert len(str(error)) > 20
    else:
        assert columns == 6 and rate > 0 and amplify > 0 and np.isfinite(frames.displacement).all()


def test_a_platen_amplified_until_it_turns_over_is_refused():
    with pytest.raises(ParameterError, match="amplify less"):
        make_frames(np.array([0.0, 1.0]), np.full((2, 6), 0.02), amplify=100.0)


def test_a_motion_drawn_beyond_the_stroke_is_said_to_be(machine, bodies, caplog):
    motion = np.zeros((2, 6))
    motion[1, 2] = 0.1
    with caplog.at_level(logging.WARNING):
        draw_animation(Recorder(), machine, bodies, make_frames(np.array([0.0, 1.0]), motion))
        assert not caplog.records
        draw_animation(Recorder(), machine, bodies, make_frames(np.array([0.0, 1.0]), motion, amplify=2.0))
    assert "V1, V2, V3, V4, V5, V6" in caplog.text and "H1" not in caplog.text


def test_the_animation_holds_the_poses_of_the_moving_bodies(machine, bodies, poses):
    recorder = Recorder()
    draw_animation(recorder, machine, bodies, make_frames(np.arange(200) / 30.0, poses))
    (packed,) = recorder.commands
    clips = {c["path"]: c["clip"] for c in umsgpack.unpackb(packed)["animations"]}
    wanted = body_poses(bodies.model, joint_positions(machine, bodies.model, poses))
    for joint in range(1, bodies.model.njoints):
        name = body_name(bodies.model, joint)
        tracks = {t["name"]: np.frombuffer(t["values"].data, "<f4") for t in clips[f"/meshcat/table/{name}"]["tracks"]}
        if ".position" in tracks:  # single precision of 10 m
            np.testing.assert_allclose(tracks[".position"].reshape(-1, 3), wanted[:, joint, :3], atol=1e-6)
        assert (".position" in tracks) != name.endswith(("_barrel", "_swivel_cross"))
    assert not any("V1_barrel" in path for path in clips)


# -------------------------------------------------------------------------------------------------- pages
def forty_seconds() -> "np.ndarray":
    t = np.arange(0, 40, 1 / 256)
    return np.stack([0.1 * np.sin(2 * np.pi * f * t) for f in (0.3, 0.4, 0.5)] + [0.003 * np.sin(3 * t)] * 3, axis=1)


def test_forty_seconds_at_30_frames_fit_in_three_megabytes_and_load_nothing(machine, tmp_path):
    motion = forty_seconds()
    time = np.arange(len(motion)) / 256
    channels = {"platen_displacement": motion, "reference_displacement": 1.01 * motion}
    title = "</script><script>alert(1)</script>"
    record = make_record(time, channels, {"axis": AXES}, {"title": title, "kind": "simulated"})
    save_animation(machine, record, tmp_path / "out.html")
    page = (tmp_path / "out.html").read_text()
    assert len(page) < 3e6
    assert "default-src 'none'" in page and not re.search(r'(src|href)="|@import|url\(', page.split("<script>")[0])
    assert "<script>alert" not in page
    assert page.count("</script>") == 2


def test_the_export_starts_no_server_and_no_process(machine, tmp_path, monkeypatch):
    def refuse(*_args: object, **_keywords: object) -> None:
        raise AssertionError("the export must not do this")

    monkeypatch.setattr(subprocess, "Popen", refuse)
    monkeypatch.setattr(socket.socket, "bind", refuse)
    monkeypatch.setattr(socket.socket, "connect", refuse)
    save_animation(machine, load_record(RECORD).isel(time=slice(0, 600)), tmp_path / "out.html")
    assert (tmp_path / "out.html").stat().st_size > 800_000  # meshcat's library is inside


def listening() -> dict[str, str]:
    """Local address by inode of this process's listening TCP sockets, as in /proc/net/tcp and tcp6."""
    own = set()
    for fd in Path("/proc/self/fd").iterdir():
        try:
            own.add(fd.readlink().name)
        except FileNotFoundError:  # the folder's own handle
            continue
    rows = [
        line.split() for name in ("tcp", "tcp6") for line in Path(f"/proc/self/net/{name}").read_text().splitlines()[1:]
    ]
    return {row[9]: row[1] for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in own}


@pytest.mark.skipif(not Path("/proc/self/net/tcp").exists(), reason="no /proc/net/tcp on this system")
def test_the_live_page_listens_on_loopback_only_and_stops(machine):
    before = listening()
    with live_animation(machine, load_record(RECORD).isel(time=slice(0, 600))) as window:
        new = {inode: address for inode, address in listening().items() if inode not in before}
        port = int(window.url.rstrip("/").rsplit(":", 1)[1])
        assert list(new.values()) == [f"0100007F:{port:04X}"]  # 127.0.0.1 in network order
    assert listening() == before


def ask(window: LoopbackWindow, path: str = "/", **headers: str) -> tuple[int, bytes]:
    """Status and body of the answer to one request."""
    port = int(window.url.rstrip("/").rsplit(":", 1)[1])
    talk = HTTPConnection("127.0.0.1", port, timeout=60)
    try:
        talk.request("GET", path, headers={name.replace("_", "-"): value for name, value in headers.items()})
        answer = talk.getresponse()
        return answer.status, answer.read()
    finally:
        talk.close()


def test_the_live_page_answers_this_computer_only():
    with LoopbackWindow("the page") as window:
        assert ask(window, Host="127.0.0.1") == (200, b"the page")
        assert ask(window, Host="localhost") == (200, b"the page")
        assert ask(window, Host="table.example.org")[0] == 404
        key = "AAAAAAAAAAAAAAAAAAAAAA=="
        upgrade = {"Upgrade": "websocket", "Sec_WebSocket_Version": "13", "Sec_WebSocket_Key": key}
        other = ask(window, "/commands", **upgrade, Connection="Upgrade", Origin="http://example.org")
        assert other[0] == 403


def test_a_browser_that_comes_late_gets_what_was_drawn_and_what_is_drawn_later():
    class Command:
        def __init__(self, path: str, value: int) -> None:
            self.fields = {"type": "set_property", "path": path, "property": "visible", "value": value}

        def lower(self) -> dict[str, object]:
            return self.fields

    async def listen(window: LoopbackWindow) -> list[object]:
        browser = await websocket_connect(window.url.replace("http", "ws") + "commands")
        early = [await browser.read_message() for _ in range(2)]
        window.send(Command("/a", 3))
        late = await browser.read_message()
        browser.close()
        return [umsgpack.unpackb(message)["value"] for message in (*early, late)]

    window = LoopbackWindow("")
    for command in (Command("/a", 1), Command("/b", 5), Command("/a", 2)):
        window.send(command)
    with window:
        assert asyncio.run(listen(window)) == [2, 5, 3]


# ------------------------------------------------------------------------------------------------ browser
BROWSER = next((b for b in map(shutil.which, ("chromium", "chromium-browser", "google-chrome")) if b), None)
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no Chromium on this computer")

PROBE = """<script>
window.faults = [];
window.addEventListener("error", (e) => faults.push(String(e.message)));
window.addEventListener("unhandledrejection", (e) => faults.push(String(e.reason)));
window.addEventListener("securitypolicyviolation", (e) => faults.push(e.violatedDirective));
console.error = (...what) => faults.push(what.join(" "));
</script>"""
LOOK = """<script>
function pixels() {
  viewer.render();
  const gl = viewer.renderer.getContext(), w = gl.drawingBufferWidth, h = gl.drawingBufferHeight;
  const out = new Uint8Array(4 * w * h);
  gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, out);
  return out;
}
function report(seconds) {
  viewer.animator.pause();
  const at = (name) => viewer.scene_tree.find(["meshcat", "table", name]).object;
  const found = {faults, seen: [], platen: [], rod: [], changed: []};
  let last = null;
  for (const time of seconds) {
    viewer.animator.seek(time);
    const now = pixels();
    let blue = 0, changed = 0;
    for (let k = 0; k < now.length; k += 4) {
      if (now[k] < 30 && now[k + 2] > 1.4 * now[k + 1] && now[k + 2] > 60) blue += 1;
      if (last && (now[k] != last[k] || now[k + 1] != last[k + 1])) changed += 1;
    }
    last = now;
    found.seen.push(blue / (now.length / 4));
    found.changed.push(changed);
    found.platen.push([...at("platen").position.toArray(), ...at("platen").quaternion.toArray()]);
    found.rod.push(at("H2_rod").position.toArray());
  }
  const note = document.createElement("pre");
  note.id = "found";
  note.textContent = JSON.stringify(found);
  document.body.prepend(note);
}
</script>"""


def chromium(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    flags = "--headless --no-sandbox --use-gl=swiftshader --enable-unsafe-swiftshader --hide-scrollbars"
    more = "--window-size=1280,800 --virtual-time-budget=4000 --enable-logging=stderr"
    command = [str(BROWSER), *flags.split(), *more.split(), f"--user-data-dir={folder / 'profile'}", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)


def console(run: subprocess.CompletedProcess[str]) -> list[str]:
    """Lines of the browser's console, without the driver's remarks on the speed of software drawing."""
    return [x for x in run.stderr.splitlines() if "CONSOLE" in x and "GL Driver Message" not in x]


@needs_browser
def test_in_a_browser_the_page_has_no_errors_and_the_platen_moves_as_recorded(machine, bodies, tmp_path):
    record = load_record(RECORD).isel(time=slice(0, 512 * 12))
    save_animation(machine, record, tmp_path / "out.html", amplify=3.0)
    times = [0.0, 8.0, 10.0]
    page = (tmp_path / "out.html").read_text().replace("<body>", f"<body>{PROBE}")
    page = page.replace("</body>", f"{LOOK}<script>report({times})</script></body>")
    (tmp_path / "probe.html").write_text(page)
    run = chromium(tmp_path, "--dump-dom", (tmp_path / "probe.html").as_uri())
    found = json.loads(re.search(r'<pre id="found">(.*?)</pre>', run.stdout).group(1))
    assert found["faults"] == [] and console(run) == []
    assert min(found["seen"]) > 0.05  # the platen covers a sixth of the page
    assert min(found["changed"][1:]) > 1000
    frames = record_frames(machine, record, amplify=3.0)
    poses = frames.displacement[[round(30 * t) for t in times]]
    model = bodies.model
    wanted = body_poses(model, joint_positions(machine, model, poses))
    names = [body_name(model, joint) for joint in range(model.njoints)]
    # the page's numbers are in single precision, 1e-7 of 10 m
    np.testing.assert_allclose(found["platen"], wanted[:, names.index("platen")], atol=2e-6)
    np.testing.assert_allclose(found["rod"], wanted[:, names.index("H2_rod"), :3], atol=2e-6)
    assert np.ptp(np.array(found["platen"])[:, :3], axis=0).max() > 0.02


@needs_browser
def test_in_a_browser_the_live_page_shows_the_table(machine, tmp_path):
    picture = tmp_path / "live.png"
    with live_animation(machine, load_record(RECORD).isel(time=slice(0, 512 * 4))) as window:
        run = chromium(tmp_path, f"--screenshot={picture}", window.url)
    assert console(run) == []
    pixels = np.asarray(Image.open(picture).convert("RGB")).astype(int)
    red, green, blue = np.moveaxis(pixels, -1, 0)
    assert np.mean((red < 30) & (blue > 1.4 * green) & (blue > 60)) > 0.05  # the platen
    assert np.mean((red > 150) & (green > 90) & (blue < 40)) > 0.005  # the horizontal actuators


# ------------------------------------------------------------------------------------------------ scripts
def script(name: str):
    """A script's module."""
    spec = util.spec_from_file_location(name, SCRIPTS / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_scripts_do_what_they_say(tmp_path, monkeypatch, capsys):
    def run(name: str, *arguments: str) -> int:
        monkeypatch.setattr(sys, "argv", [name, *arguments])
        with pytest.raises(SystemExit) as end:
            script(name).main()
        return int(end.value.code or 0)

    page, urdf = tmp_path / "page.html", tmp_path / "table.urdf"
    assert run("view_platen", str(RECORD), "--export", str(page), "--amplify", "20", "--fps", "10") == 0
    assert "drawn 20 times as large" in page.read_text()
    assert run("make_urdf", "lhpost6", "--out", str(urdf)) == 0
    assert urdf.read_text() == (models_folder() / "lhpost6.urdf").read_text()
    capsys.readouterr()
    assert run("view_platen", str(tmp_path / "none.nc"), "--export", str(page)) == 1
    assert "none.nc: no such file" in capsys.readouterr().err
    assert run("view_platen", str(RECORD), "--machine", "hexapod", "--export", str(page)) == 1
    assert "hexapod" in capsys.readouterr().err
