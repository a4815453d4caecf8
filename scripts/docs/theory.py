"""Generated parts of a theory page: uses of its laws, code, tests."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from lhpost6_pin.core.errors import ParameterError
from lhpost6_pin.effects.effect import Effect
from lhpost6_pin.effects.registry import LAWS
from lhpost6_pin.machine.library import families, make_effect
from lhpost6_pin.machine.machine import load_machine

from .markdown import cell, code_cell, table

__all__ = ["PAGES", "law", "law_modules", "laws_of", "page_of_law", "tests_of", "tree"]

ROOT = Path(__file__).parents[2]
PAGES: dict[str, tuple[str, ...]] = {
    "orifice": ("hydraulic_double", "hydraulic_single"),
    "chamber": ("hydraulic_double", "hydraulic_single", "extra_leakage", "external_leakage", "dead_volume"),
    "strut": ("nitrogen_strut",),
    "bouc_wen": ("bouc_wen_1d", "bouc_wen_2d"),
    "viscous": ("viscous",),
    "friction": ("stribeck", "asymmetric", "load_friction", "warm_up"),
    "dahl": ("dahl_instead",),
    "ball": ("ball", "smooth_ball"),
    "backlash": ("backlash",),
    "spring": ("spring", "end_stop", "drag"),
    "tabulated": ("by_position", "by_speed", "by_memory"),
    "leaks": ("turbulent_leakage", "null_leakage"),
    "bulk": ("entrained_air", "cavitation"),
    "spool": ("null_bias", "deadband", "flow_curve"),
    "lines": ("line", "supply_line"),
    "play": ("play",),
    "gas": ("gas_leak", "gas_heat"),
    "oscillator": ("oscillator",),
    "supply": ("supply_droop", "back_pressure", "valve_delay", "valve_lag"),
    "platen": ("constant", "thrust_direction", "more_inertia"),
}
"""Laws of the registry by their page; the first pages are modules of `laws/` of the same name."""


def law_modules() -> tuple[str, ...]:
    """Modules of `laws/` by name."""
    return tuple(p.stem for p in sorted((ROOT / "lhpost6_pin" / "laws").glob("*.py")) if p.stem != "__init__")


def page_of_law(name: str) -> str:
    """Page of a law; StopIteration for a law that is missing in PAGES."""
    return next(page for page in reversed(PAGES) if name in PAGES[page])


def laws_of(page: str) -> str:
    """Uses of the laws of a page: effects of the nominal machine, families of the library."""
    mine = PAGES[page]
    rows = [(_numbers(law), "machine", code_cell(e.name), cell(e.source)) for law, e in _standard() if law in mine]
    rows += [
        (
            _numbers(law),
            "library",
            f"[`{family}`](../reference/library.md#{family})",
            cell(families()[family].title),
        )
        for law, family in _of_library()
        if law in mine
    ]
    return table(("law and its parameters", "used by", "name", "description or source"), rows)


def _numbers(law: str) -> str:
    params = LAWS[law].params
    some = params if len(params) <= 12 else params[:3]
    numbers = ", ".join(f"{name.replace('_', ' ')} {cell(f'[{unit}]')}" for name, unit in some)
    return f"{code_cell(law)}: {numbers}{'' if some is params else ', ...'}"


@cache
def _standard() -> tuple[tuple[str, Effect], ...]:
    return tuple((e.law, e) for e in load_machine().effects)


@cache
def _of_library() -> tuple[tuple[str, str], ...]:
    """(law, family) of every family that makes an effect of the nominal machine."""
    found = []
    for name in families():
        try:
            found.append((make_effect(load_machine(), name).law, name))
        except ParameterError:
            continue  # of a sensor or a controller
    return tuple(found)


def law(page: str) -> str:
    """Generated part of a page on a module of `laws/`: equation and code, uses, tests."""
    return "\n\n".join(
        (
            "## Equation and code",
            _module(f"lhpost6_pin.laws.{page}"),
            "## Uses",
            laws_of(page),
            "## Tests",
            tests_of(page),
        )
    )


def _module(path: str) -> str:
    options = ("heading_level: 3", "show_root_heading: false", "show_root_toc_entry: false")
    return "\n      ".join([f"::: {path}\n    options:", *options])


# ---------------------------------------------------------------------------------------------------------- the tests
class Battery(NamedTuple):
    """A file of tests, the file of its cases, and the variable of its cases of laws."""

    file: str
    cases: str
    laws: str


BATTERIES = (
    Battery("test_laws.py", "cases.py", "CASES"),
    Battery("test_library_mechanical.py", "test_library_mechanical.py", "CASES"),
    Battery("test_library_oil.py", "test_library_oil.py", "NUMBERS"),
)
"""Test files of laws: tests on all kernels of a file, on all laws, and on single ones."""


def tests_of(page: str) -> str:
    """Tests that cover the kernels or laws of a page, and those that call its kernels directly."""
    kernels = set(import_module(f"lhpost6_pin.laws.{page}").__all__)
    parts = []
    for battery in BATTERIES:
        functions = [
            n for n in tree(battery.file).body if isinstance(n, ast.FunctionDef) and n.name.startswith("test_")
        ]
        over = {f.name: _over(f, battery, page) for f in functions}
        single = [f for f in functions if over[f.name] is None and kernels & set(_of_module(f, page, battery.file))]
        for title, some in (
            ("on all kernels and laws of this page", [f for f in functions if over[f.name]]),
            ("on these kernels", single),
        ):
            if some:
                lines = [f"- {cell(f.name.removeprefix('test_').replace('_', ' '))}" for f in some]
                parts.append(f"`tests/{battery.file}`, {title}:\n\n" + "\n".join(lines))
    return "\n\n".join(parts)


def _over(function: ast.FunctionDef, battery: Battery, page: str) -> bool | None:
    """Whether a parametrised test covers the kernels or laws of a page; None for other tests."""
    said = " ".join(ast.unparse(d) for d in function.decorator_list)
    words = set(re.findall(r"\w+", said))
    if "KERNELS" in words:
        return page in _names_in(battery.cases, "KERNELS")
    if not words & {battery.laws, "every_law"}:
        return None
    laws = [LAWS[law] for law in PAGES[page] if law in _names_in(battery.cases, battery.laws)]
    if "not LAWS" in said:
        laws = [law for law in laws if not law.stores_energy]
    elif ".states" in said:
        laws = [law for law in laws if law.states]
    return bool(laws)


@cache
def _names_in(file: str, variable: str) -> frozenset[str]:
    """Names and strings in the value of a variable of a test file."""
    nodes = [
        inner
        for n in tree(file).body
        if isinstance(n, ast.Assign) and any(isinstance(t, ast.Name) and t.id == variable for t in n.targets)
        for inner in ast.walk(n.value)
    ]
    names = {n.id for n in nodes if isinstance(n, ast.Name)}
    return frozenset(names | {str(n.value) for n in nodes if isinstance(n, ast.Constant)})


@cache
def tree(file: str) -> ast.Module:
    """A file of tests, parsed."""
    return ast.parse((ROOT / "tests" / file).read_text(encoding="utf-8"))


def _of_module(function: ast.FunctionDef, page: str, file: str) -> Iterator[str]:
    """Names of a module that a function uses, as `module.name` or imported."""
    direct = _imported(file).get(page, set())
    for node in ast.walk(function):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == page:
            yield node.attr
        elif isinstance(node, ast.Name) and node.id in direct:
            yield node.id


@cache
def _imported(file: str) -> dict[str, set[str]]:
    """Modules of `laws` imported by a test file, with the imported names."""
    found: dict[str, set[str]] = {}
    for node in tree(file).body:
        if isinstance(node, ast.ImportFrom) and node.module == "lhpost6_pin.laws":
            found |= {alias.name: set() for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("lhpost6_pin.laws."):
            found[str(node.module).rpartition(".")[2]] = {alias.name for alias in node.names}
    return found
