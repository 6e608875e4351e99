"""Verification of designs in the parts to be made: their STEP files are remeshed with finer elements, and loaded.

The samples are loaded from zero in elements as large as the optimiser's, where a snap on the way is found; their
equilibria in smaller elements start from those.

Values on the optimiser's mesh differ from those of the part because of the elements, of the outline between the
vertices of the mesh, and of the deformation of the mesh with the design. The difference of both values contains all
three: the part has the outline of the exported file, its mesh has nothing in common with the optimiser's, and
goal-oriented estimates give the error of the part's own mesh.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from fenicsmech.collective import on_one
from fenicsmech.design.equilibria import DesignEquilibria, SampleEquilibria
from fenicsmech.design.optimisers.problem import Infeasible
from fenicsmech.design.result import DesignResult, PartValue, component_values, solid_files
from fenicsmech.design.target import Comparison, Target
from fenicsmech.elasticity import MID_PLANE_SYMMETRIC, SPATIAL
from fenicsmech.errors import DescriptionError, MeshingError, positive
from fenicsmech.export import write_step
from fenicsmech.log import logger
from fenicsmech.mechanism import FlexibleLink, Joint, MaterialPoint, in_dimension, step_file
from fenicsmech.meshing import LinkMesh
from fenicsmech.model import Design, Fidelity, fits
from fenicsmech.multibody import JointChange, PlacedPoint
from fenicsmech.quantities import Sample
from fenicsmech.simulation import Simulation, WholeState

_log = logger(__name__)


def part_simulations(
    simulation: Simulation,
    links: Sequence[FlexibleLink],
    meshes: Sequence[LinkMesh],
    depths: Sequence[float],
    folder: Path,
    finer: float,
    moved: Mapping[Joint, JointChange],
    placed: Mapping[MaterialPoint, PlacedPoint],
    targets: Sequence[Target],
) -> tuple[Simulation, Simulation]:
    """The scene with ``links`` read from the STEP files of their ``meshes``, which this writes to ``folder``.

    Joints are drawn where they are ``moved`` to, and points of links where they are ``placed`` (``placed_points``). In
    space half the depth is meshed where the scene and all ``targets`` allow it: exported links are symmetric.

    Returns:
        Simulations with elements as large as those of ``simulation``, and with ``finer`` ones; nothing is meshed yet.

    Raises:
        DescriptionError: ``finer`` is not positive, or an effect acts on a part of the boundary of a link that a
            predicate of drawn points chooses.
        MeshingError: a part cannot be written or read.
    """
    finer = positive("refinement of the part's mesh", finer)
    for effect in simulation.scene.effects:
        for faces in effect.faces:
            if faces.where is not None and faces.link in links:
                raise DescriptionError(
                    f"verification of {simulation.scene.mechanism.name!r}",
                    f"{effect.explain()}: its predicate is one of drawn points, which the design moves",
                    "Describe the part in a scene of its own, with fm.step_file(…) and a predicate of its points",
                )
    paths = {link: folder / f"{name}.step" for link, name in solid_files(links).items()}
    on_one(simulation.comm, lambda: _write(paths, meshes, depths))
    shapes = {link: step_file(path, depth=depth) for (link, path), depth in zip(paths.items(), depths, strict=True)}
    halved = _halved(simulation, targets, moved)
    coarse, fine = (
        simulation.with_shapes(shapes, fidelity=_finer(simulation, factor, halved), moved=moved, placed=placed)
        for factor in (1.0, finer)
    )
    return coarse, fine


def placed_points(
    simulation: Simulation, links: Collection[FlexibleLink], targets: Sequence[Target]
) -> dict[MaterialPoint, PlacedPoint]:
    """Where the points of ``links`` that forces, outputs and targets refer to are in the shape that the model has.

    Designs move material points X to X + d(X). Averages over regions become sums over the nodes in them, each with its
    share, so that every part of a region keeps its share of a force.
    """
    mechanism = simulation.scene.mechanism
    points = [part.material for part in (*mechanism.forces, *mechanism.outputs)]
    points += [point for target in targets for point in target.quantity.material_points]
    return {point: simulation.model.placed_point(point) for point in dict.fromkeys(points) if point[0] in links}


def _write(paths: Mapping[FlexibleLink, Path], meshes: Sequence[LinkMesh], depths: Sequence[float]) -> None:
    for (link, path), mesh, depth in zip(paths.items(), meshes, depths, strict=True):
        write_step(path, mesh, depth=depth, name=link.name)


def _halved(simulation: Simulation, targets: Sequence[Target], moved: Mapping[Joint, JointChange]) -> bool:
    """Whether half the depth has all that the whole one has: nothing is beside the mid-plane, or moves out of it."""
    if any(np.any(own.shift[2:]) or np.any(own.turn[:-1]) for own in moved.values()):
        return False
    scene = simulation.scene
    points = [part.at for part in (*scene.mechanism.forces, *scene.mechanism.outputs)]
    points += [at for target in targets for _, at, _ in target.quantity.material_points]
    if any(in_dimension(at, 3)[2] for at in points) or not fits(scene, MID_PLANE_SYMMETRIC):
        return False
    try:
        for target in targets:
            target.check(scene, MID_PLANE_SYMMETRIC.mechanism_dim)
    except DescriptionError:
        return False
    return True


def _finer(simulation: Simulation, factor: float, halved: bool) -> Fidelity:
    """The fidelity of a simulation with smaller elements; half the depth of one in space if ``halved``."""
    fidelity = simulation.fidelity
    layers = None if fidelity.layers is None else math.ceil(factor * fidelity.layers)
    sizes = {link: size / factor for link, size in fidelity.sizes.items()}
    if fidelity.model is SPATIAL and halved:
        half = None if layers is None else math.ceil(0.5 * layers)
        return replace(fidelity, model=MID_PLANE_SYMMETRIC, sizes=sizes, layers=half)
    return replace(fidelity, sizes=sizes, layers=layers)


def verified_parts(
    result: DesignResult, coarse: Simulation, fine: Simulation, targets: Sequence[Target], links: Sequence[FlexibleLink]
) -> DesignResult:
    """The result with the values of its targets in the parts; without them, and a warning, where loads are not carried.

    Args:
        result: of ``targets``, in their order.
        coarse: the scene with the links from the exported files, whose equilibria are guesses.
        fine: the same with the elements whose values count.
        targets: of the design problem.
        links: that were exported.

    Raises:
        MeshingError: a part cannot be meshed in the finer elements.
    """
    comparison, known = Comparison(targets, fine.scene.units), [own.quantity.of_part(links) for own in targets]
    measured = [target for target, own in zip(targets, known, strict=True) if own]
    guesses = _guesses(coarse, result, measured)
    with _equilibria(fine, result, measured) as equilibria:
        try:
            solved = _in_finer_elements(equilibria, guesses)
        except Infeasible as failure:
            _log.warning("the exported parts do not reach all targets: %s", failure)
            return result
        found_values, found_errors = equilibria.values(solved), equilibria.errors(solved)
    of_part = np.repeat(known, [target.size for target in targets])
    values, adds = (np.full(comparison.size, np.nan) for _ in range(2))
    values[of_part], adds[of_part] = found_values, found_errors
    errors, found = comparison.errors(values + adds), []
    for own, has, place, error in zip(result.targets, known, comparison.places, errors, strict=True):
        pair = component_values(values[place]), component_values(adds[place])
        found.append(replace(own, part=PartValue(*pair, float(error)) if has else None))
    fidelity = f"{fine.fidelity.model.name}, elements of {fine.fidelity.size_text} {fine.scene.units.length}"
    return replace(result, targets=tuple(found), part_fidelity=fidelity)


@contextmanager
def _equilibria(part: Simulation, result: DesignResult, targets: Sequence[Target]) -> Iterator[SampleEquilibria]:
    """The equilibria of the samples in the parts, whose numbers are those of the result meanwhile."""
    # places of joints are those of the part already
    known = {kind: v for kind, v in result.values(part.scene).items() if not kind.changes(part.linkage.dim)}
    numbers = Design(np.zeros_like(part.model.elastic.shape.x.array), known)
    designed = part.with_design(numbers)
    with part.model.shaped(numbers):
        yield SampleEquilibria(designed, targets)


def _guesses(coarse: Simulation, result: DesignResult, targets: Sequence[Target]) -> dict[Sample, WholeState] | None:
    """Equilibria in the parts, loaded from zero; None where that fails, since finer elements may carry the loads."""
    try:
        with _equilibria(coarse, result, targets) as equilibria:
            return equilibria.whole(equilibria.from_zero())
    except (Infeasible, MeshingError) as failure:
        _log.info("the exported parts have no equilibria in elements of the optimiser's size: %s", failure)
        return None


def _in_finer_elements(equilibria: SampleEquilibria, guesses: Mapping[Sample, WholeState] | None) -> DesignEquilibria:
    """Equilibria from those of coarser elements, or from zero load."""
    if guesses is not None:
        try:
            return equilibria.from_other(guesses)
        except Infeasible as failure:
            _log.info("equilibria in larger elements do not lead to those in smaller ones: %s", failure)
    return equilibria.from_zero()
