"""No content of a file, no option and no datagram gives a traceback, a warning, a hang or half a file.

Every reader gives back something usable or raises an error of the package that names the file. A few seconds a reader;
some ten minutes with

    pytest tests/test_fuzz.py --hypothesis-profile long

What was found that way is kept by name in `KNOWN` and `NETCDF`, so that it stays mended whatever hypothesis draws.
"""

import io
import re
import struct
import sys
import tempfile
from collections.abc import Callable
from contextlib import chdir, redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from typing import NamedTuple
from unittest import mock

import fuzz_readers
import fuzzing
import h5py
import numpy as np
import pytest
import xarray as xr
from fuzz_readers import CONTENT, READERS, Reader
from fuzzing import no_leak
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from run_cases import at_rest

from lhpost6_pin import cli
from lhpost6_pin.core.errors import LhpostError
from lhpost6_pin.data.importing import load_raw
from lhpost6_pin.interfaces.link import ServedPlant, client
from lhpost6_pin.interfaces.link.clock import SECOND
from lhpost6_pin.interfaces.link.protocol import (
    MOTION,
    Datagram,
    Kind,
    LinkMode,
    VersionError,
    Welcome,
    decode,
    encode,
)
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.motions import load_motion, make_target

pytestmark = pytest.mark.long

BY_NAME = {reader.name: reader for reader in READERS}
CHECKS = [HealthCheck.too_slow, HealthCheck.filter_too_much, HealthCheck.data_too_large, HealthCheck.large_base_example]


def usable_or_refused(reader: Reader, content: bytes, folder: Path) -> None:
    """Read a file of this content and use what comes; an error of the reader must name the file."""
    path = folder / reader.file
    path.write_bytes(content)
    with no_leak():
        try:
            found = reader.load(path)
        except LhpostError as error:
            assert path.stem in str(error), error
            return
        try:
            reader.use(found)
        except LhpostError:
            return


def plainly_broken(seed: bytes) -> list[bytes]:
    """An empty file, bytes that mean nothing, half a file, and one with a number that is none."""
    half = seed[: len(seed) // 2]
    no_number = re.sub(rb"(?<=[ ,=])\d\.\d+", b"nan", seed, count=1)
    return [b"", bytes(range(256)), half + b"\xff\x00", no_number[: len(half)]]


@pytest.mark.parametrize("reader", READERS, ids=lambda r: r.name)
def test_a_valid_file_is_read_and_can_be_used(reader, tmp_path):
    path = tmp_path / reader.file
    path.write_bytes(reader.seed())
    with no_leak():
        found = reader.load(path)
        assert CONTENT[reader.use](found)
        reader.use(found)


@pytest.mark.parametrize("reader", READERS, ids=lambda r: r.name)
def test_a_broken_file_is_refused_by_name_or_usable(reader, tmp_path):
    for content in plainly_broken(reader.seed()):
        usable_or_refused(reader, content, tmp_path)

    @settings(max_examples=max(5, int(reader.share * settings().max_examples)), suppress_health_check=CHECKS)
    @given(reader.broken())
    def holds(content):
        usable_or_refused(reader, content, tmp_path)

    holds()


# ------------------------------------------------------------------------------------------------- what was found
def seed(name: str, *change: bytes) -> bytes:
    """A reader's valid file, with one text in it replaced by another."""
    content = BY_NAME[name].seed()
    assert not change or change[0] in content
    return content.replace(*change, 1) if change else content


def claiming(matlab: bool) -> bytes:
    """A small HDF5 file with a dataset of eight terabytes, of which nothing was ever written."""
    content = io.BytesIO()
    with h5py.File(content, "w", userblock_size=512 * matlab) as file:
        file.create_dataset("x", (10**12,), "f8", chunks=(1000,))
    head = b"MATLAB 7.3 MAT-file".ljust(512) if matlab else b""
    return head + content.getvalue()[len(head) :]


def cells(claimed: int) -> bytes:
    """A MATLAB v5 file with three cells that claims to have more."""
    content = fuzzing.mat_file({"a": np.array([1.0, "b", 2.0], dtype=object)})
    return content.replace(struct.pack("<2i", 1, 3), struct.pack("<2i", 1, claimed), 1)


KNOWN = {
    "effect is a number": ("machine", lambda: b"effect = 1\n", "effect must be sections"),
    "too many digits": ("machine", lambda: b"a = " + b"9" * 5000, "not a TOML file"),
    "too many digits for a message": ("uniaxial", lambda: b"[machine]\na = 0x" + b"f" * 5000, "machine.a is a whole"),
    "dots without end": ("machine", lambda: b"a" + b".a" * 5000 + b" = 1", "nested too deeply"),
    "override of nothing": ("override", lambda: b"[platen]\nmasss = 1.0\n", "no parameter named 'platen.masss'"),
    "override without value": ("override", lambda: b"[platen]\nmass = { unit = 't' }\n", "value is missing"),
    "unknown family": ("override", lambda: b"[effect.rub]\nfamily = 'rubber'\n", "named 'rubber'"),
    "a number to overflow": ("override", lambda: b"[platen]\ngravity = { value = 1e300 }\n", "beyond 1e[+]30"),
    "no sampling": ("sensors", lambda: b"", "sampling.rate is missing"),
    "half a bit": ("sensors", lambda: seed("sensors", b"value = 16.0", b"value = 0.5"), "should be a whole"),
    "gain without end": ("map", lambda: seed("map", b"1.002", b"1" + b"0" * 400), "gain is a whole number of more"),
    "index without titles": ("motions", lambda: seed("motions", b"\ntitle = ", b"\ntitel = "), "index.toml: is dam"),
    "index of nothing": ("motions", lambda: b"records = 1", "index.toml: is dam"),
    "test without kind": ("tests", lambda: seed("tests", b"\nkind = ", b"\nkid = "), "tests.toml: is dam"),
    "unknown type in MATLAB v5": ("mat5", lambda: seed("mat5", b"\x09\0\0\0\x60", b"\x08\0\0\0\x60"), "no"),
    "no numbers in MATLAB v5": ("mat5", lambda: seed("mat5", b"\x09\0\0\0\x60", b"\x0e\0\0\0\x60"), "no"),
    "two billion cells": ("mat5", lambda: cells(2**31 - 1), "fewer cells than its dimensions"),
    "a rate without end": ("map", lambda: seed("map", b"128.0", b"1e300"), "rate = 1e[+]300 must be"),
    "8 TB in HDF5": ("hdf5", lambda: claiming(False), "claims 8e[+]03 GB"),
    "8 TB in MATLAB v7.3": ("mat73", lambda: claiming(True), "claims 8e[+]03 GB"),
}
"""By what was wrong: reader, content, and what is said of it."""


@pytest.mark.parametrize("name", KNOWN)
def test_a_fault_that_was_found_stays_mended(name, tmp_path):
    reader, content, phrase = KNOWN[name]
    path = tmp_path / BY_NAME[reader].file
    path.write_bytes(content())
    with no_leak(), pytest.raises(LhpostError, match=phrase) as caught:
        BY_NAME[reader].load(path)
    assert path.stem in str(caught.value)


MASS, MOMENT, PLACE = b'mass value="200"', b'ixx="20"', b'xyz="0 0 3"'


@pytest.mark.parametrize(
    ("good", "bad", "phrase"),
    [
        (MASS, b'mass value="nan"', "link post: mass value = 'nan' should be 1 finite"),
        (MASS, b'mass value="1e300"', "link post: mass value = '1e300' should be 1 finite"),
        (MASS, b'mass value="-100"', "link post: its mass is negative"),
        (MASS, b'weight value="200"', "link post: its <inertial> has no mass value"),
        (MOMENT, b'ixx="-1e9"', "link bob: a principal moment of inertia is negative, -1e\\+09 kg m2"),
        (MOMENT, b'ixx="x"', "link bob: inertia ixx = 'x'"),
        (PLACE, b'xyz="0 0"', "joint pivot: origin xyz = '0 0' should be 3 finite"),
        (b'axis xyz="0 1 0"', b'axis xyz="0 0 0"', "joint pivot: its axis has no direction"),
        (b"</robot>", b"", "not a URDF that Pinocchio can read: no element found"),
    ],
)
def test_a_specimen_that_cannot_be_is_refused(good, bad, phrase, tmp_path):
    path = tmp_path / "broken.urdf"
    path.write_bytes(seed("urdf", good, bad))
    with no_leak(), pytest.raises(LhpostError, match=phrase) as caught:
        make_plant(load_machine().with_specimen(path))
    assert str(path) in str(caught.value)


NETCDF = {
    "no actuators": ("record", lambda d: d.isel(actuator=slice(0), horizontal=slice(0)), "is empty"),
    "another time": ("record", lambda d: d.rename(time="moment"), "time: is missing"),
    "beyond all numbers": ("long record", lambda d: d.assign(platen_velocity=1e300 + d["platen_velocity"]), "1e[+]30"),
    "a sample a century": ("record", lambda d: d.assign_coords(time=3e9 * np.arange(16.0)), "runs at|sample_rate_hz"),
    "a test of two names": ("record", lambda d: d.assign_attrs(test=np.arange(2)), "attribute test"),
    "steps in words": ("record", lambda d: d.assign_attrs(steps_per_second="many"), "attribute steps_per_second"),
    "two kinds": ("record", lambda d: d.assign_attrs(kind=np.arange(2)), "attribute kind"),
    "labels that repeat": ("drive", lambda d: d.isel(axis=[0, 0, 1, 2, 3, 4, 5]), "damaged or incomplete"),
    "a complex drive": ("drive", lambda d: d.assign(drive=d["drive"] * 1j), "damaged or incomplete"),
    "no scale": ("drive", lambda d: d.assign_attrs(scale=np.nan), "invalid description of the motion"),
    "no axes": ("drive", lambda d: d.assign_attrs(axes="x=q"), "invalid description of the motion"),
    "a complex inverse": ("inverse", lambda d: d.assign(inverse_taps=d["inverse_taps"] * 1j), "damaged or incomplete"),
    "a band upside down": ("inverse", lambda d: d.assign_attrs(band_hz=[30.0, 0.5]), "holds an inverse"),
    "an endless rate": ("inverse", lambda d: d.assign_attrs(sample_rate_hz=np.inf), "holds an inverse"),
    "an axis twice": ("inverse", lambda d: d.assign_coords(drive_axis=["x"] * 2), "holds an inverse"),
    "no kind": ("inverse", lambda d: d.assign_attrs(kind=np.zeros(0)), "is not a saved inverse"),
}


@pytest.mark.parametrize("name", NETCDF)
def test_a_fault_found_in_netcdf_stays_mended(name, tmp_path):
    reader, change, phrase = NETCDF[name]
    path = tmp_path / BY_NAME[reader].file
    path.write_bytes(opened_and_changed(reader, change))
    with no_leak(), pytest.raises(LhpostError, match=phrase) as caught:
        BY_NAME[reader].load(path)
    assert path.stem in str(caught.value)


@pytest.mark.parametrize("bad", [b"aliases = [[]]", b"aliases = [1]"])
def test_strange_words_in_the_index_of_motions_are_taken_as_texts(bad, tmp_path):
    path = tmp_path / "index.toml"
    path.write_bytes(seed("motions", b'aliases = ["ridgecrest"]', bad).replace(b"\ncommand = ", b"\ncommand = 3 # "))
    with no_leak():
        BY_NAME["motions"].use(BY_NAME["motions"].load(path))


def test_a_time_step_of_an_age_makes_no_target(tmp_path):
    path = tmp_path / "slow.csv"
    path.write_text("time_s,ax_g\n0,0.1\n1e12,0.2\n2e12,0.1\n")
    with pytest.raises(LhpostError, match=r"slow: 3e\+12 s with a time step of 1e\+12 s are more than"):
        make_target(load_motion(path))


def test_a_table_with_time_along_its_second_axis_and_labels_there_is_read(tmp_path):
    samples = ("row", "sample"), np.arange(27.0).reshape(3, 9)
    table = xr.Dataset({"x": samples}, {"sample": [f"s{k}" for k in range(9)]})
    table.to_netcdf(tmp_path / "wide.nc", engine="h5netcdf")
    assert load_raw(tmp_path / "wide.nc")[0].values.shape == (9, 3)


# ------------------------------------------------------------------------------------------------- command line
class Command(NamedTuple):
    """A command that reads a file, {} in its words; what it may leave, and whether it is quick enough for any file."""

    reader: str
    words: str
    leaves: tuple[str, ...] = ()
    quick: bool = False


SHORT = "--set amplitude=0.02 --set cycles=0.5 --set ramp_cycles=0.5 --engine fused --rate 2048 --out out"
RUN = ("out/record.nc", "out/report.html")
COMMANDS = (
    Command("record", "check {}", quick=True),
    Command("long record", "check {}", quick=True),
    Command("record", "open-loop {} --engine fused --rate 2048 --out out", RUN),
    Command("long record", "decompose {} --out out", ("out/ledger.nc", "out/report.html")),
    Command("record", "view {} --export page.html", ("page.html",)),
    Command("record", "export {} --to csv --out out/record.csv", ("out/record.csv",)),
    Command("table", "import {} --guess --out map.toml", ("map.toml",), quick=True),
    Command("469d", "import {} --guess --out map.toml", ("map.toml",), quick=True),
    Command("map", "import run.csv --map {} --out out/record.nc", RUN[:1], quick=True),
    Command("csv", "run {} --engine fused --rate 2048 --out out", RUN),
    Command("at2", "run {} --engine fused --rate 2048 --out out", RUN),
    Command("cosmos", "run {} --engine fused --rate 2048 --out out", RUN),
    Command("drive", "replay {} --engine fused --rate 2048 --out out", RUN),
    Command("override", f"run sine {SHORT} --override {{}}", RUN),
    Command("override", "info --override {}", quick=True),
    Command("machine", "info --machine {}", quick=True),
    Command("controller", f"run sine {SHORT} --controller {{}}", RUN),
    Command("inverse", f"run sine {SHORT} --aic {{}}", RUN),
    Command("urdf", f"run sine {SHORT.replace('fused', 'pinocchio')} --specimen {{}}", RUN),
    Command("sensors", "decompose record.nc --out out --sensors {}", ("out/ledger.nc", "out/report.html")),
)
RUN_CSV = b"time [s],c1,c2,c3\n" + b"".join(b"%g,1,2,3\n" % (k / 256) for k in range(32))


def ended(words: list[str]) -> tuple[int, str]:
    """Exit code and all that a command says, run as the entry point does."""
    said = io.StringIO()
    with mock.patch.object(sys, "argv", ["lhpost6", *words]), redirect_stdout(said), redirect_stderr(said):
        try:
            cli.main()
        except SystemExit as end:
            return end.code if isinstance(end.code, int) else 0, said.getvalue()
    raise AssertionError("the entry point ends by SystemExit")


def ends_well(command: Command, content: bytes, folder: Path) -> int:
    """Run a command on a file of this content in an empty folder; returns its exit code."""
    name = BY_NAME[command.reader].file
    with tempfile.TemporaryDirectory(dir=folder) as place, chdir(place), no_leak(120):  # compiling included
        Path(name).write_bytes(content)
        Path("run.csv").write_bytes(RUN_CSV)
        Path("record.nc").write_bytes(BY_NAME["long record"].seed())
        code, said = ended(command.words.format(name).split())
        left = {str(p) for p in Path().rglob("*") if p.is_file()} - {name, "run.csv", "record.nc"}
    assert code in (0, 1, 2) and "Traceback" not in said, said
    assert left <= set(command.leaves if code < 2 else ()), (code, left)
    assert code < 2 or said.count("error:") == 1, said
    return code


@pytest.mark.parametrize("command", COMMANDS, ids=lambda c: c.words.split(" --out")[0].format(c.reader))
def test_a_command_refuses_a_plainly_broken_file_and_leaves_nothing(command, tmp_path):
    codes = [ends_well(command, content, tmp_path) for content in plainly_broken(BY_NAME[command.reader].seed())]
    assert set(codes) <= {0, 1, 2} and codes[1] == (1 if command.words.startswith("check {}") else 2)


@pytest.mark.parametrize("command", [c for c in COMMANDS if c.quick], ids=lambda c: c.words.format(c.reader))
def test_a_command_ends_well_whatever_is_in_the_file(command, tmp_path):
    @settings(max_examples=max(5, settings().max_examples // 10), suppress_health_check=CHECKS)
    @given(BY_NAME[command.reader].broken())
    def holds(content):
        ends_well(command, content, tmp_path)

    holds()


def opened_and_changed(name: str, change: Callable[[xr.Dataset], xr.Dataset]) -> bytes:
    """A valid record, changed."""
    changed = change(fuzz_readers.opened(BY_NAME[name].seed()))
    return bytes(changed.to_netcdf(engine="h5netcdf", invalid_netcdf=True))


def test_records_that_are_valid_but_do_not_fit_a_command_are_refused_and_short_ones_checked(tmp_path):
    measured = opened_and_changed("record", lambda d: d.assign_attrs(kind="measured"))
    assert ends_well(COMMANDS[0], measured, tmp_path) == 0  # too short to compare its sensors
    two = opened_and_changed("record", lambda d: d.isel(horizontal=[0, 1]))
    assert ends_well(next(c for c in COMMANDS if c.words.startswith("open-loop")), two, tmp_path) == 2
    slow = {"time": np.arange(300.0)}
    slow = opened_and_changed("long record", lambda d: d.assign_coords(slow).assign_attrs(sample_rate_hz=1.0))
    assert ends_well(next(c for c in COMMANDS if c.words.startswith("decompose {}")), slow, tmp_path) == 2


# ------------------------------------------------------------------------------------------------- UDP
FLOATS = st.floats() | st.sampled_from([0.0, 1.0, -1.0, 1e308, -1e308, 5e-324])
U32, U64 = st.integers(0, 2**32 - 1), st.integers(0, 2**64 - 1)
FEW = st.integers(0, 3)


@st.composite
def datagrams(draw, actuators: int, valves: int):
    """A frame of any kind, right or wrong in one or another of its fields, without CRC so that all of it is read."""
    n, m = draw(st.just(actuators) | st.integers(0, 255)), draw(st.just(valves) | st.integers(0, 255))
    kind, session, sequence = draw(st.integers(1, 7)), draw(FEW), draw(FEW | U32)
    flags, k = draw(st.sampled_from([0, 4])), draw(FEW)
    fields = (
        b"LHP6",
        2,
        kind,
        0,
        draw(FEW),
        n,
        m,
        flags | k << 8,
        session,
        sequence,
        draw(U32),
        draw(U64),
        draw(U64),
        0,
        0,
    )
    head = struct.pack("<4s6BH3I2Q2I", *fields)
    sensors = 8 * (24 + 2 * n + (3 * n + k + 1) * (flags > 0))
    size = {2: 40 + 16 * n, 3: 8 * m, 4: sensors, 6: 96, 7: 40}.get(kind, 0)
    numbers = struct.pack(f"<{size // 8}d", *[draw(FLOATS)] * (size // 8))
    datagram = bytearray(head + draw(st.just(numbers) | st.binary(min_size=size, max_size=size)))
    if draw(st.booleans()):
        return bytes(datagram)
    return draw(fuzzing.damaged_bytes(bytes(datagram)))


@pytest.mark.parametrize("open_valves", [1, 2])
def test_no_sequence_of_datagrams_upsets_a_served_plant(open_valves):
    plant, rest = at_rest(load_machine().with_valves(open_valves))
    valves = 6 + 4 * open_valves

    @settings(max_examples=max(20, settings().max_examples // 2), suppress_health_check=CHECKS)
    @given(
        st.sampled_from(LinkMode),
        st.lists(st.sampled_from(["again", "tick", "late"]) | datagrams(10, valves), max_size=20),
        st.lists(FLOATS, min_size=valves, max_size=valves),
    )
    def holds(mode, parts, numbers):
        table, now, heard = ServedPlant(plant, rest, mode), 0, []
        hello = encode(Datagram(Kind.HELLO, 1))
        command = encode(Datagram(Kind.COMMAND, 1, valves=valves, sequence=1, numbers=np.nan_to_num(numbers)))
        with no_leak():
            for part in (hello, command, *parts):
                if isinstance(part, bytes):
                    heard.append(part)
                if part in ("tick", "late"):
                    now += SECOND // 2048 if part == "tick" else 3 * SECOND
                    table.watch(now)
                    table.tick(now)
                else:
                    for answer in table.receive(heard[len(heard) // 2] if part == "again" else part, "a", now):
                        with suppress(VersionError):  # in the version of a client that is too old
                            decode(answer)
            assert (np.abs(table.spool) <= 1.0).all()
            counts, answered = table.counts, sum(part not in ("tick", "late") for part in parts)
            dropped = counts["late"] + counts["duplicate"] + counts["short"] + counts["malformed"] + counts["foreign"]
            assert counts["received"] == 2 + answered >= dropped
            decode(table.receive(encode(Datagram(Kind.BYE, table._session)), "a", now)[0])

    holds()


def wire(answers: list[bytes]) -> mock.Mock:
    """In place of a client's socket: whatever is sent, it answers with datagrams of the client's own session."""
    found = mock.Mock(queue=[])

    def send(datagram: bytes) -> None:
        found.queue = [answer[:12] + datagram[12:16] + answer[16:] for answer in answers]

    def receive(size: int) -> bytes:
        if not found.queue:
            raise BlockingIOError
        return found.queue.pop(0)[:size]

    found.send, found.recv = send, receive
    found.fileno.return_value = 3
    return found


@settings(suppress_health_check=CHECKS)
@given(st.lists(datagrams(2, 3), max_size=6), st.lists(st.integers(0, 255), min_size=2, max_size=2), FEW)
def test_no_answer_of_a_server_upsets_a_client(answers, valves, more):
    about = Welcome(2048.0, "m", ("a", "b"), tuple(valves))
    right = [
        encode(Datagram(Kind.WELCOME, 0, actuators=2, valves=min(sum(valves), 255), welcome=about)),
        encode(Datagram(Kind.SENSORS, 0, actuators=2 + more, numbers=np.zeros(10 + 2 * more + MOTION))),
    ]
    right = [frame[:10] + b"\0\0" + frame[12:40] + bytes(4) + frame[44:] for frame in right]
    line = wire([*answers, *right])
    with (
        no_leak(),
        mock.patch.object(client.socket, "socket", lambda *_: line),
        mock.patch.object(client.select, "select", lambda *_: ([line] if line.queue else [], [], [])),
    ):
        try:
            found = client.LinkClient(timeout=1e-3, tries=1)
            n = len(found.actuators)
            assert found.reading.sensors.displacement.shape == found.reading.sensors.force.shape == (n,)
            found.exchange(np.zeros(n))
            assert found.reading.sensors.displacement.shape == (n,)
            found.close()
        except LhpostError:
            return
