"""A level: one fidelity at which a scene can be computed; and all of them for a scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

from fenicsmech.elasticity import MID_PLANE_SYMMETRIC, PLANE_STRAIN, PLANE_STRESS, SPATIAL, ElasticModel, Quadrature
from fenicsmech.equilibrium import PrimalDualNewton
from fenicsmech.errors import positive
from fenicsmech.mechanism import Scene
from fenicsmech.model import check_scene, fits

TOLERANCE = PrimalDualNewton().tolerance
"""Newton's tolerance unless a level says otherwise."""

_PLANAR_SIZES = MappingProxyType({order: (4.0, 2.0, 1.0, 0.5, 0.25) for order in (1, 2)})
_SPATIAL_SIZES = MappingProxyType({order: (4.0, 2.0, 1.0, 0.5) for order in (1, 2, 3)})
_QUADRATURES = (2, 3, 4, 5, 6)
_TOLERANCES = (1e-4, 1e-6, 1e-8)
_VARIED_ORDER = 2  # whose quadrature and tolerance are varied, at the base size


@dataclass(frozen=True)
class FidelityLevel:
    """One fidelity.

    Attributes:
        model: 3D, whole or half, plane strain or plane stress; None: every link is rigid.
        order: degree of the displacement field.
        factor: element size over the base size of the study.
        quadrature: degree; None: the default of model and order.
        tolerance: of Newton's residual over the forces that balance in it.

    Raises:
        DescriptionError: factor or tolerance is not a positive number.
    """

    model: ElasticModel | None
    order: int = 2
    factor: float = 1.0
    quadrature: int | None = None
    tolerance: float = TOLERANCE

    def __post_init__(self) -> None:
        positive("factor of a fidelity level", self.factor)
        positive("tolerance of a fidelity level", self.tolerance)

    @property
    def model_name(self) -> str:
        """The model as tables name it."""
        return "rigid" if self.model is None else self.model.name.replace("-", " ").replace("3d", "3D")

    @property
    def name(self) -> str:
        """The level in words, as "3D P2 h×0.5, degree 5"."""
        if self.model is None:
            return "rigid"
        words = [f"{self.model_name} P{self.order} h×{self.factor:g}"]
        if self.quadrature is not None:
            words.append(f"degree {self.quadrature}")
        if self.tolerance != TOLERANCE:
            words.append(f"tol {self.tolerance:.0e}".replace("e-0", "e-"))
        return ", ".join(words)

    @property
    def is_variant(self) -> bool:
        """Whether quadrature or tolerance differ from the defaults."""
        return self.quadrature is not None or self.tolerance != TOLERANCE


RIGID = FidelityLevel(None)
"""Rigid kinematics: nothing bends."""


def fidelity_levels(
    scene: Scene,
    *,
    planar: Mapping[int, Sequence[float]] = _PLANAR_SIZES,
    spatial: Mapping[int, Sequence[float]] = _SPATIAL_SIZES,
    quadratures: Sequence[int] = _QUADRATURES,
    tolerances: Sequence[float] = _TOLERANCES,
) -> list[FidelityLevel]:
    """The levels for ``scene``, each sequence from coarse to fine: rigid, plane strain and stress, 3D half and whole.

    Models of motion in the plane are left out where the scene has no such form. Quadrature and tolerance are varied for
    order 2 at the base size, in plane stress and in whole 3D.

    Args:
        scene: the mechanism and its effects.
        planar: size factors of every order in the plane.
        spatial: the same in space.
        quadratures: degrees in addition to the default one.
        tolerances: of Newton's method in addition to the default one.

    Raises:
        DescriptionError: the scene cannot be simulated in space.
    """
    found = [RIGID]
    check_scene(scene, SPATIAL)
    sequences = {PLANE_STRAIN: planar, PLANE_STRESS: planar, MID_PLANE_SYMMETRIC: spatial, SPATIAL: spatial}
    for model, sizes in sequences.items():
        if model is not SPATIAL and not fits(scene, model):
            continue
        for order, factors in sizes.items():
            found += [FidelityLevel(model, order, factor) for factor in sorted(factors, reverse=True)]
        if model in (PLANE_STRESS, SPATIAL) and 1.0 in sizes.get(_VARIED_ORDER, ()):
            base = FidelityLevel(model, _VARIED_ORDER)
            default = Quadrature.for_order(_VARIED_ORDER, model.dim).degree
            found += [replace(base, quadrature=degree) for degree in quadratures if degree != default]
            found += [replace(base, tolerance=value) for value in tolerances if value != TOLERANCE]
    return found
