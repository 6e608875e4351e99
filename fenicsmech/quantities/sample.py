"""Samples: the equilibria at which quantities are evaluated, by simultaneous forces and motor positions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fenicsmech.errors import DescriptionError, expect, finite, set_fields
from fenicsmech.mechanism import DRAWN, Configuration, Force, ForceGroup, Motor


@dataclass(frozen=True)
class PrescribedDisplacement:
    """A prescribed displacement of a force's point in place of the force's magnitude; ``at`` makes it.

    Attributes:
        value: the displacement along the force, from the unloaded configuration; a length.
    """

    value: float


def at(displacement: float) -> PrescribedDisplacement:
    """A prescribed displacement as a value of a ``Sample``; the force follows.

    Args:
        displacement: of the force's point along its direction, from the unloaded configuration; a length.

    Raises:
        DescriptionError: it is not a finite number.
    """
    return PrescribedDisplacement(finite("displacement of a sample", displacement))


class _NoForce(ForceGroup):
    """The part prescribed where nothing but motors and effects acts; groups that users make have forces."""

    def __init__(self) -> None:
        set_fields(self, name="no force", ratios=())


_NO_FORCE = _NoForce()


@dataclass(frozen=True, init=False)
class Sample:
    """An equilibrium: ``Sample({thumb: 4.0, finger: 6.0}, configuration=closed)``, ``Sample({push: at(5.0)})``.

    It is reached from the unloaded configuration: the forces grow together. Where a displacement is prescribed, the
    other forces act first.

    Args:
        loads: magnitudes of forces, or of groups of forces, each of which gets its ratio times the magnitude; ``at(…)``
            for one force prescribes the displacement of its point instead; for motors their positions, angle (rad) or
            length.
        configuration: positions of the other motors.

    Attributes:
        forces: (force, magnitude or prescribed displacement) pairs.
        configuration: positions of all motors.

    Raises:
        DescriptionError: a part is neither a force nor a motor, a number is not finite, a force or motor is given
            twice, two displacements are prescribed, or one of a group.
    """

    forces: tuple[tuple[Force, float | PrescribedDisplacement], ...]
    configuration: Configuration

    def __init__(
        self,
        loads: Mapping[Force | ForceGroup | Motor, float | PrescribedDisplacement] | None = None,
        configuration: Configuration = DRAWN,
    ) -> None:
        forces: list[tuple[Force, float | PrescribedDisplacement]] = []
        positions: list[tuple[Motor, float]] = []
        expect("sample", configuration, Configuration, "a configuration", "Make one with scene.configuration()")
        expect(
            "sample", loads, Mapping | None, "a mapping of loads", "Give Sample({force: magnitude, motor: position})"
        )
        for part, value in dict(loads or {}).items():
            if isinstance(part, Motor):
                positions.append((part, finite(f"position of {part.name!r} in a sample", value)))
            elif isinstance(part, ForceGroup):
                if isinstance(value, PrescribedDisplacement):
                    problem = f"the displacement of {part.name!r} is prescribed, a group of forces"
                    raise DescriptionError("sample", problem, "Prescribe that of one force, or give a magnitude")
                magnitude = finite(f"magnitude of {part.name!r} in a sample", value)
                forces += [(force, ratio * magnitude) for force, ratio in part.ratios]
            elif not isinstance(part, Force):
                raise DescriptionError(
                    "sample", f"{part!r} is neither a force nor a motor", "Give forces and motors of the mechanism"
                )
            elif isinstance(value, PrescribedDisplacement):
                forces.append((part, value))
            else:
                forces.append((part, finite(f"force of a sample for {part.name!r}", value)))
        acting = [force for force, _ in forces]
        for force in acting:
            if acting.count(force) > 1:
                raise DescriptionError("sample", f"{force.name!r} is given twice", "Give each force once")
        given = dict(configuration.positions)
        for motor, _ in positions:
            if motor in given:
                raise DescriptionError("sample", f"{motor.name!r} has two positions", "Give one of them")
        if positions:
            names = [] if configuration == DRAWN else [configuration.name]
            names += [f"{motor.name} at {value:g}" for motor, value in positions]
            configuration = Configuration(", ".join(names), (*configuration.positions, *positions))
        if sum(isinstance(value, PrescribedDisplacement) for _, value in forces) > 1:
            raise DescriptionError("sample", "two displacements are prescribed", "Prescribe one, with at(…)")
        set_fields(self, forces=tuple(forces), configuration=configuration)

    def __str__(self) -> str:
        shown = [
            f"{force.name!r} moved by {value.value:g}"
            if isinstance(value, PrescribedDisplacement)
            else f"{force.name!r} of {value:g}"
            for force, value in self.forces
        ]
        return f"{' and '.join(shown) or 'no force'}, {self.configuration.name}"

    @property
    def moved(self) -> tuple[Force, float] | None:
        """The force whose displacement is prescribed, and that; None if there is none."""
        found = [(force, value.value) for force, value in self.forces if isinstance(value, PrescribedDisplacement)]
        return found[0] if found else None

    @property
    def part(self) -> Force | ForceGroup:
        """The force or forces that are prescribed along the way from the unloaded configuration."""
        if self.moved:
            return self.moved[0]
        acting = self._acting or self.forces[:1]
        if not acting:
            return _NO_FORCE
        if len(acting) == 1:
            return acting[0][0]
        name = " and ".join(force.name for force, _ in acting)
        return ForceGroup(name, tuple((force, magnitude / self.magnitude) for force, magnitude in self._acting))

    @property
    def magnitude(self) -> float:
        """The magnitude of ``part``: of the first force of several."""
        return self._acting[0][1] if self._acting and not self.moved else 0.0

    @property
    def value(self) -> float:
        """The prescribed displacement of ``part``, or its magnitude."""
        return self.moved[1] if self.moved else self.magnitude

    @property
    def others(self) -> tuple[tuple[Force, float], ...]:
        """Forces that act before the displacement is prescribed."""
        return self._acting if self.moved else ()

    @property
    def _acting(self) -> tuple[tuple[Force, float], ...]:
        """Forces of given magnitude, except those of magnitude zero."""
        return tuple((force, value) for force, value in self.forces if isinstance(value, float) and value)
