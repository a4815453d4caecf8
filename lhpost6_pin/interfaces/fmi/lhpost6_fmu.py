"""The program of the FMU: an instance is a `RunningPlant` behind the functions of FMI.

`export_fmu` puts this file into the FMU; there pythonfmu imports it as a module of its own, so it names what it needs
of lhpost6_pin in full. Two faults of pythonfmu 0.7.0 shape it, each of which brings the whole process down later: it
gives back the module's names once too often for each instance, so that the class must be defined here, with its
methods, which keep them alive; and it miscounts an exception, so that none may leave a method.
"""

import logging
import re
import tempfile
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from pythonfmu import DefaultExperiment, Fmi2Causality, Fmi2Slave, Integer, Real, String
from pythonfmu.enums import Fmi2Initial, Fmi2Status, Fmi2Variability

from lhpost6_pin import __version__
from lhpost6_pin.core.errors import SimulationError
from lhpost6_pin.core.names import AXES, SAMPLE_RATE, SCHEMES
from lhpost6_pin.data.channels import LAYOUT, MOTION, channel_unit
from lhpost6_pin.interfaces.fmi.machine_file import load_machine_file
from lhpost6_pin.machine.machine import Machine
from lhpost6_pin.mechanics.coupled import motion_numbers, wrench_of
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.pose import platen_motion
from lhpost6_pin.simulation.ledger import WRENCH_AXES
from lhpost6_pin.simulation.running import RunningPlant

__all__ = ["ShakeTable"]

log = logging.getLogger("lhpost6_pin.interfaces.fmi")

_UNITS: dict[str, dict[str, int]] = {
    "1": {},
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "rad/s2": {"rad": 1, "s": -2},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "Pa": {"kg": 1, "m": -1, "s": -2},
}
"""Units of the variables by their exponents of SI base units."""

_ACTUATORS = ("actuator_displacement", "actuator_force", "spool_position", "chamber_pressure_a", "chamber_pressure_b")

_WRENCH = {name: "N.m" if name.startswith("m") else "N" for name in WRENCH_AXES}
_INTERFACE = (
    ("pose", ("m", "rad"), "position of C in {s}, Euler angles"),
    ("velocity", ("m/s", "rad/s"), "velocity of C, angular velocity, axes of the platen"),
    ("acceleration", ("m/s2", "rad/s2"), "acceleration of C less gravity, angular acceleration, axes of the platen"),
)
"""Motion of the interface: name, units of its first and last three components, description."""

_ABOUT = """{title}
Inputs are normalised spool commands, -1..1, held over a step; outputs are the sensors at the end of it, spool \
positions means over its last sample. \
The interface_wrench is that of a specimen outside on the platen, at C in axes of the platen, at the start of a step. \
Steps are whole multiples of 1/{rate} s. No output depends directly on an input. \
Needs a 64-bit Python with lhpost6-pin {version} at run time."""


class ShakeTable(Fmi2Slave):
    """A plant at rest in the zero-position; one instance is one `RunningPlant`."""

    author = "lhpost6_pin"
    license = "BSD-3-Clause"
    version = __version__

    def __init__(self, **kwargs: Any) -> None:
        """Read the machine in the FMU's resources and declare its variables."""
        super().__init__(**kwargs)
        self._machine, exported_by = load_machine_file(Path(self.resources))
        if exported_by != __version__:
            about = f"made with lhpost6_pin {exported_by}, run with {__version__}: export it anew"
            self._tell(about, Fmi2Status.warning)
        self.modelName = re.sub(r"\W|^(?=\d)", "_", self._machine.name, flags=re.ASCII)
        self.description = _ABOUT.format(title=self._machine.title, rate=SAMPLE_RATE, version=__version__)
        self.default_experiment = DefaultExperiment(start_time=0.0, stop_time=1.0, step_size=1.0 / SAMPLE_RATE)
        self.scheme = SCHEMES[0]
        self.steps_per_second = 4 * SAMPLE_RATE
        self.override = ""
        self.wrench_order = 1
        self.status = 0
        self.trouble = ""
        self._start_time = 0.0
        self._commands: dict[int, float] = {}  # by actuator, where the master has set them
        self._wrench: dict[int, float] = {}  # by component, likewise
        self._running = False
        self._settings: tuple[str, int, str, int] | None = None
        self._table: RunningPlant | None = None
        self._rest = np.full(len(self._machine.actuators), np.nan)
        self._values = np.full(len(_outputs(self._machine)), np.nan)
        self._declare(self._machine)

    # what FMI calls, by way of pythonfmu

    def setup_experiment(self, start_time: float, *_: Any) -> None:
        """Take the time at which the table is at rest."""
        self._start_time = start_time

    def exit_initialization_mode(self) -> None:
        """Build the plant; with invalid parameters it is stopped from the start."""
        self._build()
        self._running = True

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Hold the inputs over step_size [s]; False (discarded) if the step is refused or the plant stops.

        A step that is no whole number of samples, or not at the plant's own time, is refused and changes nothing.
        A plant that leaves a stroke or diverges stops for good.
        """
        if self.status or self._table is None:
            return False
        try:
            samples = _samples(current_time - self._start_time, step_size, self._table.sample)
        except SimulationError as error:
            self._tell(str(error), Fmi2Status.discard)
            return False
        command = self._rest.copy()
        command[list(self._commands)] = list(self._commands.values())
        wrench = [self._wrench.get(k, 0.0) for k in range(len(_WRENCH))] if self._wrench else None
        try:
            for k in range(samples):
                self._table.advance(command, wrench_of(wrench) if wrench and not k else None)
        except SimulationError as error:
            self._stop(str(error))
            return False
        if self._table.trouble and not self.trouble:
            self.trouble = self._table.trouble
            self.log(self.trouble, Fmi2Status.warning)
        self._values = _measure(self._table)
        return True

    def to_xml(self, model_options: Any = None) -> Element:
        """Model description with what pythonfmu leaves out: units, initial unknowns, and no direct feedthrough."""
        root = super().to_xml(model_options or {})
        units = Element("UnitDefinitions")
        for name, exponents in _UNITS.items():
            unit = SubElement(units, "Unit", name=name)
            SubElement(unit, "BaseUnit", {base: str(power) for base, power in exponents.items()})
        root.insert(list(root).index(root.find("LogCategories")), units)
        for variable in root.iter("ScalarVariable"):
            real = variable.find("Real")
            if real is not None:
                real.set("unit", self._units[variable.attrib["name"]])
        structure = root.find("ModelStructure")
        assert structure is not None
        for unknown in structure.iter("Unknown"):
            unknown.set("dependencies", "")
        initial = SubElement(structure, "InitialUnknowns")
        for index, variable in enumerate(root.iter("ScalarVariable"), start=1):
            if variable.get("causality") == "output":
                SubElement(initial, "Unknown", index=str(index))
        return root

    # the plant behind it

    def _declare(self, machine: Machine) -> None:
        """Register parameters, inputs and outputs."""
        self._units: dict[str, str] = {}
        fixed = {
            "causality": Fmi2Causality.parameter,
            "variability": Fmi2Variability.fixed,
            "initial": Fmi2Initial.exact,
        }
        about = f"integration scheme: {', '.join(SCHEMES)}"
        self.register_variable(String("scheme", description=about, **fixed))
        about = f"model steps a second, a multiple of {SAMPLE_RATE}"
        self.register_variable(Integer("steps_per_second", description=about, **fixed))
        about = "text of a TOML file with parameters of the machine to replace"
        self.register_variable(String("override", description=about, **fixed))
        for i, name in enumerate(machine.actuator_names):
            self._real(
                f"spool_command_{name}",
                "1",
                f"spool command of {name}, -1..1; from the start what feeds the leaks at rest",
                Fmi2Causality.input,
                getter=partial(self._command, i),
                setter=partial(self._commands.__setitem__, i),
            )
        about = "wrench of the interface over a step: 0 held, 1 continued linearly from the last two"
        self.register_variable(Integer("wrench_order", description=about, **fixed))
        for i, (name, unit) in enumerate(_WRENCH.items()):
            self._real(
                f"interface_wrench_{name}",
                unit,
                f"{name} of a specimen outside on the platen, at C in axes of the platen",
                Fmi2Causality.input,
                getter=partial(self._wrench_now, i),
                setter=partial(self._wrench.__setitem__, i),
            )
        for i, (name, unit, about) in enumerate(_outputs(machine)):
            self._real(
                name,
                unit,
                about,
                Fmi2Causality.output,
                initial=Fmi2Initial.calculated,
                getter=partial(self._value, i),
            )
        state = {"variability": Fmi2Variability.discrete, "initial": Fmi2Initial.calculated}
        about = "0 running, 1 stopped: outputs stay as they were before the step that went wrong"
        self.register_variable(Integer("status", causality=Fmi2Causality.output, description=about, **state))
        about = "why the plant stopped, or from when its motion is not physical; empty before"
        self.register_variable(String("trouble", causality=Fmi2Causality.local, description=about, **state))

    def _real(self, name: str, unit: str, about: str, causality: Fmi2Causality, **others: Any) -> None:
        self._units[name] = unit
        self.register_variable(
            Real(name, causality=causality, variability=Fmi2Variability.continuous, description=about, **others)
        )

    def _build(self) -> None:
        """Build the plant at rest, if its parameters are not those that it was built with; they are fixed in a run."""
        settings = (self.scheme, self.steps_per_second, self.override, self.wrench_order)
        if self._running or settings == self._settings:
            return
        self._settings, self.status, self.trouble = settings, 0, ""
        try:
            plant = make_plant(_changed(self._machine, self.override))
            rest = find_equilibrium(plant)
            steps, order = self.steps_per_second, self.wrench_order
            self._table = RunningPlant(plant, rest, scheme=self.scheme, steps_per_second=steps, wrench_order=order)
        except Exception as error:  # any: see the top of this file
            self._stop(str(error))
        else:
            self._rest, self._values = rest.spool, _measure(self._table)

    def _value(self, output: int) -> float:
        self._build()
        return float(self._values[output])

    def _command(self, actuator: int) -> float:
        self._build()
        return self._commands.get(actuator, float(self._rest[actuator]))

    def _wrench_now(self, component: int) -> float:
        return self._wrench.get(component, 0.0)

    def _stop(self, reason: str) -> None:
        self.status, self.trouble = 1, reason
        self._tell(reason, Fmi2Status.error)

    def _tell(self, message: str, status: Fmi2Status) -> None:
        """Log to the master, which shows it if its debug logging is on, and to Python."""
        self.log(message, status)
        level = logging.WARNING if status == Fmi2Status.warning else logging.ERROR
        log.log(level, "%s: %s", self.instance_name, message)


def _outputs(machine: Machine) -> list[tuple[str, str, str]]:
    """Name, unit and description of every real output, in the order of `_measure`."""
    labels = {"axis": AXES, **machine.labels}
    return [
        (f"{name}_{label}", channel_unit(f"{name}[{label}]"), f"{LAYOUT[name].long_name}, {label}")
        for name in (*_ACTUATORS, *MOTION)
        for label in labels[LAYOUT[name].dims[1]]
    ] + [
        (f"interface_{name}_{axis}", units[k // 3], f"interface: {about}")
        for name, units, about in _INTERFACE
        for k, axis in enumerate(AXES)
    ]


def _measure(table: RunningPlant) -> np.ndarray:
    """Values of `_outputs` at a plant's next sample."""
    plant, state, sensors = table.plant, table.state, table.sensors()
    chamber = plant.rows["state"][plant.tables.actuators]
    double = [a.area_b is not None for a in plant.machine.actuators]
    platen = platen_motion(plant, state.q[None], state.v[None], np.zeros((1, len(state.v))))
    return np.concatenate(
        [
            sensors.displacement,
            sensors.force,
            table.spool,
            state.z[chamber],
            state.z[chamber[double] + 1],
            platen.displacement[0],
            platen.velocity[0],
            sensors.acceleration,
            motion_numbers(table.interface_motion()),
        ]
    )


def _samples(time: float, step: float, sample: int) -> int:
    """Samples in a communication step at a time since the start; sample is the plant's own count.

    Raises SimulationError for a step that is no positive multiple of a sample, to a millionth of it, and for a time
    that is not the plant's, to half a sample.
    """
    samples = round(step * SAMPLE_RATE)
    if samples < 1 or abs(step * SAMPLE_RATE - samples) > 1e-6:
        raise SimulationError(
            f"a communication step of {step!r} s is no positive multiple of 1/{SAMPLE_RATE} s; "
            f"use {1.0 / SAMPLE_RATE!r} s or a multiple"
        )
    if abs(time * SAMPLE_RATE - sample) > 0.5:
        raise SimulationError(
            f"a step from {time:.6f} s, but the plant is at {sample / SAMPLE_RATE:.6f} s; it can neither go back nor "
            "skip time"
        )
    return samples


def _changed(machine: Machine, override: str) -> Machine:
    """Machine with the parameters of a TOML text replaced; raises ParameterError or UnknownNameError."""
    if not override.strip():
        return machine
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "override.toml"
        file.write_text(override, encoding="utf-8")
        return machine.with_params(file)
