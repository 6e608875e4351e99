"""What a scene lists under ``effects``: the part that descriptions know of."""

from __future__ import annotations

from abc import ABC, abstractmethod

from fenicsmech.mechanism.mechanism import Mechanism


class Effect(ABC):
    """Something that acts on a mechanism beside its links, joints and forces.

    An effect is described by a frozen dataclass. What it does to equilibria it says in the terms of the ``effects``
    layer, one file per effect.
    """

    @abstractmethod
    def check(self, mechanism: Mechanism, dim: int) -> None:
        """Refuses what makes no sense for ``mechanism`` in ``dim`` dimensions.

        Raises:
            DescriptionError: saying which part, and the remedy.
        """

    @abstractmethod
    def explain(self) -> str:
        """What is simulated, in one plain sentence without a full stop."""
