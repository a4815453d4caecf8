"""A battery of one-axis tables with few sensors: sealed cases of another simulator, searched, unsealed and scored.

    python scripts/one_axis_battery.py [--cases 100] [--seed 1] [--brief] [--only null] [--jobs 2] [--out FOLDER]
                                       [--check] [--publish]

Half of the cases lack nothing, the others hide friction that falls with speed or a spool off its null. Each has a table
of its own size, a random set of sensors, a machine file whose numbers are wrong within their stated deviations, and a
sensors file whose noise is wrong by a factor of 0.5 to 2 (`scripts/battery/one_axis.toml`). Labels are sealed before
any search: `seals.txt` holds one salted hash a case. Cases that have a verdict already are not searched again, so that
an interrupted battery goes on where it stopped; delete a case's verdict.json to search it anew. --brief takes shorter
campaigns, --only cases of one sort. --check exits with 1 where a campaign that lacks nothing got a name, too few a
right one, or a case got no verdict: `scripts/checks.py` runs it. --publish writes the scores to
scripts/battery/one_axis_results.md, too.
"""

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from battery.one_axis_cases import Case, draw_cases, numbers
from battery.one_axis_files import write_cases
from battery.reporting import answers, publish, report, search, wrong
from battery.scoring import Answer, Label, Share, families
from battery.sealing import seal, unseal
from joblib import Parallel, delayed

from lhpost6_pin.core.files import write_whole
from lhpost6_pin.data.campaign import load_campaign
from lhpost6_pin.data.measured_sensors import find_sensors
from lhpost6_pin.machine.machine import load_machine

RESULTS = Path(__file__).parent / "battery" / "one_axis_results.md"
"""The latest published scores."""

TOGETHER = 10
"""Cases simulated side by side: more would gain little, and need more memory."""

FORCES = ("pressure_difference", "actuator_force", "chamber_pressure_a")
"""Channels that measure the force, of which a set of sensors has one."""

LAG = "spool_lag"
"""In every valve here and in no machine file: one that cannot be told from the delay should be calibrated with it."""

LEAST = 0.5
"""Share of effects found below which something is broken; a brief campaign shows less than a full one."""


def search_case(home: Path) -> None:
    """Search a case with the machine and sensors files of its lab."""
    machine = load_machine(home / "machine.toml")
    sensors = find_sensors(machine, load_campaign(home, machine).records, home / "sensors.toml")
    search(home, machine, sensors, phases=(1,))


def shares(pairs: Sequence[tuple[Label, Answer]]) -> dict[str, Share]:
    """How many effects of each sort were found, and false names, by sort and by what measured the force."""
    groups: dict[str, list[bool]] = {}
    for label, answer in pairs:
        named, hidden = set(families(answer)), set(families(label))
        false = bool(named - hidden)
        found = f"found, {label['hides']}"
        force = next(name for name in FORCES if name in label["channels"])
        groups.setdefault(f"a false name, {label['hides']}", []).append(false)
        groups.setdefault(f"a false name, {force}", []).append(false)
        groups.setdefault(f"a false name but for {LAG}, {label['hides']}", []).append(bool(named - hidden - {LAG}))
        if hidden:
            groups.setdefault("found", []).append(hidden <= named)
            groups.setdefault(found, []).append(hidden <= named)
            groups.setdefault(f"found, {force}", []).append(hidden <= named)
    return {name: Share(sum(hits), len(hits)) for name, hits in sorted(groups.items())}


def rows(labels: Mapping[str, Label], answered: Mapping[str, tuple[Label, Answer]]) -> list[str]:
    """The shares of all cases as rows of the table of scores; a case without a verdict found nothing."""
    pairs = [answered.get(name, (label, {"effects": []})) for name, label in labels.items()]
    return [f"| {name} | {share.text} |" for name, share in shares(pairs).items()]


def make(cases: Sequence[Case], folder: Path, jobs: int) -> list[dict]:
    """Simulate and write all cases; their labels."""
    batches = [cases[i : i + TOGETHER] for i in range(0, len(cases), TOGETHER)]
    return [label for some in Parallel(jobs)(delayed(write_cases)(one, folder) for one in batches) for label in some]


def main() -> None:
    """Draw, seal, search, unseal, score."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--brief", dest="campaign", action="store_const", const="brief", default="full")
    parser.add_argument("--only", choices=list(numbers()["mix"]))
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--out", type=Path, default=Path("out") / "one_axis_battery")
    for option in ("check", "publish"):
        parser.add_argument(f"--{option}", action="store_true")
    asked = parser.parse_args()
    folder = asked.out
    folder.mkdir(parents=True, exist_ok=True)
    cases = draw_cases(asked.cases, asked.seed, asked.campaign, asked.only)
    if not (folder / "seals.txt").exists():
        seal(make(cases, folder, asked.jobs), folder)
        print(f"{len(cases)} labels sealed in {folder / 'seals.txt'}", flush=True)
    if differing := sorted({case.id for case in cases} ^ set(unseal(folder))):
        sys.exit(f"{folder} holds another battery ({', '.join(differing[:3])}, ...); give another --out")
    searches = Parallel(asked.jobs, return_as="generator_unordered")(delayed(search_case)(folder / c.id) for c in cases)
    for done, _ in enumerate(searches, 1):
        print(f"searched {done} of {len(cases)}", flush=True)
    labels = unseal(folder)
    answered = answers(folder, labels)
    text = report(folder, labels, answered, lambda *_: rows(labels, answered))
    with write_whole(folder / "scores.md") as beside:
        beside.write_text(text, encoding="utf-8")
    print(text)
    if asked.publish:
        length = " --brief" if asked.campaign == "brief" else ""
        only = f" --only {asked.only}" if asked.only else ""
        command = f"python scripts/one_axis_battery.py --cases {asked.cases} --seed {asked.seed}{length}{only}"
        publish(text, folder, RESULTS, "Scores of the one-axis battery", command)
    if asked.check and (why := wrong(labels, answered, "family first", LEAST)):
        sys.exit(why)


if __name__ == "__main__":
    main()
