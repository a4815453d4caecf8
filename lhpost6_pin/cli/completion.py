"""Shell completion of names: motions, machines, controllers, ..., from the shipped data.

It runs at every press of the tab key: nothing heavy is imported, and any error means no completion.
"""

from collections.abc import Callable, Iterable

import typer

from ..core.files import models_folder, read_toml, shipped

__all__ = ["complete_motion", "complete_sensors", "completing", "effect_names"]


def completing(names: Callable[[], Iterable[str]]) -> Callable[[str], list[str]]:
    """Function that lists the names beginning with an incomplete word."""

    def complete(incomplete: str) -> list[str]:
        try:
            return [name for name in names() if name.startswith(incomplete)]
        except Exception:  # a traceback in the middle of a command line helps nobody
            return []

    return complete


def effect_names() -> list[str]:
    """Families of the library that a machine can have, without the laws that come with it."""
    tables = (read_toml(path) for path in sorted((models_folder() / "library").glob("*.toml")))
    return [name for table in tables for name, family in table.items() if "sensor" not in family["acts_on"]]


def _motion_names() -> list[str]:
    """Names and aliases of `motions.list_motions`, without the readers and generators that come with it."""
    folder = models_folder() / "ground_motions"
    index, tests = read_toml(folder / "index.toml"), read_toml(folder / "tests.toml")
    tables = (index["records"], index["package"]["records"], index["wanted"])
    records = [x for table in tables for name, entry in table.items() for x in (name, *entry.get("aliases", ()))]
    return list(dict.fromkeys([*records, *(name for name in tests if name != "processing")]))


_motion = completing(_motion_names)

complete_sensors = completing(lambda: shipped("sensors"))
"""Names of shipped sensors files."""


def complete_motion(ctx: typer.Context, incomplete: str) -> list[str]:
    """Motions; after the first word only files are valid, which the shell completes itself."""
    return [] if ctx.params.get("motion") else _motion(incomplete)
