"""All checks of the project: lint, format, types, tests, a blind battery. Exit code 0 only if all pass.

    python scripts/checks.py [--slow]

--slow runs the long studies that the ordinary run leaves out. The battery is of twenty brief cases, made anew.
"""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

ROOT = Path(__file__).parent.parent


def main() -> int:
    """Run every check, even after one has failed, and say which failed."""
    slow = "--slow" in sys.argv[1:]
    tests = ["-m", "pytest", "-n", "auto", "--dist", "loadfile", "--no-loadscope-reorder"]
    checks = {
        "lint": ["-m", "ruff", "check", "."],
        "format": ["-m", "ruff", "format", "--check", "."],
        "tests": [*tests, "-m", "slow"] if slow else tests,
    }
    with TemporaryDirectory() as folder, ThreadPoolExecutor() as beside:
        if not slow:
            cases = ["--cases", "20", "--brief", "--seed", "903", "--jobs", str(os.cpu_count() or 1)]
            checks["battery"] = ["scripts/blind_battery.py", *cases, "--check", "--out", folder]
        types = beside.submit(_run, ["-m", "mypy"], stdout=subprocess.PIPE, text=True)  # takes one core
        failed = [name for name, command in checks.items() if not _passes(name, command)]
        print(f"== types: -m mypy\n{types.result().stdout}", end="", flush=True)
        failed += ["types"] * (types.result().returncode != 0)
    print(f"failed: {', '.join(failed)}" if failed else "all checks passed", flush=True)
    return 1 if failed else 0


def _passes(name: str, command: list[str]) -> bool:
    print(f"== {name}: {' '.join(command)}", flush=True)
    return _run(command).returncode == 0


def _run(command: list[str], **options: Any) -> "subprocess.CompletedProcess[str]":
    return subprocess.run([sys.executable, *command], cwd=ROOT, check=False, **options)


if __name__ == "__main__":
    sys.exit(main())
