"""Descriptions are plain data: frozen, comparable, hashable, and independent of solvers."""

import ast
import dataclasses
from pathlib import Path

import pytest

import fenicsmech.mechanism
from fenicsmech.mechanism import (
    DRAWN,
    ONYX,
    Arc,
    Disc,
    Line,
    Rectangle,
    Scene,
    gmsh_mesh,
    outline,
    polygon,
    step_file,
    strip,
)

from .parts import parts

PACKAGE = Path(fenicsmech.mechanism.__file__).parents[1]
# UFL is not among them: the law of a material is its energy, written in UFL's symbols
SOLVERS = {"dolfinx", "basix", "ffcx", "petsc4py", "slepc4py", "mpi4py", "gmsh", "matplotlib"}


def described():
    """One of every kind of data."""
    p = parts()
    scene = Scene(p.mechanism, effects=[])
    return [
        p.base,
        p.rod,
        p.shaft,
        p.motor,
        p.mechanism.force(on=p.crank, at=(0.0, 0.0), direction=(1.0, 0.0)),
        p.mechanism.output(on=p.crank, at=(0.0, 0.0), direction=(1.0, 0.0)),
        ONYX,
        ONYX.law,
        DRAWN,
        scene,
        scene.configuration("up", {p.motor: 1.0}),
        Disc(1.0),
        Rectangle(1.0, 2.0),
        Line((0.0, 1.0)),
        Arc((0.0, 1.0), (1.0, 1.0)),
        strip([[0, 0], [1, 0]], thickness=1, depth=1),
        polygon([[0, 0], [1, 0], [0, 1]], depth=1),
        outline([0, 0], [Line([1, 0]), Arc([1, 1], [0, 1])], depth=1),
        step_file("part.step", depth=1),
        gmsh_mesh("part.msh", depth=1),
    ]


EVERY_KIND = pytest.mark.parametrize("data", described(), ids=lambda data: type(data).__name__)


@EVERY_KIND
def test_data_cannot_be_changed(data):
    names = [field.name for field in dataclasses.fields(data)] or ["anything"]
    for name in names:
        with pytest.raises((dataclasses.FrozenInstanceError, TypeError)):
            setattr(data, name, None)


@EVERY_KIND
def test_data_can_be_a_key(data):
    assert {data: 1}[data] == 1


@pytest.mark.parametrize("k", range(len(described())))
def test_equal_descriptions_are_equal_data(k):
    one, other = described()[k], described()[k]
    if isinstance(one, Scene):  # a mechanism is itself and no other, however it is described
        one, other = one.effects, other.effects
    assert one == other
    assert hash(one) == hash(other)


def imported_by(module: Path) -> set[str]:
    """Dotted names of a module's imports, wherever they stand in it."""
    found = set()
    for node in ast.walk(ast.parse(module.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(node.module)
    return found


def file_of(name: str) -> Path:
    """The file of a module of the package."""
    path = PACKAGE.parent.joinpath(*name.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def test_descriptions_import_no_solver_and_no_mesher():
    # by the source: importing one package imports the whole of fenicsmech
    waiting, seen, outside = [file_of("fenicsmech.mechanism")], set(), set()
    while waiting:
        module = waiting.pop()
        seen.add(module)
        for name in imported_by(module):
            if name.split(".")[0] == "fenicsmech":
                waiting += {file_of(name)} - seen
            else:
                outside.add(name.split(".")[0])
    assert len(seen) > 10
    assert not outside & SOLVERS
