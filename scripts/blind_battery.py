"""A blind battery: cases of another simulator with sealed labels, searched, then unsealed and scored.

    python scripts/blind_battery.py [--cases 20] [--seed 1] [--fast | --brief] [--jobs 2] [--out FOLDER] [--baselines]
                                    [--dask] [--publish] [--check]

Labels are sealed before any search: `seals.txt` holds one salted hash a case. Cases that have a verdict already are not
searched again, so that an interrupted battery goes on where it stopped. --fast takes short campaigns of five tests,
--brief shorter ones of four, proven by inverse dynamics alone. --check exits with 1 where a campaign that lacks nothing
got a name, or too few a right one: a smoke test, which `scripts/checks.py` runs.
--baselines adds what correlation and a bagged sparse regression (pysindy) name on the same cases. --dask runs the cases
on a Dask cluster on this machine (pip install "dask[distributed]") in place of processes. --publish writes the scores
to scripts/battery/results.md, too.
"""

import argparse
import json
import sys
import time
import tomllib
from contextlib import nullcontext
from datetime import UTC, datetime
from pathlib import Path

from battery.generate import draw_cases, seal, unseal, write_case
from battery.reach import measured_label
from battery.scoring import Share, families, named_what_is_there, reach, score, strength_curve
from joblib import Parallel, delayed, parallel_config

from lhpost6_pin import __version__
from lhpost6_pin.core.errors import LhpostError
from lhpost6_pin.core.files import write_whole
from lhpost6_pin.data.campaign import load_campaign
from lhpost6_pin.data.sensors import load_sensors
from lhpost6_pin.discovery import discover, save_verdict
from lhpost6_pin.machine.machine import load_machine

RESULTS = Path(__file__).parent / "battery" / "results.md"
"""The latest published scores."""

LEAST = 0.4
"""Share of right names below which something is broken; brief campaigns do not show all that is hidden."""


def make(case, folder: Path) -> dict:
    """Write a case's campaign, unless it is there; its label."""
    if not (folder / case.id / "campaign.toml").exists():
        write_case(case, folder)
    return measured_label(case)


def search(name: str, folder: Path, phases: tuple[int, ...], with_baselines: bool) -> None:
    """Search one case, unless that was done; leaves verdict.json in its folder, or error.txt."""
    home = folder / name
    if (home / "verdict.json").exists():
        return
    machine, sensors = load_machine(), load_sensors()
    campaign = load_campaign(home, machine)
    hold_out = tomllib.loads((home / "campaign.toml").read_text(encoding="utf-8"))["hold_out"]
    begin = time.perf_counter()
    try:
        with parallel_config("threading", n_jobs=1):  # one case a worker, of whatever kind
            found = discover(machine, campaign, sensors, hold_out=hold_out, phases=phases, jobs=1, propose=False)
    except LhpostError as error:
        (home / "error.txt").write_text(str(error), encoding="utf-8")
        return
    (home / "seconds.txt").write_text(f"{time.perf_counter() - begin:.1f}", encoding="utf-8")
    if with_baselines:
        from battery.baselines import baselines

        used = [r for r in campaign.records if str(r.attrs["test"]) not in hold_out]
        named = baselines(machine, used, sensors, seed=0)
        (home / "baselines.json").write_text(json.dumps(named), encoding="utf-8")
    save_verdict(found, home / "verdict.json")


def answers(folder: Path, labels: dict[str, dict]) -> dict[str, tuple[dict, dict]]:
    """Label and verdict of all cases that have one."""
    files = {name: folder / name / "verdict.json" for name in labels}
    return {n: (labels[n], json.loads(f.read_text(encoding="utf-8"))) for n, f in files.items() if f.exists()}


def report(folder: Path, labels: dict[str, dict], answered: dict[str, tuple[dict, dict]]) -> str:
    """Scores of all cases with a verdict, as Markdown; then every case, the wrong ones marked."""
    names, pairs = list(answered), list(answered.values())
    lines = [f"{len(pairs)} of {len(labels)} cases searched", "", "| metric | value |", "|---|---|"]
    for metric, value in score(pairs).items():
        lines.append(f"| {metric} | {value.text if isinstance(value, Share) else f'{value:.2f}'} |")
    lines += baseline_rows(folder, names, pairs)
    files = [folder / n / "seconds.txt" for n in names]
    if seconds := sorted(float(f.read_text(encoding="utf-8")) for f in files if f.exists()):
        lines.append(f"| seconds a case, median | {seconds[len(seconds) // 2]:.0f} |")
    lines += ["", "| gap of an effect over the floor | its family is named |", "|---|---|"]
    lines += [f"| {words} | {share.text} |" for words, share in strength_curve(pairs).items() if share.of]
    lines += ["", "| case | sort | gap | hidden | verdict | named |", "|---|---|---|---|---|---|"]
    lines += sorted(case_row(n, *pair) for n, pair in zip(names, pairs, strict=True))
    for n in labels:
        if (folder / n / "error.txt").exists():
            lines.append(f"\n{n}: {(folder / n / 'error.txt').read_text(encoding='utf-8')}")
    return "\n".join(lines) + "\n"


def baseline_rows(folder: Path, names: list[str], pairs: list[tuple[dict, dict]]) -> list[str]:
    """What the simpler methods named, where all cases have it."""
    files = [folder / n / "baselines.json" for n in names]
    if not files or not all(f.exists() for f in files):
        return []
    named = [json.loads(f.read_text(encoding="utf-8")) for f in files]
    rows = []
    for method in named[0]:
        effects = [[{"family": f, "components": []} for f in one[method]] for one in named]
        found = score([(label, {**answer, "effects": e}) for (label, answer), e in zip(pairs, effects, strict=True)])
        rows += [f"| {method}: {m} | {found[m].text} |" for m in ("family first", "false name on nulls")]
    return rows


def case_row(name: str, label: dict, answer: dict) -> str:
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


def wrong(labels: dict[str, dict], answered: dict[str, tuple[dict, dict]]) -> str:
    """What is wrong with a battery that should have been easy; empty if nothing is."""
    if lost := [name for name in labels if name not in answered]:
        return f"no verdict on {', '.join(lost)}"
    found = score(list(answered.values()))
    false, first = found["false name on nulls"], found["family first"]
    if false.hits:
        return f"names on campaigns that lack nothing: {false.text}"
    return f"too few right names: {first.text}" if first.hits < LEAST * first.of else ""


def described(asked: argparse.Namespace) -> str:
    """What was run: the command, the version, the day."""
    length = f" --{asked.campaign}" if asked.campaign != "full" else ""
    length += " --baselines" if asked.baselines else ""
    command = f"python scripts/blind_battery.py --cases {asked.cases} --seed {asked.seed}{length}"
    today = datetime.now(UTC).date().isoformat()
    return f"`{command} --publish`, version {__version__}, {today}. Shares with 95 % Wilson intervals."


def main() -> None:
    """Draw, seal, search, unseal, score."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    for length in ("fast", "brief"):
        parser.add_argument(f"--{length}", dest="campaign", action="store_const", const=length, default="full")
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("out") / "battery")
    parser.add_argument("--baselines", action="store_true")
    parser.add_argument("--dask", action="store_true")
    parser.add_argument("--publish", action="store_true")
    asked = parser.parse_args()
    folder = asked.out
    folder.mkdir(parents=True, exist_ok=True)
    cases = draw_cases(asked.cases, asked.seed, asked.campaign)
    phases = (1,) if asked.campaign == "brief" else (1, 2)
    cluster = nullcontext()
    if asked.dask:
        from dask.distributed import Client, LocalCluster

        cluster = Client(LocalCluster(n_workers=asked.jobs, threads_per_worker=1))
    with cluster, parallel_config("dask" if asked.dask else "loky", n_jobs=asked.jobs):
        if not (folder / "seals.txt").exists():
            seal(Parallel()(delayed(make)(case, folder) for case in cases), folder)
            print(f"{len(cases)} labels sealed in {folder / 'seals.txt'}", flush=True)
        searches = (delayed(search)(case.id, folder, phases, asked.baselines) for case in cases)
        for done, _ in enumerate(Parallel(return_as="generator_unordered")(searches), 1):
            print(f"searched {done} of {len(cases)}", flush=True)
    labels = unseal(folder)
    answered = answers(folder, labels)
    text = report(folder, labels, answered)
    with write_whole(folder / "scores.md") as beside:
        beside.write_text(text, encoding="utf-8")
    print(text)
    if asked.publish:
        with write_whole(RESULTS) as beside:
            beside.write_text(f"# What the blind battery last said\n\n{described(asked)}\n\n{text}", encoding="utf-8")
    if asked.check and (why := wrong(labels, answered)):
        sys.exit(why)


if __name__ == "__main__":
    main()
