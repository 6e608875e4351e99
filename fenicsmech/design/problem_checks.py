"""What a design problem refuses: before anything is meshed, and once its first derivatives are known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fenicsmech.design.spline_design import SplineDesign, Target
from fenicsmech.errors import DescriptionError
from fenicsmech.multibody import assemble
from fenicsmech.simulation import Simulation, read_request

_NO_EFFECT = 1e-9  # relative change of a displacement when a shape changes as much as shapes do: less is rounding


def check_designs(designs: Sequence[SplineDesign]) -> None:
    """Refuses designs that are none, or name a link twice.

    Raises:
        DescriptionError: saying which.
    """
    if not designs:
        raise DescriptionError("design problem", "no link may change", "Name links with SplineDesign(…)")
    for design in designs:
        if not isinstance(design, SplineDesign):
            raise DescriptionError("design problem", f"{design!r} is no design of a link", "Give SplineDesign(…)")
    names = [design.link.name for design in designs]
    for name in names:
        if names.count(name) > 1:
            raise DescriptionError(f"design of link {name!r}", "it is given twice", "Give each link once")


def check_targets(simulation: Simulation, targets: Sequence[Target]) -> None:
    """Refuses targets that are none, or whose force or configuration ``simulation`` does not have.

    Raises:
        DescriptionError: saying which.
        AssemblyError: a configuration does not assemble.
    """
    if not targets:
        raise DescriptionError("design problem", "nothing is wanted", "Give targets=[Target(…), …]")
    for target in targets:
        if not isinstance(target, Target):
            raise DescriptionError("design problem", f"{target!r} is no target", "Give Target(…)")
        read_request(
            simulation.scene.mechanism,
            target.force_part,
            forces=[target.force],
            displacements=None,
            configuration=target.configuration,
            others=None,
        )
        assemble(simulation.linkage, target.configuration)


def check_effects(
    targets: Sequence[Target],
    designs: Sequence[SplineDesign],
    *,
    effects: np.ndarray,
    errors: np.ndarray,
) -> None:
    """Refuses targets that are missed and that no parameter moves: their derivatives cannot be right, or no help.

    Args:
        targets: what is wanted.
        designs: the links that may change.
        effects: relative change of each displacement when one parameter changes as much as counts,
            (targets, parameters).
        errors: relative errors of the displacements, (targets,).

    Raises:
        DescriptionError: naming the first such target.
    """
    names = ", ".join(repr(design.link.name) for design in designs)
    for target, row, error in zip(targets, effects, errors, strict=True):
        if np.abs(row).max(initial=0.0) > _NO_EFFECT or abs(error) <= _NO_EFFECT:
            continue
        if target.force == 0.0:
            reason, remedy = "no force acts", "Give a force that is not zero"
        else:
            reason = f"{names} do not carry the force, or something rigid holds its point"
            remedy = "Let links change that carry it, or give targets of another force"
        raise DescriptionError(
            f"target of {target.force_part.name!r} ({target.force:g} in configuration {target.configuration.name!r})",
            f"its displacement does not depend on the shapes that may change: {reason}",
            remedy,
        )
