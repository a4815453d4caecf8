"""The pages by hand with their generated parts, assembled in a directory for mkdocs.

A line `<!-- insert: NAME ... -->` of a page is replaced by what the generator NAME returns for the words behind it.
"""

import ast
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from . import commands, controller, figures, tables, theory

__all__ = ["HERE", "INSERTS", "PAGES", "ROOT", "assemble"]

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PAGES = HERE / "pages"
RECORDS = ROOT / "tests" / "data" / "records"
_INSERT = re.compile(r"^<!-- insert: (.+) -->$", re.MULTILINE)


def assemble(folder: Path) -> None:
    """Write mkdocs.yml, pages and figures below `folder`; raises KeyError for an unknown insert."""
    for name in ("mkdocs.yml", "docstrings.py"):
        shutil.copy(HERE / name, folder / name)
    shutil.copytree(PAGES, folder / "pages")
    for path in (ROOT / "scripts" / "battery").glob("*.svg"):
        shutil.copy(path, folder / "pages" / "results")
    for path in sorted((folder / "pages").rglob("*.md")):
        depth = len(path.relative_to(folder / "pages").parts) - 1
        text = _INSERT.sub(lambda found: _generated(found.group(1)), path.read_text(encoding="utf-8"))
        path.write_text(text.replace("](LAWS/", f"]({'../' * depth}theory/"), encoding="utf-8")
    figures.draw_all(folder / "pages" / "figures")


def _generated(words: str) -> str:
    name, *arguments = shlex.split(words)
    return INSERTS[name](*arguments)


def _stored(name: str) -> str:
    """Output of a script, stored beside this module."""
    return (HERE / f"{name}.md").read_text(encoding="utf-8").strip()


def _examples() -> str:
    """The numbered examples: title, call, and code to unfold."""
    parts = []
    for path in sorted((ROOT / "scripts").glob("example_*.py")):
        code = path.read_text(encoding="utf-8")
        said = ast.get_docstring(ast.parse(code)) or ""
        first, call, *more = said.split("\n\n")
        lines = [f"## {path.stem.split('_')[1]}. {first.rstrip('.')}", *more]
        calls = "\n".join(line.strip() for line in call.splitlines())
        shown = "\n".join(f"    {line}".rstrip() for line in ["```python", *code.splitlines(), "```"])
        parts += [*lines, f"```text\n{calls}\n```", f'??? example "{path.relative_to(ROOT)}"\n\n{shown}']
    return "\n\n".join(parts)


def _battery(name: str) -> str:
    """Published scores of a battery, without their title."""
    text = (ROOT / "scripts" / "battery" / f"{name}.md").read_text(encoding="utf-8")
    return text.partition("\n")[2].strip()


def _api(*modules: str) -> str:
    return "\n\n".join(f"::: lhpost6_pin.{module}" for module in modules)


def _output(*command: str) -> str:
    """A command of the package and its output; result files are deleted."""
    program = f"import sys; sys.argv = {list(command)!r}; from lhpost6_pin.cli import main; main()"
    env = {**os.environ, "COLUMNS": "96", "NO_COLOR": "1", "PYTHONPATH": str(ROOT)}
    ended = subprocess.run(
        [sys.executable, "-c", program], env=env, cwd=ROOT, capture_output=True, text=True, check=False
    )
    if ended.returncode:
        raise RuntimeError(f"{shlex.join(command)}: {ended.stderr}")
    shown = [word for word in ended.stdout.splitlines() if not word.startswith("wrote ")]
    return "\n".join(["```{.text .output}", f"$ {_shown(command)}", *(line.rstrip() for line in shown), "```"])


def _shown(command: Sequence[str]) -> str:
    """The command without the directory of its results."""
    words = list(command)
    if "--out" in words:
        at = words.index("--out")
        del words[at : at + 2]
    return shlex.join(words)


def _open_loop() -> str:
    with TemporaryDirectory() as folder:
        record = RECORDS / "open_loop_ridgecrest.nc"
        return _output("lhpost6", "open-loop", str(record.relative_to(ROOT)), "--engine", "fused", "--out", folder)


def _validation() -> str:
    """Inverse dynamics of the practice records, as a campaign."""
    with TemporaryDirectory() as folder:
        campaign = Path(folder) / "practice"
        campaign.mkdir()
        for path in RECORDS.glob("practice_a_*.nc"):
            shutil.copy(path, campaign / path.name.removeprefix("practice_a_"))
        text = _output("lhpost6", "validate", str(campaign), "--phases", "1", "--out", str(Path(folder) / "out"))
        return text.replace(str(campaign), "practice")


INSERTS: Mapping[str, Callable[..., str]] = {
    "api": _api,
    "assumptions": tables.assumptions,
    "battery": _battery,
    "capacity": tables.capacity,
    "commands": commands.commands,
    "docstring": controller.docstring,
    "effects": tables.effects,
    "evidence": tables.evidence,
    "examples": _examples,
    "functions": controller.functions,
    "law": theory.law,
    "laws": theory.laws_of,
    "layout": tables.layout,
    "library": tables.library,
    "margins": controller.margins,
    "members": controller.members,
    "modes": tables.modes,
    "motions": tables.motions,
    "numbers": controller.numbers,
    "open_loop": _open_loop,
    "panel": controller.panel,
    "stored": _stored,
    "tests_in": controller.tests_in,
    "validation": _validation,
}
"""Generators by name."""
