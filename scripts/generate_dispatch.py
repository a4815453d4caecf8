"""Write `lhpost6_pin/effects/dispatch.py`: from a row of the effect table to the functions of its law.

    python scripts/generate_dispatch.py [--check]

Reads every module of `laws/` that exports LAW or LAWS and the signatures of its functions (`laws.contract`). The file
is checked in, since numba's cache keeps no functions that are made while a program runs; --check only compares.
"""

import inspect
import pkgutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from lhpost6_pin import laws
from lhpost6_pin.laws.contract import Law, parameter_sizes

FILE = Path(__file__).parents[1] / "lhpost6_pin" / "effects" / "dispatch.py"
PORTS = ("port", "port_2", "port_3")

HEAD = '''"""From a row of the effect table to its law: written by `scripts/generate_dispatch.py`, do not edit.

A row's code says its law, its numbers are the law's parameters in order (`view_*`). The functions call those of the
law's module with what they ask for by name (`laws.contract`): coordinates s of the ports, their rates sd or increments
ds, hidden states z. Those of the report's laws are put into their callers, the others are called.
"""

from collections.abc import Mapping

from ..core.compiled import compiled, compiled_inline
from ..laws import ('''


LOAD = """
@compiled
def _load(row, p, z):
    \"\"\"Force of the actuator on the same leg [N]; p has its areas.\"\"\"
    k = row.actuator_state
    return z[k] * p.area_a - (z[k + 1] * p.area_b if p.area_b > 0.0 else 0.0)
""".split("\n")


def modules() -> dict[str, Any]:
    """Modules of laws by name."""
    found = {m.name: import_module(f"lhpost6_pin.laws.{m.name}") for m in pkgutil.iter_modules(laws.__path__)}
    return {name: m for name, m in found.items() if hasattr(m, "LAW") or hasattr(m, "LAWS")}


def write() -> str:
    """The text of the file."""
    single = {name: m for name, m in modules().items() if hasattr(m, "LAW") and not m.LAW.modifies}
    acting = sorted(single, key=lambda name: (not single[name].LAW.inlined, name))
    lines = [HEAD + ", ".join(sorted(modules())) + ")", "from ..laws.contract import Law", ""]
    lines += [
        '__all__ = ["CODES", "HYDRAULIC", "INLINED", "LAWS", "MOST_NUMBERS", "advance_called", "advance_inlined"]'
    ]
    lines += ['__all__ += ["apply_forces", "power", "rates", "view_hydraulic"]', ""]
    lines += ["CODES: Mapping[str, int] = {" + ", ".join(f'"{name}": {i}' for i, name in enumerate(acting)) + "}"]
    lines += ['"""Codes of the laws that have rows."""', ""]
    lines += [f"INLINED = {sum(single[name].LAW.inlined for name in acting)}"]
    lines += ['"""Codes below it are those of the report\'s laws."""', ""]
    lines += [f"HYDRAULIC = {acting.index('hydraulic')}", '"""Code of the actuators\' law."""', ""]
    lines += [f"MOST_NUMBERS = {max(sum(parameter_sizes(m.LAW).values()) for m in single.values())}"]
    lines += ['"""Numbers of the law that has most parameters."""', "", "LAWS: Mapping[str, Law] = {"]
    lines += [f'    "{name}": {name}.LAW,' for name in acting]
    for name, module in modules().items():
        if hasattr(module, "LAWS"):
            lines += [f'    "{law}": {name}.LAWS["{law}"],' for law in module.LAWS]
        elif module.LAW.modifies:
            lines += [f'    "{name}": {name}.LAW,']
    lines += ["}", '"""All laws by name."""', ""]
    for name in acting:
        lines += view(name, single[name])
    inlined = [name for name in acting if single[name].LAW.inlined]
    called = [name for name in acting if name not in inlined]
    lines += function("force_called", "row, s, sd, z", "force", called, single, acting)
    lines += loop(inlined, single)
    arguments = "row, s, ds, dt, z"
    lines += function("advance_inlined", arguments, "advance", inlined, single, acting, inline=True)
    lines += function("advance_called", arguments, "advance", called, single, acting)
    lines += function("rates", "row, s, sd, z, zd", "rates", acting, single, acting)
    lines += function("power", "row, s, z, work", "power", acting, single, acting)
    text = "\n".join(lines) + "\n"
    ruff = [sys.executable, "-m", "ruff"]
    for command in (["check", "--fix", "--quiet", "--select", "I", "-"], ["format", "-"]):
        arguments = [*ruff, command[0], *command[1:], "--stdin-filename", str(FILE)]
        text = subprocess.run(arguments, input=text, capture_output=True, text=True, check=True).stdout
    return text


def view(name: str, module: Any) -> list[str]:
    """The function that gives a law's parameters their names."""
    cls, law = module.LAW.parameters, module.LAW
    places, at = [], 0
    for count in parameter_sizes(law).values():
        places.append(f"numbers[{at}]" if count == 1 else f"numbers[{at}:{at + count}]")
        at += count
    home = name if hasattr(module, cls.__name__) and cls.__module__.endswith(f".{name}") else ""
    owner = home or cls.__module__.rpartition(".")[2]
    owner = owner if owner in modules() or home else name
    body = f"    return {owner}.{cls.__name__}({', '.join(places)})"
    return ["", "@compiled_inline", f"def view_{name}(numbers):", f'    """Parameters of `{name}`."""', body, ""]


def argument(name: str, law: Law) -> str:
    """What a law's argument is in the functions of the file."""
    arrays = {"s": "s", "v": "sd", "d": "ds"}
    stem, _, place = name.partition("_")
    if name in law.states:
        value = f"z[row.state + {law.states.index(name)}]"
        for state, parameter in law.state_needs:
            if state == name:
                value = f"({value} if p.{parameter} > 0.0 else 0.0)"
        return value.replace(" + 0]", "]")
    if stem in arrays and place in ("", "2", "3"):
        k = int(place or 1)
        value = f"{arrays[stem]}[row.{PORTS[k - 1]}]"
        return value if k <= law.ports[0] else f"({value} if row.{PORTS[k - 1]} >= 0 else 0.0)"
    words = {"p": "p", "dt": "dt", "work": "work", "load": "_load(row, p, z)", "planar": "row.port_2 >= 0"}
    return words[name]


def function(
    name: str,
    arguments: str,
    of: str,
    names: list[str],
    single: dict[str, Any],
    acting: list[str],
    inline: bool = False,
) -> list[str]:
    """One function of the file: a chain over the laws whose module exports `of`."""
    about = {
        "force": "Forces of a row on its first, second and third port [N or N m].",
        "rates": "Fill the rates of a row's hidden states.",
        "advance": "Advance a row's hidden states over one step in which the ports move by ds from s.",
        "power": "Dissipated power [W] and stored energy [J] of a row that does `work` [W] on its ports.",
    }
    lines = ["", "@compiled_inline" if inline else "@compiled", f"def {name}({arguments}):", f'    """{about[of]}"""']
    for law_name in names:
        module = single[law_name]
        if not hasattr(module, of):
            continue
        law, takes = module.LAW, list(inspect.signature(getattr(module, of).py_func).parameters)
        call = f"{law_name}.{of}({', '.join(argument(a, law) for a in takes)})"
        lines += [f"    if row.law == {acting.index(law_name)}:  # {law_name}"]
        lines += [f"        p = view_{law_name}(row.numbers)"]
        if of == "force":
            most = law.ports[1]
            parts = ["first", "second", "third"][:most]
            lines += [
                f"        {', '.join(parts)} = {call}",
                f"        return {', '.join(parts + ['0.0'] * (3 - most))}",
            ]
        elif of == "power":
            lines += [f"        return {call}"]
        else:
            target = "zd" if of == "rates" else "z"
            filled = ", ".join(f"{target}[row.state + {i}]".replace(" + 0]", "]") for i in range(len(law.states)))
            lines += [f"        {filled} = {call}", "        return"]
    if of == "force" and any(single[n].LAW.feels_load for n in names):
        lines = LOAD + lines
    lines += {"force": ["    return 0.0, 0.0, 0.0"], "power": ["    return -work, 0.0"]}.get(of, [])
    return [*lines, ""]


def loop(names: list[str], single: dict[str, Any]) -> list[str]:
    """The loop over a table that fills the ledger; a function a row in place of its branches would be slower."""
    lines = ["", "@compiled_inline", "def apply_forces(rows, s, sd, z, force, port_force):"]
    lines += ['    """Fill the ledger force (n_rows, 3) and its sum per port."""', "    port_force[:] = 0.0"]
    lines += ["    for i in range(rows.size):", "        row = rows[i]", "        second = third = 0.0"]
    for code, name in enumerate(names):
        law, takes = single[name].LAW, list(inspect.signature(single[name].force.py_func).parameters)
        call = ", ".join(argument(a, law).replace("p.", f"p_{code}.") if a != "p" else f"p_{code}" for a in takes)
        lines += [f"        {'elif' if code else 'if'} row.law == {code}:  # {name}"]
        lines += [f"            p_{code} = view_{name}(row.numbers)"]
        lines += [f"            {', '.join(['first', 'second', 'third'][: law.ports[1]])} = {name}.force({call})"]
    lines += ["        else:", "            first, second, third = force_called(row, s, sd, z)"]
    lines += [f"        force[i, {k}] = {value}" for k, value in enumerate(("first", "second", "third"))]
    lines += ["        port_force[row.port] += first"]
    for port, value in (("port_2", "second"), ("port_3", "third")):
        lines += [f"        if row.{port} >= 0:", f"            port_force[row.{port}] += {value}"]
    return [*lines, ""]


def main() -> int:
    """Write the file, or compare it."""
    text = write()
    if "--check" in sys.argv[1:]:
        return int(FILE.read_text(encoding="utf-8") != text)
    FILE.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
