"""What the page cannot edit, as plain data: effects, laws, quantities and other objects of the public API.

An object is the record of its arguments with the name of its class, ``{"is": "Prestrain", "link": …, "stretch": 1.1}``.
Parts of the mechanism stand in it by their names, ``{"part": "links", "name": "leaf"}``, and mappings as pairs. Classes
are those of ``KINDS``, and arguments those of their signatures: plain data from anywhere make nothing else. Functions,
as the predicates that choose parts of a boundary, have no plain data.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from inspect import Parameter, signature
from typing import Any

import numpy as np

from fenicsmech.design import MeshQuality, Number, NumberBounds, ShapeBounds, StayClose, Target, Weighted
from fenicsmech.effects import (
    Contact,
    Cylinder,
    Gravity,
    HalfPlane,
    JointCompliance,
    JointSpring,
    Mass,
    Pressure,
    Prestrain,
    Temperature,
)
from fenicsmech.elasticity import DisplacementFormulation, MixedFormulation, Quadrature
from fenicsmech.errors import DescriptionError
from fenicsmech.laws import (
    Gent,
    IsochoricNeoHookean,
    IsochoricSimoNeoHookean,
    LogarithmicNeoHookean,
    MooneyRivlin,
    NeoHookean,
    Ogden,
    Orthotropic,
    TransverselyIsotropic,
    Yeoh,
)
from fenicsmech.live.schema import LONGEST_NAME, Refused, Schema, Text
from fenicsmech.live.schema import Number as Finite
from fenicsmech.mechanism import (
    DRAWN,
    Arc,
    Basquin,
    Configuration,
    Disc,
    Drive,
    Face,
    FlexibleLink,
    Force,
    Joint,
    Line,
    Material,
    Motor,
    Outline,
    Output,
    Rectangle,
    RigidLink,
    Strength,
    Units,
)
from fenicsmech.quantities import (
    CentrelineLength,
    Component,
    Depth,
    Displacement,
    ForceMagnitude,
    JointAxis,
    JointForce,
    JointMoment,
    JointPosition,
    LargestCurvature,
    LawParameter,
    LeastGap,
    LeastThickness,
    LinkMass,
    LinkVolume,
    Magnitude,
    MotorOffset,
    MotorTorque,
    PrescribedDisplacement,
    Rotation,
    Sample,
    SpringRest,
    SpringStiffness,
    StrainEnergy,
    TemperatureChange,
)
from fenicsmech.stress import (
    InterpolationOptions,
    LargestStrain,
    LargestStress,
    LeastLife,
    LeastSafety,
    RecoveryOptions,
    SingularityOptions,
    StressOptions,
)

EFFECTS = (Gravity, Pressure, Prestrain, Temperature, JointSpring, JointCompliance, Contact)
REGIONS = (Disc, Rectangle, Face)
REGULARISERS = (Weighted, MeshQuality, ShapeBounds, NumberBounds, StayClose)
KINDS: Mapping[str, type] = {
    kind.__name__: kind
    for kind in (
        *EFFECTS, *REGIONS, *REGULARISERS, Mass, HalfPlane, Cylinder,
        Material, Strength, Basquin, Units, NeoHookean, LogarithmicNeoHookean, IsochoricNeoHookean,
        IsochoricSimoNeoHookean, MooneyRivlin, Yeoh, Gent, Ogden, Orthotropic, TransverselyIsotropic,
        Outline, Line, Arc, Drive, Configuration, Sample, PrescribedDisplacement, Target,
        Displacement, Rotation, ForceMagnitude, MotorTorque, JointForce, JointMoment, StrainEnergy, LinkMass,
        LinkVolume, CentrelineLength, LeastThickness, LargestCurvature, LeastGap, LargestStress, LargestStrain,
        LeastSafety, LeastLife, Component, Magnitude, StressOptions, RecoveryOptions, InterpolationOptions,
        SingularityOptions, Number, Depth, LawParameter, SpringStiffness, SpringRest, MotorOffset, JointPosition,
        JointAxis, TemperatureChange, Quadrature, MixedFormulation, DisplacementFormulation,
    )
}  # fmt: skip
"""Classes whose objects are carried, by their names."""

SORTS: Mapping[type, str] = {
    RigidLink: "links",
    FlexibleLink: "links",
    Joint: "joints",
    Motor: "motors",
    Force: "forces",
    Output: "outputs",
}
"""Where parts of a class stand in a mechanism."""

# attributes of arguments with another name
_ATTRIBUTES: Mapping[tuple[type, str], str] = {(JointPosition, "direction"): "vectors", (JointAxis, "about"): "vectors"}
# arguments that stand for others
_SHORT = {(Material, "E"), (Material, "nu"), *((Target, name) for name in ("force", "displacement", "configuration"))}

_DEEPEST = 9  # records and lists in one another
_LONGEST = 1000  # entries of a list


def plain(value: Any) -> Any:
    """A value, an object of one of ``KINDS`` or an argument of one, as plain data.

    Raises:
        DescriptionError: it has none, or a part of it.
    """
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float | np.number):
        if not math.isfinite(value):
            raise DescriptionError("live page", f"{value} is no number of a file", "Give a finite number")
        return value.item() if isinstance(value, np.number) else value
    if type(value) in SORTS:
        return {"part": SORTS[type(value)], "name": value.name}
    if isinstance(value, Mapping):
        return {"pairs": [[plain(key), plain(own)] for key, own in value.items()]}
    if isinstance(value, Sequence | np.ndarray):
        return [plain(own) for own in value]
    if KINDS.get(type(value).__name__) is type(value):
        return {"is": type(value).__name__, **{key: plain(own) for key, own in _arguments(value).items()}}
    what = "a function" if callable(value) else f"an object of {type(value).__name__}"
    remedy = "Describe it with the classes of fenicsmech, without functions of your own"
    raise DescriptionError("live page", f"{what} has no plain data: {value!r}", remedy)


def _arguments(value: Any) -> dict[str, Any]:
    """The arguments of an object that are not the default ones."""
    kind, found = type(value), dict[str, Any]()
    if isinstance(value, Sample):
        drawn = {} if value.configuration == DRAWN else {"configuration": value.configuration}
        return {"loads": dict(value.forces), **drawn}
    for name, parameter in _parameters(kind).items():
        if isinstance(value, Target) and name in ("equals", "at_most", "at_least", "least"):
            if value.relation == name.replace("_", " "):
                found[name] = True if name == "least" else value.wanted if value.vector else value.wanted[0]
            continue
        own = getattr(value, _ATTRIBUTES.get((kind, name), name))
        if (
            parameter.kind is Parameter.VAR_POSITIONAL
            or type(own) is not type(parameter.default)
            or (own != parameter.default)
        ):
            found[name] = own
    return found


def _parameters(kind: type) -> dict[str, Parameter]:
    return {name: own for name, own in signature(kind).parameters.items() if (kind, name) not in _SHORT}


def made(data: Any, parts: Mapping[str, Mapping[str, Any]]) -> Any:
    """The value of plain data.

    Args:
        data: that a ``Carried`` schema has checked.
        parts: of the mechanism by their names, for each of ``SORTS``.

    Raises:
        DescriptionError: it contradicts itself, or an argument is missing.
    """
    if isinstance(data, list):
        return tuple(made(own, parts) for own in data)
    if not isinstance(data, dict):
        return data
    if "is" not in data and "part" in data:
        return parts[data["part"]][data["name"]]
    if "pairs" in data:
        return {made(key, parts): made(own, parts) for key, own in data["pairs"]}
    kind, listed = KINDS[data["is"]], list[Any]()
    named = {name: made(own, parts) for name, own in data.items() if name != "is"}
    several = next((name for name, own in _parameters(kind).items() if own.kind is Parameter.VAR_POSITIONAL), None)
    if several is not None:
        lead = [name for name, own in _parameters(kind).items() if own.kind is Parameter.POSITIONAL_OR_KEYWORD]
        listed = [*(named.pop(name) for name in lead), *named.pop(several)]
    try:
        return kind(*listed, **named)
    except TypeError as error:
        raise DescriptionError(f"carried {data['is']}", str(error), "Open a file saved by the page") from None


def source(data: Any, names: Mapping[str, Mapping[str, str]]) -> str:
    """Python that makes the value of plain data, with the ``names`` of parts, sorted as those of ``made``."""
    if isinstance(data, list):
        return f"({''.join(source(own, names) + ', ' for own in data).rstrip()})"
    if not isinstance(data, dict):
        return repr(data)
    if "is" not in data and "part" in data:
        return names[data["part"]][data["name"]]
    if "pairs" in data:
        return f"{{{', '.join(f'{source(key, names)}: {source(own, names)}' for key, own in data['pairs'])}}}"
    if data["is"] == Weighted.__name__:
        pairs = zip(data["terms"], data["weights"], strict=True)
        several = len(data["terms"]) > 1
        terms = [(source(own, names), "" if several and weight == 1.0 else f"{weight!r} * ") for own, weight in pairs]
        return f"({' + '.join(factor + own for own, factor in terms)})"
    arguments = []
    for name, own in _parameters(KINDS[data["is"]]).items():
        if own.kind is Parameter.VAR_POSITIONAL:
            arguments += [source(part, names) for part in data[name]]
        elif name in data:
            leads = name == "parameter"
            arguments.append(source(data[name], names) if leads else f"{name}={source(data[name], names)}")
    return f"fm.{data['is']}({', '.join(arguments)})"


def references(data: Any) -> Iterator[tuple[str, str]]:
    """Sort and name of all parts that plain data refer to."""
    if isinstance(data, dict) and "is" not in data and "part" in data:
        yield data["part"], data["name"]
    elif isinstance(data, dict | list):
        for own in data.values() if isinstance(data, dict) else data:
            yield from references(own)


@dataclass(frozen=True)
class Carried(Schema):
    """Plain data of an object of one of some classes."""

    kinds: tuple[type, ...]

    def check(self, value, place=""):
        allowed = [kind.__name__ for kind in self.kinds]
        if not isinstance(value, dict) or value.get("is") not in allowed:
            raise Refused(place, f"not one of {', '.join(allowed)}")
        self._check(value, place, _DEEPEST)

    def _check(self, value: Any, place: str, depth: int) -> None:
        if not depth:
            raise Refused(place, f"nested deeper than {_DEEPEST}")
        if isinstance(value, list):
            if len(value) > _LONGEST:
                raise Refused(place, f"a list of {len(value)}, not at most {_LONGEST}")
            for k, own in enumerate(value):
                self._check(own, f"{place}[{k}]", depth - 1)
        elif isinstance(value, dict):
            self._check_record(value, place, depth)
        elif isinstance(value, str):
            Text(200, 0).check(value, place)
        elif value is not None and not isinstance(value, bool):
            Finite(-1e15, 1e15).check(value, place)

    def _check_record(self, value: dict, place: str, depth: int) -> None:
        if set(value) == {"pairs"}:
            pairs = value["pairs"]
            if not isinstance(pairs, list) or not all(isinstance(own, list) and len(own) == 2 for own in pairs):
                raise Refused(place, "not pairs")
            keys = [own[0] for own in pairs]
            if not all(isinstance(key, dict) and "part" in key for key in keys):
                raise Refused(place, "a key that is no part")
            self._check(pairs, place, depth - 1)
        elif set(value) == {"part", "name"}:
            if value["part"] not in SORTS.values():
                raise Refused(place, "there are no such parts")
            Text(LONGEST_NAME).check(value["name"], place)
        else:
            kind = KINDS.get(value["is"]) if isinstance(value.get("is"), str) else None
            if kind is None:
                raise Refused(place, "a record that is no object")
            parameters = _parameters(kind)
            for name, own in value.items():
                if name != "is" and name not in parameters:
                    raise Refused(place, f"{str(name)[:40]!r} is no argument of {kind.__name__}")
                several = name in parameters and parameters[name].kind is Parameter.VAR_POSITIONAL
                if several and not isinstance(own, list):
                    raise Refused(f"{place}.{name}", "not a list")
                self._check(own, f"{place}.{name}".lstrip("."), depth - 1)
            for name, own in parameters.items():
                if name not in value and (own.default is Parameter.empty):
                    raise Refused(place, f"{name} is missing")
            if kind is Weighted and not (
                isinstance(value["terms"], list)
                and isinstance(value["weights"], list)
                and len(value["terms"]) == len(value["weights"])
            ):
                raise Refused(place, "not a weight for each term")
