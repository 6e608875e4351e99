"""The rest shape of a simulation's links as a function of the design p, with optimal handles.

    p → θ*(p) → d(p, θ*(p)) → X = X₀ + c + d

with the handle positions θ, the design field d and the bulge c of the drawn edges. Handle positions are best for the
straight cells between the vertices. Edges of the outline follow the design between them too, their middles without the
part along the chord; a design whose curved cells are squeezed too much has no rest shape.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from fenicsmech.compat import cell_dofs, vector_space
from fenicsmech.design.description import Bounds, SplineDesign, shape_request
from fenicsmech.design.shape.edges import MidEdgeNodes
from fenicsmech.design.shape.handle_optimum import HandleOptimum, HandlePlacement, ShapeError
from fenicsmech.design.shape.quality import Barrier, QualitySum
from fenicsmech.design.shape.shape_map import LinkShape, ShapeMap, shape_links
from fenicsmech.design.shape.spline import LinkSpline, SplineSamples
from fenicsmech.meshing import edge_corners, least_stretches, node_ends
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


_LEAST_STRETCH = 0.1  # least det ∂X/∂X₁ in a cell, X₁ the straight cell; of the drawn shape it is at least 0.3


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
        self._cells = np.flatnonzero(np.isin(model.mesh.link, [shape.link for shape in shapes]))
        # the vertices' part, which handles are placed for
        self._straight = fem.Function(vector_space(model.mesh.mesh, 1))
        self._vertex_map = ShapeMap(model.mesh, self._straight, shapes)
        self._ratio = QualitySum(self._straight, comm=model.mesh.comm)
        self._optimum = HandleOptimum(self._vertex_map, self._ratio)
        ends, dim = node_ends(design.function_space), model.mesh.vertices.shape[1]
        drawn = model.mesh.vertices[ends].mean(axis=1)
        if model.elastic.bulge is not None:
            drawn += model.elastic.bulge.x.array.reshape(-1, dim)
        self._middles = MidEdgeNodes(ends, drawn) if model.elastic.order > 1 else None
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

    def placement_from(self, p: np.ndarray, theta: np.ndarray) -> HandlePlacement | None:
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
            ShapeError: cells stay inverted however the handles are placed, or curved ones are squeezed.
        """
        placement = self._optimum.solve(p, near)
        self._model.reshape(self._placed(placement))
        return placement

    def field(self, p: np.ndarray, near: HandlePlacement | None) -> np.ndarray:
        """This rank's values of the design field for ``p``, ghosts last, flat; the links keep the shape they have."""
        return self._placed(self._optimum.solve(p, near))

    def _placed(self, placement: HandlePlacement) -> np.ndarray:
        """The design field of a placement, this rank's values, ghosts last, flat."""
        field, elastic, mesh = self._map.field(placement.p, placement.theta), self._model.elastic, self._model.mesh
        if self._middles is not None:
            field = self._middles.placed(field)
            bent = field if elastic.bulge is None else field + elastic.bulge.x.array.reshape(field.shape)
            corners, pairs = field.shape[1] + 1, edge_corners(field.shape[1] + 1)
            values = bent[cell_dofs(elastic.d.function_space)[self._cells]]
            bulges = values[:, corners:] - values[:, pairs].mean(axis=2)
            squeezed = least_stretches(mesh.corners(self._cells) + values[:, :corners], bulges[:, ::-1])
            least = mesh.mesh.comm.allreduce(float(squeezed.min(initial=1.0)), op=MPI.MIN)
            if least < _LEAST_STRETCH:
                raise ShapeError("rest shape", "its curved edges squeeze cells", "Change it by less, or mesh it finer")
        return field.ravel()

    def gradient(self, placement: HandlePlacement, nodal: np.ndarray) -> np.ndarray:
        """dO/dp (…, parameters) from ∂O/∂d (…, owned values) of the design placed as in ``placement``."""
        fields = nodal.reshape(*nodal.shape[:-1], self._map.owned, -1)
        if self._middles is not None:
            fields = self._middles.apply_transpose(self._map.field(placement.p, placement.theta), fields)
        by_p, by_theta = self._map.apply_transpose(placement.p, placement.theta, fields)
        return self._optimum.total_gradient(placement, by_p, by_theta)

    def worst_ratio(self) -> float:
        """Largest ρ among the cells of the present rest shape."""
        self._straight.interpolate(self._model.elastic.d)
        worst = float(self._ratio.cell_values().max(initial=0.0))
        return self._model.mesh.mesh.comm.allreduce(worst, op=MPI.MAX)

    def quality_penalty(self, barrier: Barrier, placement: HandlePlacement) -> tuple[float, np.ndarray]:
        """Σ_e β(ρ_e) of the present rest shape, and its derivative by p."""
        if barrier not in self._penalties:
            self._penalties[barrier] = QualitySum(self._straight, barrier.symbolic)
        total = self._penalties[barrier]
        self._straight.interpolate(self._model.elastic.d)
        by_p, by_theta = self._vertex_map.apply_transpose(placement.p, placement.theta, total.gradient())
        return total.value(), self._optimum.total_gradient(placement, by_p, by_theta)
