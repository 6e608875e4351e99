"""What a curve is asked for, checked before anything is meshed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from fenicsmech.checks import finite
from fenicsmech.equilibrium import Control, DisplacementControl, LoadControl
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import Configuration, Drive, Force, Leader, Mechanism, Motor


@dataclass(frozen=True)
class CurveRequest:
    """A load–displacement curve to be computed.

    Attributes:
        part: the force that changes, or the motors that move.
        controls: samples of the force, as loads or as displacements counted from the unloaded configuration; none if
            the curve is followed.
        configuration: motor positions; where motors that move start from.
        others: constant magnitudes of other forces.
    """

    part: Leader
    controls: tuple[Control, ...]
    configuration: Configuration
    others: tuple[tuple[Force, float], ...]


def read_request(
    mechanism: Mechanism,
    force: Force,
    *,
    forces: Sequence[float] | None,
    displacements: Sequence[float] | None,
    configuration: Configuration,
    others: Mapping[Force, float] | None,
) -> CurveRequest:
    """The request for samples of a curve, if it makes sense for ``mechanism``.

    Raises:
        DescriptionError: a force or motor of another mechanism, a force both led and constant, neither or both of
            forces and displacements, no samples, or numbers that are not finite.
    """
    _check_force(mechanism, force)
    constant = _read_others(mechanism, force, others)
    _check_configuration(mechanism, configuration)
    if (forces is None) == (displacements is None):
        raise DescriptionError(f"{force.name!r}", "give either forces or displacements", "Pass one of the two")
    kind, samples = (DisplacementControl, displacements) if forces is None else (LoadControl, forces)
    if isinstance(samples, str) or not isinstance(samples, Iterable):
        raise DescriptionError(f"{force.name!r}", f"its samples are {samples!r}", "Give a list of numbers")
    controls = tuple(kind(finite(f"sample of {force.name!r}", value)) for value in samples)
    if not controls:
        raise DescriptionError(f"{force.name!r}", "there are no samples", "Give at least one force or displacement")
    return CurveRequest(force, controls, configuration, constant)


def read_path(
    mechanism: Mechanism, part: Leader, *, configuration: Configuration, others: Mapping[Force, float] | None
) -> CurveRequest:
    """The request for a curve that is followed, if it makes sense for ``mechanism``.

    Raises:
        DescriptionError: a force or motor of another mechanism, a force both led and constant, or numbers that are not
            finite.
    """
    match part:
        case Motor():
            _check_motors(mechanism, part.name, [part])
        case Drive():
            _check_motors(mechanism, part.name, [motor for motor, _ in part.ratios])
        case _:
            _check_force(mechanism, part)
    constant = _read_others(mechanism, part, others)
    _check_configuration(mechanism, configuration)
    return CurveRequest(part, (), configuration, constant)


def _read_others(
    mechanism: Mechanism, part: Leader, others: Mapping[Force, float] | None
) -> tuple[tuple[Force, float], ...]:
    others = dict(others or {})
    for other in others:
        _check_force(mechanism, other)
    if part in others:
        raise DescriptionError(f"{part.name!r}", "it is led and held constant at once", "Leave it out of others")
    return tuple((other, finite(f"magnitude of {other.name!r}", value)) for other, value in others.items())


def _check_force(mechanism: Mechanism, part: object) -> None:
    if part not in mechanism.forces:
        name = part.name if isinstance(part, Force) else part
        raise DescriptionError(f"{name!r}", f"it is not a force of {mechanism.name!r}", "Add it with force()")


def _check_motors(mechanism: Mechanism, part: str, motors: list[Motor]) -> None:
    for motor in motors:
        if motor not in mechanism.motors:
            raise DescriptionError(
                f"{part!r}", f"{motor.name!r} is not a motor of {mechanism.name!r}", "Add it with motor()"
            )


def _check_configuration(mechanism: Mechanism, configuration: Configuration) -> None:
    if not isinstance(configuration, Configuration):
        raise DescriptionError(
            f"configuration {configuration!r}", "it is not a configuration", "Make one with scene.configuration()"
        )
    for motor, _ in configuration.positions:
        if motor not in mechanism.motors:
            raise DescriptionError(
                f"configuration {configuration.name!r}",
                f"{motor.name!r} is not a motor of {mechanism.name!r}",
                "Make the configuration with this mechanism's scene",
            )
