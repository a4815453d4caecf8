"""How the package hangs together: imports run one way, heavy libraries stay where they belong, laws stand alone."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import lhpost6_pin

PACKAGE = Path(lhpost6_pin.__file__).parent

ORDER = ["core", "laws", "motions", "effects", "machine", "mechanics", "data", "control", "simulation"]
ORDER += ["tuning", "interfaces", "identification", "discovery", "studies", "show", "panel", "cli"]
"""The folders: one imports only from those before it. Imports for types alone count."""

PINOCCHIO = {
    *("mechanics.rigid_body", "mechanics.specimen_mount", "mechanics.kinematics", "mechanics.plant"),
    *("mechanics.equilibrium", "mechanics.derivatives", "mechanics.leg_model", "mechanics.linearize"),
    *("mechanics.instant", "mechanics.payload", "mechanics.interface_wrench", "mechanics.specimen_modes"),
    *("mechanics.coupled", "mechanics.coupled_maker", "mechanics.interface", "mechanics.opensees"),
    "mechanics.remote_specimen",
    *("simulation.engine_pinocchio", "simulation.ledger", "simulation.energy", "simulation.specimen_response"),
    *("simulation.coupling", "simulation.running", "identification.decompose.interface"),
    *("show.bodies", "show.viewer.scene", "show.viewer.live"),
}
"""Modules that may import pinocchio."""

MODULES = {".".join(p.relative_to(PACKAGE).with_suffix("").parts): p for p in sorted(PACKAGE.rglob("*.py"))}
MODULES = {name.removesuffix("__init__").rstrip("."): path for name, path in MODULES.items()}
TREES = {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in MODULES.items()}


def imports(name: str) -> Iterator[str]:
    """Absolute names that a module imports, anywhere in it; the package's own without its name."""
    package = MODULES[name].relative_to(PACKAGE).parent.parts
    for node in ast.walk(TREES[name]):
        if isinstance(node, ast.Import):
            yield from (alias.name.removeprefix("lhpost6_pin.") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else ()
            base = ".".join([*above, *filter(None, [node.module])]).removeprefix("lhpost6_pin.")
            modules = [f"{base}.{alias.name}".lstrip(".") for alias in node.names]
            yield from {module if module in MODULES else base for module in modules}


OWN = {name: {i for i in imports(name) if i in MODULES and i} for name in MODULES}


def test_folders_import_only_from_those_before_them():
    place = {folder: i for i, folder in enumerate(ORDER)}
    folders = {name: place[name.split(".")[0]] for name in MODULES if name}  # KeyError: a module outside the folders
    upward = {name: [i for i in OWN[name] if folders[i] > folders[name]] for name in folders}
    assert not {name: found for name, found in upward.items() if found}


def test_no_import_runs_in_a_circle():
    tuple(TopologicalSorter({name: found - {name} for name, found in OWN.items()}).static_order())


def test_pinocchio_is_imported_only_where_the_rigid_body_lives():
    assert {name for name in MODULES if "pinocchio" in imports(name)} <= PINOCCHIO


def test_the_library_prints_nothing():
    calls = {name: [n.func for n in ast.walk(tree) if isinstance(n, ast.Call)] for name, tree in TREES.items()}
    assert not [
        name for name, found in calls.items() if any(isinstance(f, ast.Name) and f.id == "print" for f in found)
    ]


def test_laws_know_nothing_but_numbers_and_modules_list_what_they_export():
    allowed = ("math", "numpy", "typing", "functools", "core.compiled", "laws")
    assert not [
        (name, i) for name in MODULES if name.startswith("laws.") for i in imports(name) if not i.startswith(allowed)
    ]
    exports = {name for name, tree in TREES.items() if any("__all__" in ast.unparse(n) for n in tree.body)}
    assert not [name for name, path in MODULES.items() if name not in exports and path.name != "__init__.py"]


def functions() -> Iterator[tuple[str, ast.FunctionDef]]:
    """Every function with the module that it is in."""
    for name, tree in TREES.items():
        yield from ((name, node) for node in ast.walk(tree) if isinstance(node, ast.FunctionDef))


def decorators(function: ast.FunctionDef) -> str:
    return " ".join(map(ast.unparse, function.decorator_list))


def test_no_function_takes_a_list_of_arguments_that_nobody_can_follow():
    """At most 12, and 8 by place but in compiled code; each option of a command is one."""
    long = []
    for name, function in functions():
        if name.startswith("cli.") and "command" in decorators(function):
            continue
        given = function.args
        by_place = len(given.posonlyargs + given.args)
        most = 12 if "compiled" in decorators(function) else 8
        if by_place > most or by_place + len(given.kwonlyargs) > 12:
            long.append(f"{name}.{function.name}: {by_place} by place, {len(given.kwonlyargs)} by name")
    assert not long


def test_no_module_is_longer_than_a_reader_s_patience():
    lengths = {name: len(path.read_text(encoding="utf-8").splitlines()) for name, path in MODULES.items()}
    assert not {name: length for name, length in lengths.items() if length > 350}


def test_no_number_of_a_law_is_read_by_its_place():
    places = [
        f"{name}: {ast.unparse(node)}"
        for name, tree in TREES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Subscript) and re.search(r"\bp('\])?$", ast.unparse(node.value))
        if any(isinstance(part, ast.Constant) and isinstance(part.value, int) for part in ast.walk(node.slice))
    ]
    assert not places


def test_no_function_without_reference_counts_returns_an_array():
    """What `compiled_inline` returns is numbers or views without owner: an array could be freed while in use."""
    found = []
    for name, function in functions():
        if decorators(function) != "compiled_inline":
            continue
        nodes = list(ast.walk(function))
        arrays = {ast.unparse(n.value) for n in nodes if isinstance(n, ast.Subscript)}
        arrays |= {ast.unparse(n.value) for n in nodes if isinstance(n, ast.Attribute) and n.attr in ("size", "shape")}
        given = [n.value for n in nodes if isinstance(n, ast.Return) and n.value]
        parts = [e for value in given for e in (value.elts if isinstance(value, ast.Tuple) else [value])]
        owned = re.compile(r"(?<!table_)(?<!array_)view\(")
        found += [f"{name}.{function.name}" for e in map(ast.unparse, parts) if e in arrays or owned.search(e)]
    assert not found


def test_what_a_script_needs_is_importable_from_the_top_and_loaded_where_it_is_used():
    assert set(lhpost6_pin.__all__) == set(lhpost6_pin._MODULES) <= set(dir(lhpost6_pin))
    for name in lhpost6_pin.__all__:
        assert callable(getattr(lhpost6_pin, name))
    assert not hasattr(lhpost6_pin, "load_machines")
    code = "import sys, lhpost6_pin; print({'numpy', 'xarray', 'numba', 'pinocchio'} & {*sys.modules})"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "set()"


def test_what_only_records_need_is_loaded_while_the_table_is_simulated():
    """A third of a second, which a run with the fused engine saves."""
    code = """
import sys
from lhpost6_pin.cli.rehearse import run
from lhpost6_pin.control import inverse
from lhpost6_pin.motions import find_motion
from lhpost6_pin.simulation import compile_ahead, rehearse
find_motion("ridgecrest")
print({"xarray", "pandas", "h5py", "h5netcdf"} & {*sys.modules})
"""
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "set()"
