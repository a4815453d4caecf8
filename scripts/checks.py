"""All checks of the project: lint, format, types, tests. Exit code 0 only if all pass.

    python scripts/checks.py [--slow]

--slow runs the long studies that the ordinary run leaves out.
"""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent


def main() -> int:
    """Run every check, even after one has failed, and say which failed."""
    slow = ["-m", "slow"] if "--slow" in sys.argv[1:] else []
    checks = {
        "lint": ["ruff", "check", "."],
        "format": ["ruff", "format", "--check", "."],
        "types": ["mypy"],
        "tests": ["pytest", "-n", "auto", "--dist", "loadfile", "--no-loadscope-reorder", *slow],
    }
    failed = []
    for name, command in checks.items():
        print(f"== {name}: {' '.join(command)}", flush=True)
        if subprocess.run([sys.executable, "-m", *command], cwd=ROOT, check=False).returncode:
            failed.append(name)
    print(f"failed: {', '.join(failed)}" if failed else "all checks passed", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
