"""The end of an optimisation: its equilibria verified, its outcome as plain data."""

from __future__ import annotations

from collections.abc import Sequence

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


def verify(simulation: Simulation, targets: Sequence[Target], followed: np.ndarray) -> tuple[np.ndarray, bool]:
    """Displacements on the paths from zero load, which is where a user will find them (collective).

    Args:
        simulation: has the shapes of the optimum.
        targets: what was wanted.
        followed: displacements of the equilibria that were followed from design to design, (targets,).

    Returns:
        The displacements from zero load, (targets,), or ``followed`` if one of them is not reached; and whether both
        are the same. If not, it is logged.
    """
    try:
        traced = TargetEquilibria(simulation, targets).trace()
    except Infeasible as failure:
        _log.warning("loaded from zero, the optimum does not reach all its targets: %s", failure)
        return followed, False
    verified = np.array([sample.displacement for sample in traced.samples])
    different = np.flatnonzero(np.abs(verified - followed) > _SAME * target_scales(targets))
    for index in different:
        _log.warning(
            "target %d of the optimum: %.6g when loaded from zero, %.6g when followed from the drawn design",
            index + 1,
            verified[index],
            followed[index],
        )
    return verified, len(different) == 0


def target_results(targets: Sequence[Target], started: np.ndarray, reached: np.ndarray) -> tuple[TargetResult, ...]:
    """How far each target was reached, from displacements at the start and at the end, (targets,) each."""
    return tuple(
        TargetResult(
            force_name=target.force_part.name,
            configuration=target.configuration.name,
            force=target.force,
            wanted=target.displacement,
            started=float(start),
            reached=float(there),
            error=float(error),
        )
        for target, start, there, error in zip(targets, started, reached, target_errors(targets, reached), strict=True)
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
