"""What the tests of the site share: its pages by hand, their snippets, and what a built page points to."""

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import NamedTuple

import typer

from lhpost6_pin.cli import app

ROOT = Path(__file__).parent.parent
PAGES = ROOT / "scripts" / "docs" / "pages"

_FENCE = re.compile(r"^(`{3,})(.*?)\n(.*?)^\1\s*$", re.MULTILINE | re.DOTALL)


class Snippet(NamedTuple):
    """A fenced block of a page."""

    language: str
    slow: bool
    text: str


def snippets(page: Path) -> Iterator[Snippet]:
    """All fenced blocks of a page, in order; `{.bash .slow title="..."}` is a slow one of bash."""
    for _, head, text in _FENCE.findall(page.read_text(encoding="utf-8")):
        head, _, _ = head.strip().strip("{}").partition("title=")
        words = [word.lstrip(".") for word in head.split()]
        assert words, f"{page.name}: a fence without a language: {text[:60]!r}"
        yield Snippet(words[0], "slow" in words, text)


def run_snippet(snippet: Snippet, folder: Path) -> "subprocess.CompletedProcess[str]":
    """Run a snippet of bash or python in a folder, with `lhpost6` on the path and `$SOURCE` the repository."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    env = {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT), "SOURCE": str(ROOT), "COLUMNS": "120"}
    python = snippet.language == "python"
    command = [sys.executable, "-c", snippet.text] if python else ["bash", "-c", f"set -e -o pipefail\n{snippet.text}"]
    return subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False, timeout=3600)


def check_commands(text: str) -> int:
    """Raise a UsageError for a command or option of `lhpost6` in a script of bash that does not exist; their number."""
    group = typer.main.get_command(app)
    lines = re.findall(r"(?:^|&& |\|\| )lhpost6 ([^|>&;\n]+)", text.replace("\\\n", " "), re.MULTILINE)
    for name, *words in map(shlex.split, lines):
        group.get_command(typer.Context(group), name).make_context(name, words)
    return len(lines)


class Links(HTMLParser):
    """Ids of a built page, where it links to, and what it loads when it is opened."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.ids: set[str] = set()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {key: value or "" for key, value in attrs}
        self.ids |= {given[key] for key in ("id", "name") if key in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        if tag == "link" and "canonical" not in given.get("rel", ""):
            self.loads.append(given.get("href", ""))
        self.loads += [given[key] for key in ("src", "srcset", "poster", "data") if key in given and tag != "meta"]
