"""Build the documentation site: pages by hand, pages and figures from the package and its data, links checked.

    python scripts/build_docs.py [--out out/docs]

Needs `pip install '.[docs]'`. The site is put together in a temporary folder, built by mkdocs with --strict,
and moved to --out whole or not at all. It loads nothing from elsewhere: open index.html, or put it on any web server.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from docs.assemble import ROOT, assemble

from lhpost6_pin.core.files import refuse_folder


def build(out: Path) -> bool:
    """Build the site and put it at `out`, in place of what was built there before; False if mkdocs found a fault."""
    refuse_folder(out)
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out.parent, prefix=".docs-") as name:
        folder = Path(name)
        assemble(folder)
        if not _mkdocs(folder):
            return False
        _replace(out, folder / "site", folder / "before")
    return True


def _replace(out: Path, site: Path, before: Path) -> None:
    """Put the site where another may be; if that fails, the other is put back."""
    if out.exists():
        out.rename(before)
    try:
        site.rename(out)
    except OSError:
        if before.exists():
            before.rename(out)
        raise


def _mkdocs(folder: Path) -> bool:
    path = os.pathsep.join([str(folder), str(ROOT)])
    env = {**os.environ, "PYTHONPATH": path, "NO_MKDOCS_2_WARNING": "1"}
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet"]
    return subprocess.run(command, cwd=folder, env=env, check=False).returncode == 0


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description="Build the documentation site.")
    parser.add_argument("--out", type=Path, default=Path("out/docs"), help="folder of the finished site")
    out = parser.parse_args().out
    if out.exists() and not (out / "index.html").is_file() and any(out.iterdir()):
        sys.exit(f"error: {out} holds something else than a site; name another folder with --out")
    try:
        built = build(out)
    except OSError as error:
        sys.exit(f"error: {error}")
    if not built:
        sys.exit("error: mkdocs found faults; nothing was written")
    print(f"wrote {out / 'index.html'}")


if __name__ == "__main__":
    main()
