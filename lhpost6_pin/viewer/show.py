"""A record shown: in one HTML file, in a notebook, or in a browser on this computer."""

from collections.abc import Sequence
from pathlib import Path

import xarray as xr

from ..bodies import load_bodies
from ..machine import Machine
from ..urdf import drawing_colour
from .animation import draw_animation, leg_forces
from .arrows import largest_force
from .frames import Frames, record_frames, record_title
from .page import Caption, Picture, render_page
from .scene import ROOT, draw_arrows, draw_machine, draw_motion
from .window import LoopbackWindow, Recorder, Window

__all__ = ["live_animation", "machine_legend", "save_animation", "show_record"]


def show_record(
    machine: Machine,
    record: xr.Dataset,
    others: Sequence[xr.Dataset] = (),
    *,
    rate: float = 30.0,
    amplify: float = 1.0,
    gap: float = 1.0,
    change: bool = False,
) -> Picture:
    """Return a page that shows a record, with others laid over it; as the last line of a notebook's cell it plays.

    Motion is enlarged `amplify` times, what reference and other records differ by `gap` times more; with `change`,
    forces are less what they are at the start. No server is started. Raises RecordError or ParameterError as
    `record_frames`.
    """
    frames = record_frames(machine, record, others, rate=rate, amplify=amplify, gap=gap, change=change)
    recorder = Recorder()
    _draw(recorder, machine, frames)
    return Picture(render_page(_caption(machine, record, frames), recorder.commands))


def save_animation(
    machine: Machine,
    record: xr.Dataset,
    path: Path | str,
    others: Sequence[xr.Dataset] = (),
    *,
    rate: float = 30.0,
    amplify: float = 1.0,
    gap: float = 1.0,
    change: bool = False,
) -> None:
    """Write one HTML file that shows a record and plays off line; options and errors as those of `show_record`."""
    show_record(machine, record, others, rate=rate, amplify=amplify, gap=gap, change=change).save(path)


def live_animation(
    machine: Machine,
    record: xr.Dataset,
    others: Sequence[xr.Dataset] = (),
    *,
    rate: float = 30.0,
    amplify: float = 1.0,
    gap: float = 1.0,
    change: bool = False,
) -> LoopbackWindow:
    """Return a window that shows a record at its `url` while used in a ``with`` block; only this computer can look.

    Options and errors as those of `show_record`.
    """
    frames = record_frames(machine, record, others, rate=rate, amplify=amplify, gap=gap, change=change)
    window = LoopbackWindow(render_page(_caption(machine, record, frames), live=True))
    _draw(window, machine, frames)
    return window


def machine_legend(machine: Machine) -> dict[str, str]:
    """Words and colours of what a machine is drawn with."""
    kinds = {"platen": "platen"} | {a.mount: f"{a.kind} actuators" for a in machine.actuators}
    kinds |= {"strut": f"{machine.struts[0].kind} struts"} if machine.struts else {}
    return {word.replace("_", "-"): drawing_colour(kind) for kind, word in kinds.items()}


def _draw(window: Window, machine: Machine, frames: Frames) -> None:
    bodies = load_bodies(machine)
    draw_machine(window, machine, bodies)
    draw_motion(window, machine, frames)
    draw_arrows(window, list(leg_forces(machine, frames)))
    draw_animation(window, machine, bodies, frames)


def _caption(machine: Machine, record: xr.Dataset, frames: Frames) -> Caption:
    """Title, note, legend and layers of a record's page."""
    size = "drawn to scale" if frames.amplify == 1.0 else f"motion drawn {frames.amplify:g} times as large"
    if frames.gap != 1.0:
        size += f", gaps to the outlines {frames.gap:g} times as large"
    seconds = (len(frames.time) - 1) / frames.rate
    kind = str(record.attrs.get("kind", "record"))
    note = f"{machine.name}, {kind}, {seconds:.1f} s at {frames.rate:g} frames/s, {size}; +X to the right"
    legend = machine_legend(machine) | {"path of C": drawing_colour("trace")}
    legend |= {f"{g.label} (outline)": drawing_colour(g.name) for g in frames.ghosts}
    layers = {"path of C": [f"meshcat/{ROOT}/trace"]}
    layers |= {g.label: [f"meshcat/{ROOT}/{g.name}", f"meshcat/{ROOT}/trace/{g.name}"] for g in frames.ghosts}
    if forces := leg_forces(machine, frames):
        assert frames.force is not None
        most = largest_force(frames.force)
        note += f"; longest arrow {most / 1e3:,.0f} kN" + " of change since the start" * frames.change
        legend |= {"push": drawing_colour("force_push"), "pull": drawing_colour("force_pull")}
        layers["forces"] = [f"meshcat/{ROOT}/{name}_rod/force" for name in forces]
    start, step = float(frames.time[0]), 1.0 / frames.rate
    return Caption(record_title(record), note, legend, layers, start, step)
