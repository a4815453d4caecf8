"""Running one-axis cases and writing them as a lab would leave them: records, a machine file, a sensors file."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lhpost6_pin.core.files import write_whole
from lhpost6_pin.data.records import make_record, save_record
from lhpost6_pin.machine.machine import load_machine

from .one_axis import PA, PB, Control, Run, Table, X, at_rest, control_loop, march, stacked
from .one_axis_cases import Case, Sensors, numbers
from .sensors import coloured_noise, delayed, low_pass
from .simulate import RATE

__all__ = ["machine_text", "observe", "run_cases", "run_tests", "sensors_text", "truth", "write_cases"]

AXIS_ONLY = ("platen_displacement", "platen_acceleration")


Plan = tuple[Case, str]
"""A case and one of its tests."""


def run_tests(plans: Sequence[Plan], tables: Sequence[Table]) -> list[Run]:
    """Closed-loop runs of tests on these tables, side by side."""
    references = [case.references[name] for case, name in plans]
    together = np.zeros((max(map(len, references)), len(references)))
    for column, one in zip(together.T, references, strict=True):
        column[: len(one)] = one
    control = [case.control._replace(trim=-table.null) for (case, _), table in zip(plans, tables, strict=True)]
    settings = Control(*map(np.array, zip(*control, strict=True)))
    with np.errstate(all="ignore"):  # a run that diverges is found by `_is_sound`
        table = stacked(tables)
        found = march(table, at_rest(table, len(plans)), len(together), control_loop(settings, together))
    each = enumerate(map(len, references))
    return [Run(found.y[:n, :, i], found.acceleration[:n, i], found.command[:n, i]) for i, n in each]


def run_cases(cases: Sequence[Case]) -> tuple[list[Case], dict[tuple[str, str], Run]]:
    """All tests of all cases, made smaller where a run would leave its stroke or its oil cavitate.

    Returns the cases with the references that were run, and runs by case and test. Raises ArithmeticError for a test
    that is unsound even when small.
    """
    by_id, runs = {case.id: case for case in cases}, dict[tuple[str, str], Run]()
    left = [(case.id, name) for case in cases for name in case.references]
    for _ in range(6):
        plans = [(by_id[key], name) for key, name in left]
        runs |= dict(zip(left, run_tests(plans, [case.table for case, _ in plans]), strict=True))
        left = [place for place in left if not _is_sound(by_id[place[0]], runs[place])]
        if not left:
            return list(by_id.values()), runs
        for key, name in left:
            smaller = numbers()["limit"]["shrink"] * by_id[key].references[name]
            by_id[key] = replace(by_id[key], references={**by_id[key].references, name: smaller})
    raise ArithmeticError(f"unsound, however small: {left}")


def _is_sound(case: Case, run: Run) -> bool:
    """Whether a run stayed within its stroke, with pressures between the oil's vapour and twice the supply."""
    pressures = run.y[:, (PA, PB)]
    least, most = numbers()["limit"]["least_pressure"], 2.0 * case.table.supply
    return bool(np.abs(run.y[:, X]).max() < case.stroke and pressures.min() > least and pressures.max() < most)


def truth(case: Case, run: Run) -> dict[str, np.ndarray]:
    """What perfect sensors would show at the controller's rate, by channel (n,)."""
    t, y = case.table, run.y
    pull = t.area * (y[:, PA] - y[:, PB])
    values = {
        "platen_displacement": y[:, X],
        "platen_acceleration": run.acceleration,
        "pressure_difference": y[:, PA] - y[:, PB],
        "chamber_pressure_a": y[:, PA],
        "chamber_pressure_b": y[:, PB],
        "actuator_force": pull - case.rod * t.mass * run.acceleration,  # a cell between rod and platen
        "valve_command": run.command,
    }
    return {name: values[name] for name in case.sensors.channels}


def observe(true: dict[str, np.ndarray], sensors: Sensors, random: np.random.Generator) -> dict[str, np.ndarray]:
    """What was recorded: gains, offsets, delays, noise, low-pass, converter; displacement and acceleration tared."""
    rule, seen = numbers()["sensors"], {}
    for name, values in true.items():
        own = sensors.channels[name]
        late = delayed(values[:, None] * (1.0 + own.gain) + own.offset, own.late * RATE)
        noisy = low_pass(late + coloured_noise(late.shape, rule, random) * own.noise, rule)[
            :: round(RATE / sensors.rate), 0
        ]
        if name in AXIS_ONLY:  # half a second of rest begins every test
            noisy = noisy - noisy[: round(0.4 * sensors.rate)].mean()
        step = 2.0 * own.span / 2 ** rule["bits"]
        seen[name] = step * np.round(np.clip(noisy, -own.span, own.span) / step)
    return seen


def write_cases(cases: Sequence[Case], folder: Path) -> list[dict]:
    """Write `folder/<id>` for each: TEST.nc, machine.toml, sensors.toml, campaign.toml; the labels, gaps measured."""
    cases, runs = run_cases(cases)
    hiding = [(case, name) for case in cases for name in case.hold_out if case.label["effects"]]
    without = run_tests(hiding, [case.plain for case, _ in hiding]) if hiding else []
    gaps: dict[str, list[tuple[float, float]]] = {}
    for (case, name), plain in zip(hiding, without, strict=True):
        gaps.setdefault(case.id, []).append(_changes(case, runs[case.id, name], plain))
    for case in cases:
        home = folder / case.id
        home.mkdir(parents=True, exist_ok=True)
        for file, text in (("machine.toml", machine_text(case)), ("sensors.toml", sensors_text(case))):
            with write_whole(home / file) as beside:
                beside.write_text(text, encoding="utf-8")
        labels = load_machine(home / "machine.toml").labels
        for i, name in enumerate(case.references):
            seen = observe(truth(case, runs[case.id, name]), case.sensors, np.random.default_rng([case.seed, i]))
            _save(case, name, seen, labels, home / f"{name}.nc")
        held = ", ".join(f'"{name}"' for name in case.hold_out)
        with write_whole(home / "campaign.toml") as beside:
            beside.write_text(f"hold_out = [{held}]\n", encoding="utf-8")
    return [_measured(case, gaps.get(case.id, [])) for case in cases]


def _save(case: Case, name: str, seen: dict[str, np.ndarray], labels: dict, path: Path) -> None:
    """One record in the package's layout."""
    rate = case.sensors.rate
    reference = case.references[name][:: round(RATE / rate)]
    channels = {key: values[:, None] for key, values in {**seen, "reference_displacement": reference}.items()}
    for key in (*AXIS_ONLY, "reference_displacement"):
        if key in channels:
            channels[key] = np.pad(channels[key], ((0, 0), (0, 5)))
    attrs = {"title": name, "test": name, "kind": "measured", "specimen": "none", "source": "one-axis battery"}
    save_record(make_record(np.arange(len(reference)) / rate, channels, labels, attrs), path)


def _changes(case: Case, run: Run, plain: Run) -> tuple[float, float]:
    """Change by the effect over the noise recorded, largest over the channels: rms about its mean, and its mean."""
    rule, moving, still = numbers()["sensors"], [], []
    a, b = truth(case, run), truth(case, plain)
    share = (rule["low_pass"] / (RATE / 2)) ** 0.5  # of white noise behind the low-pass
    for name, own in case.sensors.channels.items():
        change = low_pass((a[name] - b[name])[:, None], rule)[:, 0] / (own.noise * share)
        moving.append(change.std())
        still.append(abs(change.mean()))
    return float(max(moving)), float(max(still))


def _measured(case: Case, gaps: list[tuple[float, float]]) -> dict:
    """The label with the gap and the offset of its effect."""
    found = [{**e, "gap": max(g for g, _ in gaps), "offset": max(o for _, o in gaps)} for e in case.label["effects"]]
    return {**case.label, "effects": found}


def _row(key: str, value: object, unit: str, source: str, rel_sd: float | None = None) -> str:
    """One entry of a machine or sensors file."""
    shown = "[" + ", ".join(f"{v:.6g}" for v in value) + "]" if isinstance(value, list) else f"{value:.6g}"
    more = "" if rel_sd is None else f", rel_sd = {rel_sd:g}"
    return f'{key} = {{ value = {shown}, unit = "{unit}", evidence = "assumed", source = "{source}"{more} }}'


def machine_text(case: Case) -> str:
    """The machine file of the lab: what it believes, and how sure it is."""
    s, sd, stroke = case.stated, numbers()["prior"]["rel_sd"], case.stroke
    speed = s["flow"] * -np.expm1(-numbers()["prior"]["flow_curve"]) / s["area"]
    stall = s["area"] * (s["supply_pressure"] - s["return_pressure"])
    along = [0.0] * 5
    oil = [
        _row("supply_pressure", s["supply_pressure"], "Pa", "gauge"),
        _row("return_pressure", s["return_pressure"], "Pa", "gauge"),
        _row("rated_pressure", s["rated_pressure"], "Pa", "drop at one port, no load"),
        _row("bulk_modulus", s["bulk_modulus"], "Pa", "oil with a little air", sd["bulk_modulus"]),
        _row("root_regularisation", 500.0, "Pa", "far below any drop of a test"),
    ]
    drive = [
        _row("area_a", s["area"], "m2", "drawing"),
        _row("area_b", s["area"], "m2", "drawing"),
        _row("flow", s["flow"], "m3/s", "data sheet; full command passes this times the flow curve", sd["flow"]),
        _row("flow_curve", numbers()["prior"]["flow_curve"], "1", "straight flow gain"),
        _row("leakage", s["leakage"], "m3/s/Pa", "data sheet", sd["leakage"]),
        _row("chamber_a", s["chamber_a"], "m", "stroke, ports and lines", sd["chamber"]),
        _row("chamber_b", s["chamber_b"], "m", "stroke, ports and lines", sd["chamber"]),
        _row("stroke", 1.02 * stroke, "m", "drawing"),
        _row("valve_delay", s["valve_delay"], "s", "data sheet", sd["valve_delay"]),
        _row("seal_friction", s["seal_friction"], "N", "seals and guides", sd["seal_friction"]),
        _row("seal_yield", s["seal_yield"], "m", "as other seals", sd["seal_yield"]),
        _row("seal_shape", 0.1, "1", "as other seals", sd["seal_shape"]),
        _row("viscous", s["viscous"], "N s/m", "estimate", sd["viscous"]),
        _row("mass_along", 0.0, "kg", "counted in the platen's, or ahead of the load cell"),
        _row("mass_across", 0.0, "kg", "guided"),
        _row("load_cell_share", 0.03, "1", "piston and rod, estimate", sd["load_cell_share"]),
    ]
    body = [
        _row("mass", [s["mass"]] * 3, "kg", "estimate", sd["mass"]),
        _row("inertia", [s["mass"] / 3] * 3, "kg m2", "no part in a guided motion"),
        _row("centre_of_gravity", [0.0, 0.0, -0.15], "m", "no part in a guided motion"),
        _row("bearing_plane", [0.0, 0.0, -0.3], "m", "no part in a guided motion"),
        _row("size", [1.5, 1.0], "m", "to draw it"),
        _row("gravity", 9.80665, "m/s2", "standard gravity"),
    ]
    limits = [
        _row("displacement", [stroke, *along], "m | rad", "stroke"),
        _row("velocity", [speed, *along], "m/s | rad/s", "full command"),
        _row("acceleration", [stall / s["mass"], *along], "m/s2 | rad/s2", "stall force"),
        _row("bandwidth", 25.0, "Hz", "motions"),
        _row("valve_reserve", 0.15, "1", "usual"),
        _row("stroke_reserve", 0.03, "1", "usual"),
    ]
    sections = {
        "machine": ['name = "table"', 'motion = "x"', 'thrust = "report"', 'controller = "uniaxial"'],
        "platen": body,
        "hydraulics": oil,
        "kind.drive": ['role = "actuator"', 'mount = "swivel"', 'valve = "4-way"', "valves = 1", *drive],
        "component.A1": [
            'kind = "drive"',
            _row("platen_point", [0.7, 0.0, -0.15], "m", "end of the platen"),
            _row("base_point", [-1.2 - stroke, 0.0, -0.15], "m", "reaction wall"),
        ],
        "limits": limits,
    }
    return "\n".join(f"[{name}]\n" + "\n".join(rows) + "\n" for name, rows in sections.items())


def sensors_text(case: Case) -> str:
    """The sensors file of the lab; its noise is off by what was drawn."""
    rule, channels = numbers()["sensors"], case.sensors.channels
    units = dict.fromkeys(("pressure_difference", "chamber_pressure_a", "chamber_pressure_b"), "Pa")
    units |= {"valve_command": "1", "actuator_force": "N"}
    units |= {"platen_displacement": "m | rad", "platen_acceleration": "m/s2 | rad/s2"}
    source = "data sheet"
    sampling = [
        _row("rate", float(RATE), "Hz", "the noise below is white at this rate"),
        _row("low_pass", rule["low_pass"], "Hz", source),
        _row("low_pass_order", 2.0 * rule["low_pass_order"], "1", "forwards and backwards"),
        _row("bits", float(rule["bits"]), "1", source),
        _row("noise_range", rule["noise_range"], "1", "how far the figures below may be off"),
    ]
    sds = {n: [c.stated_noise] * 6 if n in AXIS_ONLY else c.stated_noise for n, c in channels.items()}
    noise = [_row(n, sd, units[n], source) for n, sd in sds.items()]
    gain = [_row(n, c.gain_range, "1", source) for n, c in channels.items() if c.gain_range]
    offset = [_row(n, c.offset_range, units[n], source) for n, c in channels.items() if c.offset_range]
    groups = {n.removesuffix("_a").removesuffix("_b") if n.startswith("chamber") else n: c for n, c in channels.items()}
    delay = [_row(n, c.delay_range, "s", source) for n, c in groups.items() if c.delay_range]
    sections = {"sensors": ['name = "table"'], "sampling": sampling, "noise": noise}
    sections |= {"gain_range": gain, "offset_range": offset, "delay_range": delay}
    return "\n".join(f"[{name}]\n" + "\n".join(rows) + "\n" for name, rows in sections.items())
