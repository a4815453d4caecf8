"""Options that select a motion and its processing, and the target that follows."""

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..core.errors import MotionError
from ..core.names import SAMPLE_RATE
from .app import stderr
from .completion import complete_motion
from .quantities import quantity_option

if TYPE_CHECKING:
    from ..machine.machine import Machine
    from ..motions import GroundMotion, Target

__all__ = [
    "FileChannels",
    "FileRotate",
    "FileRotations",
    "FileStep",
    "FileUnit",
    "HighPass",
    "LowPass",
    "MatchSpectrum",
]
__all__ += ["MotionOptions", "RotateBy", "SpectrumDamping", "Taper", "TimeScale", "is_file"]

HighPass = Annotated[
    float | None, quantity_option("--high-pass", "Hz", "0.2Hz", r"High-pass corner of the motion \[Hz].")
]
LowPass = Annotated[float | None, quantity_option("--low-pass", "Hz", "25Hz", r"Low-pass corner of the motion \[Hz].")]

TimeScale = Annotated[
    float | None,
    quantity_option(
        "--time-scale",
        "1",
        "50%",
        "Factor of durations; accelerations stay, displacements follow with its square (similitude). "
        "A run needs about 6 GB of memory for 15 minutes of motion.",
    ),
]
Taper = Annotated[
    float | None,
    quantity_option(
        "--taper",
        "s",
        "500ms",
        r"Taper at both ends of a displacement motion that does not begin and end at rest \[s].",
    ),
]
RotateBy = Annotated[
    float | None,
    typer.Option(help=r"Angle by which the horizontal components are turned, from x towards y \[deg]."),
]
MatchSpectrum = Annotated[
    Path | None,
    typer.Option(help="CSV of a response spectrum (period_s,sa_g) that the motion is adjusted to, at scale 1."),
]
SpectrumDamping = Annotated[
    float | None,
    quantity_option("--spectrum-damping", "1", "5%", "Damping of that spectrum, as share of critical; default: 0.05."),
]

FileStep = Annotated[
    float | None, quantity_option("--dt", "s", "10ms", r"Time step of a motion file that does not state it \[s].")
]
FileUnit = Annotated[
    str | None, typer.Option("--unit", help="Unit of a motion file that does not state it, such as g.")
]
FileChannels = Annotated[
    str | None, typer.Option("--channels", help="Channels or columns of a motion file by axis, such as x=2,y=1,z=3.")
]
FileRotate = Annotated[
    float | None,
    typer.Option("--rotate", help=r"Azimuth that the table's x gets: turns a file's horizontal components \[deg]."),
]
FileRotations = Annotated[
    float | None,
    typer.Option("--rotation-factor", help="Factor of a file's rotations; the report's test SFU has 1000."),
]


log = logging.getLogger(__name__)

_SMALL = 0.02
"""Share of what the axes reach, below which a motion is likely in a wrong unit."""


@dataclass(frozen=True)
class MotionOptions:
    """Options that select a motion and its processing."""

    motion: Annotated[
        list[str],
        typer.Argument(
            help="Name (see `lhpost6 motions`), file(s) (a record, too), or name and file(s).",
            autocompletion=complete_motion,
        ),
    ]
    scale: Annotated[float, quantity_option("--scale", "1", "50%", "Scale factor of the motion.")] = 1.0
    axes: Annotated[
        str | None, typer.Option(help="Axes, such as xyz, x, or x=y (the table's x moved by component y).")
    ] = None
    high_pass: HighPass = None
    low_pass: LowPass = None
    time_scale: TimeScale = None
    taper: Taper = None
    rotate_by: RotateBy = None
    match_spectrum: MatchSpectrum = None
    spectrum_damping: SpectrumDamping = None
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set", help="Option of a generated motion, key=value, in SI or followed by its unit (50mm, 1g)."
        ),
    ] = None
    dt: FileStep = None
    unit: FileUnit = None
    channels: FileChannels = None
    rotate: FileRotate = None
    rotation_factor: FileRotations = None

    def target(self, table: "Machine", beyond: bool = False) -> "Target":
        """Target of the motion at the controller's rate; raises OutOfRangeError beyond the limits, unless allowed."""
        from ..mechanics.plant import make_plant
        from ..motions import adjust_motion, load_spectrum, make_target
        from ..simulation.motion_limits import check_motion_limits

        if self.spectrum_damping is not None and self.match_spectrum is None:
            raise MotionError("--spectrum-damping is that of --match-spectrum; give both, or leave it out")
        if self.match_spectrum is not None and "=" in (self.axes or ""):
            raise MotionError(
                f"--axes {self.axes}: --match-spectrum matches each axis to its own spectrum; name axes without ="
            )
        spectrum = load_spectrum(self.match_spectrum, self.spectrum_damping) if self.match_spectrum else None
        motion, match = adjust_motion(
            self._ground(),
            rotate_by=self.rotate_by,
            time_scale=self.time_scale,
            taper=self.taper,
            spectrum=spectrum,
            high_pass=self.high_pass,
            low_pass=self.low_pass,
        )
        if match is not None:
            stderr().print(f"{motion.name}: {match.summary}", markup=False, highlight=False)
        target = make_target(
            motion,
            scale=self.scale,
            axes=self.axes or (None if table.motion == "free" else table.motion),
            high_pass=self.high_pass,
            low_pass=self.low_pass,
            rate=float(SAMPLE_RATE),
        )
        if not beyond:
            share = check_motion_limits(make_plant(table), target).of_axes
            if share < _SMALL:
                log.warning(
                    "%s reaches at most %.2g %% of the table's displacement, velocity or acceleration: little beyond "
                    "friction; check its unit and scale", motion.name, 100.0 * share,
                )  # fmt: skip
        return target

    @property
    def files(self) -> list[Path]:
        """Words of the motion as paths: those that are files are what it is made from."""
        return [Path(word) for word in self.motion]

    def _ground(self) -> "GroundMotion":
        """Motion by name, from one file or three component files, or by name from such files."""
        options: dict[str, Any] = {}
        for item in self.set_ or []:
            key, equals, value = item.partition("=")
            if not equals:
                raise MotionError(f"--set {item}: write key=value")
            options[key.strip()] = _number_or_text(value.strip())
        stated = {"time_step": self.dt, "units": self.unit, "channels": self.channels}
        stated |= {"rotate": self.rotate, "rotation_factor": self.rotation_factor}
        about_file = {key: value for key, value in stated.items() if value is not None}
        first, *files = self.motion
        if not is_file(first) and files and not any(map(is_file, files)):
            raise MotionError(f"one motion at a time; got {', '.join(self.motion)}, none of which is a file")
        if about_file and not (files or is_file(first)):
            raise MotionError(
                f"{first}: --dt, --unit, --channels, --rotate and --rotation-factor are for motions from files; "
                "--rotate-by turns any motion by an angle"
            )
        name = None if is_file(first) else first
        if name and not files:
            from ..motions import find_motion

            return find_motion(name, **options)
        from ..data.motion_files import motion_of

        return motion_of(name, files if name else self.motion, **options, **about_file)


def is_file(name: str) -> bool:
    """Whether a word of a command names a file, not a motion."""
    return bool(Path(name).suffix) or Path(name).is_file()


def _number_or_text(text: str) -> int | float | str:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
