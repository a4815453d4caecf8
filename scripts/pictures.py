"""Pictures of README and pages: the table in motion as the viewer shows it, heads of a run and a discovery report.

    python scripts/pictures.py [--out scripts/docs/pages/assets] [--results out/pictures]

Runs `lhpost6 run ridgecrest`, `lhpost6 view` and `lhpost6 demo` and photographs their pages in Chromium. Existing
results are used again.
"""

import argparse
import asyncio
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from browser import BROWSER, Tab, browse
from PIL import Image

from lhpost6_pin.core.files import write_whole
from lhpost6_pin.data.records import load_record

ROOT = Path(__file__).parents[1]
AMPLIFY = 2.5
VIEWER, RUN, REPORT = (1280, 760), (1000, 1000), (1000, 1112)  # width and height of the window [pixels]
NEARER = "viewer.camera.zoom = 1.25; viewer.camera.updateProjectionMatrix(); viewer.set_dirty()"


def lhpost6(*words: object) -> None:
    """Run a command of the package; raises CalledProcessError if it fails."""
    program = f"import sys; sys.argv = {['lhpost6', *map(str, words)]!r}; from lhpost6_pin.cli import main; main()"
    subprocess.run([sys.executable, "-c", program], check=True, cwd=ROOT)


def photograph(page: Path, path: Path, size: tuple[int, int], script: str) -> None:
    """Save what a page shows after a script; raises RuntimeError for errors of the page."""

    async def look(tab: Tab) -> list[str]:
        await asyncio.sleep(2.0)
        await tab.evaluate(script)
        await asyncio.sleep(2.0)
        await tab.picture(path)
        return tab.faults

    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        faults = browse(Path(folder), page.resolve().as_uri(), look, size)
    if faults:
        raise RuntimeError(f"{page}: {faults}")
    Image.open(path).convert("RGB").save(path, optimize=True)


def peak_moment(record: Path) -> float:
    """Time [s] of the largest horizontal acceleration of the platen."""
    test = load_record(record)
    level = np.hypot(*(test["platen_acceleration"].sel(axis=axis).values for axis in "xy"))
    return float(test["time"][int(level.argmax())])


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "scripts" / "docs" / "pages" / "assets")
    parser.add_argument("--results", type=Path, default=Path("out/pictures"), help="directory of runs and pages")
    given = parser.parse_args()
    if BROWSER is None:
        sys.exit("error: no Chromium on this computer")
    run, demo = given.results.resolve() / "run", given.results.resolve() / "demo"
    if not (run / "record.nc").exists():
        lhpost6("run", "ridgecrest", "--engine", "fused", "--record-rate", 512, "--out", run)
    if not (demo / "report.html").exists():
        lhpost6("demo", "--no-open", "--out", demo)
    lhpost6("view", run / "record.nc", "--amplify", AMPLIFY, "--force-change", "--export", run / "view.html")
    moment = peak_moment(run / "record.nc")
    seek = f"viewer.animator.pause(); seek({moment}); part('caption').open = false; {NEARER}"
    for name, page, size, script in (
        ("viewer", run / "view.html", VIEWER, seek),
        ("report", run / "report.html", RUN, "window.scrollTo(0, 0)"),
        ("discovery", demo / "report.html", REPORT, "window.scrollTo(0, 0)"),
    ):
        path = given.out / f"{name}.png"
        with write_whole(path) as beside:
            photograph(page, beside, size, script)
        print(f"wrote {path} ({path.stat().st_size / 1e3:.0f} kB)")


if __name__ == "__main__":
    main()
