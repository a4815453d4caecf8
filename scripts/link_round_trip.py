"""The link on loopback: the table in a process of its own in real time, the virtual 469D in this one.

    python scripts/link_round_trip.py [--seconds 60] [--mode real-time] [--out DIR]

Prints whether 2048 samples a second were kept up, missed deadlines, lost frames and times, and writes
link_round_trip.json. All is compiled before the clock starts, and each process keeps to a core of its own. Deadlines
are missed where others want these cores, too; on Linux `chrt -f 50 python scripts/link_round_trip.py` goes before them.
"""

import json
import multiprocessing
import os
import threading
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from lhpost6_pin.control import load_controller, make_controller
from lhpost6_pin.core.files import refuse_folder, write_whole
from lhpost6_pin.core.names import SAMPLE_RATE
from lhpost6_pin.interfaces.link import LinkClient, LinkMode, ServedPlant, find_mode, open_socket, run_over_link, serve
from lhpost6_pin.interfaces.link.clock import Histogram
from lhpost6_pin.interfaces.link.link_summary import print_link
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.simulation.simulate import ClosedLoop


def serve_table(mode: LinkMode, pipe: Connection) -> None:
    """Serve the LHPOST6 until the other end of the pipe says so; tells it the port first, how time was kept last."""
    keep_to_core(0)
    plant = make_plant(load_machine())
    served, stop = ServedPlant(plant, find_equilibrium(plant), mode), threading.Event()

    def wait() -> None:
        pipe.recv()
        stop.set()

    threading.Thread(target=wait, daemon=True).start()
    with open_socket(port=0) as sock:
        pipe.send(sock.getsockname()[1])
        timing = serve(sock, served, stop=stop)
    pipe.send((timing, served.answer_time))


def keep_to_core(number: int) -> None:
    """Keep this process to one core of those that it may use, where the system can; the other has the rest."""
    if hasattr(os, "sched_setaffinity"):
        cores = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {cores[number % len(cores)]})


def shares(times: Histogram) -> dict[str, float]:
    """Times [s] at some percentiles."""
    return {f"p{p:g}": times.percentile(p) for p in (50, 90, 99, 99.9)} | {"largest": times.largest}


def main(
    seconds: Annotated[float, typer.Option(min=0.1, help=r"Length of the run \[s].")] = 60.0,
    mode: Annotated[str, typer.Option(help="real-time, lock-step or free.")] = "real-time",
    out: Annotated[Path, typer.Option(help="Folder for the figures.")] = Path("out/link"),
) -> None:
    """Drive the table through Ridgecrest, over and over, across the link."""
    refuse_folder(out)
    plant = make_plant(load_machine())
    rest = find_equilibrium(plant)
    controller = make_controller(plant, rest, load_controller("lhpost6"))
    target = make_target(find_motion("ridgecrest"), rate=float(SAMPLE_RATE))
    drive = controller.drive_for(target.displacement, target.velocity, target.acceleration)
    samples = round(seconds * SAMPLE_RATE)
    loop = ClosedLoop(controller, np.tile(drive, (-(-samples // len(drive)), 1))[:samples], rest)
    controller.step(controller.init(), 0, loop.drive, (np.zeros(plant.spools), np.zeros(6), np.zeros(plant.spools)))

    context = multiprocessing.get_context("spawn")
    pipe, theirs = context.Pipe()
    server = context.Process(target=serve_table, args=(find_mode(mode), theirs), daemon=True)
    server.start()
    with LinkClient("127.0.0.1", pipe.recv()) as client:
        keep_to_core(1)
        run = run_over_link(client, plant, loop)
        counts = dict(client.close())
    pipe.send("stop")
    timing, answer = pipe.recv()
    server.join()

    counts |= {"resent": client.resent, "sensors_lost": client.sensors_lost, "ignored": client.ignored}
    counts["unanswered"] = int((~run.answered).sum())
    times = {
        "lateness of samples": timing.lateness,
        "work per sample": timing.work,
        "sensors to command": answer,
        "command to sensors": client.round_trip,
    }
    rate = len(run.answered) / run.seconds
    print_link(f"{mode}: {len(run.answered)} samples in {run.seconds:.3f} s, {rate:.1f} a second", counts, times)
    print(f"tripped: {run.tripped}; deadlines missed: {counts['missed_deadlines']}")
    with write_whole(out / "link_round_trip.json") as beside:
        found = {name: shares(t) for name, t in times.items() if t.count}
        figures = {"mode": mode, "samples_per_second": rate, "counts": counts, "times": found}
        beside.write_text(json.dumps(figures, indent=1))


if __name__ == "__main__":
    typer.run(main)
