"""The end of an optimisation: its equilibria verified, its outcome as plain data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.design.equilibria import TargetEquilibria
from fenicsmech.design.handle_optimum import Placement
from fenicsmech.design.objective import target_errors, target_scales
from fenicsmech.design.optimisers import Infeasible
from fenicsmech.design.rest_shape import RestShape
from fenicsmech.design.result import LinkDesign, TargetResult
from fenicsmech.design.spline_design import Target
from fenicsmech.log import logger
from fenicsmech.simulation import Simulation

_log = logger(__name__)

_SAME = 1e-6  # relative difference between displacements of one equilibrium


@dataclass(frozen=True, eq=False)
class Verification:
    """What a user will find when loading the optimum from zero.

    Attributes:
        displacements: of the targets' points, (targets,); as followed, where one of them is not reached.
        same: whether these are the ones that were followed.
        errors: what finer elements would add to them, (targets,); None if one of them is not reached.
    """

    displacements: np.ndarray
    same: bool
    errors: np.ndarray | None


def verify(simulation: Simulation, targets: Sequence[Target], followed: np.ndarray) -> Verification:
    """Loads the targets from zero, which is what a user will do, and logs where that leads elsewhere (collective).

    Args:
        simulation: has the shapes of the optimum.
        targets: what was wanted.
        followed: displacements of the equilibria that were followed from design to design, (targets,).
    """
    equilibria = TargetEquilibria(simulation, targets)
    try:
        traced = equilibria.trace()
    except Infeasible as failure:
        _log.warning("loaded from zero, the optimum does not reach all its targets: %s", failure)
        return Verification(followed, False, None)
    verified = np.array([sample.displacement for sample in traced.samples])
    different = np.flatnonzero(np.abs(verified - followed) > _SAME * target_scales(targets))
    for index in different:
        _log.warning(
            "target %d of the optimum: %.6g when loaded from zero, %.6g when followed from the drawn design",
            index + 1,
            verified[index],
            followed[index],
        )
    return Verification(verified, len(different) == 0, equilibria.errors(traced))


def target_results(
    targets: Sequence[Target], started: np.ndarray, verification: Verification
) -> tuple[TargetResult, ...]:
    """How far each target was reached, from displacements at the start, (targets,), and at the end."""
    reached, finer = verification.displacements, verification.errors
    errors = target_errors(targets, reached)
    return tuple(
        TargetResult(
            force_name=target.force_part.name,
            configuration=target.configuration.name,
            force=target.force,
            wanted=target.displacement,
            started=float(started[k]),
            reached=float(reached[k]),
            error=float(errors[k]),
            finer_elements_add=None if finer is None else float(finer[k]),
        )
        for k, target in enumerate(targets)
    )


def link_designs(rest: RestShape, placement: Placement) -> tuple[LinkDesign, ...]:
    """The shapes of all links at a placement."""
    designs = []
    for link, handles in zip(rest.links, rest.handles(placement), strict=True):
        own = placement.p[link.place]
        thickness, bend = link.thickness * link.samples.thickness(own), link.samples.curvature(own)
        designs.append(
            LinkDesign(
                name=link.name,
                parameters=tuple(own.tolist()),
                handles=tuple(handles.tolist()),
                controls=tuple(tuple(map(tuple, point)) for point in link.spline.controls_at(own).tolist()),
                thickness=(float(thickness.min()), float(thickness.max())),
                bend=float(np.abs(bend).max(initial=0.0)),
            )
        )
    return tuple(designs)
