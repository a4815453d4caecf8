"""Benchmarks: cost per step of both engines and each scheme, and ratios against plain alternatives in the same run.

    python scripts/bench.py [--out DIR] [--quick]

Prints a table and writes bench.json. Times are the best of several repeats on one core, warm unless said otherwise.
Nothing here is a test: what a machine is busy with shows in the figures; ratios within one run are what to compare.
"""

import json
import logging
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from c_step import FLAGS, CPlant, compiler
from plain_loop import PlainPlant
from rich.console import Console
from rich.table import Table

from lhpost6_pin.control import load_controller, make_controller
from lhpost6_pin.core.files import refuse_folder, write_whole
from lhpost6_pin.core.names import ENGINES, SAMPLE_RATE, SCHEMES
from lhpost6_pin.identification.inverse_dynamics import inverse_dynamics
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.pose import platen_motion
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.simulation.simulate import ClosedLoop, OpenLoop, simulate, simulate_many

FIRST_RESULT = "from lhpost6_pin.cli import main; import sys; sys.argv[1:] = {args!r}; main()"

FRAME = """
[mass]
mass = {{ value = {mass}, unit = "kg" }}
centre_of_gravity = {{ value = [0, 0, {height}], unit = "m" }}
inertia = {{ value = {inertia}, unit = "kg m2" }}

[matrices]
file = "frame.npz"
mass = {{ variable = "M", unit = "kg" }}
stiffness = {{ variable = "K", unit = "N/m" }}
damping = {{ variable = "C", unit = "N s/m" }}
influence = {{ variable = "R", unit = "1" }}
"""


def best(work: Callable[[], Any], repeats: int) -> float:
    """Seconds of the fastest of some repeats."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return min(times)


class Bench:
    """Collects rows (what, value, unit)."""

    def __init__(self, repeats: int) -> None:
        """Prepare the plant, the drive of a motion and its spools."""
        self.repeats = repeats
        self.rows: list[tuple[str, float, str]] = []
        self.plant = make_plant(load_machine())
        self.rest = find_equilibrium(self.plant)
        self.loop = make_controller(self.plant, self.rest, load_controller("lhpost6"))
        target = make_target(find_motion("ridgecrest"), rate=float(SAMPLE_RATE))
        self.drive = self.loop.drive_for(target.displacement, target.velocity, target.acceleration)
        run = simulate(self.plant, self.closed(len(self.drive)), samples=len(self.drive), engine="fused")
        self.spool = run.spool

    def closed(self, samples: int) -> ClosedLoop:
        """Closed loop on the first samples of the motion's strong part."""
        return ClosedLoop(self.loop, self.drive[:samples], self.rest)

    def open(self, samples: int) -> OpenLoop:
        """Open loop on the spools of that motion."""
        return OpenLoop(self.spool[:samples], self.rest.state)

    def add(self, what: str, value: float, unit: str) -> None:
        """Keep a row."""
        self.rows.append((what, value, unit))

    def engines(self, seconds: float) -> None:
        """Microseconds a step and times real time, each engine and scheme, open and closed loop at 8192 Hz."""
        samples = int(seconds * SAMPLE_RATE)
        for engine in ENGINES:
            for scheme in SCHEMES:
                for name, drive in (("open loop", self.open(samples)), ("closed loop", self.closed(samples))):

                    def work(engine: str = engine, scheme: str = scheme, drive: Any = drive) -> float:
                        return simulate(
                            self.plant, drive, samples=samples, scheme=scheme, engine=engine, record_every=4
                        ).time[-1]

                    reached = work() + 4 / SAMPLE_RATE  # euler stops on the way: see convergence.py
                    took = best(work, self.repeats)
                    self.add(f"{engine} {scheme} {name}", 1e6 * took / (4 * SAMPLE_RATE * reached), "us/step")
                    self.add(f"{engine} {scheme} {name}", reached / took, "x real time")

    def specimen(self, seconds: float, floors: int = 20) -> None:
        """Cost of a step with a shear frame of so many storeys by its matrices, against the bare table (fused)."""
        samples = int(seconds * SAMPLE_RATE)
        k = 25e6 * (2.0 * np.eye(floors) - np.eye(floors, k=1) - np.eye(floors, k=-1))
        k[-1, -1] /= 2.0
        once = np.zeros((floors, floors))
        once[0, 0] = 4e5  # a damper in the first storey couples the modes
        height = 3.0 * np.arange(1, floors + 1)
        influence = np.outer(np.ones(floors), [1.0, 0, 0, 0, 0, 0]) + np.outer(height, [0.0, 0, 0, 0, 1, 0])
        inertia = [2e3 * float(height @ height)] * 2 + [2e4]
        for name, damping in (("modes", 2e-3 * k), ("modes with coupled damping", 2e-3 * k + once)):
            with tempfile.TemporaryDirectory() as folder:
                np.savez(Path(folder) / "frame.npz", M=2e3 * np.eye(floors), K=k, C=damping, R=influence)
                path = Path(folder) / "frame.toml"
                path.write_text(FRAME.format(mass=2e3 * floors, height=height.mean(), inertia=inertia))
                plant = make_plant(load_machine().with_specimen(path))
            rest = find_equilibrium(plant)
            spool = self.spool[:samples] - self.rest.spool + rest.spool
            times = [np.inf, np.inf]
            for _ in range(4 * self.repeats):  # in turns: what else the computer does falls on both
                for i, (each, start) in enumerate(((self.plant, self.rest.state), (plant, rest.state))):
                    drive = OpenLoop(spool, start)
                    took = best(lambda p=each, d=drive: simulate(p, d, samples=samples, engine="fused"), 1)
                    times[i] = min(times[i], took)
            self.add(f"fused, {floors} {name} of a specimen over the bare table", times[1] / times[0], "x")

    def lengths(self, lengths: tuple[int, ...]) -> None:
        """Cost against record length [s] (fused, closed loop)."""
        for seconds in lengths:
            samples = seconds * SAMPLE_RATE
            drive = self.closed(samples)
            took = best(lambda d=drive, n=samples: simulate(self.plant, d, samples=n, engine="fused"), self.repeats)
            self.add(f"fused, record of {seconds} s", took, "s")

    def machines(self, counts: tuple[int, ...], seconds: int) -> None:
        """Cost against the number of machines (fused, threads on all cores)."""
        samples = seconds * SAMPLE_RATE
        for count in counts:
            jobs = [(self.plant, self.closed(samples))] * count
            took = best(lambda j=jobs: simulate_many(j, samples=samples), self.repeats)
            self.add(f"fused, {count} machines, {os.cpu_count()} cores", took / count, "s a machine")

    def inverse(self, seconds: int) -> None:
        """Inverse dynamics with its full ledger of a run recorded at the controller's rate."""
        samples = seconds * SAMPLE_RATE
        run = simulate(self.plant, self.closed(samples), samples=samples, engine="fused")
        motion = platen_motion(self.plant, run.q, run.v, run.a)
        force = np.zeros((len(run.time), self.plant.spools))
        took = best(lambda: inverse_dynamics(self.plant, run.time, motion, force), self.repeats)
        self.add(f"inverse dynamics, {seconds} s at {SAMPLE_RATE} Hz", took, "s")

    def against(self) -> None:
        """Ratios to a plain NumPy-and-Pinocchio loop and to SciPy's solve_ivp on the same work."""
        samples, steps = 256, 16
        dt = 1.0 / (steps * SAMPLE_RATE)
        drive = self.open(samples)
        plain = PlainPlant(self.plant.machine)

        def loop() -> np.ndarray:
            state = plain.at_rest(self.rest.state)
            for k in range(samples):
                for _ in range(steps):
                    state = plain.step(*state, drive.spool[k], dt)
            return state[0]

        def ours(engine: str) -> np.ndarray:
            return simulate(
                self.plant, drive, samples=samples, scheme="euler", steps_per_second=steps * SAMPLE_RATE, engine=engine
            ).q[-1]

        difference = float(np.abs(loop()[:3] - ours("fused")[:3]).max())
        self.add("plain NumPy and Pinocchio loop against ours, last position", difference, "m (one sample apart)")
        slow = best(loop, 1)
        self.add("plain NumPy and Pinocchio loop, euler", 1e6 * slow / (samples * steps), "us/step")
        for engine in ENGINES:
            fast = best(lambda e=engine: ours(e), self.repeats)
            self.add(f"plain loop over {engine} engine, euler", slow / fast, "x")
        self._solve_ivp(drive, samples)
        self._c_step(plain)

    def _c_step(self, plain: PlainPlant, samples: int = 2 * SAMPLE_RATE) -> None:
        """Open-loop step of the fused engine over forward Euler in C, in turns; the machine stays near its rest."""
        if compiler() is None:
            print("no C step: no C compiler (cc, gcc or clang) on the PATH")
            return
        state = plain.at_rest(self.rest.state)
        phase = np.arange(samples)[:, None] / SAMPLE_RATE * 2.0 * np.pi * np.arange(1, 11)
        spool = self.rest.spool + 0.02 * np.sin(phase) * np.minimum(1.0, phase[:, :1])
        drive, steps = OpenLoop(spool, self.rest.state), 4 * samples
        short = 0.01 / (4 * SAMPLE_RATE)  # forward Euler is stable; its time does not depend on the step
        plants = {}
        for more in ((), ("-march=native",)):
            with suppress(subprocess.CalledProcessError):  # which some compilers do not know
                plants[more] = CPlant(plain, *more)
        times = {more: np.inf for more in plants}
        ours = np.inf
        for _ in range(4 * self.repeats):
            for more, plant in plants.items():
                times[more] = min(times[more], best(lambda p=plant: p.run(state, spool, 4, short), 1))
            ours = min(ours, best(lambda: simulate(self.plant, drive, samples=samples, engine="fused"), 1))
        for more, took in times.items():
            name = f"C step, {' '.join((*FLAGS, *more))}"
            self.add(name, 1e6 * took / steps, "us/step")
            self.add(f"fused semi_implicit open loop over {name}", ours / took, "x")

    def _solve_ivp(self, drive: OpenLoop, samples: int) -> None:
        """SciPy's LSODA on the compiled right-hand side, sample by sample as the spool is held."""
        import pinocchio as pin
        from scipy.integrate import solve_ivp

        from lhpost6_pin.mechanics.derivatives import evaluate_derivatives
        from lhpost6_pin.mechanics.schemes import A, V
        from lhpost6_pin.mechanics.workspace import make_workspace

        plant, rest = self.plant, self.rest
        ws = make_workspace(plant, rest.state)
        nv, nz = plant.model.nv, len(plant.states)

        def right(spool: np.ndarray, q0: np.ndarray) -> Callable[[float, np.ndarray], np.ndarray]:
            def f(_: float, x: np.ndarray) -> np.ndarray:
                ws.q[:] = pin.integrate(plant.model, q0, x[:nv])
                ws.motion[V] = x[nv : 2 * nv]
                ws.z[:] = x[2 * nv :]
                evaluate_derivatives(plant, ws, spool)
                local = pin.dDifference(plant.model, q0, ws.q, pin.ArgumentPosition.ARG1) @ ws.motion[V]
                return np.concatenate([local, ws.motion[A], ws.zd])

            return f

        def work() -> np.ndarray:
            q, x = rest.state.q.copy(), np.concatenate([np.zeros(2 * nv), rest.state.z])
            scale = np.concatenate([np.full(2 * nv, 1e-7), np.full(nz, 1e-6)])
            scale[2 * nv : 2 * nv + 14] = 10.0
            for k in range(samples):
                x = solve_ivp(
                    right(drive.spool[k], q), (0.0, 1.0 / SAMPLE_RATE), x, method="RK45", rtol=1e-6, atol=scale
                ).y[:, -1]
                q = pin.integrate(plant.model, q, x[:nv])
                x[:nv] = 0.0
            return q

        took = best(work, 1)
        for engine in ENGINES:
            ours = best(lambda e=engine: simulate(plant, drive, samples=samples, engine=e), self.repeats)
            self.add(f"solve_ivp RK45 (rtol 1e-6) over {engine} engine, default scheme", took / ours, "x")

    def first_result(self) -> None:
        """Wall time of `lhpost6 run` in a new process, compiled code cold and warm, and its peak memory."""
        with tempfile.TemporaryDirectory() as folder:
            out = str(Path(folder) / "out")
            code = FIRST_RESULT.format(args=["run", "ridgecrest", "--out", out])
            environment = {**os.environ, "LHPOST6_CACHE_DIR": folder}
            for word in ("cold", "warm"):
                begin = time.perf_counter()
                quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
                child = subprocess.Popen([sys.executable, "-c", code], env=environment, **quiet)
                _, status, usage = os.wait4(child.pid, 0)
                child.returncode = os.waitstatus_to_exitcode(status)
                if child.returncode:
                    raise SystemExit(f"lhpost6 run failed with exit code {child.returncode}")
                self.add(f"lhpost6 run ridgecrest (50 s of motion), {word}", time.perf_counter() - begin, "s")
                self.add(f"peak memory of it, {word}", usage.ru_maxrss / 1024.0, "MiB")


def main(
    out: Annotated[Path | None, typer.Option(help="Folder for bench.json.")] = None,
    quick: Annotated[bool, typer.Option(help="Shorter runs, once each: shows that the script works.")] = False,
) -> None:
    """Run all benchmarks, print them and keep them."""
    if out is not None:
        refuse_folder(out)
    logging.getLogger("lhpost6_pin").setLevel(logging.ERROR)  # runs that stop are expected of euler
    bench = Bench(repeats=1 if quick else 5)
    bench.engines(0.5 if quick else 10.0)
    bench.specimen(0.5 if quick else 4.0)
    bench.against()
    bench.lengths((1, 2) if quick else (5, 10, 20, 40))
    bench.inverse(1 if quick else 20)
    bench.machines((1, 2) if quick else (1, 2, 4, 8, 16), 1 if quick else 5)
    if not quick:
        bench.first_result()
    facts = f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}"
    table = Table("what", "value", "unit", title=facts)
    for what, value, unit in bench.rows:
        table.add_row(what, f"{value:.4g}", unit)
    Console(width=110).print(table)
    if out is not None:
        rows = [{"what": what, "value": value, "unit": unit} for what, value, unit in bench.rows]
        with write_whole(out / "bench.json") as path:
            path.write_text(json.dumps({"machine": facts, "rows": rows}, indent=1))


if __name__ == "__main__":
    typer.run(main)
