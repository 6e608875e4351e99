"""What a design problem refuses before anything is meshed."""

from __future__ import annotations

from collections.abc import Sequence

from fenicsmech.design.spline_design import SplineDesign, Target
from fenicsmech.errors import DescriptionError
from fenicsmech.linkage import assemble
from fenicsmech.simulation import Simulation
from fenicsmech.simulation.request import read_request


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
