"""Generated parts of the pages on the controller: settings, margins, code, tests."""

import ast
import inspect
import math
import re
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from pathlib import Path

from lhpost6_pin.control import make_controller
from lhpost6_pin.control.settings import load_controller
from lhpost6_pin.core.files import models_folder
from lhpost6_pin.core.names import AXES
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.machine.parameters import Parameters, Quantity, load_parameters
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.tuning.margins import make_loop_model
from lhpost6_pin.tuning.margins import margins as margins_of

from .docstrings import as_markdown
from .markdown import cell, code_cell, table
from .theory import tree

__all__ = ["SYMBOLS", "docstring", "functions", "margins", "members", "numbers", "panel", "tests_in"]

API = Path(__file__).parent / "pages" / "reference" / "api"
SYMBOLS = {
    "master_gain": "Km",
    "reference_high_pass": "w / 2 pi",
    "reference_damping": "zeta",
    "reference_low_pass": "w2 / 2 pi",
    "displacement_feedforward": "Kxf",
    "velocity_feedforward": "Kvf",
    "acceleration_feedforward": "Kaf",
    "jerk_feedforward": "Kjf",
    "crossover": "c / 2 pi",
    "displacement_gain": "Kx",
    "velocity_gain": "Kv",
    "acceleration_gain": "Ka",
    "reset_gain": "Ki",
    "reset_limit": "limit of sat",
    "force_damping": "zeta of KF",
    "force_cut_in": "corner of HP",
    "balance_gain": "g",
    "frequency": "w0 / 2 pi",
    "bandwidth": "B / 2 pi",
    "depth": "d",
}
"""Symbols of settings in the equations."""


# ------------------------------------------------------------------------------------------------------- the numbers
def panel(name: str) -> str:
    """Every setting of a shipped controller, with its symbol; idle notches are one line."""
    stated = load_parameters(models_folder() / "controllers" / f"{name}.toml")
    sections = tuple(dict.fromkeys(key.split(".")[0] for key in stated))
    idle = [s for s in sections if s.startswith("notch_") and not any(stated.vector(f"{s}.depth"))]
    parts = [f"Mode: {code_cell(str(stated.words['controller.mode']))}."]
    parts += [_section(stated, section) for section in sections if section not in idle]
    if idle:
        parts.append(f"Not in use, depth zero on every degree of freedom: {', '.join(map(code_cell, idle))}.")
    return "\n\n".join(parts)


def numbers(file: str, *sections: str) -> str:
    """Numbers of some sections of a file in models/."""
    stated = load_parameters(models_folder() / file)
    return "\n\n".join(_section(stated, section) for section in sections)


def _section(stated: Parameters, section: str) -> str:
    """Numbers of a section as a table, with symbols if there are any."""
    names = [key.split(".")[1] for key in stated if key.split(".")[0] == section]
    rows = [
        (code_cell(name), code_cell(SYMBOLS.get(name, "")), *_stated(stated[f"{section}.{name}"])) for name in names
    ]
    head = (code_cell(f"[{section}]"), "symbol", "value", "unit", "evidence", "reason")
    if not any(name in SYMBOLS for name in names):
        head, rows = (head[0], *head[2:]), [(row[0], *row[2:]) for row in rows]
    return table(head, rows)


def _stated(quantity: Quantity) -> tuple[str, ...]:
    values = quantity.value if isinstance(quantity.value, tuple) else (quantity.value,)
    shown = " ".join(f"{v:.4g}" for v in (values[:1] if len(set(values)) == 1 else values))
    return cell(shown), cell(quantity.unit), quantity.evidence, cell(quantity.source)


def margins() -> str:
    """Margins of the shipped settings on the nominal machine."""
    machine = load_machine()
    plant = make_plant(machine)
    controller = make_controller(plant, find_equilibrium(plant), load_controller(machine.controller))
    found = margins_of(make_loop_model(controller), controller)
    rows = [
        (
            AXES[k],
            f"{20 * math.log10(m.gain):.1f} dB at {m.gain_frequency:.3g} Hz",
            f"{math.degrees(m.phase):.0f} deg at {m.phase_frequency:.2g} Hz",
        )
        for k, m in zip(plant.axes, found, strict=True)
    ]
    return table(("degree of freedom", "gain margin", "phase margin"), rows)


# ---------------------------------------------------------------------------------------------------------- the code
def docstring(module: str) -> str:
    """Docstring of a module without its first line, equations as blocks."""
    return as_markdown(inspect.getdoc(import_module(f"lhpost6_pin.{module}"))).partition("\n\n")[2]


def members(*modules: str) -> str:
    """Public functions of modules with their source, without those that only pass tables."""
    return "\n\n".join(
        f"::: lhpost6_pin.{module}.{name}\n    options:\n      heading_level: 3"
        for module in modules
        for name in _functions(module)
        if not name.endswith("_flat")
    )


def _functions(module: str) -> Iterator[str]:
    path = Path(import_module(f"lhpost6_pin.{module}").__file__)
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            yield node.name


def functions(*modules: str) -> str:
    """Exports of modules with their first line and a link to the reference."""
    rows = []
    for module in modules:
        at, found = _reference(module), import_module(f"lhpost6_pin.{module}")
        for name in found.__all__:
            thing = getattr(found, name)
            if inspect.isfunction(thing) or inspect.isclass(thing):
                link = f"[`{module}.{name}`](../reference/api/{at}#lhpost6_pin.{module}.{name})"
                rows.append((link, cell(inspect.getdoc(thing).partition("\n")[0])))
    return table(("code", "description"), rows)


@cache
def _reference(module: str) -> str:
    """Page of the reference with a module; StopIteration if there is none."""
    return next(p.name for p in sorted(API.glob("*.md")) if re.search(rf"insert: api.* {module}( |$)", p.read_text()))


# --------------------------------------------------------------------------------------------------------- the tests
def tests_in(*files: str) -> str:
    """First lines of test files, and their tests as sentences."""
    parts = []
    for file in files:
        parsed = tree(f"test_{file}.py")
        about = (ast.get_docstring(parsed) or "").partition("\n")[0]
        said = [f"- {_sentence(n)}" for n in parsed.body if isinstance(n, ast.FunctionDef) and _is_test(n)]
        parts.append(f"`tests/test_{file}.py`: {cell(about)}\n\n" + "\n".join(said))
    return "\n\n".join(parts)


def _is_test(node: ast.FunctionDef) -> bool:
    return node.name.startswith("test_")


def _sentence(node: ast.FunctionDef) -> str:
    long = any("slow" in ast.unparse(d) for d in node.decorator_list)
    return cell(node.name.removeprefix("test_").replace("_", " ")) + (" (long)" if long else "")
