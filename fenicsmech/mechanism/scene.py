"""The scene of a mechanism: the effects simulated, its configurations, and names of units.

Effects add to the potential energy

    Π = E_int + σ · (Σ link energies + Σ pose potentials) + Σ potentials that hold − loads.

The load factor σ grows from 0 to 1 before the controlled force does, as that of the constant loads. What holds the
mechanism, as the stiffness of a spring does, acts from the start: without it equilibria on the way need not exist.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

from fenicsmech.checks import finite
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism.mechanism import Mechanism
from fenicsmech.mechanism.parts import Joint, Link, Motor


@dataclass(frozen=True)
class Effect(ABC):
    """An influence on a mechanism; a frozen dataclass derived from this one, in a file of its own.

    It overrides the hooks that it needs. Each is nothing by default and then adds no form, no unknown and no entry of a
    matrix. The arguments of hooks are objects of the layers above.
    """

    @property
    def faces(self) -> tuple:
        """``Faces``, the parts of links' boundaries that ``link_energy`` integrates over."""
        return ()

    @abstractmethod
    def explain(self) -> str:
        """The effect in one plain sentence without a full stop."""

    def check(self, mechanism: Mechanism, dim: int) -> None:
        """Checks that the effect applies to ``mechanism`` in ``dim`` dimensions; by default, that its parts exist.

        Raises:
            DescriptionError: it does not.
        """
        for field in fields(self):
            part = getattr(self, field.name)
            if isinstance(part, Link | Joint) and part not in (*mechanism.links, *mechanism.joints):
                kind = "joint" if isinstance(part, Joint) else "link"
                raise DescriptionError(
                    f"effect {type(self).__name__}",
                    f"{part.name!r} is not a {kind} of {mechanism.name!r}",
                    f"Name a {kind} of the mechanism",
                )

    def link_energy(self, fields):
        """A potential energy of flexible links in UFL, a form in the ``LinkFields``; None if no link is concerned."""
        return None

    def pose_potentials(self, linkage):
        """A sequence of ``PosePotential``, potentials of the poses of bodies of the ``Linkage``."""
        return ()

    def soften(self, linkage):
        """Compliances c ≥ 0 by row of ``linkage.joints``, whose equation becomes C + c λ = 0; those of effects add."""
        return {}

    def growth(self, model):
        """The ``Stretch`` by flexible link by which it is longer or shorter without strain than drawn.

        Raises:
            DescriptionError: the ``ElasticModel`` does not support it.
        """
        return {}


@dataclass(frozen=True)
class Units:
    """Names of a consistent set of units, stress in force over length squared; for labels only."""

    length: str = "mm"
    force: str = "N"
    stress: str = "MPa"


@dataclass(frozen=True)
class Configuration:
    """Motor positions that stay fixed while loads are applied.

    Attributes:
        name: for messages, plots and tables.
        positions: (motor, position) pairs: angle in rad or travel, counted from the drawn configuration.

    Raises:
        DescriptionError: a position is not finite.
    """

    name: str
    positions: tuple[tuple[Motor, float], ...] = ()

    def __post_init__(self) -> None:
        checked = (
            (motor, finite(f"position of motor {motor.name!r} in configuration {self.name!r}", value))
            for motor, value in self.positions
        )
        object.__setattr__(self, "positions", tuple(checked))

    def __repr__(self) -> str:
        positions = ", ".join(f"{motor.name!r} at {position:g}" for motor, position in self.positions)
        return f"Configuration({self.name!r}: {positions or 'every motor as drawn'})"

    def position(self, motor: Motor) -> float:
        """The position of ``motor``: 0 (as drawn) unless given."""
        return dict(self.positions).get(motor, 0.0)


DRAWN = Configuration("as drawn")
"""Every motor at the position in which the mechanism was drawn."""


@dataclass(frozen=True)
class Scene:
    """A mechanism and the ``effects`` that act on it; ``units`` name the units of plots and tables.

    Raises:
        DescriptionError: ``mechanism`` is not a mechanism, or something listed under ``effects`` is not an effect.
    """

    mechanism: Mechanism
    effects: Sequence[Effect] = ()
    units: Units = Units()

    def __post_init__(self) -> None:
        object.__setattr__(self, "effects", tuple(self.effects))
        if not isinstance(self.mechanism, Mechanism):
            raise DescriptionError("scene", f"{self.mechanism!r} is not a mechanism", "Pass a Mechanism")
        for effect in self.effects:
            if not isinstance(effect, Effect):
                raise DescriptionError("scene", f"{effect!r} is not an effect", "List effects only, as Gravity(…)")

    def __repr__(self) -> str:
        effects = "; ".join(effect.explain() for effect in self.effects)
        return f"Scene({self.mechanism.name!r}: {effects or 'no effects'})"

    def configuration(self, name: str, positions: Mapping[Motor, float]) -> Configuration:
        """A configuration with the given motor positions (rad or length, from the drawn configuration).

        Raises:
            DescriptionError: a motor is not in the mechanism, or its position is not finite.
        """
        for motor in positions:
            if motor not in self.mechanism.motors:
                raise DescriptionError(
                    f"configuration {name!r}",
                    f"{motor.name!r} is not a motor of {self.mechanism.name!r}",
                    "Add it with motor(), and name motors, not joints",
                )
        return Configuration(name, tuple(positions.items()))
