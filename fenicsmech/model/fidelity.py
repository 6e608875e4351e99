"""Fidelity: the elastic model, the elements and the formulation that a scene is computed with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fenicsmech.checks import positive
from fenicsmech.elasticity import (
    MID_PLANE_SYMMETRIC,
    PLANE_STRAIN,
    PLANE_STRESS,
    SPATIAL,
    ElasticModel,
    Formulation,
    Quadrature,
)
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import FlexibleLink, Scene, validate
from fenicsmech.meshing import LEAST_SEGMENTS

SPACES = {model.name: model for model in (SPATIAL, MID_PLANE_SYMMETRIC, PLANE_STRESS, PLANE_STRAIN)}
"""Names of the elastic models, as users type them."""


@dataclass(frozen=True)
class Fidelity:
    """Elastic model, elements and formulation of a simulation.

    Attributes:
        model: 3D, whole or half, plane strain or plane stress.
        order: degree of the displacement field.
        sizes: element size per flexible link.
        quadrature: quadrature degree.
        formulation: the criterion for links in the u–p (mixed) formulation.
        layers: through the depth, or through half of it where half is meshed; None: chosen from depth and size.
        segments: around a pin, at least.
    """

    model: ElasticModel
    order: int
    sizes: Mapping[FlexibleLink, float]
    quadrature: Quadrature
    formulation: Formulation
    layers: int | None = None
    segments: int = LEAST_SEGMENTS


def read_fidelity(
    scene: Scene,
    *,
    space: str | None,
    order: int | None,
    size: float | Mapping[FlexibleLink, float] | None,
    quadrature: Quadrature | None,
    formulation: Formulation,
    layers: int | None,
    segments: int | None,
) -> Fidelity:
    """The fidelity, if ``scene`` can be simulated at it; arguments as those of ``Simulation``.

    Raises:
        DescriptionError: it cannot.
    """
    space, order = "3d" if space is None else space, 2 if order is None else order
    if space not in SPACES:
        raise DescriptionError("space", f"{space!r} is not known", f"Choose one of {', '.join(SPACES)}")
    if order not in (1, 2, 3):
        raise DescriptionError("order", f"{order!r} is not 1, 2 or 3", "Choose 1 for speed, 2 for accuracy")
    if size is None:
        raise DescriptionError("size", "it is missing", "Give an element size, or accuracy=… to have one chosen")
    model, links = SPACES[space], scene.mechanism.flexible_links
    per_link = size if isinstance(size, Mapping) else dict.fromkeys(links, size)
    sizes = {link: positive(f"element size of {link.name!r}", per_link.get(link)) for link in links}
    rule = quadrature or Quadrature.for_order(order, model.dim)
    check_scene(scene, model)
    return Fidelity(model, order, sizes, rule, formulation, layers, LEAST_SEGMENTS if segments is None else segments)


def check_scene(scene: Scene, model: ElasticModel) -> None:
    """Checks that a scene can be simulated in ``model``.

    Raises:
        DescriptionError: it cannot.
    """
    mechanism = scene.mechanism
    validate(mechanism, model.mechanism_dim)
    if not mechanism.flexible_links:
        raise DescriptionError(
            f"mechanism {mechanism.name!r}", "no link is flexible: nothing would bend", "Add one with flexible()"
        )
    for effect in scene.effects:
        effect.check(mechanism, model.mechanism_dim)


def fits(scene: Scene, model: ElasticModel) -> bool:
    """Whether a scene can be simulated in ``model``."""
    try:
        check_scene(scene, model)
    except DescriptionError:
        return False
    return True
