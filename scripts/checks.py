"""All checks of the project: lint, format, types, tests. Exit code 0 only if all pass.

    python scripts/checks.py [--fast | --slow]

--fast leaves out all tests marked `long`: between two edits. --slow runs the long studies that the ordinary run leaves
out, builds the documentation site, and searches two batteries of a few brief cases, made anew.
"""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

ROOT = Path(__file__).parent.parent
TESTS = ["-m", "pytest", "-n", "auto", "--dist", "loadfile", "--no-loadscope-reorder"]
BATTERIES = {
    "battery": ["scripts/blind_battery.py", "--cases", "3", "--brief", "--seed", "901", "--check"],
    "one-axis battery": ["scripts/one_axis_battery.py", "--cases", "4", "--brief", "--seed", "7", "--check"],
}
"""One that lacks nothing, one with one effect, and one with two; two that lack nothing, one with each effect."""

COMPILE = """
import sys
from lhpost6_pin.cli import main
for words in sys.argv[1:]:
    sys.argv = ["lhpost6", *words.split()]
    try:
        main()
    except SystemExit:
        pass
"""
SINE = "run sine --set amplitude=0.02 --set cycles=0.5 --set ramp_cycles=0.5 --rate 2048 --record-rate 512 --engine"
COMPILED = ((f"{SINE} fused",), ("decompose tests/data/records/practice_a_TX.nc", f"{SINE} pinocchio"))
"""Commands that compile nearly all there is: workers that begin without would each compile the same.

Those of two processes beside each other: the fused engine takes longest, and what it shares with the rest is little.
"""


def main() -> int:
    """Run every check, even after one has failed, and say which failed."""
    fast, slow = (option in sys.argv[1:] for option in ("--fast", "--slow"))
    chosen = ["-m", "fast"] if fast else ["-m", "slow"] if slow else []
    checks = {"lint": ["-m", "ruff", "check", "."], "format": ["-m", "ruff", "format", "--check", "."]}
    with TemporaryDirectory() as folder, ThreadPoolExecutor() as beside:
        types = beside.submit(_run, ["-m", "mypy"], stdout=subprocess.PIPE, text=True)  # takes one core
        failed = [name for name, command in checks.items() if not _passes(name, command)]
        list(beside.map(_compile, COMPILED, [f"{folder}/{k}" for k in range(len(COMPILED))]))  # until both have ended
        failed += ["tests"] * (not _passes("tests", [*TESTS, *chosen]))
        for name, battery in BATTERIES.items() if slow else ():
            command = [*battery, "--jobs", str(os.cpu_count() or 1), "--out", f"{folder}/{name}"]
            failed += [name] * (not _passes(name, command))
        print(f"== types: -m mypy\n{types.result().stdout}", end="", flush=True)
        failed += ["types"] * (types.result().returncode != 0)
    print(f"failed: {', '.join(failed)}" if failed else "all checks passed", flush=True)
    return 1 if failed else 0


def _passes(name: str, command: list[str]) -> bool:
    print(f"== {name}: {' '.join(command)}", flush=True)
    return _run(command).returncode == 0


def _compile(commands: tuple[str, ...], folder: str) -> None:
    given = [f"{words} --out {folder}" for words in commands]
    _run(["-c", COMPILE, *given], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _run(command: list[str], **options: Any) -> "subprocess.CompletedProcess[str]":
    # there is a worker on every core: more threads would only wait; and no process compiles the same modules again
    settings = {"OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": ""}
    return subprocess.run([sys.executable, *command], cwd=ROOT, check=False, env=os.environ | settings, **options)


if __name__ == "__main__":
    sys.exit(main())
