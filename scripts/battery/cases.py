"""Drawing cases: what is hidden, how strongly, in which component, with which wrong parameters."""

import tomllib
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from .hidden import Effect
from .machines import Model, draw_anew
from .sensors import Fault, Instruments, draw_instruments
from .table import ACTUATORS, load_model, nominal_values

__all__ = ["Case", "Test", "Variety", "draw_case", "draw_cases", "model", "numbers"]

KIND_LEGS = {"horizontal": ACTUATORS[:4], "vertical": ACTUATORS[4:], "strut": ("S1", "S2", "S3")}


@dataclass(frozen=True)
class Test:
    """One test of a campaign: its settings in `numbers.toml` and the seeds of its motion and its noise."""

    name: str
    settings: dict
    seed: int
    oil: float  # share of the campaign's drift of the oil reached, -0.5..0.5


@dataclass(frozen=True)
class Variety:
    """How cases differ beside what they hide."""

    anew: bool = False  # every case has a table of its own
    fewer: bool = False  # a third of the sensors is left out


@dataclass(frozen=True)
class Case:
    """One blind campaign, complete: `generate.write_case` needs nothing else."""

    id: str
    label: dict
    values: dict[str, dict]
    scatter: dict[str, np.ndarray]
    oil: dict[str, float]
    effects: tuple[Effect, ...]
    instruments: Instruments
    tests: tuple[Test, ...]
    hold_out: tuple[str, ...]
    model: Model = field(repr=False)  # as its lab knows the table
    left_out: tuple[str, ...]  # variables that are not recorded


@cache
def numbers() -> dict:
    """Every number of the generator."""
    with (Path(__file__).parent / "numbers.toml").open("rb") as file:
        return tomllib.load(file)


@cache
def model() -> dict[str, dict]:
    """The nominal table as `models/lhpost6.toml` has it."""
    return load_model(Path(__file__).parents[2] / "models" / "lhpost6.toml")


def draw_cases(count: int, seed: int, campaign: str = "full", variety: Variety = Variety()) -> list[Case]:
    """`count` cases in the battery's mix, in random order; the same for the same arguments."""
    root = np.random.SeedSequence(seed)
    random = np.random.default_rng(root)
    mix = numbers()["mix"]
    share = np.array(list(mix.values())) * count / sum(mix.values())
    whole = np.floor(share).astype(int)
    for i in np.argsort(whole - share, kind="stable")[: count - whole.sum()]:
        whole[i] += 1
    sorts = [str(sort) for sort in random.permutation(np.repeat(list(mix), whole))]
    piles = {"one": "effect", "more": "effect", "unknown": "unknown", "sensor": "sensor"}
    decks = {name: _Deck(list(numbers()[group]), random) for name, group in piles.items()}
    hidden = [_deal(sort, decks) for sort in sorts]
    each = zip(sorts, hidden, root.spawn(count), strict=True)
    return [draw_case(sort, families, seed=own, campaign=campaign, variety=variety) for sort, families, own in each]


class _Deck:
    """Names dealt without return until all were dealt: every family gets its turn."""

    def __init__(self, names: list[str], random: np.random.Generator) -> None:
        self.names, self.random, self.left = names, random, list[str]()

    def take(self, taken: tuple[str, ...] = ()) -> str:
        if not set(self.left) - set(taken):
            self.left = [*self.left, *self.random.permutation(self.names)]
        name = next(name for name in self.left if name not in taken)
        self.left.remove(name)
        return str(name)


def _deal(sort: str, decks: dict[str, _Deck]) -> tuple[str, ...]:
    """Families for one case of a sort of the mix."""
    if sort not in ("two", "three"):
        return (decks[sort].take(),) if sort in decks else ()
    families: tuple[str, ...] = (decks["more"].take(),)
    for _ in range(1 if sort == "two" else 2):
        families = (*families, decks["more"].take(families))
    return families


def draw_case(
    sort: str,
    families: tuple[str, ...] = (),
    *,
    seed: int | np.random.SeedSequence,
    campaign: str = "full",
    strength: float | None = None,
    variant: int | None = None,
    variety: Variety = Variety(),
) -> Case:
    """One case of a sort of the mix with given families; `strength` and `variant` fix what is otherwise drawn."""
    random = np.random.default_rng(seed)
    sizes = numbers()["strength"]
    bold = sort == "null" and random.random() < numbers()["parameters"]["bold_share"]
    own = random.spawn(2)  # what else is drawn stays the same with them
    table = draw_anew(model(), numbers()["anew"], own[0]) if variety.anew else model()
    left_out = draw_left_out(own[1]) if variety.fewer else ()
    values, moved = draw_parameters(table, random, bold)
    scatter = {name: random.normal(1.0, numbers()["scatter"]["sd"], 13) for name in numbers()["scatter"]["fields"]}
    stretch = numbers()["campaign"][campaign]["stretch"]
    effects: list[Effect] = []
    faults: tuple[Fault, ...] = ()
    decoy = sort in ("absorbable", "unexcited")
    if sort == "sensor":
        faults = (draw_fault(families[0], random),)
    elif decoy:
        family = families[0] if families else str(random.choice(list(numbers()[sort])))
        effects = [draw_effect(family, numbers()[sort][family], sizes, random, 1.0, variant)]
        campaign = numbers()[sort][family][0].get("campaign", campaign)
    elif sort != "null":
        library = numbers()["unknown" if sort == "unknown" else "effect"]
        effects = [draw_effect(family, library[family], sizes, random, strength, variant) for family in families]
        for effect in effects:
            values, moved = _alike(effect, library[effect.family], table, values, moved)
    described = [_describe(effect) for effect in effects]
    verdict, accept = VERDICTS[sort]
    name = random.bytes(5).hex()
    label = {
        "id": name,
        "sort": sort,
        "verdict": verdict,
        "accept": [verdict, *accept],
        "effects": [] if decoy else described,
        "sensors": [{"family": f.family, "channels": [list(c) for c in f.channels], **_size(f)} for f in faults],
        "decoys": described if decoy else [],
        "parameters_sd": {name: round(by, 3) for name, by in moved.items()},
        "campaign": campaign,
        "left_out": list(left_out),
    }
    plan = numbers()["campaign"][campaign]
    settings = [_stretched(numbers()["test"][t["motion"]], stretch) for t in plan["tests"]]
    order = np.linspace(-0.5, 0.5, len(settings))
    tests = tuple(
        Test(t["name"], s, int(random.integers(2**31)), float(o))
        for t, s, o in zip(plan["tests"], settings, order, strict=True)
    )
    drift = numbers()["oil_drift"]
    oil = {name: float(random.normal(0.0, drift[name])) for name in ("bulk", "viscous")}
    instruments = draw_instruments(numbers()["sensors"], random, faults)
    values["friction"] = {"exponent": float(random.uniform(*numbers()["friction"]["exponent"]))}
    return Case(
        id=name,
        label=label,
        values=values,
        scatter=scatter,
        oil=oil,
        effects=tuple(effects),
        instruments=instruments,
        tests=tests,
        hold_out=tuple(plan["hold_out"]),
        model=table,
        left_out=left_out,
    )


VERDICTS: dict[str, tuple[str, tuple[str, ...]]] = {
    "null": ("parameters_only", ("none",)),
    "absorbable": ("parameters_only", ("none",)),
    "sensor": ("sensor", ()),
    "one": ("named", ("ambiguous",)),
    "two": ("named", ("ambiguous",)),
    "three": ("named", ("ambiguous",)),
    "unexcited": ("not_testable", ("none", "parameters_only")),
    "unknown": ("unexplained", ()),
}


def draw_left_out(random: np.random.Generator) -> tuple[str, ...]:
    """Variables that are not recorded: a third of what is measured, never both forces and pressures."""
    rule = numbers()["left_out"]
    stays = str(random.choice(rule["one_of"]))
    groups = [group for group in rule["groups"] if stays not in group]
    return tuple(name for i in sorted(random.permutation(len(groups))[: rule["count"]]) for name in groups[i])


def draw_parameters(model: Model, random: np.random.Generator, bold: bool) -> tuple[dict[str, dict], dict[str, float]]:
    """Parameters of a table off by their stated deviation, alike for twins; `bold`: one or two by three deviations.

    Returns the values and by how many deviations each went.
    """
    rules = numbers()["parameters"]
    values, moved = nominal_values(model), dict[str, float]()
    known = [(t, k) for t, table in model.items() for k, entry in table.items() if _deviation(entry) is not None]
    far = list(random.permutation(rules["bold"])[: random.integers(1, 3)]) if bold else list[str]()
    mirrored: dict[tuple[str, str], np.ndarray] = {}
    for table, key in known:
        if key in rules["unused"]:
            continue
        entry = model[table][key]
        value, sd = np.array(entry["value"], dtype=float), np.array(_deviation(entry))
        step = np.clip(random.standard_normal(value.shape), -rules["clip"], rules["clip"])
        if f"{table}.{key}" in far:
            worst = np.all(value - 3 * sd >= rules["least"] * value)
            step = np.full(value.shape, 3.0) * (random.choice([-1, 1]) if worst else 1)
        if table.startswith("component."):  # twins' points move alike, mirrored
            kind = model[table]["kind"]
            step = mirrored.setdefault((kind, "plan" if kind == "vertical" else key), step)
            values[table][key] = value + sd * step * np.where(value != 0, np.sign(value), 0.0) * [1, 1, -1]
        else:
            values[table][key] = np.maximum(value + sd * step, rules["least"] * np.abs(value) * np.sign(value))
            if value.ndim and (value == 0).any():
                values[table][key] = value + sd * step
        name = table if not table.startswith("component.") else f"component.{model[table]['kind']}"
        moved |= _steps(f"{name}.{key}", step)
    plane = values["platen"]["bearing_plane"][2]
    for name in KIND_LEGS["vertical"]:  # the bearings lie in the sliding plane
        values[f"component.{name}"]["platen_point"][2] = plane
    return values, moved


def _alike(
    effect: Effect, variants: list[dict], model: Model, values: dict[str, dict], moved: dict[str, float]
) -> tuple[dict[str, dict], dict[str, float]]:
    """Parameters with the one that an effect of a family adds `with`, if any, off in the direction of that effect."""
    (name,) = {variant.get("with") for variant in variants}
    if name is None:
        return values, moved
    table, key = name.rsplit(".", 1)
    way = float(np.sign(next(iter(effect.fields.values()))))
    stated, step = model[table][key]["value"], way * abs(moved[name])
    value = stated + step * _deviation(model[table][key])
    return {**values, table: {**values[table], key: value}}, {**moved, name: step}


def _deviation(entry: object) -> np.ndarray | float | None:
    """Stated standard deviation of an entry, or None."""
    if not isinstance(entry, dict) or not ("sd" in entry or "rel_sd" in entry):
        return None
    return np.array(entry["sd"]) if "sd" in entry else entry["rel_sd"] * np.abs(np.array(entry["value"], dtype=float))


def _steps(name: str, step: np.ndarray) -> dict[str, float]:
    return {name: float(step)} if step.ndim == 0 else {f"{name}[{i}]": float(s) for i, s in enumerate(step)}


def draw_effect(
    name: str,
    variants: list[dict],
    sizes: dict,
    random: np.random.Generator,
    strength: float | None = None,
    variant: int | None = None,
) -> Effect:
    """An effect of a family: a variant of it, all twins or one of them, a strength drawn log-uniform."""
    chosen = variants[int(random.integers(len(variants))) if variant is None else variant]
    alone = chosen.get("alone", 0.0)
    twins = KIND_LEGS.get(chosen["where"], ())
    one = random.random() < alone
    least = max(sizes["least"], chosen.get("least_one" if one else "least_all", 0.0))
    low, high = np.log(least), np.log(min(sizes["most"], chosen.get("most", np.inf)))
    drawn = float(np.exp(random.uniform(low, high))) if strength is None else min(strength, chosen.get("most", np.inf))
    sign = random.choice([-1.0, 1.0]) if chosen.get("signed") else 1.0
    fields = {key: float(sign * drawn * size) for key, size in chosen["size"].items()}
    fields |= {key: float(random.uniform(*span)) for key, span in chosen.get("draw", {}).items()}
    fields |= chosen.get("fixed", {})
    components = (str(random.choice(twins)),) if one else twins
    return Effect(name, components, drawn, fields)


def draw_fault(name: str, random: np.random.Generator) -> Fault:
    """An instrument beyond its usual range."""
    kinds = numbers()["sensor"][name]
    chosen = kinds[int(random.integers(len(kinds)))]
    variable = chosen["variables"][int(random.integers(len(chosen["variables"])))]
    column = int(random.integers(chosen["first"], chosen["last"] + 1))
    low, high = np.log(chosen["span"])
    size = float(np.exp(random.uniform(low, high))) * (random.choice([-1.0, 1.0]) if chosen["what"] != "delay" else 1.0)
    return Fault(name, ((variable, column),), **{chosen["what"]: float(size)})


def _size(fault: Fault) -> dict[str, float]:
    return {k: v for k in ("gain", "offset", "cross", "delay") if (v := getattr(fault, k))}


def _describe(effect: Effect) -> dict:
    return {
        "family": effect.family,
        "components": list(effect.components),
        "strength": effect.strength,
        "fields": effect.fields,
    }


def _stretched(test: dict, stretch: float) -> dict:
    """A test made shorter at the same speeds: slow motions smaller, noise and earthquakes as strong."""
    if stretch == 1.0:
        return test
    slow = test["kind"] in ("triangles", "steps", "sway")
    size = [s * (stretch if slow else 1.0) for s in test["size"]]
    return {**test, "duration": test["duration"] * stretch, "size": size}
