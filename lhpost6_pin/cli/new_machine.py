"""The command that writes a first machine file for a table: from options, and from questions on a terminal."""

import sys
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..core.errors import ParameterError
from ..machine.draft.asked import ASKED, alternatives_of, option_of, read_answers, refuse_alternatives
from ..machine.draft.cylinder import CYLINDERS
from ..machine.structure import MOTIONS
from .app import command, print_result, stderr
from .options import Json

if TYPE_CHECKING:
    from ..machine.machine import Machine

__all__ = ["Answers", "ask", "new_machine"]


def _option(name: str) -> Any:
    asked = ASKED[name]
    needed = "; needed" if asked.needed else ""
    return typer.Option(option_of(name), help=rf"{asked.question} \[{asked.unit}]{needed}.", metavar="<quantity>")


@dataclass(frozen=True)
class Answers:
    """An option for each number that is asked for."""

    mass: Annotated[str | None, _option("mass")] = None
    size: Annotated[str | None, _option("size")] = None
    inertia: Annotated[str | None, _option("inertia")] = None
    area: Annotated[str | None, _option("area")] = None
    bore: Annotated[str | None, _option("bore")] = None
    rod: Annotated[str | None, _option("rod")] = None
    stroke: Annotated[str | None, _option("stroke")] = None
    length: Annotated[str | None, _option("length")] = None
    supply_pressure: Annotated[str | None, _option("supply_pressure")] = None
    return_pressure: Annotated[str | None, _option("return_pressure")] = None
    speed: Annotated[str | None, _option("speed")] = None
    rated_flow: Annotated[str | None, _option("rated_flow")] = None
    rated_drop: Annotated[str | None, _option("rated_drop")] = None
    valve_delay: Annotated[str | None, _option("valve_delay")] = None
    friction: Annotated[str | None, _option("friction")] = None
    presliding: Annotated[str | None, _option("presliding")] = None
    bulk_modulus: Annotated[str | None, _option("bulk_modulus")] = None
    platen_radius: Annotated[str | None, _option("platen_radius")] = None
    base_radius: Annotated[str | None, _option("base_radius")] = None
    platen_spread: Annotated[str | None, _option("platen_spread")] = None
    base_spread: Annotated[str | None, _option("base_spread")] = None

    def given(self) -> dict[str, str]:
        """What was answered, by name."""
        texts = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: text for name, text in texts.items() if text is not None}


@command("new-machine")
def new_machine(
    name: Annotated[str, typer.Argument(help="Name of the machine; the file is NAME.toml.")],
    answers: Answers,
    motion: Annotated[
        str | None, typer.Option(help=f"Axes of the guides, or free for a platform on six legs: {', '.join(MOTIONS)}.")
    ] = None,
    cylinder: Annotated[str | None, typer.Option(help=f"Cylinders: {' or '.join(CYLINDERS)}.")] = None,
    voltage: Annotated[
        float | None,
        typer.Option(help="Full command of the valves [V]."),
    ] = None,
    title: Annotated[str, typer.Option(help="One line about the machine.")] = "",
    out: Annotated[Path | None, typer.Option(help="File to write; default: NAME.toml in this directory.")] = None,
    replace: Annotated[bool, typer.Option("--replace", help="Replace the file if there is one.")] = False,
    json: Json = False,
) -> None:
    """Write a machine file from the few numbers known of a table; the rest is assumed, with wide priors.

    Quantities are a number with its unit and, if known, one standard deviation: '310 kg +- 20 %'. On a terminal what is
    not given as an option is asked for.
    """
    from ..machine.draft.draft import draft_machine
    from ..show.new_machine import draft_entries, draft_text, print_draft

    path = out or Path(f"{name}.toml")
    if not name.isidentifier():
        raise ParameterError(f"{name!r}: use letters, digits and underscores for the name of a machine")
    if path.exists() and not replace:
        raise ParameterError(f"{path}: exists already; choose another with --out, or add --replace")
    texts = answers.given()
    refuse_alternatives(texts)
    if sys.stdin.isatty() and stderr().is_terminal and not json:
        motion, cylinder, voltage = ask(texts, motion, cylinder, voltage)
    machine = draft_machine(
        name,
        read_answers(texts, voltage),
        motion=motion or MOTIONS[1],
        cylinder=cylinder or CYLINDERS[0],
        title=title,
    )
    _write(machine, path, draft_text)
    print_result(json, lambda: draft_entries(machine), lambda: print_draft(machine, path), [path])


def _write(machine: "Machine", path: Path, text: "Callable[[Machine], str]") -> None:
    """Write the file once the actuators are known to hold the table."""
    from ..core.files import write_whole
    from ..mechanics.equilibrium import find_equilibrium
    from ..mechanics.plant import make_plant

    find_equilibrium(make_plant(machine))
    with write_whole(path) as beside:
        beside.write_text(text(machine), encoding="utf-8")


def ask(
    texts: dict[str, str], motion: str | None, cylinder: str | None, voltage: float | None
) -> tuple[str, str, float | None]:
    """Ask for what `texts` does not hold and add the answers; returns motion, cylinder and voltage.

    An answer that cannot be read is asked for again; an empty one stands for what is not known.
    """
    from rich.prompt import Prompt

    console = stderr()
    console.print(
        "A number with its unit, as in '24 cm2' or '310 kg +- 20 %'; Enter where it is not known.", style="dim"
    )

    def put(question: str, default: str = "", choices: list[str] | None = None) -> str:
        extra: dict[str, Any] = {"choices": choices} if choices else {}
        answer = Prompt.ask(question, console=console, default=default, show_default=bool(default), **extra)
        return answer.strip()

    motion = motion or put("Axes of the guides; free: a platform on six legs", MOTIONS[1], list(MOTIONS))
    cylinder = cylinder or put("Cylinders", CYLINDERS[0], list(CYLINDERS))
    for name, asked in ASKED.items():
        if name in texts or not _matters(name, texts, motion, cylinder):
            continue
        needed = asked.needed or (name == "bore") or (name == "rod" and cylinder == CYLINDERS[0])
        while True:
            answer = put(rf"{asked.question} \[{asked.unit}]{'' if needed else ', or Enter'}")
            if not answer and not needed:
                break
            if name == "speed" and answer.endswith("V") and voltage is None:
                voltage = _number(put(r"Full command of the valve \[V]"))
            try:
                _check(name, answer, voltage)
            except ParameterError as error:
                console.print(str(error), style="red", markup=False)
                continue
            texts[name] = answer
            break
    return motion, cylinder, voltage


def _matters(name: str, texts: dict[str, str], motion: str, cylinder: str) -> bool:
    """Whether a number is still to be asked for, after the answers so far."""
    if ASKED[name].when and ASKED[name].when != motion:
        return False
    if any(other in texts for other in alternatives_of(name)):
        return False
    if name == "rod":  # of a double-rod cylinder the area has no part of it
        return cylinder != CYLINDERS[0] or "area" not in texts
    return name != "rated_drop" or "rated_flow" in texts


def _check(name: str, text: str, voltage: float | None) -> None:
    """Raise ParameterError for an answer that cannot be read."""
    needed = {"mass": "1 kg", "area": "1 m2", "stroke": "1 m", "supply_pressure": "1 Pa"}
    read_answers({**needed, name: text}, voltage)


def _number(text: str) -> float | None:
    try:
        return float(text.removesuffix("V"))
    except ValueError:
        return None
