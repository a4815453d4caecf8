"""The machine: a platen, its actuators and hold-down struts, typed, checked and immutable.

A `Machine` is built from a `Parameters` mapping, so that another table is another file in ``models/``. It holds
plain floats; where each comes from stays in `Machine.parameters` under the same path.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from ..core.errors import ParameterError, RecordError, UnknownNameError
from ..core.user_code import is_python
from ..effects.effect import Effect
from ..effects.registry import LAWS
from .accelerometers import ACCELEROMETER, accelerometers_of
from .components import Actuator, Floor, Hydraulics, Limits, Platen, PowerSupply, Strut, Vec3
from .library import effect_entry, make_named_effect, size_of
from .machine_checks import check_actuator, check_machine, check_names
from .parameters import EffectEntry, Parameters, load_parameters, override_parameters
from .recorded_specimen import place_words, recorded_mounting
from .schema import build_section
from .specimen import Specimen, find_specimen
from .standard_effects import standard_effects
from .structure import BODIES, ESTIMATES, FLOW_READINGS, MOTIONS, VALVE_PORTS, Structure
from .user_specimen import REMOTE, load_user_specimen

__all__ = ["Machine", "build_machine", "load_machine"]


@dataclass(frozen=True, repr=False)
class Machine(Structure):
    """A shake table as an ordered list of force effects on a platen.

    Change it with `with_params`, `with_effect` and `with_specimen`; each returns a changed copy.
    """

    own_effects: tuple[Effect, ...] = ()
    specimen: Specimen | None = None

    def __repr__(self) -> str:
        """What the machine is, in a line; its numbers are in `parameters`."""
        parts = f"{len(self.actuators)} actuators, {len(self.struts)} struts, {len(self.parameters)} numbers"
        return f"Machine({self.name!r}: {parts}, specimen {self.mounted}; of {self.parameters.origin})"

    @property
    def mounted(self) -> str:
        """Name of the specimen, as records have it; "none" without one."""
        return self.specimen.name if self.specimen else "none"

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """All effects that make forces, in ledger order: the report's, then those added."""
        added = (e for e in self.added_effects if not LAWS[e.law].modifies)
        return (*standard_effects(self), *added)

    @cached_property
    def modifiers(self) -> tuple[Effect, ...]:
        """Effects added that make no force of their own but modify what is there."""
        return tuple(e for e in self.added_effects if LAWS[e.law].modifies)

    @cached_property
    def added_effects(self) -> tuple[Effect, ...]:
        """Effects beyond the report's: the library's that the parameters name, then those given as such."""
        named = (make_named_effect(self, name, entry) for name, entry in self.parameters.effects.items())
        return (*named, *self.own_effects)

    def with_params(self, changes: Mapping[str, Any] | str | Path | None = None, /, **keywords: Any) -> "Machine":
        """Return a copy with parameters replaced: a mapping by path, a small TOML file, or keywords.

        In a keyword the dot of a path is two underscores: ``with_params(platen__mass=[1e5, 1e5, 1e5])``.
        The library keeps the size of this machine, however far its numbers are fitted from priors that may be wide.
        Raises ParameterError or UnknownNameError that name the key.
        """
        parameters = self.parameters
        if changes is not None:
            parameters = override_parameters(parameters, changes)
        if keywords:
            parameters = override_parameters(parameters, {k.replace("__", "."): v for k, v in keywords.items()})
        return self._rebuilt(parameters)

    def with_effect(
        self, effect: Effect | str, components: Sequence[str] = (), *, name: str = "", **values: float
    ) -> "Machine":
        """Return a copy with one more effect: of the library by its family's name, or one made by hand.

        Of a family: components (none: all that it can act on), values in SI (typical ones where none are given), and a
        name of its own, the family's if empty. The name must be new.
        Raises ParameterError; UnknownNameError for a family that the library has not.
        """
        label = name or (effect if isinstance(effect, str) else effect.name)
        if label in {e.name for e in (*self.effects, *self.modifiers)}:
            raise ParameterError(f"an effect named {label!r} is in this machine already; give it another name")
        if isinstance(effect, Effect):
            return replace(self, own_effects=(*self.own_effects, effect))
        return self._with_effects({**self.parameters.effects, label: effect_entry(self, effect, components, values)})

    def without_effect(self, name: str) -> "Machine":
        """Return a copy without an effect of the library by its name; raises UnknownNameError."""
        entries = dict(self.parameters.effects)
        if name not in entries:
            raise UnknownNameError("effect of this machine", name, list(entries))
        del entries[name]
        return self._with_effects(entries)

    def _with_effects(self, entries: Mapping[str, EffectEntry]) -> "Machine":
        machine = replace(self, parameters=replace(self.parameters, effects=entries))
        made = zip(self.parameters.effects.items(), self.added_effects, strict=False)
        known = {name: effect for (name, entry), effect in made if entries.get(name) is entry}
        vars(machine)["added_effects"] = (
            *(known.get(name) or make_named_effect(machine, name, entry) for name, entry in entries.items()),
            *self.own_effects,
        )  # raises for an effect that cannot be
        return machine

    def with_valves(self, count: int) -> "Machine":
        """Return a copy with so many servovalves open on each double-acting actuator; 0 leaves it as it is."""
        if count == 0:
            return self
        return self.with_params({f"{a.kind}.valves": count for a in self.actuators if a.area_b is not None})

    def with_bodies(self, bodies: str) -> "Machine":
        """Return a copy with moving parts of its legs "lumped" to the platen, or as bodies of their own ("full")."""
        return self._with_word("bodies", bodies)

    def with_flow_reading(self, reading: str) -> "Machine":
        """Return a copy with a reading of Eq. 4-2, one of `FLOW_READINGS`; raises UnknownNameError."""
        if reading not in FLOW_READINGS:
            raise UnknownNameError("reading of the valve flow", reading, FLOW_READINGS)
        return self._with_word("flow_reading", reading)

    def with_accelerometers(self, stated: Parameters) -> "Machine":
        """Return a copy with the accelerometers that a file of sensors states, in place of its own.

        Raises ParameterError if the file states none.
        """
        found = {path: quantity for path, quantity in stated.items() if path.startswith(ACCELEROMETER)}
        if not found:
            raise ParameterError(
                f"{stated.origin}: states no accelerometers; add sections [accelerometer.NAME] with point and direction"
            )
        kept = {path: q for path, q in self.parameters.items() if not path.startswith(ACCELEROMETER)}
        parameters = replace(self.parameters, quantities={**kept, **found})
        return self._rebuilt(parameters)

    def _rebuilt(self, parameters: Parameters) -> "Machine":
        """The machine of other parameters, with all else that this one has."""
        return build_machine(parameters, self.own_effects, self.specimen, size_of(self))

    def _with_word(self, key: str, word: str) -> "Machine":
        parameters = replace(self.parameters, words={**self.parameters.words, f"machine.{key}": word})
        return self._rebuilt(parameters)

    def with_inertia(self, estimate: str) -> "Machine":
        """Return a copy with mass and moments of inertia of an estimate of the file, "first" or "second" (Table 4.1).

        Raises ParameterError if the machine's file has no such estimate.
        """
        found = {key: f"estimates.{estimate}.{key}" for key in ("mass", "inertia")}
        if estimate not in ESTIMATES or not all(path in self.parameters for path in found.values()):
            known = [e for e in ESTIMATES if f"estimates.{e}.mass" in self.parameters]
            hint = f"choose {' or '.join(known)}" if known else "its file states no estimates of the platen's inertia"
            raise ParameterError(f"{self.parameters.origin}: no estimate {estimate!r}; {hint}")
        return self.with_params({f"platen.{key}": self.parameters[path] for key, path in found.items()})

    def as_tested(self, attrs: Mapping[str, Any], record: str) -> "Machine":
        """Return a copy with the specimen and the open servovalves that a record's attributes state, if any.

        Raises what `as_mounted` does.
        """
        return self.as_mounted(attrs, record).with_valves(int(attrs.get("valves_per_horizontal_actuator", 0)))

    def as_mounted(self, attrs: Mapping[str, Any], record: str) -> "Machine":
        """Return a copy with the specimen that `record` was made with; one that is mounted stays.

        Raises RecordError if its place or its file is not known.
        """
        mounting = None if self.specimen else recorded_mounting(attrs, record)
        if mounting is None:
            self.refuse_unmounted(attrs, record)
            return self
        return self.with_specimen(mounting.file, mounting.position, mounting.rpy, locked=mounting.locked)

    def refuse_unmounted(self, attrs: Mapping[str, Any], record: str) -> None:
        """Raise RecordError if `record` was made with a specimen and this table is bare."""
        carried = str(attrs.get("specimen", "none"))
        if carried != "none" and self.specimen is None:
            how = "mount it with --specimen"
            if "specimen_file" not in attrs and "specimen_position" in attrs:  # a program
                at = place_words(attrs["specimen_position"])
                how += f" FILE.py:NAME --specimen-at {at}; calibrate and discover take tests without it alone"
            raise RecordError(f"{record} was made with specimen {carried!r} on the table; {how}")

    def with_specimen(
        self,
        name_or_path: Any,
        position: Vec3 = (0.0, 0.0, 0.0),
        rpy: Vec3 = (0.0, 0.0, 0.0),
        *,
        locked: bool = False,
    ) -> "Machine":
        """Return a copy with a specimen bolted to the platen: a shipped name (``pendulum``), or a file.

        A file is a URDF, or states a rigid body with modes or matrices (.toml, .npz, .mat; `specimen_file`).
        ``FILE.py:NAME``, or an object in Python, is a specimen of your own (`mechanics.coupled`), ``udp:HOST:PORT`` one
        in another process (`mechanics.remote_specimen`).
        position [m] and rpy [rad] place its root or base in the platen's top-face frame (axes of the platen, origin C).
        locked: one rigid body. Free joints join the Pinocchio model; modes run in both engines.
        """
        named = isinstance(name_or_path, str | Path)
        if not named or is_python(str(name_or_path)) or str(name_or_path).startswith(REMOTE):
            if locked:
                raise ParameterError(f"{name_or_path}: a program has no joints or modes to lock (--locked)")
            source = str(name_or_path) if named else name_or_path
            return replace(self, specimen=load_user_specimen(source, position, rpy))
        return replace(self, specimen=Specimen(find_specimen(name_or_path), position, rpy, locked))

    def without_specimen(self) -> "Machine":
        """Return a copy with the bare table."""
        return replace(self, specimen=None)


def load_machine(
    name_or_path: str | Path = "lhpost6", override: Mapping[str, Any] | str | Path | None = None
) -> Machine:
    """Read a machine file by shipped name or path, with an optional override file or mapping.

    Raises ParameterError that names file and key for a missing, unknown, ill-dimensioned or impossible value.
    """
    parameters = load_parameters(name_or_path)
    if override is not None:
        parameters = override_parameters(parameters, override)
    return build_machine(parameters)


def build_machine(
    parameters: Parameters,
    added_effects: tuple[Effect, ...] = (),
    specimen: Specimen | None = None,
    size: tuple[int, ...] | None = None,
) -> Machine:
    """Give typed objects to a flat mapping of quantities; raises ParameterError."""
    words = parameters.words
    options = {
        "motion": _word(parameters, "machine.motion", MOTIONS),
        "thrust": _word(parameters, "machine.thrust", ("report", "normal")),
        "bodies": _word(parameters, "machine.bodies", BODIES, BODIES[0]),
        "flow_reading": _word(parameters, "machine.flow_reading", FLOW_READINGS, FLOW_READINGS[0]),
        "valve_ports": _word(parameters, "machine.valve_ports", VALVE_PORTS, VALVE_PORTS[0]),
    }
    components = [path.split(".")[0] for path in words if path.count(".") == 1 and path.endswith(".kind")]
    kinds = {str(words[f"{c}.kind"]) for c in components}
    floors = [path.split(".")[0] for path in words if path.count(".") == 1 and path.endswith(".along")]
    check_names(parameters, components, kinds, floors)
    actuators, struts = [], []
    for name in components:
        kind = str(words[f"{name}.kind"])
        role = _word(parameters, f"{kind}.role", ("actuator", "strut"))
        if role == "strut":
            struts.append(build_section(Strut, parameters, (name, kind), name=name, kind=kind))
            continue
        actuator = build_section(
            Actuator,
            parameters,
            (name, kind),
            name=name,
            kind=kind,
            mount=_word(parameters, f"{kind}.mount", ("swivel", "bearing")),
            valve=_word(parameters, f"{kind}.valve", ("4-way", "3-way")),
            valves=_count(parameters, name, kind),
        )
        check_actuator(actuator, parameters.origin)
        actuators.append(actuator)
    if not actuators:
        raise ParameterError(f"{parameters.origin}: no actuator; give at least one [component.NAME] of role actuator")
    machine = Machine(
        name=str(words.get("machine.name", "unnamed")),
        title=str(words.get("machine.title", "")),
        controller=str(words.get("machine.controller", "")),
        sensors=str(words.get("machine.sensors", "")),
        **options,
        platen=build_section(Platen, parameters, ("platen",)),
        hydraulics=build_section(Hydraulics, parameters, ("hydraulics",)),
        actuators=tuple(actuators),
        struts=tuple(struts),
        floors=tuple(
            build_section(Floor, parameters, (name,), name=name, along=_word(parameters, f"{name}.along", tuple("xyz")))
            for name in floors
        ),
        accelerometers=accelerometers_of(parameters),
        limits=build_section(Limits, parameters, ("limits",)),
        power_supply=build_section(PowerSupply, parameters, ("power_supply",)),
        parameters=parameters,
        size=size,
        own_effects=added_effects,
        specimen=specimen,
    )
    check_machine(machine)
    try:
        _ = machine.added_effects  # raises for an effect that cannot be
    except (ParameterError, UnknownNameError) as error:
        raise ParameterError(f"{parameters.origin}: {error}") from None
    return machine


def _word(parameters: Parameters, path: str, valid: tuple[str, ...], default: str | None = None) -> str:
    word = parameters.words.get(path, default)
    if word not in valid:
        state = "is missing" if word is None else f"= {word!r}"
        raise ParameterError(f"{parameters.origin}: {path} {state}; it should be one of {', '.join(valid)}")
    return str(word)


def _count(parameters: Parameters, component: str, kind: str) -> int:
    path = f"{component}.valves" if f"{component}.valves" in parameters.words else f"{kind}.valves"
    count = parameters.words.get(path, 1)
    if not isinstance(count, int) or count < 1:
        raise ParameterError(
            f"{parameters.origin}: {path} = {count!r}; it should be a whole number of open servovalves"
        )
    return count
