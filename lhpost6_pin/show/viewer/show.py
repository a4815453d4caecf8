"""Show a record in one HTML file, in a notebook, or in a browser on this computer."""

from collections.abc import Sequence

import xarray as xr

from ...machine.machine import Machine
from ...machine.recorded_changes import changes_summary
from ..bodies import load_bodies
from ..urdf import drawing_colour
from .animation import draw_animation, leg_forces
from .arrows import kilonewtons, largest_force
from .frames import AS_IT_IS, Frames, Look, record_frames, record_title
from .histories import packed_histories, record_histories
from .overlay import compare_overlaid
from .scene import ROOT, draw_arrows, draw_machine, draw_motion, draw_names, names_layer
from .viewer_page import Caption, Picture, render_page
from .window import LoopbackWindow, Recorder, Window

__all__ = ["live_animation", "machine_legend", "show_record"]


def show_record(
    machine: Machine, record: xr.Dataset, others: Sequence[xr.Dataset] = (), look: Look = AS_IT_IS
) -> Picture:
    """Return a page that shows a record, with others laid over it; as the last line of a notebook's cell it plays.

    No server is started. Raises RecordError or ParameterError as `record_frames`.
    """
    frames = record_frames(machine, record, others, look)
    recorder = Recorder()
    _draw(recorder, machine, frames)
    return Picture(render_page(_caption(machine, record, others, frames), recorder.commands))


def live_animation(
    machine: Machine, record: xr.Dataset, others: Sequence[xr.Dataset] = (), look: Look = AS_IT_IS
) -> LoopbackWindow:
    """Return a window that shows a record at its `url` while used in a ``with`` block, to this computer only.

    Raises RecordError or ParameterError as `record_frames`.
    """
    frames = record_frames(machine, record, others, look)
    window = LoopbackWindow(render_page(_caption(machine, record, others, frames), live=True))
    _draw(window, machine, frames)
    return window


def machine_legend(machine: Machine) -> dict[str, str]:
    """Names and colours of the kinds of bodies of a machine."""
    kinds = {"platen": "platen"} | {a.mount: f"{a.kind} actuators" for a in machine.actuators}
    kinds |= {"strut": f"{machine.struts[0].kind} struts"} if machine.struts else {}
    kinds |= {"specimen": "specimen"} if machine.specimen else {}
    return {word.replace("_", "-"): drawing_colour(kind) for kind, word in kinds.items()}


def _draw(window: Window, machine: Machine, frames: Frames) -> None:
    bodies = load_bodies(machine)
    draw_machine(window, machine, bodies)
    draw_names(window, machine)
    draw_motion(window, machine, frames)
    draw_arrows(window, list(leg_forces(machine, frames)))
    draw_animation(window, machine, bodies, frames)


def _caption(machine: Machine, record: xr.Dataset, others: Sequence[xr.Dataset], frames: Frames) -> Caption:
    """Title, note, legend and layers of a record's page."""
    look, seconds = frames.look, (len(frames.time) - 1) / frames.look.rate
    kind = str(record.attrs.get("kind", "record"))
    note = f"{machine.name}, {kind}, {seconds:.1f} s at {look.rate:g} frames/s, {look.size}; +X to the right"
    carried = str(record.attrs.get("specimen", "none"))
    if carried != "none" and machine.specimen is None:
        note += f"; specimen {carried} not drawn: give --specimen"
    note += "".join(f"; {sentence}" for sentence in changes_summary(record.attrs, 2))
    note += "".join(f"; {sentence}" for sentence in compare_overlaid(record, others, frame=1.0 / look.rate).sentences)
    legend = machine_legend(machine) | {"path of C": drawing_colour("trace")}
    legend |= {f"{g.label} (outline)": drawing_colour(g.name) for g in frames.ghosts}
    layers = {"names": names_layer(), "path of C": [f"meshcat/{ROOT}/trace"]}
    layers |= {g.label: [f"meshcat/{ROOT}/{g.name}", f"meshcat/{ROOT}/trace/{g.name}"] for g in frames.ghosts}
    if forces := leg_forces(machine, frames):
        assert frames.force is not None
        most = frames.full_scale or largest_force(frames.force)
        note += f"; longest arrow {kilonewtons(most)}" + " of change since the start" * look.change
        legend |= {"push": drawing_colour("force_push"), "pull": drawing_colour("force_pull")}
        layers["forces"] = [f"meshcat/{ROOT}/{name}_rod/force" for name in forces]
    start, end = float(frames.time[0]), float(frames.time[-1])
    time = record["time"].values
    shown = record.isel(time=(time >= start) & (time <= end))
    histories = packed_histories(record_histories(machine, shown), start)
    return Caption(record_title(record), note, legend, layers, start, 1.0 / look.rate, histories)
