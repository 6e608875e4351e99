"""What the samples of a curve leave open, and error estimates are of."""

from enum import Enum


class Goal(Enum):
    """A displacement where forces are prescribed, a force where displacements are."""

    DISPLACEMENT = "displacement"
    FORCE = "force"
