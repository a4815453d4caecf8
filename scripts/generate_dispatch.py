"""Write `effects/views.py` and `effects/dispatch.py`: from a row of the effect table to the functions of its law.

    python scripts/generate_dispatch.py [--check] [--out FOLDER]

Reads every module of `laws/` that exports LAW or LAWS and the signatures of its functions (`laws.contract`). The files
are checked in, since numba's cache keeps no functions that are made while a program runs; --check only compares.
"""

import argparse
import inspect
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from lhpost6_pin import laws
from lhpost6_pin.effects.registry import CODES, INLINED
from lhpost6_pin.laws.contract import Law, parameter_sizes

FOLDER = Path(__file__).parents[1] / "lhpost6_pin" / "effects"
PORTS = ("port", "port_2", "port_3")

VIEWS = '''"""A row's numbers as the parameters of its law: written by `scripts/generate_dispatch.py`, do not edit."""

from ..core.compiled import compiled_inline
from ..laws import {modules}

__all__ = ["view_hydraulic"]  # by name; all others as `views.view_...`
'''

DISPATCH = '''"""From a row of the effect table to its law: written by `scripts/generate_dispatch.py`, do not edit.

The functions call those of the law's module with what they ask for by name (`laws.contract`): coordinates s of the
ports, their rates sd or increments ds, hidden states z. The report's laws, whose codes are below INLINED, are put into
the loops; the others are called.
"""

from ..core.compiled import compiled, compiled_inline
from ..laws import {modules}
from . import views

__all__ = ["advance_called", "advance_inlined", "apply_forces", "power", "rates"]


@compiled
def _load(row, z):
    """Force of the actuator on the same leg [N]."""
    k, p = row.actuator_state, views.view_load_friction(row.numbers)
    return z[k] * p.area_a - (z[k + 1] * p.area_b if p.area_b > 0.0 else 0.0)
'''

ABOUT = {
    "force": "Forces of a row on its first, second and third port [N or N m].",
    "rates": "Fill the rates of a row's hidden states.",
    "advance": "Advance a row's hidden states over one step in which the ports move by ds from s.",
    "power": "Dissipated power [W] and stored energy [J] of a row that does `work` [W] on its ports.",
}


def write() -> dict[str, str]:
    """The texts of the files."""
    acting = {name: import_module(f"{laws.__name__}.{name}") for name in CODES}
    inlined, called = list(acting)[:INLINED], list(acting)[INLINED:]
    chains = DISPATCH.format(modules=_names(acting))
    chains += _chain("force_called", "row, s, sd, z", "force", called, acting)
    chains += _loop(inlined, acting)
    chains += _chain("advance_inlined", "row, s, ds, dt, z", "advance", inlined, acting)
    chains += _chain("advance_called", "row, s, ds, dt, z", "advance", called, acting)
    chains += _chain("rates", "row, s, sd, z, zd", "rates", list(acting), acting)
    chains += _chain("power", "row, s, z, work", "power", list(acting), acting)
    views = VIEWS.format(modules=_names(acting)) + "".join(_view(name, module) for name, module in acting.items())
    texts = {"views.py": views, "dispatch.py": chains}
    return {name: _formatted(text, FOLDER / name) for name, text in texts.items()}


def _names(names: Any) -> str:
    return "(" + ", ".join(sorted(names)) + ")"


def _formatted(text: str, file: Path) -> str:
    for command in (["check", "--fix", "--quiet", "--select", "I"], ["format"]):
        ruff = [sys.executable, "-m", "ruff", *command, "--stdin-filename", str(file), "-"]
        text = subprocess.run(ruff, input=text, capture_output=True, text=True, check=True).stdout
    return text


def _view(name: str, module: Any) -> str:
    """The function that gives a law's parameters their names."""
    places, at = [], 0
    for count in parameter_sizes(module.LAW).values():
        places.append(f"numbers[{at}]" if count == 1 else f"numbers[{at}:{at + count}]")
        at += count
    call = f"{name}.{module.LAW.parameters.__name__}({', '.join(places)})"
    return f'\n\n@compiled_inline\ndef view_{name}(numbers):\n    """Parameters of `{name}`."""\n    return {call}\n'


def _call(name: str, of: str, module: Any, p: str = "") -> str:
    """The call of a law's function, its parameters in `p` or by their view."""
    takes = inspect.signature(getattr(module, of).py_func).parameters
    p = p or f"views.view_{name}(row.numbers)"
    return f"{name}.{of}({', '.join(p if a == 'p' else _argument(a, module.LAW, p) for a in takes)})"


def _argument(name: str, law: Law, p: str) -> str:
    """What an argument of a law's function is in the functions of the file."""
    arrays = {"s": "s", "v": "sd", "d": "ds"}
    stem, _, place = name.partition("_")
    if name in law.states:
        value = f"z[row.state + {law.states.index(name)}]".replace(" + 0]", "]")
        needs = dict(law.state_needs).get(name)
        return f"({value} if {p}.{needs} > 0.0 else 0.0)" if needs else value
    if stem in arrays and place in ("", "2", "3"):
        k = int(place or 1)
        value = f"{arrays[stem]}[row.{PORTS[k - 1]}]"
        return value if k <= law.ports[0] else f"({value} if row.{PORTS[k - 1]} >= 0 else 0.0)"
    return {"dt": "dt", "work": "work", "load": "_load(row, z)", "planar": "row.port_2 >= 0"}[name]


def _chain(name: str, arguments: str, of: str, names: list[str], acting: dict[str, Any]) -> str:
    """One function of the file: a chain over the laws whose module exports `of`."""
    kind = "compiled_inline" if name.endswith("inlined") else "compiled"
    text = f'\n\n@{kind}\ndef {name}({arguments}):\n    """{ABOUT[of]}"""\n'
    word = "if"
    for law_name in (n for n in names if hasattr(acting[n], of)):
        law, call = acting[law_name].LAW, _call(law_name, of, acting[law_name])
        text += f"    {word} row.law == {CODES[law_name]}:\n"
        if of in ("force", "power"):
            parts = [call, *["0.0"] * 2] if of == "force" and law.ports[1] == 1 else [call]
            if of == "force" and law.ports[1] == 2:
                text += f"        first, second = {call}\n"
                parts = ["first", "second", "0.0"]
            text += f"        return {', '.join(parts)}\n"
            continue
        target = "zd" if of == "rates" else "z"
        filled = ", ".join(f"{target}[row.state + {i}]".replace(" + 0]", "]") for i in range(len(law.states)))
        text += f"        {filled} = {call}\n"
        word = "elif"
    return text + {"force": "    return 0.0, 0.0, 0.0\n", "power": "    return -work, 0.0\n"}.get(of, "")


def _loop(names: list[str], acting: dict[str, Any]) -> str:
    """The loop over a table that fills the ledger; a function a row in place of its branches would be slower."""
    text = "\n\n@compiled_inline\ndef apply_forces(rows, s, sd, z, force, port_force):\n"
    text += '    """Fill the ledger force (n_rows, 3) and its sum per port."""\n    port_force[:] = 0.0\n'
    text += "    for i in range(rows.size):\n        row = rows[i]\n        second = third = 0.0\n"
    for code, name in enumerate(names):
        parts = ", ".join(("first", "second", "third")[: acting[name].LAW.ports[1]])
        text += f"        {'elif' if code else 'if'} row.law == {code}:\n"
        text += f"            p_{code} = views.view_{name}(row.numbers)\n"
        text += f"            {parts} = {_call(name, 'force', acting[name], f'p_{code}')}\n"
    text += "        else:\n            first, second, third = force_called(row, s, sd, z)\n"
    text += "".join(f"        force[i, {k}] = {v}\n" for k, v in enumerate(("first", "second", "third")))
    text += "        port_force[row.port] += first\n"
    for port, value in (("port_2", "second"), ("port_3", "third")):
        text += f"        if row.{port} >= 0:\n            port_force[row.{port}] += {value}\n"
    return text


def main() -> int:
    """Write the files, or compare them."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 if a file is not current")
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder of the files (default: the package's)")
    options = parser.parse_args()
    texts = write()
    if options.check:
        return int(any((options.out / name).read_text(encoding="utf-8") != text for name, text in texts.items()))
    for name, text in texts.items():
        (options.out / name).write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
