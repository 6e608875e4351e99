"""Recovered stress and strain at the surface of flexible links, and their peaks.

Samples of all processes are gathered on one, which fits the polynomials: results are those of one process.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from typing import Any

import numpy as np
from mpi4py import MPI

from fenicsmech.collective import from_one, gathered, on_one, scattered
from fenicsmech.compat import cell_dofs, cell_nodes, global_dofs, original_cells, original_nodes
from fenicsmech.effects import OneSided
from fenicsmech.equilibrium import State
from fenicsmech.mechanism import Effect, Force, Material, Units
from fenicsmech.meshing import edge_corners
from fenicsmech.model import Design, MechanismModel
from fenicsmech.stress.drawn import SurfaceFit
from fenicsmech.stress.edge import EdgeStress, edge_stress
from fenicsmech.stress.fields import StressField
from fenicsmech.stress.law_stability import LawStability, least_stable
from fenicsmech.stress.recovered import CellFields, Recovered
from fenicsmech.stress.singular_places import SingularPlace
from fenicsmech.stress.surface import LinkSurface, StressOptions, SurfacePeaks, SurfaceStress


class StressRecovery:
    """Recovered stresses of one model; forms are compiled when they are first needed.

    Args:
        model: the mechanism.
        options: of the recovery; None: those of the simulation that the model belongs to.
    """

    def __init__(self, model: MechanismModel, options: StressOptions | None = None) -> None:
        self._model, self._options = model, options or model.stress_options or StressOptions()
        self._kept: tuple[tuple[Force, ...], LinkSurface | None] | None = None

    def peaks(self, state: State, design: Design) -> SurfacePeaks:
        """The peaks of the von Mises stress at an equilibrium."""
        surface, fields = self.surface, self._fields(state, design)

        def find() -> SurfacePeaks:
            assert surface is not None and fields is not None  # on the first process
            return surface.peaks(fields)

        return from_one(self._model.mesh.comm, find)

    def strain_peaks(self, state: State, design: Design) -> SurfacePeaks:
        """The peaks of the largest principal nominal strain of the elastic deformation at an equilibrium."""
        surface, fields = self.surface, self._fields(state, design, strains=True)

        def find() -> SurfacePeaks:
            assert surface is not None and fields is not None  # on the first process
            return surface.strain_peaks(fields)

        return from_one(self._model.mesh.comm, find)

    @property
    def materials(self) -> Mapping[str, Material]:
        """Materials of the flexible links, by their names."""
        model = self._model
        return {link.name: own for link, own in zip(model.mechanism.flexible_links, model.materials, strict=True)}

    def at(
        self, state: State, design: Design, places: Callable[[LinkSurface], tuple[np.ndarray, np.ndarray]]
    ) -> Recovered | None:
        """Recovered fields at an equilibrium, those of strains too, on the first process; None elsewhere.

        Args:
            state, design: the equilibrium.
            places: called with the surface, on the first process: numbers of cells (k,), and barycentric coordinates of
                points in them (k, p, dim + 1).
        """
        surface, fields = self.surface, self._fields(state, design, strains=True)

        def find() -> Recovered:
            assert surface is not None and fields is not None  # on the first process
            return surface.at(fields, *places(surface))

        return on_one(self._model.mesh.comm, find)

    def field(self, state: State, design: Design) -> StressField | None:
        """Stress and strain at the vertices of the mesh, on the first process; None elsewhere."""
        count, surface = len(self._model.mesh.vertices), self.surface
        found = self.at(state, design, lambda surface: surface.vertices[1:])
        return None if found is None or surface is None else StressField.of(found, surface.vertices[0], count)

    def edge(
        self,
        state: State,
        design: Design,
        link: str,
        units: Units,
        start: np.ndarray | None = None,
        end: np.ndarray | None = None,
    ) -> EdgeStress:
        """Stress and strain along the edge of a link, see ``Curve.edge_stress``."""
        surface, number = self.surface, list(self.materials).index(link)
        fields = self._fields(state, design, strains=True)

        def find() -> dict[str, Any]:
            assert surface is not None and fields is not None  # on the first process
            return edge_stress(surface, fields, number, link, start, end)

        return EdgeStress(**from_one(self.comm, find), units=units, comm=self.comm)

    def surface_stress(self, state: State, design: Design) -> SurfaceStress | None:
        """The stress at the surface, on the first process; None elsewhere."""
        surface = self.surface
        fields = self._fields(state, design)

        def find() -> SurfaceStress:
            assert surface is not None and fields is not None  # on the first process
            return surface.stress(fields)

        return on_one(self._model.mesh.comm, find)

    def law_stabilities(self, state: State, design: Design) -> tuple[LawStability, ...]:
        """The least stability of the law of each flexible link that deforms, at an equilibrium."""
        model = self._model
        with model.clock.phase("stress"), self._holding(state, design):
            gradients = self.gathered(model.elastic.spatial_samples())
            nodes = self.gathered(self._nodes(model.elastic.shape.x.array))
            materials = model.materials

        def find() -> tuple[LawStability, ...]:
            assert nodes is not None and gradients is not None  # on the first process
            points = model.elastic.sample_points
            shares = np.column_stack([1.0 - points.sum(axis=1), points])
            places = np.einsum("qv,cvd->cqd", shares, nodes[:, : shares.shape[1]])
            links = model.mechanism.flexible_links
            return least_stable(links, materials, model.mesh.link_of_cell, places, gradients)

        return from_one(model.mesh.mesh.comm, find)

    @property
    def comm(self) -> MPI.Comm:
        """Processes of the model."""
        return self._model.mesh.comm

    @property
    def singular_places(self) -> tuple[SingularPlace, ...]:
        """The places left out of peaks."""
        surface = self.surface
        return from_one(self._model.mesh.comm, lambda: () if surface is None else surface.places)

    # -- fields of all processes on the first one ----------------------------------------------------------------

    def _fields(self, state: State, design: Design, *, strains: bool = False) -> CellFields | None:
        """Fields of all cells at an equilibrium, on the first process; None elsewhere."""
        with self._model.clock.phase("stress"), self._holding(state, design):
            return self.present(strains=strains)

    def present(self, *, strains: bool) -> CellFields | None:
        """The same of the equilibrium and the design that the model holds."""
        nodes = self.gathered(self._nodes(self._model.elastic.shape.x.array))
        with self._without(self._gradient_errors(nodes)):
            samples = self.gathered(self._samples(strains))
        touched = self._touched()
        return None if nodes is None or samples is None else CellFields(nodes, samples, touched)

    def _gradient_errors(self, nodes: np.ndarray | None) -> np.ndarray:
        """Estimated errors of ∇u at the samples of this rank's own cells, from the nodes of all cells at rest."""
        u, surface = self._model.elastic.u, self.surface
        own = cell_dofs(u.function_space)
        numbers = self.gathered(global_dofs(u.function_space)[own])
        moved = self.gathered(u.x.array.reshape(-1, self._model.elastic.model.dim)[own])

        def find() -> np.ndarray:
            assert surface is not None and nodes is not None and numbers is not None and moved is not None
            return surface.strain_errors(nodes, numbers, moved)

        return self.scattered(on_one(self.comm, find))

    @contextmanager
    def _without(self, errors: np.ndarray) -> Iterator[None]:
        """Samples leave out errors of ∇u, of this rank's own cells, within."""
        field = self._model.elastic.gradient_errors
        values = field.x.array.reshape(-1, errors.shape[-1] ** 2)
        values[cell_dofs(field.function_space)[: len(errors)]] = errors.reshape(*errors.shape[:2], -1)
        try:
            yield
        finally:
            values[:] = 0.0

    def drawn_fit(self, links: np.ndarray) -> SurfaceFit | None:
        """Fits in the coordinates of the drawn links, of those in a mask, on the first process; None elsewhere.

        What may touch obstacles counts as touching them.
        """
        surface, boundaries = self.surface, self._model.fields.boundaries
        nodes = self.gathered(self._nodes(self._model.elastic.drawn_shape))
        parts = [part for effect, own in self._constraints if own for part in effect.faces]
        touched = self._corners([boundaries[part].corners for part in parts])

        def make() -> SurfaceFit:
            assert surface is not None and nodes is not None  # on the first process
            return surface.fit(CellFields(nodes, np.zeros((*nodes.shape[:2], 0)), touched), links)

        return on_one(self._model.mesh.comm, make)

    @contextmanager
    def _holding(self, state: State, design: Design) -> Iterator[None]:
        """The model holds an equilibrium within, and its own fields again afterwards."""
        elastic = self._model.elastic
        before, factor = [field.x.array.copy() for field in elastic.fields], elastic.load_factor.value.copy()
        with self._model.shaped(design):
            try:
                self._model.load(state)
                yield
            finally:
                elastic.load_factor.value = factor
                for own, values in zip(elastic.fields, before, strict=True):
                    own.x.array[:] = values

    def gathered(self, values: np.ndarray) -> np.ndarray | None:
        """Values of all cells from those of this rank's cells."""
        own = self._own_cells
        return gathered(self._model.mesh.comm, own, values[: len(own)], len(self._model.mesh.cells))

    def scattered(self, values: np.ndarray | None) -> np.ndarray:
        """Values of this rank's own cells from those of all cells on the first process."""
        return scattered(self._model.mesh.comm, self._own_cells, values)

    @property
    def _own_cells(self) -> np.ndarray:
        """Numbers of this rank's own cells among all."""
        mesh = self._model.mesh.mesh
        return original_cells(mesh)[: mesh.topology.index_map(mesh.topology.dim).size_local]

    @property
    def surface(self) -> LinkSurface | None:
        """The surface, on the first process; None elsewhere. It is kept while the mechanism has the same forces."""
        forces = tuple(self._model.mechanism.forces)
        if self._kept is None or self._kept[0] != forces:
            self._kept = forces, self._surface()
        return self._kept[1]

    def _surface(self) -> LinkSurface | None:
        mesh, boundaries = self._model.mesh.mesh, self._model.fields.boundaries
        cells = self.gathered(original_nodes(mesh)[cell_nodes(mesh)])
        # constraints act only where they touch
        parts = [part for effect, own in self._constraints if not own for part in effect.faces]
        loaded = self._corners([boundaries[part].corners for part in parts])
        return None if cells is None else LinkSurface(self._model, cells, loaded, self._options)

    @cached_property
    def _constraints(self) -> list[tuple[Effect, Sequence[OneSided]]]:
        """The effects, with the one-sided constraints of each."""
        return [(effect, effect.one_sided(self._model.fields)) for effect in self._model.effects]

    def _touched(self) -> np.ndarray:
        """Vertices of facets that touch obstacles, (k, dim), on the first process; none elsewhere."""
        constraints = [constraint for _, own in self._constraints for constraint in own]
        for constraint in constraints:
            constraint.update()
        return self._corners([constraint.touched for constraint in constraints])

    def _corners(self, own: Sequence[np.ndarray]) -> np.ndarray:
        """Vertices of facets of all processes, (k, dim), on the first one; none elsewhere."""
        none = np.zeros((0, self._model.elastic.model.dim), dtype=int)
        parts = self._model.mesh.comm.gather(np.concatenate([none, *own]), root=0)
        return none if parts is None else np.concatenate(parts)

    def _nodes(self, shape: np.ndarray) -> np.ndarray:
        """Nodes of this rank's cells at rest, (cells, nodes, dim), from all its values of s, flat."""
        elastic, mesh = self._model.elastic, self._model.mesh.mesh
        dim = elastic.model.dim
        shape = shape.reshape(-1, dim)[cell_dofs(elastic.shape.function_space)]
        corners = mesh.geometry.x[cell_nodes(mesh)][..., :dim]
        if shape.shape[1] > dim + 1:
            corners = np.concatenate([corners, corners[:, edge_corners(dim + 1)].mean(axis=2)], axis=1)
        return corners + shape

    def _samples(self, strains: bool) -> np.ndarray:
        """σ and F at the samples of this rank's cells, (cells, q, 9 + dim²), and F elastic for ``strains``."""
        parts = [*self._model.elastic.stress_samples()]
        if strains:
            parts.append(self._model.elastic.elastic_samples())
        return np.concatenate([own.reshape(*own.shape[:2], -1) for own in parts], axis=2)
