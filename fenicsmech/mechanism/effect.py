"""What a scene lists under ``effects``: what acts on a mechanism beside its links, joints and forces.

    Π = E_int + s · (Σ link energies + Σ pose potentials) + Σ potentials that hold − loads

The load factor s grows from 0 to 1 before the controlled force does, as that of the constant loads. What holds the
mechanism, as the stiffness of a spring does, acts from the start: without it equilibria on the way need not exist.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import fields

from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism.mechanism import Mechanism
from fenicsmech.mechanism.parts import Joint, Link


class Effect(ABC):
    """Something that acts on a mechanism; a frozen dataclass derived from this one, in a file of its own.

    It overrides those hooks that it needs; each is nothing by default, and what is nothing costs nothing: no form, no
    unknown, no entry of a matrix. The arguments of hooks are objects of the layers above.

    Attributes:
        faces: ``Faces``, the parts of links' boundaries that ``link_energy`` integrates over.
    """

    faces = ()

    @abstractmethod
    def explain(self) -> str:
        """What is simulated, in one plain sentence without a full stop."""

    def check(self, mechanism: Mechanism, dim: int) -> None:
        """Refuses what makes no sense for ``mechanism`` in ``dim`` dimensions; by default, parts of another mechanism.

        Raises:
            DescriptionError: saying which part, and the remedy.
        """
        for field in fields(self):
            part = getattr(self, field.name)
            if isinstance(part, Link | Joint) and part not in (*mechanism.links, *mechanism.joints):
                kind = "joint" if isinstance(part, Joint) else "link"
                raise DescriptionError(
                    f"effect {type(self).__name__}",
                    f"{part.name!r} is no {kind} of {mechanism.name!r}",
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
            DescriptionError: it makes no sense in the ``ElasticModel``.
        """
        return {}
