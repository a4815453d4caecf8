"""Generated parts of a theory page: uses of its laws, code, tests."""

import ast
import re
import sys
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from pathlib import Path

from lhpost6_pin.core.errors import ParameterError
from lhpost6_pin.effects.effect import Effect
from lhpost6_pin.effects.registry import LAWS
from lhpost6_pin.laws.contract import parameter_units
from lhpost6_pin.machine.library import families, make_effect
from lhpost6_pin.machine.machine import load_machine

from .markdown import cell, code_cell, table

__all__ = ["PAGES", "law", "law_modules", "laws_of", "page_of_law", "tests_of", "tree"]

ROOT = Path(__file__).parents[2]
PAGES: dict[str, tuple[str, ...]] = {
    "orifice": ("orifice",),
    "chamber": ("chamber", "hydraulic"),
    "strut": ("nitrogen_strut",),
    "bouc_wen": ("bouc_wen", "bouc_wen_1d", "bouc_wen_2d"),
    "viscous": ("viscous",),
    "friction": ("stribeck", "stribeck_lag", "asymmetric", "load_friction", "warm_up"),
    "dahl": ("dahl_instead",),
    "ball": ("ball", "smooth_ball"),
    "backlash": ("backlash", "backlash_instead"),
    "spring": ("spring", "spring_damper", "end_stop", "drag"),
    "tabulated": ("tabulated", "by_position", "by_speed", "by_memory"),
    "leaks": ("leaks",),
    "bulk": ("bulk",),
    "spool": ("spool",),
    "lines": ("lines",),
    "play": ("play",),
    "gas": ("gas_leak", "gas_heat"),
    "oscillator": ("oscillator",),
    "supply": ("supply", "valve_path"),
    "platen": ("constant", "platen_body"),
}
"""Modules of `laws/` by page."""


def law_modules() -> tuple[str, ...]:
    """Modules of `laws/` with equations, by name."""
    stems = sorted(p.stem for p in (ROOT / "lhpost6_pin" / "laws").glob("*.py"))
    return tuple(stem for stem in stems if stem not in ("__init__", "contract"))


def laws_on(page: str) -> tuple[str, ...]:
    """Laws of the registry on a page; the orifice is part of the actuator's."""
    found: list[str] = ["hydraulic"] if page == "orifice" else []
    for name in PAGES[page]:
        module = import_module(f"lhpost6_pin.laws.{name}")
        found += [name] if hasattr(module, "LAW") else getattr(module, "LAWS", ())
    return tuple(found)


def page_of_law(name: str) -> str:
    """Page of a law; StopIteration for a law that is missing in PAGES."""
    return next(page for page in reversed(PAGES) if name in laws_on(page))


def laws_of(page: str) -> str:
    """Uses of the laws of a page: effects of the nominal machine, families of the library."""
    mine = laws_on(page)
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
    params = parameter_units(LAWS[law])
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
    """Generated part of a page on modules of `laws/`: equation and code, uses, tests."""
    return "\n\n".join(
        (
            "## Equation and code",
            *(_module(name, len(PAGES[page]) > 1) for name in PAGES[page]),
            "## Uses",
            laws_of(page),
            "## Tests",
            tests_of(page),
        )
    )


def _module(name: str, several: bool) -> str:
    heading = f"### `laws/{name}.py`\n\n" if several else ""
    level = f"heading_level: {4 if several else 3}"
    options = (level, "show_root_heading: false", "show_root_toc_entry: false")
    return heading + "\n      ".join([f"::: lhpost6_pin.laws.{name}\n    options:", *options])


# ---------------------------------------------------------------------------------------------------------- the tests
FILES = ("test_law_battery.py", "test_mechanical_effects.py", "test_oil_effects.py")
"""Test files of laws: tests on all of them, with cases in `tests/law_cases.py`, and on single ones."""


def tests_of(page: str) -> str:
    """Tests that cover the kernels or laws of a page, and those that call its kernels directly."""
    parts = []
    for file in FILES:
        functions = [n for n in tree(file).body if isinstance(n, ast.FunctionDef) and n.name.startswith("test_")]
        covering = [f for f in functions if _covers(f, page)]
        single = [f for f in functions if f not in covering and _calls(f, page, file)]
        for title, some in (("on all kernels and laws of this page", covering), ("on these kernels", single)):
            if some:
                lines = [f"- {cell(f.name.removeprefix('test_').replace('_', ' '))}" for f in some]
                parts.append(f"`tests/{file}`, {title}:\n\n" + "\n".join(lines))
    return "\n\n".join(parts)


def _covers(function: ast.FunctionDef, page: str) -> bool:
    """Whether a test is parametrised over cases, laws or kernels of a page."""
    words = re.findall(r"\w+", " ".join(ast.unparse(d) for d in function.decorator_list))
    return any(_names_in(word) & {*laws_on(page), *(f"{name}.py" for name in PAGES[page])} for word in words)


@cache
def _names_in(variable: str) -> frozenset[str]:
    """Laws in the value of a variable of `tests/law_cases.py`; modules with their suffix where it holds kernels."""
    if str(ROOT / "tests") not in sys.path:
        sys.path.append(str(ROOT / "tests"))
    found = getattr(import_module("law_cases"), variable, ())
    if isinstance(found, Mapping):
        return frozenset(f"{name.split('.')[0]}.py" if "." in name else name for name in found)
    return frozenset(case.law for case in found if hasattr(case, "law")) if isinstance(found, tuple) else frozenset()


@cache
def tree(file: str) -> ast.Module:
    """A file of tests, parsed."""
    return ast.parse((ROOT / "tests" / file).read_text(encoding="utf-8"))


def _calls(function: ast.FunctionDef, page: str, file: str) -> bool:
    """Whether a test uses what a module of a page exports, as `module.name` or imported."""
    exported = {name: set(import_module(f"lhpost6_pin.laws.{name}").__all__) for name in PAGES[page]}
    direct = {x for name in exported for x in _imported(file).get(name, set()) & exported[name]}
    return any(
        (isinstance(n, ast.Name) and n.id in direct)
        or (isinstance(n, ast.Attribute) and isinstance(n.value, ast.Name) and n.attr in exported.get(n.value.id, ()))
        for n in ast.walk(function)
    )


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
