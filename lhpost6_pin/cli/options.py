"""Options shared by commands; bundles of options that load what they select: machine, specimen, scheme, controller."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..core.errors import ParameterError, RecordError, UnknownNameError
from ..core.files import shipped, shipped_specimens
from ..core.names import ENGINES, SCHEMES
from .completion import complete_sensors, completing
from .results_folder import Out, ResumedOut, folder_for

if TYPE_CHECKING:
    import xarray as xr

    from ..control import ControllerSettings
    from ..control.plug import UserController
    from ..machine.machine import Machine
    from ..simulation.coupling import CouplingOptions

log = logging.getLogger(__name__)

EXCHANGES = ("sample", "step")
"""How often a specimen that is a program exchanges motion and wrench."""

__all__ = ["Beyond", "CampaignFolder", "Cancel", "ControllerName", "Jobs", "Json", "MachineName", "MachineOptions"]
__all__ += [
    "ExchangeOptions",
    "MountOptions",
    "Out",
    "PhaseSettingsName",
    "Processes",
    "ResumedOut",
    "SensorsName",
    "SettingsName",
]
__all__ += ["SpecimenOptions", "StepOptions", "Valves", "find_controller", "find_settings", "folder_for", "measuring"]
__all__ += ["record_name"]


def _jobs(what: str, help: str) -> Any:
    """The option --jobs, a number of `what`."""

    def refuse_none(jobs: int) -> int:
        if jobs == 0:
            raise ParameterError(f"--jobs 0: give a number of {what}, or -1 for as many as there are cores")
        return jobs

    return typer.Option(help=help, callback=refuse_none)


_settings = completing(lambda: shipped("controllers"))

CampaignFolder = Annotated[Path, typer.Argument(help="Campaign: a directory of records of one machine in one state.")]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON and nothing else.")]
Jobs = Annotated[int, _jobs("cores", "Cores; -1: all.")]
Processes = Annotated[int, _jobs("processes", "Processes; -1: one a core.")]
Beyond = Annotated[bool, typer.Option("--beyond-limits", help="Run a motion beyond the limits of the table.")]
Valves = Annotated[
    int,
    typer.Option(min=0, max=2, help="Open servovalves per horizontal actuator; 0: machine file (LHPOST6: 1 of 2)."),
]
SensorsName = Annotated[
    str | None,
    typer.Option(
        help="Noise and calibration ranges of the sensors: shipped name, or a TOML file; default: those that the "
        "machine file names, else as rests of the records show.",
        autocompletion=complete_sensors,
    ),
]
MachineName = Annotated[
    str, typer.Option(help="Shipped machine name, or a TOML file.", autocompletion=completing(shipped))
]
SettingsName = Annotated[
    str | None,
    typer.Option(
        help="Controller settings: name or TOML file; default: those of the machine.", autocompletion=_settings
    ),
]
PhaseSettingsName = Annotated[
    str | None,
    typer.Option(
        help="Controller settings for phase 3: name or TOML file; default: those named in the records.",
        autocompletion=_settings,
    ),
]
Cancel = Annotated[
    str | None,
    typer.Option(
        help="Amplitude-phase control and harmonic cancellation of a sine-like motion: axis and fundamental [Hz], "
        "such as x=0.5."
    ),
]
ControllerName = Annotated[
    str | None,
    typer.Option(help="Controller settings: name or TOML file; or your own, FILE.py:NAME.", autocompletion=_settings),
]


@dataclass(frozen=True)
class MachineOptions:
    """Options that select a machine."""

    machine: MachineName = "lhpost6"
    override: Annotated[Path | None, typer.Option(help="TOML file with parameters to replace, effects to add.")] = None
    inertia: Annotated[
        str | None,
        typer.Option(
            help="Effective inertia of the platen: first (computed, M_eff,1) or second (identified, M_eff,2) estimate "
            "of Table 4.1; default: as in the machine file; an override goes on top.",
            autocompletion=completing(lambda: ("first", "second")),
        ),
    ] = None
    bodies: Annotated[
        str | None,
        typer.Option(
            help="Moving parts of the legs: lumped to the platen, or full: barrels and rods as bodies; default: as in "
            "the machine file.",
            autocompletion=completing(lambda: ("lumped", "full")),
        ),
    ] = None

    accelerometers: Annotated[
        str | None,
        typer.Option(
            help="Sensors file, or shipped name, that states accelerometers on the platen; the acceleration feedback "
            "is then computed from them. Default: those of the machine file, else the platen's own acceleration.",
            autocompletion=complete_sensors,
        ),
    ] = None

    def load(self) -> "Machine":
        """Machine by shipped name or file, with the numbers of an override file and the options given."""
        from ..machine.machine import load_machine

        table = load_machine(self.machine, None if self.inertia else self.override)
        if self.inertia is not None:
            table = table.with_inertia(self.inertia)
            table = table if self.override is None else table.with_params(self.override)
        table = table if self.bodies is None else table.with_bodies(self.bodies)
        if self.accelerometers is None:
            return table
        from ..data.sensors import load_sensors  # of these commands few need it

        return table.with_accelerometers(load_sensors(self.accelerometers).parameters)


@dataclass(frozen=True)
class MountOptions:
    """Options that mount a specimen."""

    specimen: Annotated[
        str | None,
        typer.Option(
            help="Specimen on the platen: shipped name; a URDF; a rigid body with modes or matrices in .toml, .npz or "
            ".mat; FILE.py:NAME, a class or an OpenSees model; or udp:HOST:PORT (`lhpost6 serve-specimen`).",
            autocompletion=completing(shipped_specimens),
        ),
    ] = None
    specimen_at: Annotated[
        str | None, typer.Option(help=r"Place of its root from C: x,y,z \[m], or with roll,pitch,yaw \[rad].")
    ] = None
    locked: Annotated[bool, typer.Option("--locked", help="Lock the specimen's joints or modes: one rigid body.")] = (
        False
    )

    def onto(self, table: "Machine") -> "Machine":
        """The machine with the specimen, if any; warnings about the specimen are logged."""
        from ..mechanics.plant import make_plant
        from ..mechanics.specimen_joints import specimen_doubts

        at = self.specimen_at
        if self.specimen is None:
            if self.locked or at:
                raise ParameterError("--locked and --specimen-at concern a specimen; name it with --specimen")
            return table
        try:
            place = [float(x) for x in at.split(",")] if at else [0.0] * 3
        except ValueError:
            place = []
        if len(place) not in (3, 6):
            raise ParameterError(f"--specimen-at {at}: write x,y,z in metres, or x,y,z,roll,pitch,yaw with radians")
        x, y, z, roll, pitch, yaw = (*place, 0.0, 0.0, 0.0)[:6]
        loaded = table.with_specimen(self.specimen, (x, y, z), (roll, pitch, yaw), locked=self.locked)
        for doubt in specimen_doubts(make_plant(loaded)):
            log.warning("%s", doubt)
        return loaded

    def onto_for(self, table: "Machine", records: Sequence["xr.Dataset"]) -> "Machine":
        """As `onto`; without --specimen the machine with the specimen that all records state, as far as they do.

        Records that state other mountings or moving parts are a warning. Raises RecordError for records with different
        specimens, or a stated one whose file is not there.
        """
        for bodies in sorted({_bodies(r) for r in records if r.attrs.get("kind") == "simulated"} - {table.bodies}):
            log.warning(
                "records were made with moving parts of the legs as bodies = %s; %s has %s, whose inertia differs: "
                "--bodies %s, or that word in the machine file, mends it", bodies, table.name, table.bodies, bodies,
            )  # fmt: skip
        if self.specimen is not None or not records:
            from ..machine.recorded_specimen import mounting_doubts

            mounted = self.onto(table)
            for doubt in mounting_doubts(mounted.specimen, [r.attrs for r in records]):
                log.warning("%s", doubt)
            return mounted
        by_specimen = {_specimen_words(record.attrs): record for record in records}
        record, *others = by_specimen.values()
        if others:
            raise RecordError(f"the records were made with different specimens: {'; '.join(by_specimen)}")
        self.onto(table)  # raises for --locked without --specimen
        if "specimen_file" not in record.attrs:  # its place is not stated: what needs it says so
            return table
        return table.as_mounted(record.attrs, str(record.encoding.get("source", "the record")))


@dataclass(frozen=True)
class SpecimenOptions(MountOptions, MachineOptions):
    """Options that select a machine and its specimen."""

    def load(self, valves: int = 0) -> "Machine":
        """Machine with its open valves and its specimen, if any; warnings about the specimen are logged."""
        return self.onto(MachineOptions.load(self).with_valves(valves))

    def load_bare(self) -> "Machine":
        """Machine without a specimen."""
        return MachineOptions.load(self)

    @property
    def words(self) -> list[str]:
        """The options as on a command line, those that are not defaults."""
        given = {
            "--machine": self.machine if self.machine != "lhpost6" else None,
            "--override": self.override,
            "--accelerometers": self.accelerometers,
            "--specimen": self.specimen,
            "--specimen-at": self.specimen_at,
        }
        named = [word for option, value in given.items() if value is not None for word in (option, str(value))]
        return [*named, *["--locked"] * self.locked]


@dataclass(frozen=True)
class ExchangeOptions:
    """Options of the exchange with a specimen that is a program."""

    exchange: Annotated[
        str,
        typer.Option(
            help="A specimen that is a program exchanges motion and wrench once a controller sample, or every step.",
            autocompletion=completing(lambda: EXCHANGES),
        ),
    ] = "sample"
    held: Annotated[
        bool, typer.Option("--held", help="Hold its wrench between exchanges, instead of continuing it linearly.")
    ] = False
    no_impedance: Annotated[
        bool, typer.Option("--no-impedance", help="Keep its interface mass off the platen's side.")
    ] = False

    def coupling(self, table: "Machine") -> "CouplingOptions | None":
        """How the table's specimen is coupled; None as usual. Raises ParameterError where there is none to couple."""
        from ..machine.user_specimen import UserSpecimen
        from ..simulation.coupling import CouplingOptions

        if self.exchange not in EXCHANGES:
            raise UnknownNameError("exchange with a specimen", self.exchange, EXCHANGES)
        chosen = CouplingOptions(self.exchange == "step", not self.no_impedance, 0 if self.held else 1)
        if chosen == CouplingOptions():
            return None
        if not isinstance(table.specimen, UserSpecimen):
            raise ParameterError("--exchange, --held, --no-impedance concern a specimen that is a program; mount one")
        return chosen


@dataclass(frozen=True)
class StepOptions(ExchangeOptions):
    """Options of the integration."""

    scheme: Annotated[
        str,
        typer.Option(
            help="Integration scheme: semi_implicit, euler or rk4.", autocompletion=completing(lambda: SCHEMES)
        ),
    ] = "semi_implicit"
    rate: Annotated[int, typer.Option(help="Model steps per second, a multiple of 2048.")] = 8192
    engine: Annotated[
        str,
        typer.Option(
            help="pinocchio (per step) or fused (one compiled loop).", autocompletion=completing(lambda: ENGINES)
        ),
    ] = "pinocchio"

    def checked(self, table: "Machine", own_controller: bool = False) -> dict[str, Any]:
        """Options of `simulate`; raises its errors for invalid ones before any long computation."""
        from ..mechanics.plant import make_plant
        from ..simulation.simulate import check_options

        options: dict[str, Any] = {"scheme": self.scheme, "steps_per_second": self.rate, "engine": self.engine}
        check_options(make_plant(table), plugged=own_controller, **options)
        return options | {"coupling": self.coupling(table)}


def find_settings(name: str | None, table: "Machine") -> "ControllerSettings":
    """Settings by name or file; default: those named by the machine."""
    from ..control import load_controller
    from ..control.plug import is_plugged

    if name and is_plugged(name):
        raise ParameterError(
            f"--controller {name}: this command works with the 469D's own settings, a name or a TOML file; "
            "your own controller goes with `lhpost6 run` and `lhpost6 link`"
        )
    chosen = name or table.controller
    if not chosen:
        raise ParameterError(f"{table.name} names no controller; give one with --controller")
    return load_controller(chosen)


def find_controller(name: str | None, table: "Machine") -> "ControllerSettings | UserController":
    """A user's own controller as FILE.py:NAME, else settings as `find_settings`."""
    from ..control.plug import is_plugged, load_plugged

    return load_plugged(name) if name and is_plugged(name) else find_settings(name, table)


def measuring(campaign: Path, machine: str) -> str:
    """Remedy where no sensors are known: the command that measures them."""
    command = f"lhpost6 check {campaign} --machine {machine} --sensors-out sensors.toml"
    return f"`{command}` writes one where tests rest for two seconds"


def record_name(path: Path, attrs: Any) -> str:
    """Name of a record for its results: that of the file, of the test for a file named record.nc."""
    return path.stem if path.stem != "record" else str(attrs.get("test", "record")).replace("/", "_")


def _bodies(record: "xr.Dataset") -> str:
    """How the table of a simulated record describes the moving parts of its legs."""
    return str(record.attrs.get("moving_parts", "bodies = lumped")).removeprefix("bodies = ")


def _specimen_words(attrs: Any) -> str:
    """The specimen that a record states, with its place, in words."""
    keys = ("specimen", "specimen_position", "specimen_rpy", "specimen_locked")
    return ", ".join(f"{key} {attrs[key]}" for key in keys if key in attrs)
