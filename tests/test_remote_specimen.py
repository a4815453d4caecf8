"""A specimen in another process: the same motion as in this one, whatever is lost on the way; and what is refused."""

import json
import socket
import struct
import subprocess
import sys
import threading
from contextlib import contextmanager

import numpy as np
import pinocchio as pin
import pytest
from coupled_cases import moving, tower
from hypothesis import given
from hypothesis import strategies as st

from lhpost6_pin.core.errors import ParameterError, SimulationError
from lhpost6_pin.interfaces.link import ServedSpecimen, open_socket, serve_specimen
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics import remote_specimen as remote
from lhpost6_pin.mechanics.coupled import motion_numbers, motion_of_numbers
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.remote_specimen import Message, MessageKind, decode_message, encode_message
from lhpost6_pin.simulation.coupling import CouplingOptions
from lhpost6_pin.simulation.simulate import simulate

SAMPLES = 200
BASE = np.zeros(18)


class Stating:
    """A mass on the platen that states its interface mass."""

    inertia = pin.Inertia.Zero()

    def interface_mass(self, dt):
        return np.diag([5e3] * 3 + [1e3] * 3)

    def init(self, base, gravity):
        return {}, pin.Force(np.array([0.0, 0.0, -5e3 * gravity, 0.0, 0.0, 0.0]))

    def step(self, memory, base, dt):
        return pin.Force(-self.interface_mass(dt) @ base.acceleration.vector - [0, 0, 5e3 * 9.80665, 0, 0, 0])


class Failing(Stating):
    """One that fails at its third step."""

    def step(self, memory, base, dt):
        memory["n"] = memory.get("n", 0) + 1
        if memory["n"] == 3:
            raise RuntimeError("a bolt broke")
        return super().step(memory, base, dt)


@contextmanager
def served(specimen, losing=0):
    """Address of a specimen served by another thread; of its answers every `losing`-th is lost."""
    stop = threading.Event()
    with open_socket("127.0.0.1", 0) as sock:
        server = ServedSpecimen(specimen)
        if losing:
            answer, count = server.receive, [0]

            def receive(datagram):
                count[0] += 1
                found = answer(datagram)
                return None if count[0] % losing == 0 else found

            server.receive = receive
        thread = threading.Thread(target=serve_specimen, args=(sock, server), kwargs={"stop": stop}, daemon=True)
        thread.start()
        try:
            yield f"udp:127.0.0.1:{sock.getsockname()[1]}", server
        finally:
            stop.set()
            thread.join(5.0)


def motion_of(specimen, options=None):
    plant = make_plant(load_machine().with_specimen(specimen))
    return simulate(plant, moving(find_equilibrium(plant), SAMPLES), samples=SAMPLES, coupling=options)


@pytest.mark.long
@pytest.mark.parametrize("every_step", [False, True])
def test_a_specimen_over_the_network_moves_the_table_as_one_in_the_same_process(monkeypatch, every_step):
    monkeypatch.setattr(remote, "_PATIENCE", 0.05)
    own = tower(2e4)
    options = CouplingOptions(every_step=every_step)
    here = motion_of(own, options)
    with served(own, losing=37) as (address, server):
        there = motion_of(address, options)
    assert server.steps >= SAMPLES * (4 if every_step else 1) - 1
    # Euler angles of a pose and back are rounded
    assert np.allclose(there.q, here.q, rtol=0.0, atol=1e-12)
    assert np.allclose(there.coupling.wrench, here.coupling.wrench, rtol=1e-9, atol=1e-4)
    assert there.coupling.stability.growth == pytest.approx(here.coupling.stability.growth, rel=1e-9)


@pytest.mark.long
def test_a_stated_interface_mass_comes_over_the_network():
    with served(Stating()) as (address, server):
        there = motion_of(address)
    assert np.array_equal(there.coupling.stability.interface_mass, Stating().interface_mass(0.0))
    here = motion_of(Stating())
    assert np.allclose(there.q, here.q, rtol=0.0, atol=1e-12)
    assert server.rests < 7  # it was not probed


@pytest.mark.long
def test_a_specimen_that_fails_ends_the_run_with_its_reason():
    with served(Failing()) as (address, _):
        run = motion_of(address)
    assert "Failing.step failed" in run.trouble and "a bolt broke" in run.trouble
    assert 0 < len(run.time) < SAMPLES


def test_where_nothing_listens_the_remedy_is_said(monkeypatch):
    monkeypatch.setattr(remote, "_PATIENCE", 0.01)
    with open_socket("127.0.0.1", 0) as silent:
        address = f"udp:127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(ParameterError, match=f"no specimen answered at {address} .*lhpost6 serve-specimen"):
            make_plant(load_machine().with_specimen(address))


@pytest.mark.parametrize("address", ["udp:46947", "udp:127.0.0.1:", "udp:host:99999", "udp:a:b"])
def test_an_address_that_is_none_is_refused(address):
    with pytest.raises(ParameterError, match="write udp:HOST:PORT"):
        make_plant(load_machine().with_specimen(address))


def test_a_specimen_elsewhere_has_no_joints_to_lock():
    with pytest.raises(ParameterError, match="no joints or modes to lock"):
        load_machine().with_specimen("udp:127.0.0.1:46947", locked=True)


# ------------------------------------------------------------------------------------------------ datagrams
def ask(server, kind, numbers, sequence):
    return server.receive(encode_message(Message(kind, 7, sequence, np.asarray(numbers, float))))


def test_the_same_request_gets_the_same_answer_and_moves_nothing():
    server = ServedSpecimen(Stating())
    rest = ask(server, MessageKind.REST, [9.8, *BASE], 1)
    first, again = (ask(server, MessageKind.STEP, [1 / 2048, *BASE], 2) for _ in range(2))
    assert first == again and first != rest
    assert (server.rests, server.steps) == (1, 1)


def test_a_step_before_rest_fails_with_a_reason():
    answer = decode_message(ask(ServedSpecimen(Stating()), MessageKind.STEP, [1 / 2048, *BASE], 1))
    assert answer.kind == MessageKind.FAILED and "before the specimen was put at rest" in answer.text


def test_a_datagram_is_as_documented_to_the_byte():
    datagram = encode_message(Message(MessageKind.WRENCH, 0x01020304, 5, np.arange(6.0)))
    assert datagram[:8] == b"LHPS\x01\x05\x00\x00"
    assert struct.unpack_from("<II", datagram, 8) == (0x01020304, 5)
    assert struct.unpack_from("<6d", datagram, 20) == (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)
    assert len(datagram) == 20 + 48


NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
SIZED = st.sampled_from([(k, n) for k, sizes in remote._SIZES.items() for n in sizes])


@given(data=st.data(), kind=SIZED, session=st.integers(0, 2**32 - 1), sequence=st.integers(0, 2**32 - 1))
def test_a_message_reads_back(data, kind, session, sequence):
    numbers = np.array(data.draw(st.lists(NUMBERS, min_size=kind[1], max_size=kind[1])))
    found = decode_message(encode_message(Message(kind[0], session, sequence, numbers)))
    assert found[:3] == (kind[0], session, sequence) and np.array_equal(found.numbers, numbers)


@given(st.binary(max_size=200))
def test_garbage_is_no_message_and_gets_no_answer(content):
    with pytest.raises(ValueError):
        decode_message(content)
    assert ServedSpecimen(Stating()).receive(content) is None


@given(at=st.integers(0, 67), bit=st.integers(0, 7))
def test_a_flipped_bit_is_noticed(at, bit):
    datagram = bytearray(encode_message(Message(MessageKind.WRENCH, 1, 2, np.arange(6.0))))
    datagram[at] ^= 1 << bit
    with pytest.raises(ValueError):
        decode_message(bytes(datagram))


def test_numbers_that_are_not_finite_are_not_sent():
    with pytest.raises(ValueError, match="not finite"):
        encode_message(Message(MessageKind.WRENCH, 1, 1, np.full(6, np.nan)))


def test_a_motion_reads_back_from_its_numbers():
    pose = pin.SE3(pin.rpy.rpyToMatrix(0.02, -0.01, 0.03), np.array([0.1, -0.2, 0.05]))
    numbers = np.concatenate([pose.translation, [0.02, -0.01, 0.03], np.arange(12.0)])
    assert np.allclose(motion_numbers(motion_of_numbers(numbers)), numbers, rtol=0.0, atol=1e-15)


# ------------------------------------------------------------------------------------------------ commands
@pytest.mark.parametrize(
    "options, said",
    [
        (["--exchange", "never"], "no exchange with a specimen named 'never'"),
        (["--exchange", "step"], "concern a specimen that is a program"),
        (["--held", "--specimen", "block_4_9MN"], "concern a specimen that is a program"),
    ],
)
def test_options_of_the_exchange_are_checked(lhpost6, options, said):
    ended = lhpost6("run", "sine", *options)
    assert ended.code == 2 and said in " ".join(ended.err.split())


def test_what_is_no_program_is_not_served(lhpost6):
    ended = lhpost6("serve-specimen", "block_4_9MN")
    assert ended.code == 2 and "is no FILE.py:NAME" in " ".join(ended.err.split())


def test_a_served_specimen_ends_after_its_time(lhpost6, tmp_path):
    (tmp_path / "mass.py").write_text(
        "import numpy as np, pinocchio as pin\n"
        "class Mass:\n"
        "    inertia = pin.Inertia.Zero()\n"
        "    def init(self, base, gravity): return None, pin.Force.Zero()\n"
        "    def step(self, memory, base, dt): return pin.Force.Zero()\n"
    )
    ended = lhpost6("serve-specimen", "mass.py:Mass", "--port", 0, "--seconds", 0.1)
    assert ended.code == 0 and "Mass listens at 127.0.0.1" in ended.out and "0 starts, 0 steps" in ended.out


def test_a_served_specimen_that_is_terminated_prints_its_counts_and_keeps_what_it_wrote(tmp_path):
    """SIGTERM, as a job scheduler or `kill` sends it; a buffered line of a file is lost if the process just ends."""
    (tmp_path / "mass.py").write_text(
        "import pinocchio as pin\n"
        "class Mass:\n"
        "    inertia = pin.Inertia.Zero()\n"
        "    def init(self, base, gravity):\n"
        "        self.file = open('history.txt', 'w')\n"
        "        self.file.write('at rest')\n"
        "        return None, pin.Force.Zero()\n"
        "    def step(self, memory, base, dt): return pin.Force.Zero()\n"
    )
    command = [sys.executable, "-c", "from lhpost6_pin.cli import main; main()", "serve-specimen", "mass.py:Mass"]
    command += ["--port", "0", "--json"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, cwd=tmp_path, **pipes) as server:
        try:
            port = int(server.stderr.readline().split("127.0.0.1:")[1].split(":")[0])
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as table:
                table.settimeout(30.0)
                message = Message(MessageKind.REST, 7, 1, np.asarray([9.8, *BASE], float))
                table.sendto(encode_message(message), ("127.0.0.1", port))
                table.recv(2048)
            server.terminate()
            out, _ = server.communicate(timeout=30.0)
        finally:
            server.kill()
    assert server.returncode == 0 and json.loads(out)["rests"] == 1
    assert (tmp_path / "history.txt").read_text() == "at rest"


def test_a_busy_port_is_said(lhpost6, tmp_path):
    (tmp_path / "m.py").write_text(
        "import pinocchio as pin\nclass M:\n    inertia = pin.Inertia.Zero()\n"
        "    def init(self, b, g): ...\n    def step(self, m, b, d): ...\n"
    )
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        ended = lhpost6("serve-specimen", "m.py:M", "--port", taken.getsockname()[1])
    assert ended.code == 2 and "cannot listen" in " ".join(ended.err.split())


def test_errors_name_the_specimen(monkeypatch):
    monkeypatch.setattr(remote, "_PATIENCE", 0.01)
    with served(Failing()) as (address, _):
        far = remote.RemoteSpecimen(address)
        base = motion_of_numbers(BASE)
        far.init(base, 9.8)
        with pytest.raises(SimulationError, match=f"the specimen at {address} failed: .*a bolt broke"):
            for _ in range(3):
                far.step(None, base, 1 / 2048)
