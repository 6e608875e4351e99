"""The rest shape of a simulation's links as a function of the design p, with optimal handles.

    p → θ*(p) → d(p, θ*(p)) → X = X₀ + d

with the handle positions θ and the design field d.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from fenicsmech.design.description import Bounds, SplineDesign, shape_request
from fenicsmech.design.shape.handle_optimum import HandleOptimum, HandlePlacement
from fenicsmech.design.shape.quality import Barrier, QualitySum
from fenicsmech.design.shape.shape_map import LinkShape, ShapeMap, shape_links
from fenicsmech.design.shape.spline import LinkSpline, SplineSamples
from fenicsmech.model import MechanismModel
from fenicsmech.simulation import Simulation


@dataclass(frozen=True, eq=False)
class DesignedLink:
    """A link that changes.

    Attributes:
        name: of the link.
        place: its entries of p.
        spline: its centreline and thickness.
        samples: parameters at which they are bounded.
        thickness: in the plane, where δ = 1.
        bounds: of fabrication.
    """

    name: str
    place: slice
    spline: LinkSpline
    samples: SplineSamples
    thickness: float
    bounds: Bounds


class ParametricShape:
    """The rest shape of one model.

    Args:
        model: whose links change.
        shapes: handles and weights of these links.
        designs: how they may change.

    Attributes:
        links: the links that change.
        initial: p of the drawn design, (parameters,).
        lengths: typical change ℓ of each parameter, (parameters,): a link's thickness; 1 for δ.

    Raises:
        DescriptionError: the drawn thickness of a link is not within its bounds.
    """

    def __init__(self, model: MechanismModel, shapes: Sequence[LinkShape], designs: Sequence[SplineDesign]) -> None:
        self._model, design = model, model.elastic.d
        self._map = ShapeMap(model.mesh, design, shapes)
        self._ratio = QualitySum(design, comm=model.mesh.comm)
        self._optimum = HandleOptimum(self._map, self._ratio)
        self._penalties: dict[Barrier, QualitySum] = {}
        self.initial = self._map.initial
        links, first = [], 0
        for shape, wanted in zip(shapes, designs, strict=True):
            spline, h = shape.handles.spline, shape.thickness
            place = slice(first, first := first + spline.size)
            links.append(DesignedLink(wanted.link.name, place, spline, SplineSamples(spline), h, wanted.bounds(h)))
        self.links = tuple(links)
        self.lengths = np.concatenate([np.where(s.spline.is_thickness, 1.0, s.thickness) for s in self.links])

    @staticmethod
    def of(simulation: Simulation, designs: Sequence[SplineDesign]) -> ParametricShape:
        """The rest shape of a simulation's links, handles and weights computed on its mesh."""
        requests = [shape_request(design, simulation.scene.mechanism, simulation.linkage) for design in designs]
        return ParametricShape(simulation.model, shape_links(simulation.model.mesh, requests), designs)

    def known(self, p: np.ndarray, theta: np.ndarray) -> HandlePlacement | None:
        """A placement to start from, for handle positions found before; None if their number has changed."""
        if theta.shape != self._map.initial_theta.shape:
            return None
        return HandlePlacement(p, theta)

    def handles(self, placement: HandlePlacement) -> list[np.ndarray]:
        """Positions of the handles of each link."""
        return self._map.positions(placement.theta)

    def place(self, p: np.ndarray, near: HandlePlacement | None) -> HandlePlacement:
        """Gives the links the shape of design ``p`` with optimal handles.

        Args:
            p: the design, (parameters,).
            near: placement of a design near by.

        Raises:
            ShapeError: cells stay inverted however the handles are placed.
        """
        placement = self._optimum.solve(p, near)
        self._model.reshape(self._model.elastic.d.x.array)
        return placement

    def field(self, p: np.ndarray, near: HandlePlacement | None) -> np.ndarray:
        """This rank's values of the design field for ``p``, ghosts last, flat; the links keep the shape they have."""
        before = self._model.elastic.d.x.array.copy()
        with self._model.shaped(before):
            self.place(p, near)
            return self._model.elastic.d.x.array.copy()

    def gradient(self, placement: HandlePlacement, nodal: np.ndarray) -> np.ndarray:
        """dO/dp (…, parameters) from ∂O/∂d (…, owned values) of the design placed as in ``placement``."""
        fields = nodal.reshape(*nodal.shape[:-1], self._map.owned, -1)
        by_p, by_theta = self._map.apply_transpose(placement.p, placement.theta, fields)
        return self._optimum.total_gradient(placement, by_p, by_theta)

    def worst_ratio(self) -> float:
        """Largest ρ among the cells of the present rest shape."""
        worst = float(self._ratio.cell_values().max(initial=0.0))
        return self._model.mesh.mesh.comm.allreduce(worst, op=MPI.MAX)

    def quality_penalty(self, barrier: Barrier, placement: HandlePlacement) -> tuple[float, np.ndarray]:
        """Σ_e β(ρ_e) of the present rest shape, and its derivative by p."""
        if barrier not in self._penalties:
            self._penalties[barrier] = QualitySum(self._model.elastic.d, barrier.symbolic)
        total = self._penalties[barrier]
        return total.value(), self.gradient(placement, total.gradient().ravel())
