"""Parts of boundaries: what they hold, overlaps, and their areas at rest."""

from __future__ import annotations

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.compat import compile_form
from fenicsmech.effects import Faces, LinkFields, find_boundaries

from ..design.refusal import refused

pytestmark = pytest.mark.parallel

LENGTH, THICKNESS, DEPTH = 20.0, 4.0, 6.0


def left(x: np.ndarray) -> np.ndarray:
    return x[:, 0] < 1e-9


def top(x: np.ndarray) -> np.ndarray:
    return x[:, 1] > 0.5 * THICKNESS - 1e-9


class Bars:
    """Two rectangular bars, and measures on parts of their boundaries."""

    def __init__(self, space: str, comm: MPI.Comm) -> None:
        mechanism = fm.Mechanism("bars")
        base = mechanism.rigid("base", fixed=True)
        self.bars = []
        for name, height in (("lower", 0.0), ("upper", 9.0)):
            shape = fm.strip([(0, height), (LENGTH, height)], thickness=THICKNESS, depth=DEPTH)
            self.bars.append(mechanism.flexible(name, shape, fm.ONYX))
            mechanism.weld(base, self.bars[-1], at=(0.5 * LENGTH, height), interface_radius=1.0)
        self.model = fm.Simulation(fm.Scene(mechanism), space=space, size=4.0, comm=comm).model

    def fields(self, *faces: Faces) -> LinkFields:
        mesh = self.model.mesh
        body = self.model.elastic
        found = find_boundaries(mesh.mesh, self.bars, mesh.link, faces, half=body.model.half)
        return LinkFields(tuple(self.bars), body, found)

    def area(self, fields: LinkFields, part: Faces) -> float:
        """Of the whole depth."""
        form = compile_form(fields.boundary_integral(1.0, part, degree=1))
        return self.model.mesh.mesh.comm.allreduce(fem.assemble_scalar(form))


CASES = [("plane-stress", "alone"), ("plane-stress", "together"), ("3d-symmetric", "together"), ("3d", "alone")]


@pytest.fixture(params=CASES, ids="-".join)
def bars(request) -> Bars:
    space, comm = request.param
    return Bars(space, {"alone": MPI.COMM_SELF, "together": MPI.COMM_WORLD}[comm])


def test_parts_may_overlap(bars):
    lower, upper = bars.bars
    whole, end, flank, other = Faces(lower), Faces(lower, left), Faces(lower, top), Faces(upper)
    fields = bars.fields(whole, end, flank, other, Faces(lower))
    around = 2.0 * (LENGTH + THICKNESS) * DEPTH + (0.0 if fields.dim == 2 else 2.0 * LENGTH * THICKNESS)
    for part, expected in ((whole, around), (other, around), (end, THICKNESS * DEPTH), (flank, LENGTH * DEPTH)):
        assert bars.area(fields, part) == pytest.approx(expected, rel=1e-12)


def test_areas_are_those_of_the_rest_shape(bars):
    lower, _ = bars.bars
    end, flank = Faces(lower, left), Faces(lower, top)
    fields = bars.fields(end, flank)
    dim = fields.dim
    places = fields.body.shape.function_space.tabulate_dof_coordinates()[:, :dim]
    # x is stretched by 1.5, y by 0.5 and sheared along x
    change = np.zeros((dim, dim))
    change[0, 0], change[0, 1], change[1, 1] = 0.5, 0.75, -0.5
    fields.body.shape.x.array[:] = (places @ change.T).ravel()
    assert bars.area(fields, end) == pytest.approx(THICKNESS * np.hypot(0.75, 0.5) * DEPTH, rel=1e-12)
    assert bars.area(fields, flank) == pytest.approx(1.5 * LENGTH * DEPTH, rel=1e-12)


def test_predicates_may_compare_the_places_of_their_link(bars):
    lower, upper = bars.bars
    for link in (lower, upper):
        highest = Faces(link, lambda x: x[:, 1] > x[:, 1].max() - 1e-9)
        assert bars.area(bars.fields(highest), highest) == pytest.approx(LENGTH * DEPTH, rel=1e-12)


def test_a_part_without_a_facet_is_refused(bars):
    nowhere = Faces(bars.bars[0], lambda x: x[:, 0] > 1e3)
    refused(lambda: bars.fields(nowhere), part="'lower'", problem="no facet", remedy="Widen")


def across(x):
    return x[0] > 5.0  # as dolfinx has it, points as columns


@pytest.mark.parametrize("where", [across, lambda x: x[:, 0], lambda x: True], ids=["columns", "numbers", "one"])
def test_a_predicate_that_does_not_give_a_boolean_for_each_row_is_refused_on_all_ranks(bars, where):
    one = Faces(bars.bars[0], where)
    refused(lambda: bars.fields(one), part="'lower'", problem="the predicate gives", remedy="lambda x: x[:, 0] > 5")


def test_without_parts_nothing_is_made(bars):
    assert bars.fields().boundaries == {}
