"""What elements a quarter as wide, and space, make of the last equilibrium of a coarse scene.

That equilibrium is the guess in the finer elements: a few steps of Newton's method lead to theirs. Where they do not,
or a fold lies between, the whole curve is computed there, from zero load.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from unittest.mock import patch

import numpy as np

import fenicsmech as fm
from fenicsmech import model
from fenicsmech.design import Infeasible, SampleEquilibria
from fenicsmech.meshing import LinkMesh, cutting
from fenicsmech.simulation import whole_state

from .blueprint import Blueprint, Built, build
from .draw import length
from .thresholds import THRESHOLDS

_AROUND_PINS = 40  # cells of a link

Shapes = Mapping[fm.FlexibleLink, object]
"""Shapes of links of the mechanism as drawn."""


class Unsolved(Exception):
    """An equilibrium that is not found."""


@dataclass(frozen=True)
class Finer:
    """A value in finer elements, or in space.

    Attributes:
        value: of the curve's unknown.
        error: estimated, of the elements.
    """

    value: float
    error: float


def coarse_curve(scene: Blueprint, shapes: Shapes | None = None) -> tuple[fm.Curve, Built]:
    """The curve of a scene, with some links of other ``shapes``, and what it was made of.

    Raises:
        Unsolved: an equilibrium is not found.
    """
    try:
        built = _built(scene, shapes)
        return built.curve(scene), built
    except fm.FenicsmechError as failure:
        raise Unsolved(f"{type(failure).__name__} in its own elements") from failure


def finer(scene: Blueprint, curve: fm.Curve, levels: int, shapes: Shapes | None = None) -> Finer:
    """The value at the last equilibrium of ``curve`` in a ``scene`` like its own, with triangles cut in four.

    Args:
        scene: that of the curve, of another order or in space.
        curve: in coarse elements.
        levels: how many times triangles are cut; layers in space are cut in two.
        shapes: of links.

    Raises:
        Unsolved: there is no such equilibrium.
        FenicsmechError: the error of its elements cannot be estimated.
    """
    with refined(levels):
        try:
            built = _built(scene, shapes)
        except fm.FenicsmechError as failure:
            raise Unsolved(f"{type(failure).__name__} in finer elements") from failure
        if (found := _continued(scene, curve, built)) is not None:
            return found
        try:
            whole = built.curve(scene)
        except fm.FenicsmechError as failure:
            raise Unsolved(f"{type(failure).__name__} in finer elements") from failure
    if not comparable(curve, whole):
        raise Unsolved("a path of another length")
    return Finer(float(whole.values[-1]), float(whole.error_estimates()[-1]))


def comparable(curve: fm.Curve, other: fm.Curve) -> bool:
    """Whether the last equilibria of both curves belong to the same value of the control."""
    displaced = curve.unknown is fm.Unknown.FORCE
    ends = [c.displacements[-1] if displaced else c.forces[-1] for c in (curve, other)]
    return abs(ends[0] - ends[1]) <= THRESHOLDS.energy * abs(ends[0])


@contextmanager
def refined(levels: int) -> Iterator[None]:
    """Simulations made within have triangles cut in four ``levels`` times, and layers in two."""
    mesh_links, extrude = model.mesh_links, cutting.extrude

    def cut(mesh: LinkMesh) -> LinkMesh:
        for _ in range(levels):
            mesh = mesh.quartered()
        return mesh

    def flat(*arguments) -> list[LinkMesh]:
        return [cut(mesh) if mesh.dim == 2 else mesh for mesh in mesh_links(*arguments)]

    def deep(plan: LinkMesh, depth: float, layers: int, *, half: bool = False) -> LinkMesh:
        return extrude(cut(plan), depth, 2**levels * layers, half=half)

    with patch.object(model, "mesh_links", flat), patch.object(cutting, "extrude", deep):
        yield


def most_unknowns(scene: Blueprint) -> float:
    """About how many displacements the largest of the finer meshes of a coarse scene has."""
    triangles = sum(
        2.0 * max(1.0, link.thickness / link.size) * length(link) / link.size + _AROUND_PINS for link in scene.flexible
    )
    in_plane = 16.0 * triangles * max(scene.order, 2) ** 2  # each has order² / 2 nodes
    in_space = 4.0 * triangles * 2.0 * 5.0 * 3.0  # of order 2 in two layers, whose nodes lie at five heights
    return {"plane-stress": max(in_plane, in_space), "plane-strain": in_plane}.get(scene.space, in_space)


def _continued(scene: Blueprint, curve: fm.Curve, built: Built) -> Finer | None:
    """The value at the equilibrium near the last one of ``curve``; None where that is not found.

    Raises:
        FenicsmechError: the error of its elements cannot be estimated.
    """
    frame, displaced, led = curve.frames[-1], curve.unknown is fm.Unknown.FORCE, len(scene.ratios)
    if displaced and led > 1:
        return None  # samples prescribe the displacement of one force
    parts, ratios = [built.forces[plan.name] for plan in scene.forces], np.array(scene.ratios)
    loads = dict(zip(parts[led:], (plan.magnitude for plan in scene.forces[led:]), strict=True))
    if displaced:
        loads[parts[0]] = fm.at(float(frame.displacement))
        quantities = [fm.ForceMagnitude(parts[0])]
    else:
        loads |= dict(zip(parts, map(float, ratios * frame.force), strict=False))
        quantities = [fm.Displacement(part) for part in parts[:led]]
    sample, guess = fm.Sample(loads, built.configuration), whole_state(curve.discretisation.model, frame.state)
    try:
        equilibria = SampleEquilibria(built.simulation, [fm.Target(own, sample, least=True) for own in quantities])
        found = equilibria.from_other({sample: guess})
    except (Infeasible, fm.FenicsmechError):
        return None
    return Finer(*(float(ratios @ values) for values in (equilibria.values(found), equilibria.errors(found))))


def _built(scene: Blueprint, shapes: Shapes | None) -> Built:
    built = build(scene)
    if shapes:
        own = {built.links[link.name]: shape for link, shape in shapes.items()}
        built.simulation = built.simulation.with_shapes(own)
    return built
