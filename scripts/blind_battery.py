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
import tomllib
from contextlib import nullcontext
from functools import partial
from pathlib import Path

from battery.generate import draw_cases, seal, unseal, write_case
from battery.reach import measured_label
from battery.reporting import answers, publish, report, search, wrong
from battery.scoring import score
from joblib import Parallel, delayed, parallel_config

from lhpost6_pin.core.files import write_whole
from lhpost6_pin.data.campaign import load_campaign
from lhpost6_pin.data.sensors import load_sensors
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


def search_case(name: str, folder: Path, phases: tuple[int, ...], with_baselines: bool) -> None:
    """Search one case, unless that was done; leaves verdict.json in its folder, or error.txt."""
    home = folder / name
    machine, sensors = load_machine(), load_sensors()
    search(home, machine, sensors, phases)
    if not with_baselines or (home / "baselines.json").exists() or not (home / "verdict.json").exists():
        return
    from battery.baselines import baselines

    hold_out = tomllib.loads((home / "campaign.toml").read_text(encoding="utf-8"))["hold_out"]
    used = [r for r in load_campaign(home, machine).records if str(r.attrs["test"]) not in hold_out]
    (home / "baselines.json").write_text(json.dumps(baselines(machine, used, sensors, seed=0)), encoding="utf-8")


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


def command_of(asked: argparse.Namespace) -> str:
    """The command that was run."""
    length = f" --{asked.campaign}" if asked.campaign != "full" else ""
    length += " --baselines" if asked.baselines else ""
    return f"python scripts/blind_battery.py --cases {asked.cases} --seed {asked.seed}{length}"


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
        searches = (delayed(search_case)(case.id, folder, phases, asked.baselines) for case in cases)
        for done, _ in enumerate(Parallel(return_as="generator_unordered")(searches), 1):
            print(f"searched {done} of {len(cases)}", flush=True)
    labels = unseal(folder)
    answered = answers(folder, labels)
    text = report(folder, labels, answered, partial(baseline_rows, folder))
    with write_whole(folder / "scores.md") as beside:
        beside.write_text(text, encoding="utf-8")
    print(text)
    if asked.publish:
        publish(text, RESULTS, "Scores of the blind battery", command_of(asked))
    if asked.check and (why := wrong(labels, answered, "family first", LEAST)):
        sys.exit(why)


if __name__ == "__main__":
    main()
