"""A blind battery: cases of another simulator with sealed labels, searched, then unsealed and scored.

    python scripts/blind_battery.py [--cases 20] [--seed 1] [--fast | --brief] [--anew] [--fewer] [--jobs 2]
                                    [--out FOLDER] [--baselines] [--dask ADDRESS] [--publish] [--check]

Labels are sealed before any search: `seals.txt` holds one salted hash a case. Cases that have a verdict already are not
searched again, so that an interrupted battery goes on where it stopped. --fast takes short campaigns of five tests,
--brief shorter ones of four, proven by inverse dynamics alone. --anew draws a table of its own for each case, other in
size, valves, oil and friction than the LHPOST6; --fewer leaves out a third of the sensors. --check exits with 1 where a
campaign that lacks nothing got a name, or too few a right one: a smoke test, which `scripts/checks.py` runs.
--baselines adds what correlation and a bagged sparse regression (pysindy) name on the first 60 cases. --dask runs the
cases on a Dask cluster, at an address or `local`, in place of processes. --publish writes the
scores to scripts/battery/results.md, too, with a figure beside it; of batteries of another variety to results_anew.md
and the like. It needs `pip install '.[docs]'`.
"""

import argparse
import json
import sys
import tomllib
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from battery.cases import Case, Variety, model
from battery.generate import draw_cases, seal, unseal, write_case
from battery.machines import changed_values
from battery.reach import measured_label
from battery.reporting import answers, publish, report, search, wrong
from battery.scoring import reliability, score, strength_curve

from lhpost6_pin.core.files import write_whole
from lhpost6_pin.data.campaign import load_campaign
from lhpost6_pin.data.sensors import load_sensors
from lhpost6_pin.machine.machine import Machine, load_machine
from lhpost6_pin.machine.machine_toml import save_machine_toml
from lhpost6_pin.studies.workers import results_of, workers

MACHINE = "machine.toml"
"""In the folder of a case: its table as its lab knows it; the LHPOST6 where there is none."""

DRAW = "draw.txt"
"""In the folder of a battery: the options by which its cases were drawn."""

RESULTS = Path(__file__).parent / "battery"
"""Folder of the latest published scores."""

COMPARED = 60
"""Cases on which the simpler methods are tried, too: they take a fifth of the time, and err in nearly all."""

FIGURE = (
    "Share of hidden effects that were named, by their gap over sensor noise, and share of names that were right, by "
    "their stated probability, with 95 % Wilson intervals"
)
"""What the figure beside the scores shows."""

LEAST = 0.4
"""Share of right names below which something is broken; brief campaigns do not show all that is hidden."""


def make(case: Case, folder: Path) -> dict:
    """Write a case's campaign and its lab's machine file, unless they are there; its label."""
    if not (folder / case.id / "campaign.toml").exists():
        if changes := changed_values(case.model, model()):
            (folder / case.id).mkdir(parents=True, exist_ok=True)
            save_machine_toml(load_machine().with_params(changes), folder / case.id / MACHINE)
        write_case(case, folder)
    return measured_label(case)


def machine_of(home: Path) -> Machine:
    """The machine as the lab of a case knows it."""
    return load_machine(home / MACHINE) if (home / MACHINE).exists() else load_machine()


def search_case(name: str, folder: Path, phases: tuple[int, ...], with_baselines: bool) -> None:
    """Search one case, unless that was done; leaves verdict.json in its folder, or error.txt."""
    home = folder / name
    machine, sensors = machine_of(home), load_sensors()
    search(home, machine, sensors, phases)
    if not with_baselines or (home / "baselines.json").exists() or not (home / "verdict.json").exists():
        return
    from battery.baselines import baselines

    hold_out = tomllib.loads((home / "campaign.toml").read_text(encoding="utf-8"))["hold_out"]
    used = [r for r in load_campaign(home, machine).records if str(r.attrs["test"]) not in hold_out]
    (home / "baselines.json").write_text(json.dumps(baselines(machine, used, sensors, seed=0)), encoding="utf-8")


def baseline_rows(folder: Path, names: list[str], pairs: list[tuple[dict, dict]]) -> list[str]:
    """What the simpler methods named, where they were tried."""
    files = (folder / n / "baselines.json" for n in names)
    both = zip(files, pairs, strict=True)
    tried = [(json.loads(file.read_text(encoding="utf-8")), *pair) for file, pair in both if file.exists()]
    rows = []
    for method in tried[0][0] if tried else ():
        effects = [[{"family": f, "components": []} for f in named[method]] for named, _, _ in tried]
        found = score([(label, {**answer, "effects": e}) for (_, label, answer), e in zip(tried, effects, strict=True)])
        rows += [f"| {method}: {m} | {found[m].text} |" for m in ("family first", "false name on nulls")]
    return rows


def drawn_by(asked: argparse.Namespace) -> str:
    """The options by which cases are drawn."""
    length = f" --{asked.campaign}" if asked.campaign != "full" else ""
    varied = "".join(f" --{option}" for option in ("anew", "fewer") if getattr(asked, option))
    return f"--cases {asked.cases} --seed {asked.seed}{length}{varied}"


def refuse_other_draw(folder: Path, draw: str) -> None:
    """Exit if the folder holds cases of another draw, whose labels would not be those of these: their names recur."""
    path, known = folder / DRAW, draw
    if path.exists() or any(folder.iterdir()):
        known = path.read_text(encoding="utf-8") if path.exists() else "unknown"
    if known != draw:
        sys.exit(f"{folder}: holds cases of another draw ({known}): choose another --out, or remove it")
    path.write_text(draw, encoding="utf-8")


def _draw(pairs: list[tuple[dict, dict]], path: Path) -> None:
    """Draw the strength curve and the reliability of names."""
    from battery.curves import draw_curves

    draw_curves(strength_curve(pairs), reliability(pairs), path)


def main() -> None:
    """Draw, seal, search, unseal, score."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    for length in ("fast", "brief"):
        parser.add_argument(f"--{length}", dest="campaign", action="store_const", const=length, default="full")
    for option in ("anew", "fewer", "check"):
        parser.add_argument(f"--{option}", action="store_true")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("out") / "battery")
    parser.add_argument("--baselines", action="store_true")
    parser.add_argument("--dask")
    parser.add_argument("--publish", action="store_true")
    asked = parser.parse_args()
    if asked.publish and find_spec("matplotlib") is None:
        sys.exit("--publish draws a figure: pip install '.[docs]' first")
    folder = asked.out
    folder.mkdir(parents=True, exist_ok=True)
    refuse_other_draw(folder, drawn_by(asked))
    cases = draw_cases(asked.cases, asked.seed, asked.campaign, Variety(asked.anew, asked.fewer))
    phases = (1,) if asked.campaign == "brief" else (1, 2)
    with workers(asked.jobs, asked.dask):
        if not (folder / "seals.txt").exists():
            seal(sorted(results_of(make, ((case, folder) for case in cases)), key=lambda label: label["id"]), folder)
            print(f"{len(cases)} labels sealed in {folder / 'seals.txt'}", flush=True)
        searches = ((case.id, folder, phases, asked.baselines and i < COMPARED) for i, case in enumerate(cases))
        for done, _ in enumerate(results_of(search_case, searches), 1):
            print(f"searched {done} of {len(cases)}", flush=True)
    labels = unseal(folder)
    answered = answers(folder, labels)
    text = report(folder, labels, answered, partial(baseline_rows, folder))
    with write_whole(folder / "scores.md") as beside:
        beside.write_text(text, encoding="utf-8")
    print(text)
    if asked.publish:
        command = f"python scripts/blind_battery.py {drawn_by(asked)}{' --baselines' if asked.baselines else ''}"
        words = [option for option in ("anew", "fewer") if getattr(asked, option)]
        page = RESULTS / f"{'_'.join(['results', *words])}.md"
        _draw(list(answered.values()), page.with_suffix(".svg"))
        publish(text, folder, page, "Scores of the blind battery", command, FIGURE)
    if asked.check and (why := wrong(labels, answered, "family first", LEAST)):
        sys.exit(why)


if __name__ == "__main__":
    main()
