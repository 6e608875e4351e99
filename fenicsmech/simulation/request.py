"""The request for a curve, checked before anything is meshed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from fenicsmech.equilibrium import Control, DisplacementControl, LoadControl
from fenicsmech.errors import DescriptionError, expect, finite
from fenicsmech.mechanism import Configuration, Force, ForceGroup, Mechanism, Motor, PrescribedPart


@dataclass(frozen=True)
class CurveRequest:
    """A load–displacement curve to be computed.

    Attributes:
        part: the force that changes, or the motors that move.
        controls: prescribed values, as loads or as displacements counted from the unloaded configuration; none if
            the curve is followed.
        configuration: motor positions; the initial ones of motors that move.
        others: constant magnitudes of other forces.
    """

    part: PrescribedPart
    controls: tuple[Control, ...]
    configuration: Configuration
    others: tuple[tuple[Force, float], ...]

    @property
    def where(self) -> str:
        """The part and the configuration, for messages."""
        return f"{self.part.name!r} in configuration {self.configuration.name!r}"


def read_request(
    mechanism: Mechanism,
    force: Force | ForceGroup,
    *,
    forces: Sequence[float] | None,
    displacements: Sequence[float] | None,
    configuration: Configuration,
    others: Mapping[Force, float] | None,
) -> CurveRequest:
    """The request for a curve at prescribed values, if it makes sense for ``mechanism``."""
    check_force(mechanism, force)
    constant = read_others(mechanism, force, configuration, others)
    if (forces is None) == (displacements is None):
        given = "both forces and displacements are given" if forces is not None else "no values are given"
        raise DescriptionError(f"{force.name!r}", given, "Give either forces or displacements")
    kind, values = (DisplacementControl, displacements) if forces is None else (LoadControl, forces)
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise DescriptionError(f"{force.name!r}", f"its prescribed values are {values!r}", "Give a list of numbers")
    controls = tuple(kind(finite(f"prescribed value of {force.name!r}", value)) for value in values)
    if not controls:
        raise DescriptionError(f"{force.name!r}", "no value is prescribed", "Give at least one force or displacement")
    return CurveRequest(force, controls, configuration, constant)


def read_others(
    mechanism: Mechanism, part: PrescribedPart, configuration: Configuration, others: Mapping[Force, float] | None
) -> tuple[tuple[Force, float], ...]:
    """The constant forces in addition to ``part``, if they and the configuration are of ``mechanism``."""
    others = dict(others or {})
    for other in others:
        expect(f"other force of {part.name!r}", other, Force, "a force", "Give {force: magnitude, …}, of a group each")
        check_force(mechanism, other)
    if isinstance(part, Force | ForceGroup) and not others.keys().isdisjoint(dict(part.ratios)):
        raise DescriptionError(f"{part.name!r}", "it is to change and to be held constant", "Leave it out of others")
    if not isinstance(configuration, Configuration):
        raise DescriptionError(
            f"configuration {configuration!r}", "it is not a configuration", "Make one with scene.configuration()"
        )
    remedy = "Make the configuration with this mechanism's scene"
    check_motors(mechanism, f"configuration {configuration.name!r}", configuration.positions, remedy)
    return tuple((other, finite(f"magnitude of {other.name!r}", value)) for other, value in others.items())


def check_force(mechanism: Mechanism, part: object) -> None:
    """Raises a DescriptionError unless ``part`` is a force of ``mechanism``, or a group of them."""
    for force in dict(part.ratios) if isinstance(part, Force | ForceGroup) else (part,):
        if force not in mechanism.forces:
            name = force.name if isinstance(force, Force) else force
            raise DescriptionError(f"{name!r}", f"it is not a force of {mechanism.name!r}", "Add it with force()")


def check_motors(mechanism: Mechanism, where: str, motors: Iterable[tuple[Motor, float]], remedy: str) -> None:
    """Raises a DescriptionError unless ``motors`` are motors of ``mechanism``."""
    for motor, _ in motors:
        if motor not in mechanism.motors:
            raise DescriptionError(where, f"{motor.name!r} is not a motor of {mechanism.name!r}", remedy)
