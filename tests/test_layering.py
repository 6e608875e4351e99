"""The layers of the package: every import points down, wherever in a file it stands."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = "fenicsmech"
PACKAGE = Path(__file__).parents[1] / ROOT

# Lowest first: a module may import from its own layer and from those before it.
LAYERS = (
    "errors",
    "laws",
    "polygons",
    "log",
    "symbolic",
    "compat",
    "collective",
    "files",
    "plot",
    "joints",
    "mechanism",
    "meshing",
    "export",
    "multibody",
    "elasticity",
    "effects",
    "equilibrium",
    "continuation",
    "model",
    "quantities",
    "estimates",
    "stress",
    "simulation",
    "design",
    "report",
    "live",
)

# Libraries that belong to a few layers only: descriptions and joints know no elements, only one layer makes meshes,
# only one draws.
RESTRICTED = {
    "dolfinx": {"plot", "joints", "mechanism"},
    "ufl": {"plot", "joints", "mechanism"},
    "petsc4py": {"plot", "joints", "mechanism"},
    "gmsh": set(LAYERS) - {"compat", "meshing", "export"},
    "matplotlib": set(LAYERS) - {"plot"},
}


@cache
def modules() -> dict[str, Path]:
    """Every module of the package by its dotted name; a package stands for its `__init__.py`."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def layer(module: str) -> str | None:
    """The layer of a module of the package, None for the package itself."""
    return module.split(".")[1] if "." in module else None


def imports(module: str, source: str, *, is_package: bool) -> Iterator[tuple[str, int]]:
    """The (dotted name, line) of each import in a module, those inside functions too."""
    home = module.split(".") if is_package else module.split(".")[:-1]
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            start = home[: len(home) - node.level + 1] if node.level else []
            origin = ".".join([*start, *([node.module] if node.module else [])])
            for alias in node.names:
                # "from package import name" names a module if there is one, else something in the package
                full = f"{origin}.{alias.name}"
                yield full if full in modules() or origin == ROOT else origin, node.lineno


def upward_imports(module: str, source: str, *, is_package: bool = False) -> list[str]:
    """Imports of a module against the order of the layers, as readable complaints."""
    own = layer(module)
    complaints = []
    for target, line in imports(module, source, is_package=is_package):
        if target.split(".")[0] != ROOT:
            continue
        theirs = layer(target)
        if theirs not in LAYERS:
            complaints.append(f"{module}:{line} imports {target}, which is in no layer")
        elif LAYERS.index(theirs) > LAYERS.index(own):
            complaints.append(f"{module}:{line} imports {target}: {own} may not know {theirs}")
    return complaints


def layered_modules() -> list[str]:
    return [module for module in modules() if layer(module) in LAYERS]


def imports_of(module: str) -> list[tuple[str, int]]:
    path = modules()[module]
    return list(imports(module, path.read_text(), is_package=path.name == "__init__.py"))


def test_every_module_has_a_layer():
    unlisted = {layer(module) for module in modules()} - {None, *LAYERS}
    assert not unlisted, f"add {sorted(unlisted)} to LAYERS, at the place that says what they may import"


@pytest.mark.parametrize("module", layered_modules())
def test_imports_point_down(module):
    path = modules()[module]
    complaints = upward_imports(module, path.read_text(), is_package=path.name == "__init__.py")
    assert not complaints, "\n".join(complaints)


def test_modules_do_not_import_each_other_in_a_circle():
    graph = {
        module: {target for target, _ in imports_of(module) if target in modules()} for module in layered_modules()
    }
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail("imports in a circle: " + " <- ".join(error.args[1]))


@pytest.mark.parametrize("library", RESTRICTED)
def test_libraries_stay_in_their_layers(library):
    complaints = [
        f"{module}:{line} imports {target}"
        for module in layered_modules()
        if layer(module) in RESTRICTED[library]
        for target, line in imports_of(module)
        if target.split(".")[0] == library
    ]
    assert not complaints, "\n".join(complaints)


def deep_imports(path: Path) -> list[str]:
    """The imports of a file that pass by the front door of a folder of the package which is not its own."""
    parts = path.relative_to(PACKAGE.parent).parts
    own = parts[1] if parts[0] == ROOT and len(parts) > 2 else None
    complaints = []
    for node in ast.walk(ast.parse(path.read_text())):
        names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else names
        for name in names:
            first, *rest = name.split(".")
            if first == ROOT and len(rest) > 1 and rest[0] != own:
                complaints.append(f"{path}:{node.lineno} imports {name}")
    return complaints


@pytest.mark.parametrize("folder", [ROOT, "tests", "benchmarks", "demos"])
def test_folders_are_reached_through_their_front_doors(folder):
    complaints = [c for path in sorted((PACKAGE.parent / folder).rglob("*.py")) for c in deep_imports(path)]
    assert not complaints, "\n".join(complaints)


def test_versions_are_distinguished_in_compat_only():
    complaints = [
        f"{module}:{node.lineno} reads __version__"
        for module, path in modules().items()
        if layer(module) != "compat"
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Attribute) and node.attr == "__version__"
    ]
    assert not complaints, "\n".join(complaints)


@pytest.mark.parametrize("module", modules())
def test_every_module_has_a_docstring(module):
    assert ast.get_docstring(ast.parse(modules()[module].read_text())), f"{module} has no docstring"


@pytest.mark.parametrize(
    "source",
    [
        "from fenicsmech.mechanism import Scene",
        "import fenicsmech.mechanism.scene",
        "from ..mechanism import Scene",
        "from .. import mechanism",
        "from fenicsmech import mechanism",
        "from fenicsmech import Scene",
        "import fenicsmech",
        "def late():\n    from fenicsmech.mechanism import Scene",
        "if TYPE_CHECKING:\n    from fenicsmech.mechanism import Scene",
    ],
)
def test_an_upward_import_is_found_however_it_is_written(source):
    assert len(upward_imports("fenicsmech.joints.joint", source)) == 1


@pytest.mark.parametrize(
    "source",
    [
        "import numpy",
        "from fenicsmech import errors",
        "from fenicsmech.errors import AssemblyError",
        "from ..errors import AssemblyError",
        "from .rotations import RIGID_SPACES",
        "from . import rotations",
    ],
)
def test_a_downward_import_is_accepted_however_it_is_written(source):
    assert not upward_imports("fenicsmech.joints.joint", source)
