"""Requests: the prescribed part of a curve, its samples or ends, and constant loads, checked before anything is meshed.

The prescribed part is a force or motors; both give a curve of force (or torque) over displacement (or position).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.checks import finite
from fenicsmech.equilibrium import Control, DisplacementControl, LoadControl, MotorControl, PointLoad
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import Configuration, Drive, Force, Mechanism, Motor, PrescribedPart, Units
from fenicsmech.model import MechanismModel
from fenicsmech.multibody import JointSystem, body_point


@dataclass(frozen=True)
class CurveRequest:
    """A load–displacement curve to be computed.

    Attributes:
        part: the force that changes, or the motors that move.
        controls: samples of the force, as loads or as displacements counted from the unloaded configuration; none if
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


@dataclass(frozen=True)
class Until:
    """A path ends as soon as it passes one of these values, exactly there, or after so many frames.

    Args:
        displacement: of the point of the prescribed force, along it, counted as on curves; one value or several.
        position: of the prescribed motors, rad or length, counted from the drawing; one value or several.
        force: magnitude of the prescribed force, or torque or force of the motors; one value or several.
        frames: most frames, critical points aside; the path ends there without error.

    Raises:
        DescriptionError: nothing to end at, displacement and position at once, or numbers that make no sense.
    """

    displacement: float | tuple[float, ...] = ()
    force: float | tuple[float, ...] = ()
    position: float | tuple[float, ...] = ()
    frames: int = 500

    def __post_init__(self) -> None:
        for name in ("displacement", "force", "position"):
            values = _several(getattr(self, name))
            object.__setattr__(self, name, tuple(finite(f"{name} where a path ends", value) for value in values))
        if not (self.displacement or self.force or self.position):
            raise DescriptionError("end of a path", "no displacement, position or force is given", "Give one of them")
        if self.displacement and self.position:
            raise DescriptionError(
                "end of a path",
                "it has displacement and position",
                "Give displacement for a force, position for a motor",
            )
        if isinstance(self.frames, bool) or not isinstance(self.frames, int) or self.frames < 2:
            raise DescriptionError("end of a path", f"{self.frames!r} frames", "Give a whole number of at least 2")

    @property
    def travels(self) -> tuple[float, ...]:
        """Displacements or positions, whichever are given."""
        return _several(self.displacement or self.position)

    @property
    def forces(self) -> tuple[float, ...]:
        """Magnitudes of the force."""
        return _several(self.force)


def _several(given: float | Iterable[float]) -> tuple[float, ...]:
    return tuple(given) if isinstance(given, Iterable) and not isinstance(given, str) else (given,)


@dataclass(frozen=True)
class Axis:
    """A quantity and its unit."""

    quantity: str
    unit: str

    @property
    def label(self) -> str:
        """The label of plots and columns."""
        return f"{self.quantity} [{self.unit}]"

    def __call__(self, value: float, digits: int = 3) -> str:
        """A value with its unit."""
        return f"{value:.{digits}g} {self.unit}"


def quantities(part: PrescribedPart) -> tuple[str, str]:
    """Quantities on the axes of the curve of a part."""
    if isinstance(part, Force):
        return "displacement", "force"
    return ("position", "force") if _drive(part).sliding else ("angle", "torque")


def axes(part: PrescribedPart, units: Units) -> tuple[Axis, Axis]:
    """Quantities and units on the axes of the curve of a part."""
    across, up = quantities(part)
    if across == "angle":
        return Axis(across, "rad"), Axis(up, f"{units.force} {units.length}")
    return Axis(across, units.length), Axis(up, units.force)


def followed_control(part: PrescribedPart, joints: JointSystem) -> LoadControl | MotorControl:
    """The control whose value changes along the path of a part."""
    if isinstance(part, Force):
        return LoadControl()
    ratios = dict(_drive(part).ratios)
    return MotorControl(0.0, joints.motor_values(lambda motor: ratios.get(motor, 0.0)))


def controlled_load(part: PrescribedPart, model: MechanismModel) -> PointLoad:
    """The load whose magnitude is an unknown of the equilibrium; for motors one without effect, on a link they move."""
    if isinstance(part, Force):
        return model.point_load(part)
    joints, (motor, _) = model.linkage.joints, _drive(part).ratios[0]
    (connection,) = (connection for connection in joints.connections if connection.motor == motor)
    body = next(body for body in (connection.b, connection.a) if body in joints.columns)
    centre = np.array(joints.bodies[body].centre)
    return PointLoad("no force", body_point(centre, body, centre, joints.space), np.zeros(model.linkage.dim))


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
        DescriptionError: a force or motor of another mechanism, a force both prescribed and constant, neither or both
            of forces and displacements, no samples, or numbers that are not finite.
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
    mechanism: Mechanism,
    part: PrescribedPart,
    *,
    until: object,
    configuration: Configuration,
    others: Mapping[Force, float] | None,
) -> CurveRequest:
    """The request for a curve that is followed, if it makes sense for ``mechanism``.

    Raises:
        DescriptionError: a force or motor of another mechanism, a force both prescribed and constant, an end that the
            curve of the part does not have, or numbers that are not finite.
    """
    if isinstance(part, Motor | Drive):
        for motor, _ in _drive(part).ratios:
            if motor not in mechanism.motors:
                problem = f"{motor.name!r} is not a motor of {mechanism.name!r}"
                raise DescriptionError(f"{part.name!r}", problem, "Add it with motor()")
    else:
        _check_force(mechanism, part)
    constant = _read_others(mechanism, part, others)
    _check_configuration(mechanism, configuration)
    check_until(until, part)
    return CurveRequest(part, (), configuration, constant)


def check_until(until: object, part: PrescribedPart) -> None:
    """Checks that the path of ``part`` can end as in ``until``.

    Raises:
        DescriptionError: it cannot.
    """
    has, lacks = ("displacement", "position") if isinstance(part, Force) else ("position", "displacement")
    if not isinstance(until, Until):
        raise DescriptionError("end of a path", f"{until!r} does not say where", f"Give until=Until({has}=…)")
    if getattr(until, lacks):
        raise DescriptionError(
            "end of a path", f"{part.name!r} is prescribed, which has no {lacks}", f"Give its {has}=…"
        )


def _drive(part: Motor | Drive) -> Drive:
    return Drive(part.name, ((part, 1.0),)) if isinstance(part, Motor) else part


def _read_others(
    mechanism: Mechanism, part: PrescribedPart, others: Mapping[Force, float] | None
) -> tuple[tuple[Force, float], ...]:
    others = dict(others or {})
    for other in others:
        _check_force(mechanism, other)
    if part in others:
        raise DescriptionError(f"{part.name!r}", "it changes and is held constant at once", "Leave it out of others")
    return tuple((other, finite(f"magnitude of {other.name!r}", value)) for other, value in others.items())


def _check_force(mechanism: Mechanism, part: object) -> None:
    if part not in mechanism.forces:
        name = part.name if isinstance(part, Force) else part
        raise DescriptionError(f"{name!r}", f"it is not a force of {mechanism.name!r}", "Add it with force()")


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
