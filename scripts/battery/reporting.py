"""Searching the cases of a battery, and its scores as Markdown."""

import json
import subprocess
import time
import tomllib
import traceback
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

from joblib import parallel_config

from lhpost6_pin import __version__
from lhpost6_pin.core.errors import LhpostError
from lhpost6_pin.core.files import write_whole
from lhpost6_pin.data.campaign import load_campaign
from lhpost6_pin.data.sensors import SensorSet
from lhpost6_pin.discovery import discover, save_verdict
from lhpost6_pin.machine.machine import Machine

from .scoring import (
    Answer,
    Label,
    Share,
    families,
    misses,
    named_what_is_there,
    reach,
    reliability,
    score,
    strength_curve,
)

__all__ = ["answers", "publish", "report", "search", "wrong"]

Rows = Callable[[list[str], list[tuple[Label, Answer]]], list[str]]
"""Further rows of the table of scores from the names of cases and their labels with verdicts."""


def search(home: Path, machine: Machine, sensors: SensorSet, phases: Sequence[int]) -> None:
    """Search the case in a folder, unless that was done; leaves verdict.json there, or error.txt."""
    if (home / "verdict.json").exists():
        return
    campaign = load_campaign(home, machine)
    hold_out = tomllib.loads((home / "campaign.toml").read_text(encoding="utf-8"))["hold_out"]
    begin = time.perf_counter()
    try:
        with parallel_config("threading", n_jobs=1):  # one case a worker, of whatever kind
            found = discover(machine, campaign, sensors, hold_out=hold_out, phases=phases, jobs=1, propose=False)
    except Exception as error:  # one case must not end a battery; it counts as a case without a verdict
        said = str(error) if isinstance(error, LhpostError) else traceback.format_exc()
        (home / "error.txt").write_text(said, encoding="utf-8")
        return
    (home / "error.txt").unlink(missing_ok=True)
    (home / "seconds.txt").write_text(f"{time.perf_counter() - begin:.1f}", encoding="utf-8")
    (home / "commit.txt").write_text(_commit(), encoding="utf-8")
    save_verdict(found, home / "verdict.json")


@cache
def _commit() -> str:
    """Commit of the code at hand, `-dirty` with changes beyond it; unknown without git."""
    command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty", "--exclude=*"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def answers(folder: Path, labels: Mapping[str, Label]) -> dict[str, tuple[Label, Answer]]:
    """Label and verdict of all cases that have one."""
    files = {name: folder / name / "verdict.json" for name in labels}
    return {n: (labels[n], json.loads(f.read_text(encoding="utf-8"))) for n, f in files.items() if f.exists()}


def report(
    folder: Path, labels: Mapping[str, Label], answered: Mapping[str, tuple[Label, Answer]], more: Rows | None = None
) -> str:
    """Scores of all cases with a verdict, as Markdown; then every case, the wrong ones marked."""
    names, pairs = list(answered), list(answered.values())
    lines = [f"{len(pairs)} of {len(labels)} cases searched", "", "| metric | value |", "|---|---|"]
    for metric, value in score(pairs).items():
        if not isinstance(value, Share) or value.of:
            lines.append(f"| {metric} | {value.text if isinstance(value, Share) else f'{value:.2f}'} |")
    lines += more(names, pairs) if more else []
    files = [folder / n / "seconds.txt" for n in names]
    if seconds := sorted(float(f.read_text(encoding="utf-8")) for f in files if f.exists()):
        lines.append(f"| seconds a case, median | {seconds[len(seconds) // 2]:.0f} |")
    lines += ["", "| gap of an effect over the floor | its family is named |", "|---|---|"]
    lines += [f"| {words} | {share.text} |" for words, share in strength_curve(pairs).items() if share.of]
    lines += ["", "| stated probability of a name | right |", "|---|---|"]
    lines += [f"| {words} | {share.text} |" for words, share in reliability(pairs).items()]
    lost = [(n, *miss) for n, pair in zip(names, pairs, strict=True) for miss in misses(*pair)]
    lines += ["", "| hidden and not named | case | gap | why |", "|---|---|---|---|"] if lost else []
    lines += [f"| {family} | {n} | {gap:.1f} | {why} |" for n, family, gap, why in lost]
    lines += ["", "| case | sort | gap | hidden | verdict | named |", "|---|---|---|---|---|---|"]
    lines += sorted(_case_row(n, *pair) for n, pair in zip(names, pairs, strict=True))
    for n in labels:
        if (folder / n / "error.txt").exists():
            lines.append(f"\n{n}: {(folder / n / 'error.txt').read_text(encoding='utf-8')}")
    return "\n".join(lines) + "\n"


def _case_row(name: str, label: Label, answer: Answer) -> str:
    """One case: what was hidden, what was said."""
    hidden = [f"{e['family']} {' '.join(e['components'])}" for e in (*label["effects"], *label["decoys"])]
    hidden += [s["family"] for s in label["sensors"]]
    named = [f"{e['family']} {' '.join(e['components'])}" for e in answer["effects"]]
    wanted = set() if label["sort"] == "unknown" else set(families(label))
    right = wanted == set(families(answer)) and answer["verdict"] in label["accept"]
    if label["sort"] == "unexcited" and families(answer):
        right = named_what_is_there(label, answer)
    cells = (label["sort"], f"{reach(label):.1f}", ", ".join(hidden), answer["verdict"], ", ".join(named))
    return f"| {' | '.join((name if right else f'{name} (wrong)', *cells))} |"


def wrong(labels: Mapping[str, Label], answered: Mapping[str, tuple[Label, Answer]], metric: str, least: float) -> str:
    """What is wrong with a battery that should have been easy; empty if nothing is.

    That is: no verdict on a case, a name on one that lacks nothing, or a share of `metric` below `least`.
    """
    if lost := [name for name in labels if name not in answered]:
        return f"no verdict on {', '.join(lost)}"
    found = score(list(answered.values()))
    false, first = found["false name on nulls"], found[metric]
    if false.hits:
        return f"names on campaigns that lack nothing: {false.text}"
    return f"too few right names: {first.text}" if first.hits < least * first.of else ""


def publish(text: str, folder: Path, path: Path, title: str, command: str, figure: str = "") -> None:
    """Write scores to a page of the documentation's, with the command that gave them, the version and the day.

    Its cases are in `folder`, each with the commit it was searched at. figure says what the picture beside the page
    shows, which comes first; empty without one.
    """
    today = datetime.now(UTC).date().isoformat()
    commits = sorted({one.read_text(encoding="utf-8") for one in folder.glob("*/commit.txt")})
    code = f"version {__version__} (commit {', '.join(commits) or 'unknown'})"
    how = f"`{command} --publish`, {code}, {today}. Shares with 95 % Wilson intervals."
    with write_whole(path) as beside:
        picture = f"![{figure}]({path.stem}.svg)\n\n" if figure else ""
        beside.write_text(f"# {title}\n\n{picture}{how}\n\n{text}", encoding="utf-8")
