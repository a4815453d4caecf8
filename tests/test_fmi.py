"""The FMU is the plant: driven by FMPy, it does what `RunningPlant` does, to the last bit, and fails as plainly."""

import logging
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from machine_cases import machine_named
from run_cases import at_rest

from lhpost6_pin.core.errors import ParameterError, SimulationError
from lhpost6_pin.core.names import AXES, SAMPLE_RATE
from lhpost6_pin.effects.effect import Effect
from lhpost6_pin.interfaces.fmi import export_fmu
from lhpost6_pin.interfaces.fmi.machine_file import load_machine_file, save_machine_file
from lhpost6_pin.machine.machine import Machine, load_machine
from lhpost6_pin.mechanics.coupled import motion_numbers, wrench_of
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.pose import platen_motion
from lhpost6_pin.simulation.running import RunningPlant

builder = pytest.importorskip("pythonfmu.builder", reason="pythonfmu makes the FMU: pip install pythonfmu")
fmpy = pytest.importorskip("fmpy", reason="FMPy runs the FMU: pip install fmpy")
fmi2 = pytest.importorskip("fmpy.fmi2")
FMICallException = pytest.importorskip("fmpy.fmi1").FMICallException
HAS_BINARY = builder.FmuBuilder.has_binary()
pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not HAS_BINARY, reason="pythonfmu brings no library for this platform"),
]

STEP = 1.0 / SAMPLE_RATE
DISCARD = 2  # fmi2Status
TERMINATED = 3  # fmi2StatusKind


class Instance:
    """An instance of an extracted FMU, initialised, with its variables by name."""

    def __init__(self, folder: str, name: str = "table", **parameters: str | int) -> None:
        about = fmpy.read_model_description(folder)
        self.numbers = {v.name: v.valueReference for v in about.modelVariables}
        identifier = about.coSimulation.modelIdentifier
        self.fmu = fmi2.FMU2Slave(guid=about.guid, unzipDirectory=folder, modelIdentifier=identifier, instanceName=name)
        self.fmu.instantiate()
        self.initialise(**parameters)

    def initialise(self, start: float = 0.0, **parameters: str | int) -> None:
        self.fmu.setupExperiment(startTime=start)
        for name, value in parameters.items():
            (self.fmu.setString if isinstance(value, str) else self.fmu.setInteger)([self.numbers[name]], [value])
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def command(self, values: np.ndarray) -> None:
        """Set all inputs (n_actuators,)."""
        inputs = [number for name, number in self.numbers.items() if name.startswith("spool_command_")]
        self.fmu.setReal(inputs, list(values))

    def step(self, time: float, size: float = STEP) -> None:
        self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=size)

    def read(self, channel: str) -> np.ndarray:
        return np.array(self.fmu.getReal([number for name, number in self.numbers.items() if name.startswith(channel)]))

    @property
    def status(self) -> int:
        """0 running, 1 stopped."""
        return self.fmu.getInteger([self.numbers["status"]])[0]

    @property
    def trouble(self) -> str:
        return self.fmu.getString([self.numbers["trouble"]])[0].decode()


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """The nominal table as an FMU."""
    path = tmp_path_factory.mktemp("made") / "lhpost6.fmu"
    export_fmu(load_machine(), path)
    return path


@pytest.fixture(scope="module")
def folder(made, tmp_path_factory) -> str:
    """The same, extracted."""
    return fmpy.extract(str(made), str(tmp_path_factory.mktemp("a folder")))  # a space in its name


@pytest.fixture
def instance(folder) -> Iterator[Instance]:
    one = Instance(folder)
    yield one
    one.fmu.freeInstance()


def spools(rest: np.ndarray, samples: int) -> np.ndarray:
    """Commands (samples, n_actuators): a sine of its own about what holds each actuator at rest."""
    t = np.arange(samples)[:, None] / SAMPLE_RATE
    size = np.where(np.arange(len(rest)) < 4, 0.1, 0.02)
    return rest + size * np.sin(2 * np.pi * t * np.linspace(2.0, 5.0, len(rest)))


def measured(table: RunningPlant) -> dict[str, np.ndarray]:
    """What an FMU of this plant ought to tell."""
    sensors, state = table.sensors(), table.state
    platen = platen_motion(table.plant, state.q[None], state.v[None], np.zeros((1, len(state.v))))
    z = dict(zip(table.plant.states, state.z, strict=True))
    pressures = {
        f"chamber_pressure_{side}": np.array(
            [z[n] for a in table.plant.machine.actuator_names for n in z if n.endswith(f".{a}.pressure_{side}")]
        )
        for side in "ab"
    }
    interface = np.split(motion_numbers(table.interface_motion()), 3)
    return pressures | {
        "actuator_displacement": sensors.displacement,
        "actuator_force": sensors.force,
        "platen_acceleration": sensors.acceleration,
        "platen_displacement": platen.displacement[0],
        "platen_velocity": platen.velocity[0],
        "spool_position": table.spool,
        **dict(zip(("interface_pose", "interface_velocity", "interface_acceleration"), interface, strict=True)),
    }


def assert_same(instance: Instance, table: RunningPlant) -> None:
    for channel, ours in measured(table).items():
        np.testing.assert_array_equal(instance.read(channel), ours, err_msg=channel)


def assert_follows(instance: Instance, table: RunningPlant, samples: int = 100) -> None:
    """Over some moving samples the FMU is the plant."""
    for k, command in enumerate(spools(table.spool, samples)):
        instance.command(command)
        instance.step(k * STEP)
        table.advance(command)
    assert_same(instance, table)
    instance.fmu.freeInstance()


def refused(instance: Instance, *step: float) -> int:
    with pytest.raises(FMICallException) as failure:
        instance.step(*step)
    return failure.value.status


def test_the_model_description_is_valid_and_says_what_the_fmu_can(made):
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(made)) == []
    about = fmpy.read_model_description(str(made))
    assert not about.coSimulation.canHandleVariableCommunicationStepSize
    assert not about.coSimulation.canGetAndSetFMUstate
    assert about.coSimulation.needsExecutionTool
    assert about.defaultExperiment.stepSize == str(STEP)
    assert "Needs a 64-bit Python with lhpost6-pin" in about.description
    units = {v.name: v.unit for v in about.modelVariables if v.type == "Real"}
    assert units["actuator_force_V6"] == "N" and units["platen_acceleration_yaw"] == "rad/s2"
    assert [n for n in units if n.startswith("platen_velocity_")] == [f"platen_velocity_{axis}" for axis in AXES]
    assert len(about.outputs) == 10 * 4 + 4 + 18 + 18 + 1
    assert units["interface_wrench_mx"] == "N.m" and units["interface_acceleration_pitch"] == "rad/s2"
    assert all(unknown.dependencies == [] for unknown in about.outputs)  # no direct feedthrough


def test_the_exporter_leaves_pythons_imports_and_earlier_files_as_they_were(tmp_path):
    path = list(sys.path)
    export_fmu(load_machine("uniaxial"), tmp_path / "a.fmu")
    assert sys.path == path and "lhpost6_fmu" not in sys.modules
    before = (tmp_path / "a.fmu").read_bytes()
    lost = load_machine().with_specimen(tmp_path / "absent.urdf")
    with pytest.raises(ParameterError, match=r"absent\.urdf: no such URDF file"):
        export_fmu(lost, tmp_path / "a.fmu")
    assert (tmp_path / "a.fmu").read_bytes() == before and [p.name for p in tmp_path.iterdir()] == ["a.fmu"]


def test_the_fmu_brings_the_licences_of_what_is_in_it(made):
    with zipfile.ZipFile(made) as fmu:
        texts = {name: fmu.read(f"documentation/licenses/{name}.txt").decode() for name in ("lhpost6-pin", "pythonfmu")}
    assert "BSD 3-Clause" in texts["lhpost6-pin"]
    assert "MIT License" in texts["pythonfmu"] and "Mozilla Public License" in texts["pythonfmu"]


@pytest.mark.parametrize("samples", [1, 4])
def test_the_fmu_is_the_plant_to_the_last_bit(instance, plant, rest, samples):
    """Steps of one and four samples with the inputs held; the same compiled code, so nothing may differ."""
    table = RunningPlant(plant, rest)
    assert_same(instance, table)
    for k, command in enumerate(spools(rest.spool, SAMPLE_RATE)[::samples]):
        instance.command(command)
        assert_same(instance, table)  # no direct feedthrough
        instance.step(k * samples * STEP, samples * STEP)
        for _ in range(samples):
            table.advance(command)
    assert table.time == 1.0 and np.abs(table.sensors().displacement).max() > 1e-3
    assert_same(instance, table)


@pytest.mark.parametrize("order", [0, 1])
def test_a_wrench_acts_as_on_the_plant_to_the_last_bit(folder, plant, rest, order):
    """Steps of two samples: the wrench is taken at their start, held, or continued as `RunningPlant` does."""
    one = Instance(folder, wrench_order=order)
    table = RunningPlant(plant, rest, wrench_order=order)
    inputs = [one.numbers[f"interface_wrench_{name}"] for name in ("fx", "fy", "fz", "mx", "my", "mz")]
    for k in range(0, 200, 2):
        push = np.array([1e5, 2e4, -1e5, 1e4, 0.0, 3e4]) * np.sin(0.05 * k)
        one.fmu.setReal(inputs, list(push))
        one.step(k * STEP, 2 * STEP)
        table.advance(rest.spool, wrench_of(push))
        table.advance(rest.spool)
    assert np.abs(table.sensors().displacement).max() > 1e-4
    assert_same(one, table)
    one.fmu.freeInstance()


def test_fmpys_own_loop_drives_it_within_a_nanometre(made, plant, rest):
    """FMPy interpolates its input at the steps' times, which may cost the last bits of a command."""
    commands = spools(rest.spool, SAMPLE_RATE // 2 + 1)
    t = np.arange(len(commands)) * STEP
    names = [f"spool_command_{name}" for name in plant.machine.actuator_names]
    told = fmpy.simulate_fmu(
        str(made),
        stop_time=0.5,
        output_interval=STEP,
        input=np.rec.fromarrays([t, *commands.T], names=["time", *names]),
    )
    table = RunningPlant(plant, rest)
    found = []
    for command in commands:
        found.append(table.sensors().displacement)
        table.advance(command)
    theirs = np.column_stack([told[f"actuator_displacement_{name}"] for name in plant.machine.actuator_names])
    assert np.abs(found).max() > 1e-3
    np.testing.assert_allclose(theirs, found, rtol=0, atol=1e-9)
    assert not told["status"].any()


@pytest.mark.parametrize("size", [0.001, 0.5 * STEP, 1.5 * STEP, 0.0, -STEP])
def test_a_step_that_is_no_multiple_of_a_sample_fails_and_says_which_to_use(instance, caplog, size):
    assert refused(instance, 0.0, size) == DISCARD
    assert f"a communication step of {size!r} s is no positive multiple of 1/2048 s" in caplog.text
    instance.step(0.0)  # the plant has not moved
    assert instance.status == 0


def test_a_step_from_another_time_than_the_plants_fails(instance, caplog):
    instance.step(0.0)
    refused(instance, 0.0)
    assert "the plant is at 0.000488 s; it can neither go back nor skip time" in caplog.text


def test_the_clock_may_start_at_any_time_and_its_rounding_is_forgiven(folder):
    late = Instance(folder)
    late.fmu.reset()
    late.initialise(start=100.1)
    for k in range(2 * SAMPLE_RATE):
        late.step(100.1 + k * STEP, (100.1 + (k + 1) * STEP) - (100.1 + k * STEP))
    assert late.status == 0
    late.fmu.freeInstance()


def test_leaving_the_stroke_stops_the_plant_with_a_reason_and_keeps_the_last_outputs(instance, rest, caplog):
    command = rest.spool.copy()
    command[4:] = 1.0  # all six vertical actuators up, 0.127 m to go at 0.8 m/s, and more push than the bumpers bear
    instance.command(command)
    with pytest.raises(FMICallException) as failure:
        for k in range(2 * SAMPLE_RATE):
            before = instance.read("actuator_displacement")
            instance.step(k * STEP)
    assert failure.value.status == DISCARD and 0.1 < k * STEP < 1.0
    assert instance.fmu.getBooleanStatus(TERMINATED) and instance.status == 1
    assert "V" in instance.trouble and "left its stroke" in instance.trouble and instance.trouble in caplog.text
    np.testing.assert_array_equal(instance.read("actuator_displacement"), before)
    assert refused(instance, k * STEP) == DISCARD
    instance.fmu.terminate()


def test_a_command_that_is_not_finite_stops_the_plant(instance):
    instance.command(np.full(10, np.nan))
    refused(instance, 0.0)
    assert instance.status == 1 and "finite spool values" in instance.trouble


def test_reset_brings_a_fresh_plant_also_after_a_stop(instance, plant, rest):
    commands = spools(rest.spool, 100)
    for k, command in enumerate(commands):
        instance.command(command)
        instance.step(k * STEP)
    first = instance.read("platen_acceleration")
    instance.command(np.full(10, np.nan))
    refused(instance, 100 * STEP)
    instance.fmu.terminate()
    for _ in range(2):
        instance.fmu.reset()
        instance.initialise()
        assert_same(instance, RunningPlant(plant, rest))
        for k, command in enumerate(commands):
            instance.command(command)
            instance.step(k * STEP)
        np.testing.assert_array_equal(instance.read("platen_acceleration"), first)
        instance.fmu.terminate()


def test_instances_in_one_process_share_nothing_and_come_and_go_alike(instance, folder, plant, rest):
    """One runs at 4096 steps a second, one moves while the other rests: each equals its own plant."""
    other = Instance(folder, "other", steps_per_second=2 * SAMPLE_RATE)
    tables = [RunningPlant(plant, rest), RunningPlant(plant, rest, steps_per_second=2 * SAMPLE_RATE)]
    for k, command in enumerate(spools(rest.spool, 300)):
        for one, table, moved in zip((instance, other), tables, (command, 2 * rest.spool - command), strict=True):
            one.command(moved)
            one.step(k * STEP)
            table.advance(moved)
    assert_same(instance, tables[0])
    assert_same(other, tables[1])
    other.fmu.freeInstance()
    for k in range(20):
        assert_follows(Instance(folder, f"table {k}"), RunningPlant(plant, rest), 1)
    instance.step(300 * STEP)
    tables[0].advance(command)
    assert_same(instance, tables[0])


def test_parameters_choose_scheme_rate_and_changes_of_the_machine(folder):
    text = "[platen]\nmass = { value = [150e3, 150e3, 160e3], unit = 'kg' }\n"
    one = Instance(folder, scheme="rk4", steps_per_second=4 * SAMPLE_RATE, override=text)
    changed = load_machine().with_params(platen__mass=[150e3, 150e3, 160e3])
    assert_follows(one, RunningPlant(*at_rest(changed), scheme="rk4"))


@pytest.mark.parametrize(
    "parameters, reason",
    [
        ({"scheme": "verlet"}, "no scheme named 'verlet'"),
        ({"steps_per_second": 3000}, "got 3000"),
        ({"override": "[platen]\nmas = { value = 1.0 }"}, "platen.mas"),
        ({"override": "= 1"}, "not a TOML file"),
    ],
)
def test_parameters_that_cannot_be_stop_the_plant_from_the_start_and_say_why(folder, caplog, parameters, reason):
    one = Instance(folder, **parameters)
    assert one.status == 1 and reason in one.trouble and reason in caplog.text
    assert np.isnan(one.read("actuator_force")).all() and refused(one, 0.0) == DISCARD
    one.fmu.reset()
    one.initialise()
    one.step(0.0)
    assert one.status == 0
    one.fmu.freeInstance()


def test_an_fmu_run_by_another_version_says_so(made, tmp_path, caplog):
    fmpy.extract(str(made), str(tmp_path))
    file = tmp_path / "resources" / "machine.json"
    file.write_text(file.read_text().replace('"lhpost6_pin": "', '"lhpost6_pin": "0.0.0+'))
    one = Instance(str(tmp_path))
    for k in range(200):
        one.step(k * STEP)
    assert np.abs(one.read("actuator_displacement")).max() < 1e-9  # rest without inputs: rounding of 1e7 Pa
    assert one.status == 0 and one.trouble == ""
    one.fmu.freeInstance()
    assert [r.levelno for r in caplog.records] == [logging.WARNING]
    assert "made with lhpost6_pin 0.0.0+" in caplog.text


def with_everything() -> Machine:
    """A machine changed in every way that there is."""
    return (
        load_machine()
        .with_params({"platen.mass": [0.1 + 0.2, 1e5 / 3, 2e5], "horizontal.valves": 2, "H3.seal_friction": 1 / 3})
        .with_effect(Effect("drag", "viscous", ("platen.x",), ((1e4 / 7,),), "test"))
        .with_specimen("pendulum", (0.1, 0.2, 0.3), locked=True)
    )


def test_a_machine_changed_in_every_way_comes_back(tmp_path):
    machine = with_everything()
    save_machine_file(machine, tmp_path)
    back = load_machine_file(tmp_path)[0]
    assert back.specimen is not None and back.specimen.file.parent == tmp_path
    assert back.parameters == machine.parameters and back.added_effects == machine.added_effects
    for ours, theirs in zip(make_plant(machine).zero_state(), make_plant(back).zero_state(), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_array_equal(make_plant(machine).rows, make_plant(back).rows)
    for machine in map(machine_named, ("lhpost6", "stewart", "uniaxial")):
        save_machine_file(machine, tmp_path)
        assert load_machine_file(tmp_path)[0] == machine


def test_the_fmu_needs_no_file_of_its_machine(tmp_path):
    """Overrides, valves, an effect and a specimen are inside: it runs after the files are gone, as the machine does."""
    machine = with_everything()
    urdf = tmp_path / "moved.urdf"
    urdf.write_bytes(machine.specimen.file.read_bytes())
    machine = machine.with_specimen(urdf)
    plant, rest = at_rest(machine)
    export_fmu(machine, tmp_path / "a.fmu")
    urdf.unlink()
    one = Instance(fmpy.extract(str(tmp_path / "a.fmu"), str(tmp_path / "a")))
    assert_follows(one, RunningPlant(plant, rest))


def test_a_guided_machine_becomes_an_fmu_too(tmp_path):
    plant, rest = at_rest(load_machine("uniaxial"))
    export_fmu(plant.machine, tmp_path / "uniaxial.fmu")
    one = Instance(fmpy.extract(str(tmp_path / "uniaxial.fmu"), str(tmp_path / "a")))
    assert_follows(one, RunningPlant(plant, rest))


def test_without_pythonfmu_or_the_right_suffix_nothing_is_exported(tmp_path, monkeypatch):
    with pytest.raises(SimulationError, match=r"ends in \.fmu"):
        export_fmu(load_machine(), tmp_path / "a.zip")
    monkeypatch.setitem(sys.modules, "pythonfmu.builder", None)
    with pytest.raises(SimulationError, match="pip install"):
        export_fmu(load_machine(), tmp_path / "a.fmu")
    assert list(tmp_path.iterdir()) == []


def test_the_command_line_exports_a_machine_with_its_changes(lhpost6, tmp_path, caplog, monkeypatch):
    changes = tmp_path / "change.toml"
    changes.write_text("[platen]\nmass = { value = [150e3, 150e3, 160e3], unit = 'kg' }\n")
    out = tmp_path / "new" / "table.fmu"
    ended = lhpost6("export-fmu", "--override", changes, "--valves", "2", "--out", out)
    assert ended.code == 0 and str(out) in ended.out.replace("\n", "") and "will be replaced" not in caplog.text
    monkeypatch.setattr("lhpost6_pin.interfaces.fmi.export_fmu", lambda *_: None)
    assert lhpost6("export-fmu", "--out", out).code == 0 and "an earlier FMU will be replaced" in caplog.text
    machine, _ = load_machine_file(Path(fmpy.extract(str(out), str(tmp_path / "a"))) / "resources")
    assert machine.platen.mass == (150e3, 150e3, 160e3)
    assert {a.valves for a in machine.actuators if a.area_b is not None} == {2}
