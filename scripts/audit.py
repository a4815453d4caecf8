"""What the package says of itself: where energy goes over a long test, whether runs repeat, how heavy its pages are.

    python scripts/audit.py [--seconds 60] [--out FILE.md]

energy      white noise on all axes in closed loop: what flows in, is created by the report's equations (`energy`),
            stored and dissipated, and what of it is left over
repeating   the same runs twice, over one thread and over as many as asked for, compared bit by bit
pages       sizes of a forty-second test's report and animation

What it found last is on the site's page Audit: `python scripts/audit.py --out scripts/docs/audit.md`.
"""

import argparse
import hashlib
import os
import tempfile
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from docs.markdown import print_and_keep

from lhpost6_pin import __version__
from lhpost6_pin.control import load_controller, make_controller
from lhpost6_pin.core.names import SAMPLE_RATE
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.plant import Plant, make_plant
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.show.report.run_report import write_run_report
from lhpost6_pin.show.tables import machine_rows
from lhpost6_pin.show.viewer import show_record
from lhpost6_pin.simulation.energy import energy_audit
from lhpost6_pin.simulation.limit_use import plant_limits
from lhpost6_pin.simulation.rehearse import rehearse
from lhpost6_pin.simulation.simulate import ClosedLoop, Run, simulate, simulate_many


def noise(plant: Plant, seconds: float) -> ClosedLoop:
    """White noise on all axes under the machine's controller."""
    target = make_target(find_motion("white-noise", six_axis=True, duration=seconds), rate=float(SAMPLE_RATE))
    rest = find_equilibrium(plant)
    controller = make_controller(plant, rest, load_controller(plant.machine.controller))
    drive = controller.drive_for(target.displacement, target.velocity, target.acceleration)
    return ClosedLoop(controller, drive[: round(seconds * SAMPLE_RATE)], rest)


def energy_rows(plant: Plant, seconds: float) -> list[str]:
    """The energy balance of a long run."""
    loop = noise(plant, seconds)
    audit = energy_audit(simulate(plant, loop, samples=len(loop.drive), engine="fused"))
    flows = [audit.total(kind)[-1] for kind in ("inflow", "created", "stored", "dissipated")]
    left = float(np.abs(audit.residual).max())
    cells = [*(f"{flow / 1e3:.4g}" for flow in flows), f"{left / 1e3:.2g}", f"{left / abs(flows[0]):.1e}"]
    return [
        f"## Energy over {seconds:g} s of white noise on all axes, closed loop",
        "",
        "| flows in [kJ] | created [kJ] | stored [kJ] | dissipated [kJ] | left over, at most [kJ] | over inflow |",
        "|---|---|---|---|---|---|",
        f"| {' | '.join(cells)} |",
        "",
    ]


def fingerprint(run: Run) -> str:
    """Hash of all numbers of a run."""
    digest = hashlib.sha256()
    for values in (run.q, run.v, run.a, run.z, run.spool):
        digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()


def repeating_rows(machine, threads: int) -> list[str]:
    """Whether runs of several machines repeat, twice and over threads."""
    plants = [make_plant(machine.with_valves(valves)) for valves in (1, 2, 1, 2)]
    jobs = [(plant, noise(plant, 5.0)) for plant in plants]
    samples = len(jobs[0][1].drive)
    repeats = [simulate_many(jobs, samples=samples, threads=count) for count in (1, 1, threads)]
    same = len({tuple(map(fingerprint, runs)) for runs in repeats}) == 1
    steps = [fingerprint(simulate(*jobs[0], samples=samples, engine="pinocchio")) for _ in range(2)]
    return [
        "## Runs that repeat",
        "",
        "| runs | compared | bit by bit |",
        "|---|---|---|",
        f"| {len(jobs)} closed loops of 5 s, fused | twice on one thread, once on {threads} | {said(same)} |",
        f"| a closed loop of 5 s, step by step on Pinocchio | twice | {said(steps[0] == steps[1])} |",
        "",
    ]


def run_line(seconds: float) -> str:
    """What was run: the command, the version, the day."""
    today = datetime.now(UTC).date().isoformat()
    return f"`python scripts/audit.py --seconds {seconds:g}`, version {__version__}, {today}."


def said(same: bool) -> str:
    """The answer in a word."""
    return "the same" if same else "DIFFERENT"


def page_rows(machine) -> list[str]:
    """Sizes of the pages of a test of forty seconds."""
    target = make_target(find_motion("ridgecrest"), rate=float(SAMPLE_RATE))
    settings = load_controller(machine.controller)
    run, record = rehearse(machine, target, settings, attrs={"test": "ridgecrest"}, engine="fused")
    part = record.isel(time=slice(0, 40 * SAMPLE_RATE))
    with tempfile.TemporaryDirectory() as folder:
        report, view = Path(folder) / "report.html", Path(folder) / "view.html"
        write_run_report(part, report, limits=plant_limits(run.plant), machine_table=machine_rows(machine))
        show_record(machine, part).save(view)
        sizes = [path.stat().st_size / 1e6 for path in (report, view)]
    return [
        "## Pages of a test of 40 s at 2048 Hz",
        "",
        "| page | MB |",
        "|---|---|",
        f"| report | {sizes[0]:.2f} |",
        f"| animation at 30 frames a second | {sizes[1]:.2f} |",
        "",
    ]


def main() -> None:
    """Audit, and print what was found as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--threads", type=int, default=max(2, os.cpu_count() or 2))
    parser.add_argument("--out", type=Path, default=None, help="write it to this file, too")
    asked = parser.parse_args()
    machine = load_machine()
    rows = [
        run_line(asked.seconds),
        "",
        *energy_rows(make_plant(machine), asked.seconds),
        *repeating_rows(machine, asked.threads),
    ]
    print_and_keep([*rows, *page_rows(machine)], asked.out)


if __name__ == "__main__":
    main()
