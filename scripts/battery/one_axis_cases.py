"""Drawing one-axis cases: a table, what it hides, its sensors, and what its lab states about both."""

import tomllib
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from .motions import make_motion
from .one_axis import SUBSTEPS, Control, Table
from .simulate import RATE

__all__ = ["Case", "Channel", "Sensors", "draw_case", "draw_cases", "numbers"]

Random = np.random.Generator
CHAMBERS = ("chamber_pressure_a", "chamber_pressure_b")


@dataclass(frozen=True)
class Channel:
    """A channel's errors, and what its lab states of them."""

    noise: float
    span: float  # of the converter, either way
    gain: float = 0.0
    offset: float = 0.0
    late: float = 0.0
    stated_noise: float = 0.0
    gain_range: float = 0.0
    offset_range: float = 0.0
    delay_range: float = 0.0


@dataclass(frozen=True)
class Sensors:
    """A set of few sensors: channels by the names of records."""

    rate: int
    channels: dict[str, Channel]


@dataclass(frozen=True)
class Case:
    """One campaign, complete; `references` are displacements at the controller's rate (n,)."""

    id: str
    label: dict
    table: Table
    stroke: float
    rod: float  # share of the mass ahead of a load cell
    control: Control
    stated: dict[str, float]
    sensors: Sensors
    references: dict[str, np.ndarray] = field(repr=False)
    hold_out: tuple[str, ...]
    seed: int

    @property
    def plain(self) -> Table:
        """The table without what it hides."""
        return self.table._replace(null=0.0, stribeck=0.0)


@cache
def numbers() -> dict:
    """Every number of this generator."""
    with Path(__file__).with_name("one_axis.toml").open("rb") as file:
        return tomllib.load(file)


def draw_cases(count: int, seed: int, campaign: str = "full", only: str | None = None) -> list[Case]:
    """`count` cases in the battery's mix, or `only` of one sort, in random order; the same for the same arguments."""
    root = np.random.SeedSequence(seed)
    random = np.random.default_rng(root)
    mix = numbers()["mix"] if only is None else {only: 1}
    parts = np.repeat(list(mix), list(mix.values()))
    sorts = random.permutation(np.resize(parts, count))
    return [draw_case(str(sort), own, campaign) for sort, own in zip(sorts, root.spawn(count), strict=True)]


def draw_case(sort: str, seed: int | np.random.SeedSequence, campaign: str = "full") -> Case:
    """One case of a sort of the mix."""
    random = np.random.default_rng(seed)
    rule, plan = numbers(), numbers()["campaign"][campaign]
    table, stroke, rod, speed = draw_table(random)
    effects = []
    if sort != "null":
        hidden = {name: _log(random, span) for name, span in rule["effect"][sort]["log"].items()}
        if "null" in hidden:
            hidden["null"] *= random.choice([-1.0, 1.0])
        else:
            hidden["stribeck"] *= table.friction
        table = table._replace(**hidden)
        effects = [{"family": rule["effect"][sort]["family"], "components": ["A1"], "fields": hidden}]
    sensors = draw_sensors(random, table, stroke)
    references = {name: _motion(name, plan["duration"], random, table, stroke, speed) for name in plan["tests"]}
    name = random.bytes(5).hex()
    label = {
        "id": name,
        "sort": "one" if effects else "null",
        "hides": sort,
        "verdict": "named" if effects else "parameters_only",
        "accept": ["named", "ambiguous"] if effects else ["parameters_only", "none", "not_testable"],
        "effects": effects,
        "sensors": [],
        "decoys": [],
        "channels": sorted(sensors.channels),
        "noise_stated_over_true": {n: round(c.stated_noise / c.noise, 3) for n, c in sensors.channels.items()},
        "campaign": campaign,
    }
    control = draw_control(random, table, speed)
    stated, off = draw_statement(random, table, stroke, 0.0 if "actuator_force" not in sensors.channels else rod)
    return Case(
        id=name,
        label={**label, "true_over_stated": off, "table": table._asdict()},
        table=table,
        stroke=stroke,
        rod=rod,
        control=control,
        stated=stated,
        sensors=sensors,
        references=references,
        hold_out=tuple(plan["hold_out"]),
        seed=int(random.integers(2**31)),
    )


def draw_table(random: Random) -> tuple[Table, float, float, float]:
    """A table that hides nothing, its stroke [m], its rod's share of the mass, its speed at full command [m/s]."""
    rule = numbers()["table"]
    sizes = {name: _log(random, span) for name, span in rule["log"].items()}
    sizes |= {name: float(random.uniform(*span)) for name, span in rule["even"].items()}
    supply, back = sizes["supply"], sizes["back"]
    area = 1.5 * sizes["mass"] * sizes["thrust"] / supply
    area = float(np.clip(area, rule["least"]["area"], rule["most"]["area"]))
    stall = area * (supply - back)
    dahl = random.random() < 0.5
    chamber = sizes["stroke"] * sizes["dead"]
    step = 1.0 / (RATE * SUBSTEPS)
    table = Table(
        mass=sizes["mass"],
        area=area,
        chamber_a=chamber,
        chamber_b=chamber * float(random.uniform(0.95, 1.05)),
        bulk=sizes["bulk"],
        supply=supply,
        back=back,
        valve=sizes["speed"] * area / (0.5 * (supply - back)) ** 0.5,
        leakage=sizes["leak"] * sizes["speed"] * area / supply,
        lag=sizes["lag"],
        delay=round(sizes["delay"] / step) * step,
        friction=sizes["friction"] * stall,
        # fast motions must not bend a bristle by more than some spans a step
        span=max(sizes["span"], numbers()["limit"]["speed"] * sizes["speed"] * step / 2.0),
        exponent=sizes["exponent"] if dahl else 1.0,
        bristle_damping=0.0 if dahl else sizes["bristle_damping"],
        viscous=sizes["viscous"] * stall,
    )
    return table, sizes["stroke"], sizes["rod"], sizes["speed"]


def draw_control(random: Random, table: Table, speed: float) -> Control:
    """A controller tuned to bear the table's oil column."""
    rule = numbers()["control"]
    column = (table.bulk * table.area * (1 / table.chamber_a + 1 / table.chamber_b) / table.mass) ** 0.5
    proportional = min(_log(random, rule["proportional"]), rule["crossover"] * column)
    return Control(
        proportional=proportional,
        integral=rule["integral"] * proportional,
        derivative=float(random.uniform(*rule["derivative"])),
        low_pass=rule["low_pass"],
        speed=speed * (1.0 + rule["belief"] * float(random.uniform(-1, 1))),
        trim=-table.null,
    )


def draw_sensors(random: Random, table: Table, stroke: float) -> Sensors:
    """Displacement and command, one measure of force, and often an accelerometer; noise stated wrongly."""
    rule = numbers()["sensors"]
    stall = table.area * (table.supply - table.back)
    scale = {"platen_displacement": stroke, "actuator_force": stall}
    scale |= dict.fromkeys(("pressure_difference", "chamber_pressure"), table.supply)
    kinds = ["platen_displacement", "valve_command", str(random.choice(rule["force"]))]
    if random.random() < rule["acceleration_share"]:
        kinds.append("platen_acceleration")
    channels = {}
    for kind in kinds:
        own, unit = numbers()["channel"][kind], scale.get(kind, 1.0)
        late, misstated = float(random.uniform(0.0, own.get("late", 0.0))), _log(random, rule["misstated"])
        noise = unit * _log(random, own["noise"])
        for name in CHAMBERS if kind == "chamber_pressure" else (kind,):
            gain, offset = own.get("gain", 0.0), unit * own.get("offset", 0.0)
            channels[name] = Channel(
                noise=noise,
                span=unit * own["range"],
                gain=gain * float(random.uniform(-1, 1)),
                offset=offset * float(random.uniform(-1, 1)),
                late=late,
                stated_noise=noise * misstated,
                gain_range=gain,
                offset_range=offset,
                delay_range=own.get("skew", 0.0),
            )
    return Sensors(int(random.choice(rule["rates"])), channels)


def draw_statement(
    random: Random, table: Table, stroke: float, rod: float
) -> tuple[dict[str, float], dict[str, float]]:
    """What the lab believes, by key of a machine file, and true over stated values.

    Of the mass it states what its sensors see, behind a load cell that without the rod; chambers hold the stroke.
    """
    rule = numbers()["prior"]
    rated = 0.5 * (table.supply - table.back)
    true = {
        "mass": table.mass * (1.0 - rod),
        "bulk_modulus": table.bulk,
        "flow": table.valve * rated**0.5 / -np.expm1(-rule["flow_curve"]),
        "leakage": table.leakage,
        "chamber_a": table.chamber_a,
        "chamber_b": table.chamber_b,
        "valve_delay": table.delay + table.lag,
        "seal_friction": table.friction,
        "seal_yield": table.span / rule["yield_factor"],
        "viscous": table.viscous,
    }
    off = {}
    for key in true:
        sd = rule["rel_sd"][key.removesuffix("_a").removesuffix("_b")]
        steps = float(np.clip(random.standard_normal(), -rule["within"], rule["within"]))
        off[key] = max(1.0 + sd * steps, rule["least"])
        if key.startswith("chamber"):
            off[key] = min(off[key], true[key] / (rule["least_chamber"] * stroke))
    exact = {"supply_pressure": table.supply, "return_pressure": table.back, "rated_pressure": rated}
    stated = {key: float(value / off[key]) for key, value in true.items()}
    return {**stated, **exact, "area": table.area}, {key: round(value, 3) for key, value in off.items()}


def _motion(name: str, duration: float, random: Random, table: Table, stroke: float, speed: float) -> np.ndarray:
    """Reference displacement (n,) of a test, as strong as stroke, valve and force allow."""
    rule, limit = numbers()["test"][name], numbers()["limit"]
    unit = {**rule, "duration": duration, "size": [1.0] * 6}
    motion = make_motion(unit, int(random.integers(2**31)))[:, 0]
    velocity = np.gradient(motion, 1 / RATE)
    inertia = np.abs(table.mass * np.gradient(velocity, 1 / RATE) + table.viscous * velocity).max()
    left = limit["force"] * table.area * (table.supply - table.back) - table.friction - table.stribeck
    scales = (
        limit["stroke"] * stroke / np.abs(motion).max(),
        limit["speed"] * speed / np.abs(velocity).max(),
        left / inertia,
    )
    return rule["share"] * min(scales) * motion


def _log(random: Random, span: list[float]) -> float:
    """A number drawn log-uniform."""
    return float(np.exp(random.uniform(*np.log(span))))
