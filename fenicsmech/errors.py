"""Exceptions: each names the part, shows the offending value and gives the remedy."""

from __future__ import annotations


class FenicsmechError(Exception):
    """Base of the errors of this package.

    Args:
        part: the part concerned, in the user's words ("strip of link 'diagonal'").
        problem: the problem, with the offending value.
        remedy: the way to mend it.
    """

    def __init__(self, part: str, problem: str, remedy: str) -> None:
        self.part, self.problem, self.remedy = part, problem, remedy
        super().__init__(f"{part}: {problem}. {remedy}.")

    def __reduce__(self):
        # errors travel between MPI ranks
        return type(self), (self.part, self.problem, self.remedy)


class DescriptionError(FenicsmechError, ValueError):
    """The description of a mechanism, scene or request contradicts itself or is incomplete."""


class AssemblyError(FenicsmechError):
    """No rigid assembly satisfies the joints at the requested motor positions."""


class MeshingError(FenicsmechError):
    """A link cannot be meshed as described."""


class EquilibriumError(FenicsmechError):
    """No equilibrium was found at the requested load.

    Attributes:
        last: the last converged frame (None if there was none).
        frames: every frame converged before the failure.
    """

    def __init__(self, part: str, problem: str, remedy: str, *, last=None, frames=()) -> None:
        super().__init__(part, problem, remedy)
        self.last, self.frames = last, tuple(frames)
