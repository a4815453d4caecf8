"""A record to look at: frames, arrows and the commands that draw them; pages that load nothing, on loopback only."""

import asyncio
import base64
import gc
import html
import json
import logging
import os
import re
import socket
import struct
import subprocess
import time
from dataclasses import replace
from http.client import HTTPConnection
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
import umsgpack
from commands import refused
from hypothesis import given, settings
from hypothesis import strategies as st
from tornado.websocket import websocket_connect

from lhpost6_pin.core.errors import LhpostError, ParameterError, RecordError
from lhpost6_pin.core.names import AXES
from lhpost6_pin.data.records import load_record, make_record, save_record
from lhpost6_pin.show.bodies import body_name, body_poses, joint_positions, load_bodies, load_specimen_bodies
from lhpost6_pin.show.urdf import legs
from lhpost6_pin.show.viewer import (
    Look,
    LoopbackWindow,
    Recorder,
    compare_overlaid,
    live_animation,
    make_frames,
    record_frames,
    show_record,
)
from lhpost6_pin.show.viewer.animation import draw_animation
from lhpost6_pin.show.viewer.arrows import arrow_colours, arrow_sizes, arrow_solid, kilonewtons
from lhpost6_pin.show.viewer.frames import Ghost
from lhpost6_pin.show.viewer.histories import packed_histories, record_histories
from lhpost6_pin.show.viewer.scene import draw_machine, draw_names

RECORD = Path(__file__).parent / "data" / "records" / "practice_a_EQ_ridgecrest2019_ccc.nc"


@pytest.fixture(scope="module")
def record():
    return load_record(RECORD)


def clips_of(machine, bodies, frames) -> dict[str, dict[str, np.ndarray]]:
    """Values of an animation's tracks by path in the scene and by track."""
    recorder = Recorder()
    draw_animation(recorder, machine, bodies, frames)
    (packed,) = recorder.commands
    return {
        c["path"].removeprefix("/meshcat/table/"): {
            t["name"]: np.frombuffer(t["values"].data, "<f4").reshape(len(frames.time), -1) for t in c["clip"]["tracks"]
        }
        for c in umsgpack.unpackb(packed)["animations"]
    }


# ------------------------------------------------------------------------------------------------- frames
def test_frames_sample_the_record_uniformly_and_amplify_it():
    time = np.linspace(2.0, 4.0, 1025)
    motion = np.outer(np.sin(time - 2.0), [0.1, 0, 0, 0, 0, 0])
    twice = Ghost("reference", "reference", time, 2 * motion)
    frames = make_frames(time, motion, [twice], look=Look(amplify=5.0))
    assert frames.displacement.shape == (61, 6)
    # linear interpolation over 2 ms of 0.5 m sin t: 0.5 h^2 / 8
    np.testing.assert_allclose(frames.displacement[:, 0], 0.5 * np.sin(np.arange(61) / 30.0), atol=3e-7)
    np.testing.assert_allclose(frames.ghosts[0].displacement, 2 * frames.displacement, atol=1e-15)
    far = make_frames(time, motion, [twice], look=Look(gap=10.0))
    np.testing.assert_allclose(far.ghosts[0].displacement, 11 * far.displacement, atol=1e-14)  # 1 + 10 (2 - 1)


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
        frames = make_frames(np.arange(10) / 10.0, motion, look=Look(rate, amplify))
    except LhpostError as error:
        assert len(str(error)) > 20
    else:
        assert columns == 6 and rate > 0 and amplify > 0 and np.isfinite(frames.displacement).all()


def test_a_record_of_hours_and_a_platen_amplified_until_it_turns_over_are_refused():
    with pytest.raises(ParameterError, match="more than 36000: cut the record"):
        make_frames(np.linspace(0.0, 5000.0, 500), np.zeros((500, 6)))
    with pytest.raises(ParameterError, match="amplify less"):
        make_frames(np.array([0.0, 1.0]), np.full((2, 6), 0.02), look=Look(amplify=100.0))


def test_a_motion_drawn_beyond_the_stroke_is_said_to_be(machine, bodies, caplog):
    motion = np.zeros((2, 6))
    motion[1, 2] = 0.1
    with caplog.at_level(logging.WARNING):
        for amplify in (1.0, 2.0):
            assert not caplog.records
            frames = make_frames(np.array([0.0, 1.0]), motion, look=Look(amplify=amplify))
            draw_animation(Recorder(), machine, bodies, frames)
    assert "V1, V2, V3, V4, V5, V6" in caplog.text and "H1" not in caplog.text


def test_the_animation_holds_the_poses_of_the_moving_bodies(machine, bodies, poses):
    clips = clips_of(machine, bodies, make_frames(np.arange(200) / 30.0, poses))
    wanted = body_poses(bodies.model, joint_positions(machine, bodies.model, poses))
    for joint in range(1, bodies.model.njoints):
        name = body_name(bodies.model, joint)
        if ".position" in clips.get(name, {}):  # single precision of 10 m
            np.testing.assert_allclose(clips[name][".position"], wanted[:, joint, :3], atol=1e-6)
        assert (".position" in clips.get(name, {})) != name.endswith(("_barrel", "_swivel_cross"))
    assert "V1_barrel" not in clips


def test_a_specimen_stands_on_the_platen_and_its_joints_move(machine, poses):
    loaded = machine.with_specimen("pendulum", (1.0, 2.0, 0.0))
    angle = np.linspace(0.0, 0.3, len(poses))
    frames = make_frames(np.arange(len(poses)) / 30.0, poses)
    frames = replace(frames, joints={"pivot": angle})
    bodies = load_bodies(loaded)
    clips = clips_of(loaded, bodies, frames)
    turned = clips["platen/specimen/1"][".quaternion"]
    np.testing.assert_allclose(turned[:, 1], np.sin(0.5 * angle), atol=1e-7)  # about Y; the page's numbers are single
    assert ".position" not in clips["platen/specimen/1"]  # the pivot is on the platen
    window = Recorder()
    draw_machine(window, loaded, bodies)
    sent = [umsgpack.unpackb(c) for c in window.commands]
    (at,) = (m["matrix"] for m in sent if m["type"] == "set_transform" and m["path"].endswith("platen/specimen/1"))
    from_b = np.array([1.0, 2.0, 3.0]) - machine.platen.centre_of_gravity  # the pivot is 3 m above the root
    np.testing.assert_allclose(at[12:15], from_b, atol=1e-6)
    drawn = [m["path"] for m in sent if m["type"] == "set_object" and "/specimen/" in m["path"]]
    assert [path.split("/")[-2] for path in drawn] == ["0", "1"]
    bare = Recorder()
    draw_machine(bare, machine, load_bodies(machine))
    assert not any("/specimen/" in umsgpack.unpackb(c)["path"] for c in bare.commands)


def test_joints_of_a_record_are_drawn_enlarged_if_they_are_numbers(machine, record):
    angle = np.linspace(0.0, 0.2, record.sizes["time"])[:, None]
    moved = record.assign(specimen_joint_position=(("time", "specimen_joint"), angle))
    moved = moved.assign_coords(specimen_joint=["pivot"])
    frames = record_frames(machine, moved, look=Look(amplify=3.0))
    # the last frame is before the end
    np.testing.assert_allclose(frames.joints["pivot"][[0, -1]], [0.0, 0.6], atol=2e-3)
    angle[7] = np.nan
    for broken in (moved, record.assign(specimen_joint_position=("time", np.zeros(len(angle))))):
        with pytest.raises(RecordError, match="specimen_joint_position must be finite"):
            record_frames(machine, broken)


def test_every_leg_has_its_name_where_it_is(machine):
    window = Recorder()
    draw_names(window, machine)
    sent = [umsgpack.unpackb(c) for c in window.commands]
    objects = [m for m in sent if m["type"] == "set_object"]
    written = {m["path"].rsplit("/", 1)[1]: m["object"]["textures"][0]["text"] for m in objects}
    assert written == {leg.name: leg.name for leg in legs(machine)}
    assert {m["path"].rsplit("/", 1)[0] for m in sent} == {"/meshcat/table/names", "/meshcat/table/platen/names"}
    for m in sent:
        if m["type"] == "set_transform":
            name, x = m["path"].rsplit("/", 1)[1], m["matrix"][12]
            leg = next(leg for leg in legs(machine) if leg.name == name)
            ends = sorted((leg.base_point[0], leg.platen_point[0]))
            assert ends[0] - 0.5 <= x + machine.platen.centre_of_gravity[0] <= ends[1] + 0.5


def test_a_body_without_shapes_is_the_uniform_box_of_its_inertia(tmp_path, machine):
    mass, edges = 240.0, np.array([1.0, 2.0, 3.0])
    xx, yy, zz = mass / 12.0 * (np.sum(edges**2) - edges**2)
    inertia = f'ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"'
    path = tmp_path / "box.urdf"
    link = f'<link name="a"><inertial><mass value="{mass}"/><inertia {inertia}/></inertial></link>'
    path.write_text(f'<robot name="box">{link}</robot>')
    (shape,) = load_specimen_bodies(machine.with_specimen(path)).shapes
    size = np.abs(shape.placement.rotation @ (2.0 * shape.geometry.halfSide))
    np.testing.assert_allclose(size, edges, rtol=1e-12)
    mesh = path.read_text().replace("</link>", '<visual><geometry><mesh filename="no.stl"/></geometry></visual></link>')
    path.write_text(mesh)
    (shape,) = load_specimen_bodies(machine.with_specimen(path)).shapes
    np.testing.assert_allclose(np.sort(2.0 * shape.geometry.halfSide), edges)


def test_what_two_records_leave_out_of_each_other_is_stated_and_another_test_is_warned_of(machine, record):
    short, late = record.isel(time=slice(0, 4096)), record.isel(time=slice(512, None))
    first, last = late["time"].values[0], short["time"].values[-1]
    found = compare_overlaid(short, [late], ["short.nc", "late.nc"])
    assert found.shown == (first, last) and found.different == ()  # the same motion
    only = f"only {first:.2f} to {last:.2f} s, which all records have, are shown"
    more = late["time"].values[-1] - last
    start = first - short["time"].values[0]
    assert found.cut == (
        f"short.nc is cut by {start:.2f} s at its start: {only}",
        f"late.nc is cut by {more:.2f} s at its end: {only}",
    )
    assert (
        html.escape(found.sentences[0].replace("short.nc", record.attrs["title"]))
        in show_record(machine, short, [late]).page
    )
    whole = compare_overlaid(record, [record.assign_attrs(test="scaled")])
    assert whole.sentences == ()


def test_records_of_different_motions_are_not_the_same_test(record):
    scaled, turned, still = record.copy(deep=True), record.copy(deep=True), record.copy(deep=True)
    for name in ("reference_displacement", "platen_displacement"):
        if name in record:
            scaled[name] = 0.5 * record[name]
            turned[name] = (record[name].dims, record[name].values[::-1])
            still[name] = 0.0 * record[name]
    found = compare_overlaid(record, [scaled, turned, still], ["a", "scaled", "turned", "still"])
    assert len(found.different) == 2 and found.different[0].startswith("turned is not the same test as a: the corr")
    assert found.different[1] == "still is not the same test as a: one of them is at rest"
    driven = turned.drop_vars("reference_displacement", errors="ignore").assign_attrs(spool_interpolation="held")
    assert not compare_overlaid(record, [driven], ["a", "driven by its spools"]).different  # it drifts
    named = compare_overlaid(record.assign_attrs(motion="sine"), [record.assign_attrs(motion="kobe")], ["a", "b"])
    assert named.different == ("b is not the same test as a: its motion is kobe, not sine",)


def test_two_records_are_drawn_over_the_time_that_both_have(machine, record):
    early, late = record.isel(time=slice(0, 4096)), record.isel(time=slice(2048, 6144))
    frames = record_frames(machine, early, [late])
    assert frames.time[0] == late["time"].values[0] and frames.time[-1] <= early["time"].values[-1]
    other = next(g for g in frames.ghosts if g.name == "first_other")
    np.testing.assert_allclose(other.displacement, frames.displacement, atol=1e-12)  # the same samples
    with pytest.raises(RecordError, match="do not overlap in time"):
        record_frames(machine, early, [record.isel(time=slice(8192, 9000))])


# ------------------------------------------------------------------------------------------------- arrows
def test_an_arrow_is_as_long_as_its_force_and_turns_round_under_tension(machine, bodies, record):
    frames = record_frames(machine, record.isel(time=slice(0, 2048)))
    most = np.abs(frames.force).max()
    clips = clips_of(machine, bodies, frames)
    scale = 0.3 * max(machine.platen.size) / most  # models/drawing: arrow.length
    for leg, force in zip(legs(machine), frames.force.T, strict=True):
        sizes = clips[f"{leg.name}_rod/force"][".scale"]
        long = np.maximum(np.abs(force) * scale, 1e-4 * most * scale)  # shorter ones are not seen
        np.testing.assert_allclose(sizes[:, 2], np.copysign(long, force), rtol=1e-6)  # single precision
        np.testing.assert_allclose(sizes[:, :2], long[:, None].repeat(2, 1), rtol=1e-6)
    down = [clips[f"{s.name}_rod/force"][".scale"][:, 2].max() for s in machine.struts]
    up = [clips[f"{a.name}_rod/force"][".scale"][:, 2].min() for a in machine.actuators if a.mount == "bearing"]
    assert max(down) < 0.0 < min(up)  # struts hold the platen down against what carries it
    assert np.abs(arrow_sizes(machine, np.zeros(3), 1.0)).min() > 0.0  # no force can still be drawn
    since = record_frames(machine, record.isel(time=slice(0, 2048)), look=Look(change=True))
    assert np.abs(since.force[0]).max() == 0.0
    np.testing.assert_allclose(since.force + frames.force[0], frames.force, rtol=1e-12)


def test_a_colour_says_push_or_pull_and_how_much():
    none, push, pull, half = arrow_colours(np.array([0.0, 2.0, -2.0, 1.0]), 2.0)
    assert np.ptp(none) < 0.1  # grey
    assert push[0] > 2 * push[2] and pull[2] > 1.5 * pull[0]  # red and violet
    np.testing.assert_allclose(half, 0.5 * (none + push), atol=1e-12)


def test_the_arrow_is_a_closed_solid_of_unit_length():
    solid = arrow_solid()
    edges = {tuple(sorted(pair)) for f in solid.faces for pair in ((f[0], f[1]), (f[1], f[2]), (f[2], f[0]))}
    assert len(solid.vertices) - len(edges) + len(solid.faces) == 2  # Euler's formula
    corners = solid.vertices[solid.faces].astype(float)
    volume = np.einsum("ni,ni->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    assert volume > 0.0  # faces look outwards
    assert solid.vertices[:, 2].min() == 0.0 and solid.vertices[:, 2].max() == 1.0


def test_a_record_without_forces_has_no_arrows(machine, bodies, record):
    bare = record.isel(time=slice(0, 600)).drop_vars(["actuator_force", "strut_pressure"])
    assert not any("force" in path for path in clips_of(machine, bodies, record_frames(machine, bare)))
    some = record.isel(time=slice(0, 600)).drop_vars("strut_pressure")
    paths = clips_of(machine, bodies, record_frames(machine, some))
    assert "H1_rod/force" in paths and f"{machine.struts[0].name}_rod/force" not in paths


# -------------------------------------------------------------------------------------------------- pages


def test_forty_seconds_at_30_frames_fit_in_four_megabytes_and_load_nothing(machine, tmp_path):
    time = np.arange(0, 40, 1 / 256)
    motion = np.sin(np.outer(time, [2.0, 2.5, 3.0, 3.0, 3.0, 3.0])) * [0.1, 0.1, 0.1, 0.003, 0.003, 0.003]
    force = 1e5 * np.sin(np.outer(time, np.arange(1, 11)))
    pressure = 1e7 + 1e5 * np.sin(np.outer(time, np.arange(1, 4)))
    channels = {"platen_displacement": motion, "reference_displacement": 1.01 * motion}
    channels |= {"actuator_force": force, "strut_pressure": pressure}
    title = "</script><script>alert(1)</script>"
    labels = {"axis": AXES, "actuator": machine.actuator_names, "strut": machine.strut_names}
    record = make_record(time, channels, labels, {"title": title, "kind": "simulated"})
    show_record(machine, record).save(tmp_path / "out.html")
    page = (tmp_path / "out.html").read_text()
    assert len(page) < 4e6
    assert "default-src 'none'" in page and not re.search(r'(src|href)="|@import|url\(', page.split("<script>")[0])
    assert "<script>alert" not in page
    assert page.count("</script>") == 5  # meshcat, settings, commands, histories, the page's own


def test_the_export_starts_no_server_and_no_process(machine, record, tmp_path, monkeypatch):
    refuse = mock.Mock(side_effect=AssertionError("the export must not do this"))
    monkeypatch.setattr(subprocess, "Popen", refuse)
    monkeypatch.setattr(socket.socket, "bind", refuse)
    monkeypatch.setattr(socket.socket, "connect", refuse)
    show_record(machine, record.isel(time=slice(0, 600))).save(tmp_path / "out.html")
    assert (tmp_path / "out.html").stat().st_size > 800_000  # meshcat's library is inside


def listening() -> dict[str, str]:
    """Local address by inode of this process's listening TCP sockets, as in /proc/net/tcp and tcp6."""
    own = {os.readlink(fd) for fd in Path("/proc/self/fd").iterdir() if os.path.lexists(fd)}
    files = [Path(f"/proc/self/net/{name}").read_text() for name in ("tcp", "tcp6")]
    rows = [line.split() for text in files for line in text.splitlines()[1:]]
    return {row[9]: row[1] for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in own}


@pytest.mark.skipif(not Path("/proc/self/net/tcp").exists(), reason="no /proc/net/tcp on this system")
def test_the_live_page_listens_on_loopback_only_and_stops(machine, record):
    before = listening()
    with live_animation(machine, record.isel(time=slice(0, 600))) as window:
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


class Command:
    """A property set on an object of the scene."""

    def __init__(self, path: str, value: object) -> None:
        self.fields = {"type": "set_property", "path": path, "property": "visible", "value": value}

    def lower(self) -> dict[str, object]:
        return self.fields


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
    async def listen(window: LoopbackWindow) -> list[object]:
        browser = await websocket_connect(window.url.replace("http", "ws") + "commands")
        early = [await browser.read_message() for _ in range(2)]
        window.send(Command("/a", 3))
        late = await browser.read_message()
        browser.close()
        assert await browser.read_message() is None  # the socket is closed: the loop may end
        return [umsgpack.unpackb(message)["value"] for message in (*early, late)]

    window = LoopbackWindow("")
    for command in (Command("/a", 1), Command("/b", 5), Command("/a", 2)):
        window.send(command)
    with window:
        assert asyncio.run(listen(window)) == [2, 5, 3]


def test_a_browser_that_leaves_in_the_middle_of_a_message_leaves_no_complaint(caplog):
    ask = (
        "GET /commands HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    )
    with caplog.at_level(logging.ERROR), LoopbackWindow("") as window:
        port = int(window.url.rstrip("/").rsplit(":", 1)[1])
        for _ in range(10):
            with socket.create_connection(("127.0.0.1", port), timeout=60) as browser:
                browser.sendall(ask.encode())
                assert browser.recv(4096).startswith(b"HTTP/1.1 101")
                assert window.wait(60.0)
                browser.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # as a killed tab
            for _ in range(200):
                window.send(Command("/a", "x" * 20_000))
            time.sleep(0.05)
    gc.collect()  # what nobody has asked after is complained of when it goes
    assert caplog.text == ""


def test_a_picture_stands_in_a_notebook_and_in_a_file_alike(machine, record, tmp_path):
    picture = show_record(machine, record.isel(time=slice(0, 600)))
    inside = re.search(r'srcdoc="([^"]*)"', picture._repr_html_())[1]
    assert "<" not in inside and html.unescape(inside) == picture.page
    picture.save(tmp_path / "a.html")
    assert (tmp_path / "a.html").read_text() == picture.page


# ------------------------------------------------------------------------------------------------ the command
def test_the_page_says_what_was_changed_of_the_machine(machine, record):
    assert "made with" not in show_record(machine, record).page
    changed = record.assign_attrs(effects="cable: stray_spring on platen.x", overrides="a.b = 1 m (was 2 m); c; d; e")
    page = show_record(machine, changed).page
    assert "made with effects: cable: stray_spring on platen.x" in page
    assert "made with overrides: a.b = 1 m (was 2 m); c; and 2 more" in page


def test_the_command_writes_one_file_and_says_what_it_cannot_show(lhpost6, record, tmp_path, caplog):
    page = tmp_path / "page.html"
    ended = lhpost6("view", RECORD, RECORD, "--export", page, "--amplify", 20, "--fps", 10, "--gap", 2)
    assert ended.code == 0 and f"wrote {page}" in ended.out
    text = page.read_text()
    assert "not the same test" not in caplog.text and "is cut" not in caplog.text
    assert "drawn 20 times as large, gaps to the outlines 2 times as large" in text and "10 frames/s" in text
    short, found = tmp_path / "short.nc", tmp_path / "found.html"
    save_record(record.isel(time=slice(0, 4096)), short)
    ended = lhpost6("view", RECORD, short, "--export", found, "--json")
    entries = json.loads(ended.out)
    assert entries["different"] == [] and len(entries["cut"]) == 1 and entries["cut"][0].startswith(str(RECORD))
    assert "is cut by" in caplog.text and entries["shown"][1] == record["time"].values[4095]
    for wrong, why in (
        ([tmp_path / "none.nc"], "none.nc: no such file"),
        ([RECORD, "--machine", "hexapod"], "hexapod"),
        ([RECORD, *[RECORD] * 3], "at most 2"),
        ([RECORD, "--amplify", 0], "positive number"),
        ([RECORD, "--machine", "uniaxial"], "name its machine"),
    ):
        assert refused(lhpost6("view", *wrong, "--export", tmp_path / "other.html"), why)
    assert not (tmp_path / "other.html").exists()
    for name in ("view.png", "view.mp4", "view"):
        assert refused(
            lhpost6("view", RECORD, "--export", tmp_path / name), "a page of HTML is written; name it view.html"
        )
        assert not (tmp_path / name).exists()


def test_histories_beside_a_shorter_record_are_of_the_interval_that_is_shown(machine, record):
    """Scale and labels come from what is drawn: the whole record's peaks made a flat line of its quiet beginning."""
    short = record.isel(time=slice(0, 2048))
    page = show_record(machine, record, [short]).page
    packed = json.loads(re.search(r'id="histories">(.*?)</script>', page)[1])
    last = float(record_frames(machine, record, [short]).time[-1])
    inside = record["time"].values <= last
    moved = 1e3 * record["platen_displacement"].values
    assert np.abs(moved[inside]).max() < 0.5 * np.abs(moved).max()
    for curve in packed[0]["curves"]:
        x, y = (np.frombuffer(base64.b64decode(curve[key]), "<f4") for key in "xy")
        own = moved[inside, AXES.index(curve["name"])].astype("<f4")  # values travel in single precision
        assert (y.min(), y.max()) == (own.min(), own.max()) and x.max() <= last


def test_histories_keep_every_peak_and_leave_out_what_has_gaps(machine, record):
    whole = record_histories(machine, record)
    assert [h.title.split()[0] for h in whole] == ["Displacement", "Acceleration", "Force"]
    np.testing.assert_array_equal(whole[0].curves["y"], 1e3 * record["platen_displacement"].values[:, 1])
    assert set(whole[2].curves) == {leg.name for leg in (*machine.actuators, *machine.struts)}
    (packed, *_) = packed_histories(whole, float(record["time"][0]))
    drawn = np.frombuffer(base64.b64decode(packed["curves"][0]["y"]), "<f4")
    x = whole[0].curves["x"].astype("<f4")  # values travel in single precision
    assert drawn.max() == x.max() and drawn.min() == x.min() and len(drawn) <= 2 * 500 + 2
    torn = record.copy(deep=True)
    torn["actuator_force"][5, 2] = np.nan
    assert set(whole[2].curves) - set(record_histories(machine, torn)[2].curves) == {machine.actuator_names[2]}
    assert record_histories(machine, record[["platen_displacement"]])[0].title.startswith("Displacement")


@pytest.mark.parametrize("force, words", [(1.7604e6, "1,760 kN"), (6632.0, "6.63 kN"), (120.0, "0.12 kN")])
def test_the_longest_arrow_has_three_digits_on_machines_of_any_size(force, words):
    assert kilonewtons(force) == words
