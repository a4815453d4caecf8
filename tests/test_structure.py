"""How the package hangs together: imports run one way, heavy libraries stay where they belong, laws stand alone."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import lhpost6_pin

PACKAGE = Path(lhpost6_pin.__file__).parent

LAYERS = [
    {
        "",
        "errors",
        "compiled",
        "decimals",
        "names",
        "plain",
        "progress",
        "console",
    },  # "" is the package itself: its version
    {"files"},
    {"laws"},
    {"parameters", "specimen", "signals", "transfer", "distortion"},
    {"schema", "records", "motions", "conditioning", "urdf_numbers"},
    {"components", "inverse", "importing", "sensors"},
    {"law_table", "ports"},
    {"alterations"},
    {"effects"},
    {"library"},
    {"machine"},
    {"machine_toml"},
    {"rigid_body", "platen_steps", "kinematics", "stage_added", "oil", "urdf"},
    {"supply"},
    {"stage", "oil_residuals"},
    {"plant", "schemes"},
    {"pose", "workspace", "specimen_joints"},
    {"alignment", "fusion", "equilibrium", "engine_pinocchio", "bodies"},
    {"specimen_bodies"},
    {"control", "capacity", "linearize", "gas", "sight"},
    {"engine_fused"},
    {"simulate"},
    {"batch", "outputs", "check", "ledger", "running", "drives", "port_path"},
    {"energy", "identify", "margins", "inverse_dynamics", "wrench_residuals"},
    {"residuals", "sensor_pairs"},
    {"consistency", "campaign", "decompose"},
    {"calibration"},
    {"tuning", "iterate", "sine"},
    {"rehearse", "tables", "doctor", "fmi", "link"},
    {"validation"},
    {"discover"},
    {"demo"},
    {"report", "control_tables", "calibration_table", "discovery_table", "results"},
    {"viewer"},
    {"cli"},
]
"""Modules and subpackages, lowest first; one imports only from layers below, or within its own subpackage."""

PINOCCHIO = {
    *(
        "rigid_body",
        "kinematics",
        "plant",
        "equilibrium",
        "engine_pinocchio",
        "linearize",
        "ledger",
        "energy",
    ),  # dynamics
    *("bodies", "specimen_bodies", "viewer.scene", "viewer.live"),  # pictures
}
"""Modules that may import pinocchio."""


def modules() -> Iterator[tuple[str, Path]]:
    """Dotted name within the package, and path, of every module."""
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        yield ".".join(p for p in parts if p != "__init__"), path


MODULES = dict(modules())


def top(name: str) -> str:
    return name.split(".")[0]


def at_type_checking(tree: ast.AST) -> set[ast.AST]:
    """Nodes under `if TYPE_CHECKING:`, which never run."""
    hidden: set[ast.AST] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            hidden |= {inner for statement in node.body for inner in ast.walk(statement)}
    return hidden


def imports(path: Path) -> Iterator[str]:
    """Absolute names that a module imports when it runs, anywhere in it."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    hidden = at_type_checking(tree)
    package = ("lhpost6_pin", *path.relative_to(PACKAGE).parent.parts)
    for node in ast.walk(tree):
        if node in hidden:
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            if node.level == 0:
                base = node.module or ""
            else:
                base = ".".join((*package[: len(package) - node.level + 1], *filter(None, [node.module])))
            yield base
            # `from . import module` names modules, not things in them
            yield from (f"{base}.{alias.name}" for alias in node.names if f"{base}.{alias.name}"[12:] in MODULES)


def inside(path: Path) -> set[str]:
    """Top-level modules of the package that a module imports."""
    own = {n for n in imports(path) if n == "lhpost6_pin" or n.startswith("lhpost6_pin.")}
    return {top(n.removeprefix("lhpost6_pin").removeprefix(".")) for n in own}


def layer_of(name: str) -> int:
    found = [i for i, layer in enumerate(LAYERS) if top(name) in layer]
    assert len(found) == 1, f"{name} has no layer, or two: add it to LAYERS where its imports allow"
    return found[0]


@pytest.mark.parametrize("name", MODULES)
def test_imports_run_one_way(name):
    mine = layer_of(name)
    for other in inside(MODULES[name]) - {top(name)}:
        assert layer_of(other) < mine, f"{name} imports {other}, which is not below it"


def test_layers_name_no_module_that_is_gone():
    assert set().union(*LAYERS) <= {top(n) for n in MODULES} | {""}


@pytest.mark.parametrize("name", MODULES)
def test_pinocchio_is_imported_only_where_the_rigid_body_lives(name):
    uses = any(top(n) == "pinocchio" for n in imports(MODULES[name]))
    assert not uses or name in PINOCCHIO


@pytest.mark.parametrize("name", MODULES)
def test_the_library_prints_nothing(name):
    tree = ast.parse(MODULES[name].read_text(encoding="utf-8"))
    calls = [n for n in ast.walk(tree) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)]
    assert "print" not in [c.func.id for c in calls]


@pytest.mark.parametrize("name", [n for n in MODULES if n.startswith("laws.")])
def test_laws_know_nothing_but_numbers(name):
    allowed = ("math", "numpy", "lhpost6_pin.compiled", "lhpost6_pin.laws")
    for imported in imports(MODULES[name]):
        assert imported.startswith(allowed), f"{name} imports {imported}"


@pytest.mark.parametrize("name", [n for n, path in MODULES.items() if path.name != "__init__.py"])
def test_modules_list_what_they_export(name):
    tree = ast.parse(MODULES[name].read_text(encoding="utf-8"))
    targets = [t.id for n in tree.body if isinstance(n, ast.Assign) for t in n.targets if isinstance(t, ast.Name)]
    assert "__all__" in targets
