"""Figures of the machine, drawn from its data: the same machine file gives the same bytes."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch, Polygon, Rectangle

from lhpost6_pin.control import load_controller
from lhpost6_pin.core.files import write_whole
from lhpost6_pin.machine.components import Actuator, Strut
from lhpost6_pin.machine.machine import Machine, load_machine
from lhpost6_pin.mechanics import kinematics
from lhpost6_pin.show.urdf import drawing_colour, legs

__all__ = ["FIGURES", "draw_all"]

STYLE = {
    "svg.hashsalt": "lhpost6",
    "svg.fonttype": "path",
    "font.family": "DejaVu Sans",
    "font.size": 12.0,
    "axes.titlesize": 13.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
}
PLAIN = {"Date": None, "Creator": None}
"""Without date and version, for reproducible bytes."""

INK, FAINT, PAPER = "#1B1F24", "#8A8F98", "#FFFFFF"


def draw_all(folder: Path) -> None:
    """Write every figure as SVG."""
    machine = load_machine()
    for name, draw in FIGURES.items():
        with matplotlib.rc_context(STYLE), write_whole(folder / f"{name}.svg") as path:
            draw(machine).savefig(path, format="svg", metadata=PLAIN, facecolor=PAPER, bbox_inches="tight")


def _axes(width: float, height: float) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(width, height), layout="constrained")
    axes = figure.add_subplot()
    return figure, axes


def _bare(width: float, height: float, x: tuple[float, float], y: tuple[float, float]) -> tuple[Figure, Axes]:
    """A figure without axes, in its own units."""
    figure, axes = _axes(width, height)
    axes.set(xlim=x, ylim=y, aspect="equal")
    axes.axis("off")
    return figure, axes


def _kind(leg: Actuator | Strut) -> str:
    return leg.mount if isinstance(leg, Actuator) else "strut"


def _arrow(
    axes: Axes, start: Sequence[float], end: Sequence[float], colour: str = INK, style: str = "-|>", width: float = 1.8
) -> None:
    options = {"arrowstyle": style, "color": colour, "lw": width, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 15}
    axes.annotate("", tuple(end), tuple(start), arrowprops=options, annotation_clip=False)


def _word(axes: Axes, place: Sequence[float], text: str, colour: str = INK, **options: object) -> None:
    """Text on a background patch."""
    box = {"facecolor": PAPER, "edgecolor": "none", "pad": 1.2, "alpha": 0.85}
    axes.text(place[0], place[1], text, **{"color": colour, "ha": "center", "va": "center", "bbox": box, **options})


def _dimension(axes: Axes, start: Sequence[float], end: Sequence[float], text: str, **options: object) -> None:
    _arrow(axes, start, end, FAINT, "<|-|>", 1.1)
    middle = [(a + b) / 2 for a, b in zip(start, end, strict=True)]
    _word(axes, middle, text, **{"fontsize": 11, **options})


def _frame(axes: Axes, origin: Sequence[float], turn: float, size: float, names: Sequence[str], colour: str) -> None:
    """Two axes of a frame in the plane of the figure."""
    for name, angle in zip(names, (turn, turn + math.pi / 2), strict=True):
        along = np.array([math.cos(angle), math.sin(angle)])
        tip = np.array(origin) + size * along
        _arrow(axes, origin, tip, colour, width=2.2)
        if name:
            _word(axes, tip + 0.28 * size * along, name, colour, fontweight="bold")


# --------------------------------------------------------------------------------------------------- the whole machine
def _plan(machine: Machine) -> Figure:
    figure, axes = _axes(7.2, 5.0)
    length, width = machine.platen.size
    axes.add_patch(_slab((-length / 2, -width / 2), length, width))
    for leg in legs(machine):
        colour, (px, py, _), (ax, ay, _) = drawing_colour(_kind(leg)), leg.platen_point, leg.base_point
        if _kind(leg) == "swivel":
            axes.plot([ax, px], [ay, py], color=colour, lw=6, solid_capstyle="round")
            axes.plot([ax, px], [ay, py], "o", color=INK, ms=4)
            _word(axes, (ax - 0.4 * np.sign(ax), ay + 0.75 * np.sign(ay)), leg.name, fontweight="bold")
        else:
            axes.plot(px, py, "s" if _kind(leg) == "bearing" else "o", color=colour, ms=15)
            _word(axes, (px + 0.95, py - 0.1 - 0.4 * (_kind(leg) == "strut")), leg.name, fontweight="bold")
    _frame(axes, (0, 0), 0.0, 1.3, ("x", "y"), INK)
    _word(axes, (-0.95, 0.45), "O, C", fontsize=11)
    first = machine.actuators[0]
    _dimension(axes, (-length / 2, -4.8), (length / 2, -4.8), f"{length:g} m")
    _dimension(axes, (-2.6, -width / 2), (-2.6, width / 2), f"{width:g} m", rotation=90)
    along = np.subtract(first.base_point, first.platen_point)
    angle = math.degrees(math.atan2(abs(along[1]), abs(along[0])))
    axes.plot([first.platen_point[0], 10.4], [first.platen_point[1]] * 2, color=FAINT, lw=0.9, ls=":")
    _word(axes, (9.4, first.platen_point[1] + 0.85), f"{angle:.1f}°", fontsize=11)
    axes.set(xlim=(-11.5, 11.5), ylim=(-5.4, 5.1), aspect="equal")
    axes.set(xlabel="x, longitudinal [m]", ylabel="y, transverse [m]")
    axes.set_title("Plan, seen from above", loc="left")
    return figure


def _slab(corner: tuple[float, float], width: float, height: float) -> Rectangle:
    colour = drawing_colour("platen")
    return Rectangle(corner, width, height, facecolor=(*to_rgb(colour), 0.14), edgecolor=colour, lw=1.6)


TALL = 2.0
"""Scale of heights over scale of lengths in the elevation."""


def _elevation(machine: Machine) -> Figure:
    figure, axes = _axes(7.2, 6.4)
    length, plane = machine.platen.size[0], machine.platen.bearing_plane[2]
    axes.add_patch(_slab((-length / 2, plane), length, -plane))
    columns: dict[tuple[float, float], list[Actuator | Strut]] = {}
    for leg in legs(machine):  # coinciding in x and z
        columns.setdefault((leg.platen_point[0], leg.platen_point[2]), []).append(leg)
    for same in columns.values():
        leg, names = same[0], ", ".join(leg.name for leg in same)
        (px, _, pz), (ax, _, az) = leg.platen_point, leg.base_point
        axes.plot([ax, px], [az, pz], color=drawing_colour(_kind(leg)), lw=7, solid_capstyle="butt")
        axes.plot([ax, px], [az, pz], "o", color=INK, ms=4)
        place = {
            "swivel": (ax - 1.9 * np.sign(ax), az - 0.35),
            "bearing": (ax + 1.25, -1.65),
            "strut": (ax + 0.75, -4.2),
        }
        _word(axes, place[_kind(leg)], names, fontweight="bold")
    _frame(axes, (0, 0), 0.0, 1.0, ("x", "z"), INK)
    body, foot = machine.platen.centre_of_gravity, machine.platen.bearing_plane
    for point, name, shift in ((body, "B", 0.5), ((0.0, 0.0, 0.0), "O, C", -0.95), (foot, "N", 0.5)):
        axes.plot(point[0], point[2], "o", color=INK, ms=6, zorder=5)
        _word(axes, (point[0] + shift, point[2] + (0.32 if point[2] == 0.0 else 0.16)), name, fontweight="bold")
    strut, vertical = machine.struts[0], next(a for a in machine.actuators if a.mount == "bearing")
    for x, bottom in ((-1.5, body[2]), (-3.0, plane), (-11.0, vertical.base_point[2]), (11.0, strut.base_point[2])):
        reach = (x, vertical.base_point[0] * -1) if x < -5 else (x, strut.base_point[0]) if x > 5 else (x, 0)
        axes.plot(reach, [bottom, bottom], color=FAINT, lw=0.8, ls=":")
        _dimension(axes, (x, 0.0), (x, bottom), f"{-bottom:g} m", rotation=90)
    axes.set(xlim=(-11.5, 11.9), ylim=(-6.4, 1.5), aspect=TALL)
    axes.set(xlabel="x, longitudinal [m]", ylabel=f"z, up [m], enlarged {TALL:g} times")
    axes.set_title("Elevation, seen along y", loc="left")
    return figure


# ------------------------------------------------------------------------------------------------------------- frames
POSE = np.array([1.5, 0.0, 1.6, 0.0, math.radians(-14.0), 0.0])
"""Pose in the figure of frames, beyond the limits of the machine, to separate the frames."""


def _frames(machine: Machine) -> Figure:
    figure, axes = _bare(7.2, 4.2, (-5.3, 7.2), (-3.0, 3.8))
    turn, centre = kinematics.rotation(POSE[3:]), POSE[:3]
    blue, green = drawing_colour("platen"), drawing_colour("bearing")

    def carried(point: Sequence[float]) -> np.ndarray:
        return (centre + turn @ np.asarray(point))[[0, 2]]

    plane, half = machine.platen.bearing_plane[2], 0.36 * machine.platen.size[0]
    corners = np.array([(-half, 0, 0), (half, 0, 0), (half, 0, plane), (-half, 0, plane)])
    axes.add_patch(Polygon(corners[:, [0, 2]], fill=False, edgecolor=FAINT, lw=1.4, ls="--"))
    axes.add_patch(Polygon([carried(c) for c in corners], facecolor=(*to_rgb(blue), 0.14), edgecolor=blue, lw=1.6))

    slope = math.atan2(turn[2, 0], turn[0, 0])
    column = 0.55 * max(a.platen_point[0] for a in machine.actuators if a.mount == "bearing")  # moved inwards
    foot, particle = carried((0, 0, plane)), carried((column, 0, plane))
    top = np.array([column, foot[1] + (column - foot[0]) * math.tan(slope)])  # on the bearing plane, over the base
    base = np.array([column, -2.7])
    axes.plot(*zip(base, top, strict=True), color=green, lw=9, solid_capstyle="butt", alpha=0.75)
    for point, name, shift in (
        (base, "$A_i$", (0.55, 0.0)),
        (top, "$P_i$", (-0.45, -0.4)),
        (particle, "$P'_i$", (0.35, -0.45)),
        (foot, "N", (-0.15, -0.42)),
    ):
        axes.plot(*point, "o", color=INK, ms=6, zorder=6)
        _word(axes, point + shift, name, fontsize=13)
    _frame(axes, top, slope, 1.1, ("", ""), green)
    _word(axes, (column + 0.95, top[1] - 0.38), "$\\{n_i\\}$", green, fontsize=14)
    _frame(axes, particle, 0.0, 1.1, ("", ""), drawing_colour("swivel"))
    _word(axes, particle + np.array([1.0, 0.75]), "$\\{p'_i\\}$", drawing_colour("swivel"), fontsize=14)
    for origin, angle, colour, name, shift in (
        (np.zeros(2), 0.0, FAINT, "{s} at O", (-0.95, 0.3)),
        (centre[[0, 2]], 0.0, INK, "{c} at C", (1.0, 0.95)),
        (carried(machine.platen.centre_of_gravity), slope, blue, "{b} at B", (-1.0, -0.1)),
    ):
        _frame(axes, origin, angle, 1.4, ("", ""), colour)
        axes.plot(*origin, "o", color=colour, ms=6)
        _word(axes, origin + shift, name, colour, fontsize=13)
    axes.text(-5.2, -1.75, "dashed: control zero-position", color=FAINT, va="center")
    return figure


# ---------------------------------------------------------------------------------------------------------------- legs
def _leg(machine: Machine) -> Figure:
    figure, axes = _bare(7.2, 4.4, (-0.4, 12.2), (-3.9, 3.9))
    steel, oil = drawing_colour("rod"), drawing_colour("trace")
    push, pull, colour = drawing_colour("force_push"), drawing_colour("force_pull"), drawing_colour("swivel")
    axes.add_patch(Rectangle((1.2, -0.9), 5.6, 1.8, facecolor=colour, alpha=0.35, edgecolor=INK, lw=1.5))
    axes.add_patch(Rectangle((1.3, -0.8), 2.5, 1.6, facecolor=oil, alpha=0.8))
    axes.add_patch(Rectangle((4.2, -0.8), 2.5, 1.6, facecolor=oil, alpha=0.45))
    axes.add_patch(Rectangle((3.8, -0.8), 0.4, 1.6, facecolor=INK))
    axes.add_patch(Rectangle((4.2, -0.35), 5.3, 0.7, facecolor=steel, edgecolor=INK, lw=1.2))
    axes.plot([0.6, 1.2], [0, 0], color=INK, lw=5)
    for x, name in ((0.6, "$A_i$, base"), (9.8, "$P_i$, platen")):
        axes.plot(x, 0, "o", color=INK, ms=13)
        axes.text(x, -0.75 if x > 5 else -1.25, name, ha="center", va="top")
    axes.text(2.5, 0, "$P_A$, $A_1$", ha="center", va="center", fontsize=13)
    axes.text(5.5, 0.57, "$P_B$, $A_2$", ha="center", va="center", fontsize=11)
    _dimension(axes, (0.6, -2.3), (9.8, -2.3), "length $L = L_0 + s$", fontsize=12)
    _arrow(axes, (9.8, 1.1), (11.9, 1.1), INK, width=2.4)
    axes.text(10.85, 1.3, "$s$, $\\dot s$", ha="center", va="bottom")
    _arrow(axes, (10.2, 0), (11.9, 0), push, width=3.2)
    axes.text(11.1, -0.25, "$f$", ha="center", va="top", color=push, fontsize=14)
    _arrow(axes, (2.5, 2.6), (2.5, 0.95), INK)
    _arrow(axes, (5.5, 0.95), (5.5, 2.6), INK)
    axes.text(4.0, 2.95, "spool $x > 0$: supply to A, B to return", ha="center", va="center", fontsize=12)
    axes.text(2.3, 1.75, "$Q_A > 0$", ha="right", va="center")
    axes.text(5.7, 1.75, "$Q_B < 0$", ha="left", va="center")
    _arrow(axes, (9.2, -3.3), (7.2, -3.3), pull, width=2.6)
    axes.text(6.9, -3.3, "friction on the platen while $\\dot s > 0$", ha="right", va="center", color=pull)
    return figure


# --------------------------------------------------------------------------------------------------------- signal flow
BOXES = (
    ("records of a campaign", "motion, forces, pressures, spools"),
    ("align, fuse", "skews removed; one motion from all sensors"),
    ("residuals", "wrench  flow  gas  force  servo  supply"),
    ("refit", "parameters and sensor errors, with priors"),
    ("score", "every family on every group of components"),
    ("add the best", "joint fit with everything else; repeat"),
    ("held-out test", "error before and after"),
    ("verdict", "effect identified, or the reason why not"),
)


def _flow(machine: Machine) -> Figure:
    figure, axes = _bare(5.6, 8.0, (0, 5.6), (-0.1, 8.1))
    for k, (title, text) in enumerate(BOXES):
        y = 7.3 - k
        colour = drawing_colour("platen") if title in ("residuals", "verdict") else INK
        box = FancyBboxPatch((0.45, y), 4.6, 0.66, boxstyle="round,pad=0.02", facecolor=PAPER, edgecolor=colour, lw=1.8)
        axes.add_patch(box)
        axes.text(2.75, y + 0.46, title, ha="center", va="center", fontweight="bold", color=colour)
        axes.text(2.75, y + 0.18, text, ha="center", va="center", fontsize=10.5)
        if k + 1 < len(BOXES):
            _arrow(axes, (2.75, y - 0.02), (2.75, y - 0.32))
    start, end = 7.3 - 5 + 0.33, 7.3 - 3 + 0.33
    axes.plot([5.09, 5.4, 5.4], [start, start, end], color=FAINT, lw=1.8)
    _arrow(axes, (5.4, end), (5.09, end), FAINT)
    axes.text(5.5, (start + end) / 2, "repeat", rotation=90, ha="left", va="center", color=FAINT, fontsize=11)
    return figure


# ------------------------------------------------------------------------------------------------- the virtual 469D
def _control(machine: Machine) -> Figure:
    """Signal flow from target to spools and back, per degree of freedom and per actuator."""
    rate, n = load_controller(machine.controller).rate, len(machine.actuators)
    late = " or ".join(dict.fromkeys(f"{1e3 * a.valve_delay:g}" for a in machine.actuators))
    figure, axes = _bare(6.3, 8.8, (0, 6.3), (0.3, 9.1))
    motion, legs_of = drawing_colour("platen"), drawing_colour("swivel")
    forward = (
        ("target", "of C and the Euler angles", INK),
        ("drive", "input of the generator", motion),
        ("reference generator", "$x_r$, $v_r$, $a_r$, $j_r$", motion),
        ("three-variable law", "feed-forward, errors, force", motion),
        ("notches, master gain", "velocity command $u$", motion),
        ("Jacobian $K$", f"{n} velocities $K u - b\\,(f - f_0)$", legs_of),
        ("valve linearisation", "velocity to spool; clipped", legs_of),
        ("hold and delay", f"1/{rate:g} s, then {late} ms", legs_of),
        ("table", "valves, oil, friction, platen", INK),
    )
    left, right, bus = (0.45, 3.15), (4.0, 1.85), 6.1

    def level(k: float) -> float:
        return 8.35 - k

    def box(k: float, column: tuple[float, float], title: str, text: str, colour: str, line: str = "-") -> None:
        x, width = column
        place, size = (x, level(k)), {"width": width, "height": 0.62}
        style = {"boxstyle": "round,pad=0.02", "facecolor": PAPER, "edgecolor": colour, "lw": 1.8, "ls": line}
        axes.add_patch(FancyBboxPatch(place, **size, **style))
        for up, words, weight in ((0.43, title, "bold"), (0.16, text, "normal")):
            middle = (x + width / 2, level(k) + up)
            axes.text(*middle, words, ha="center", va="center", fontweight=weight)

    for k, (title, text, colour) in enumerate(forward):
        box(k, left, title, text, colour)
        if k:
            _arrow(axes, (2.0, level(k - 1) - 0.02), (2.0, level(k) + 0.64))
    for k, title, text, colour, line in (
        (1, "cancellers", "sine tests only", motion, "--"),
        (2, "force feedback", "$K_F$ HP$(K^T (f - f_0))$", motion, "-"),
        (3, "feedback gen.", "$x_f$, $v_f$, $a_f$", motion, "-"),
        (4, "kinematics", "$s$ to pose $x_s$", motion, "-"),
        (5, "force balance", "$b\\,(f - f_0)$", legs_of, "-"),
        (8, "sensors", "$s$, $f$, acceleration", INK, "-"),
    ):
        box(k, right, title, text, colour, line)
    edge, start, middle = sum(left) + 0.02, right[0] - 0.02, 0.31
    for k in (1, 3, 5):
        _arrow(axes, (start, level(k) + middle), (edge, level(k) + middle))
    axes.plot([start, 3.8, 3.8], [level(2) + middle] * 2 + [level(3) + 0.5], color=INK, lw=1.8)
    _arrow(axes, (3.8, level(3) + 0.5), (edge, level(3) + 0.5))
    _arrow(axes, (4.9, level(4) + 0.64), (4.9, level(3) - 0.02))
    _arrow(axes, (edge, level(8) + middle), (start, level(8) + middle))
    side = sum(right) + 0.02
    axes.plot([side, bus, bus], [level(8) + middle] * 2 + [level(2) + middle], color=FAINT, lw=1.8)
    for k, carried in ((2, "$f$"), (3, "$a$"), (4, "$s$"), (5, "$f$")):
        _arrow(axes, (bus, level(k) + middle), (side, level(k) + middle), FAINT)
        axes.text(bus + 0.06, level(k) + middle, carried, ha="left", va="center")
    for first, last, words, colour in (
        (1, 4, "per degree of freedom", motion),
        (5, 7, "per actuator", legs_of),
    ):
        axes.plot([0.27, 0.27], [level(first) + 0.62, level(last)], color=colour, lw=1.8)
        axes.text(0.12, (level(first) + level(last) + 0.62) / 2, words, rotation=90, ha="center", va="center")
    return figure


FIGURES: Mapping[str, Callable[[Machine], Figure]] = {
    "plan": _plan,
    "elevation": _elevation,
    "frames": _frames,
    "leg": _leg,
    "flow": _flow,
    "control": _control,
}
"""Figures by the name of their file."""
