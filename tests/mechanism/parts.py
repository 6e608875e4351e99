"""A mechanism with one of everything, and a check of error messages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import pytest

from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import ONYX, FlexibleLink, Joint, Mechanism, Motor, RigidLink, strip


@dataclass
class Parts:
    """A crank between a base and a flexible rod, driven by a motor."""

    mechanism: Mechanism
    base: RigidLink
    crank: RigidLink
    rod: FlexibleLink
    shaft: Joint
    motor: Motor


def parts() -> Parts:
    """The parts, freshly made."""
    m = Mechanism("press")
    base, crank = m.rigid("base", fixed=True), m.rigid("crank")
    rod = m.flexible("rod", strip([(10.0, 0.0), (40.0, 0.0)], thickness=2.0, depth=10.0), ONYX)
    shaft = m.revolute(base, crank, at=(0.0, 0.0), name="shaft")
    m.revolute(crank, rod, at=(10.0, 0.0), interface_radius=2.0, name="pin")
    return Parts(m, base, crank, rod, shaft, m.motor(shaft, name="drive"))


def assert_refused(action: Callable[[], object], part: str, problem: str, remedy: str) -> None:
    """``action`` raises a DescriptionError with exactly this message."""
    with pytest.raises(DescriptionError) as caught:
        action()
    error = caught.value
    assert (error.part, error.problem, error.remedy) == (part, problem, remedy)
    assert str(error) == f"{part}: {problem}. {remedy}."
