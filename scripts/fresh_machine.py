"""How long does a newcomer wait? The README's first command and the demonstration, where nothing is installed yet.

    python scripts/fresh_machine.py [--out FILE]

In a clone of what is committed, with a home folder of its own: no package, no compiled code; what pip has downloaded
before is kept. Prints Markdown.
"""

import argparse
import asyncio
import datetime
import os
import re
import subprocess
import tempfile
import time
from pathlib import Path

from browser import BROWSER, Tab, browse
from docs.markdown import print_and_keep

from lhpost6_pin import __version__

ROOT = Path(__file__).parent.parent
SHOWN = 5.0  # [s] of the animation over which frames are counted
WINDOW = (1280, 800)


def first_command() -> str:
    """The first command of the README."""
    found = re.search(r"```bash\n(.+?)\n```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    return found[1]


def taken(command: str, folder: Path, home: Path) -> float:
    """Seconds that a command takes; raises CalledProcessError if it fails."""
    cache = os.environ.get("PIP_CACHE_DIR", str(Path.home() / ".cache" / "pip"))
    known = {k: v for k, v in os.environ.items() if not k.startswith(("LHPOST6", "PYTHON", "VIRTUAL", "XDG"))}
    begun = time.perf_counter()
    subprocess.run(
        command, shell=True, check=True, cwd=folder, env={**known, "HOME": str(home), "PIP_CACHE_DIR": cache}
    )
    return time.perf_counter() - begun


def frame_rate(page: Path) -> float:
    """Frames a second of an animation that plays in a browser."""

    async def look(tab: Tab) -> float:
        await asyncio.sleep(SHOWN)
        count = "let n = 0; const from = performance.now(); const end = from + 1e3 * seconds"
        each = "(now) => { n++; if (now > end) done(1e3 * n / (now - from)); else requestAnimationFrame(each) }"
        script = f"new Promise((done) => {{ {count}; const each = {each}; requestAnimationFrame(each) }})"
        return float(await tab.evaluate(f"{{ const seconds = {SHOWN}; {script} }}"))

    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        return float(browse(Path(folder), page.as_uri(), look, WINDOW))


def main() -> None:
    """Time, and print what was found as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=None, help="write it to this file, too")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as above:
        home, clone = Path(above) / "home", Path(above) / "clone"
        home.mkdir()
        subprocess.run(["git", "clone", "--quiet", str(ROOT), str(clone)], check=True)
        first = taken(first_command(), clone, home)
        demo = taken(".venv/bin/lhpost6 demo --no-open --out out/demo", clone, home)
        again = taken(".venv/bin/lhpost6 run ridgecrest --out out/again", clone, home)
        rate = frame_rate(clone / "out" / "demo" / "view.html") if BROWSER else float("nan")
    rows = [
        f"`python scripts/fresh_machine.py`, version {__version__}, {datetime.date.today()}, {os.cpu_count()} cores.",
        "",
        "| what | seconds | wanted |",
        "|---|---|---|",
        f"| installed, compiled, and a first simulated earthquake of 50 s | {first:.0f} | 180 |",
        f"| and then an effect hidden, found, proven: `lhpost6 demo` | {first + demo:.0f} | 300 |",
        f"| `lhpost6 demo` alone | {demo:.0f} | 90 |",
        f"| the same earthquake again | {again:.0f} | |",
        "",
        "| its animation, WebGL drawn by the processor, {} by {} | frames a second | wanted |".format(*WINDOW),
        "|---|---|---|",
        f"| playing | {rate:.0f} | 30 |",
        "",
    ]
    print_and_keep(rows, asked.out)


if __name__ == "__main__":
    main()
