"""The package's public names: what its signatures ask for is among them."""

from __future__ import annotations

import dataclasses
import inspect
import re
import typing
from collections.abc import Callable, Iterator
from pathlib import Path

import fenicsmech as fm

PUBLIC = [getattr(fm, name) for name in fm.__all__]

# Classes that methods return for the package's own layers, or hand to solvers, optimisers and regularisers, which
# read attributes of it and never make one.
INNER = {
    "ActiveSet",
    "Adjoint",
    "Body",
    "Bounds",
    "Clock",
    "CurveRequest",
    "Discretisation",
    "ElasticBody",
    "Equilibrium",
    "Estimates",
    "Spin",
    "InterfaceMap",
    "Iterate",
    "JointSystem",
    "Problem",
    "LinearSolver",
    "Linearisation",
    "MechanismModel",
    "NewtonSolver",
    "OneSided",
    "Panel",
    "ParametricShape",
    "PathPlane",
    "PointLoad",
    "PowerSums",
    "Quadratic",
    "Residual",
    "RigidSpace",
    "Stability",
    "Start",
    "Step",
    "StressRecovery",
    "Trial",
    "TurningLink",
}


def hints(public: type | Callable) -> Iterator[object]:
    """Annotations of a function, or of the fields, the constructor and the public methods of a class."""
    functions = [public]
    if inspect.isclass(public):
        members = [each for name, each in inspect.getmembers(public) if not name.startswith("_")]
        functions = [each.fget if isinstance(each, property) else each for each in members]
        if dataclasses.is_dataclass(public):
            own = typing.get_type_hints(public)
            yield from (own[field.name] for field in dataclasses.fields(public) if not field.name.startswith("_"))
        else:
            functions.append(public.__init__)
    for function in functions:
        if inspect.isfunction(function) and function.__module__.startswith("fenicsmech"):
            yield from typing.get_type_hints(function).values()


def classes(hint: object) -> Iterator[type]:
    """The package's classes in an annotation."""
    inner = typing.get_args(hint) if not isinstance(hint, list) else hint
    if not inner and inspect.isclass(hint) and hint.__module__.startswith("fenicsmech"):
        yield hint
    for each in inner:
        yield from classes(each)


def test_classes_in_signatures_are_public():
    named = {found for public in PUBLIC for hint in hints(public) for found in classes(hint)}
    assert {found.__name__ for found in named if found not in PUBLIC} == INNER


def test_every_public_name_stands_under_one_theme_of_the_api_page():
    page = (Path(__file__).parents[1] / "docs" / "api.md").read_text()
    assert sorted(re.findall(r"^\.\. (?:auto\w+|py:data):: (\w+)$", page, flags=re.M)) == sorted(fm.__all__)
