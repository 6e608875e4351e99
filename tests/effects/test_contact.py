"""Links come to rest against rigid obstacles as closed forms say, and those out of reach change nothing."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from scipy.sparse import csr_matrix

import fenicsmech as fm
from fenicsmech.effects import Contact, Cylinder, HalfPlane, OneSided
from fenicsmech.equilibrium import ActiveSet, Direct, EquilibriumSystem, LoadControl, NewtonSolver, TwoLevel
from fenicsmech.quantities import Sensitivity

from ..design.in_plane import design_field
from ..design.refusal import refused
from ..oracles.wrapped import wrap
from ..ranks import EACH_COMM
from .touching import block, cantilever, channel, finger, touching_beside_another, wrapped, wrapped_tip, wrapping_force

PULLS = [0.05, 0.1, 0.2, 0.4]


@pytest.mark.thorough
@pytest.mark.parametrize("space", ["plane-stress", "3d-symmetric", "3d"])
def test_a_cantilever_rests_on_a_plane_first_at_its_tip_and_then_farther_in(space):
    # P at a = L / 2; R on the tip, or where the link touches with horizontal tangent, c = a + 6 EI gap / (P a²)
    length, gap = 100.0, 1.0
    case = cantilever(space, gap=gap, length=length)
    bending, a = 2000.0 * 3.0 * 2.0**3 / 12.0, 0.5 * length
    deflection = 6.0 * bending * gap / a**2
    for frame in case.simulation.load_displacement(case.force, forces=[0.05, 0.12, 0.18, 0.3]).frames:
        load = frame.force
        c = min(a + deflection / load, length)
        reaction = load * a**2 / c**2 if c < length else 5.0 / 16.0 * load - 3.0 * bending * gap / length**3
        force, least = case.measure(frame)
        assert force[1] == pytest.approx(max(reaction, 0.0), rel=0.01, abs=1e-12)
        assert np.abs(np.delete(force, 1)).max() < 1e-12
        at_load = (load * a**3 / 3.0 - max(reaction, 0.0) * a**2 * (3.0 * c - a) / 6.0) / bending
        assert frame.displacement == pytest.approx(at_load, rel=0.005)
        assert least > -0.01 * gap
        assert frame.stable


@pytest.mark.parametrize("space", ["plane-stress", "3d-symmetric"])
def test_a_block_sinks_in_by_force_over_area_and_stiffness(space):
    force = 20.0
    for stiffness in (30.0, 60.0):
        case = block(space, stiffness)
        (frame,) = case.simulation.load_displacement(case.force, forces=[force]).frames
        found, gap = case.measure(frame)
        assert found == pytest.approx(np.eye(len(found))[1] * force, abs=1e-8 * force)
        assert gap == pytest.approx(-force / (50.0 * stiffness), rel=1e-3 if space == "plane-stress" else 0.01)


@pytest.mark.thorough
@pytest.mark.parametrize("space", ["plane-stress", "3d-symmetric"])
def test_a_finger_closes_on_a_cylinder_and_penetrates_the_less_the_stiffer_it_is(space):
    depths = []
    for stiffness in (0.5, 2.0, None):
        case = finger(space, stiffness=stiffness)
        frame = case.simulation.load_displacement(case.force, forces=PULLS).frames[-1]
        force, gap = case.measure(frame)
        # the finger leans on the cylinder's right, which pushes it away from its axis
        assert 0.5 < force[0] < 0.7 and 0.0 < force[1] < 0.2
        depths.append(-gap)
        assert frame.stable
    # on a round obstacle the area of contact grows too: somewhat slower than 1 / κ
    assert 2.0 < depths[0] / depths[1] < 4.0
    assert depths[-1] < 0.05


@pytest.mark.parametrize(
    "space", ["plane-stress", *(pytest.param(s, marks=pytest.mark.thorough) for s in ("3d-symmetric", "3d"))]
)
def test_an_obstacle_out_of_reach_changes_nothing(space):
    far, without = finger(space, centre=(-100.0, 38.0)), finger(space, active=False)
    curves = [case.simulation.load_displacement(case.force, forces=PULLS) for case in (far, without)]
    for a, b in zip(*(curve.frames for curve in curves), strict=True):
        assert np.abs(a.state.u - b.state.u).max() < 1e-9
    force, gap = far.measure(curves[0].frames[-1])
    assert not force.any()
    assert gap > 0.0


@pytest.mark.parametrize("load", [0.03, 0.05, 0.1])
def test_a_cantilever_wraps_round_a_cylinder_in_few_iterations(load):
    case = wrapped()
    (frame,) = case.simulation.load_displacement(case.force, forces=[wrapping_force(load)]).frames
    centreline = 50.0 + 0.5 * 0.005  # radius of it, over the length
    assert frame.displacement == pytest.approx(100.0 * wrap(load, centreline).deflection, rel=1e-3)
    assert frame.displacement == pytest.approx(wrapped_tip(load), rel=1e-3)
    assert frame.iterations <= 6
    assert frame.stable
    force, gap = case.measure(frame)
    assert force[1] == pytest.approx(wrapping_force(load), rel=0.01)  # all of it where the beam leaves the cylinder
    assert gap > -1e-4 * 0.5


def test_wrapping_does_not_depend_on_units():
    units = {"unit": 1e-3, "stress": 1e6}  # m, N, Pa
    found = []
    for given in ({}, units):
        case = wrapped(**given)
        (frame,) = case.simulation.load_displacement(case.force, forces=[wrapping_force(0.05, **given)]).frames
        found.append(frame.displacement / given.get("unit", 1.0))
    assert found[0] == pytest.approx(found[1], rel=1e-8)


@pytest.mark.thorough
@pytest.mark.parallel
def test_wrapping_is_equal_on_all_ranks():
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        case = wrapped(comm=comm)
        (frame,) = case.simulation.load_displacement(case.force, forces=[wrapping_force(0.05)]).frames
        found.append(frame.displacement)
    assert found[0] == pytest.approx(found[1], rel=1e-8)


@pytest.mark.thorough
@pytest.mark.parallel
def test_ranks_without_points_that_may_touch_take_part():
    # the link that may touch is a tenth of all: on several ranks some hold none of it
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        case = touching_beside_another(comm)
        (frame,) = case.simulation.load_displacement(case.force, forces=[0.3]).frames
        path = case.simulation.follow(case.force, until=fm.Until(force=0.3)).frames[-1]
        assert path.displacement == pytest.approx(frame.displacement, rel=1e-8)
        points = len(case.simulation.solver(case.force).system.contact.touching())
        found.append(frame.displacement)
        assert case.measure(frame)[0][1] > 0.01
        assert comm.size == 1 or 0 in comm.allgather(points)
    assert found[0] == pytest.approx(found[1], rel=1e-8)


@pytest.mark.parametrize("space", ["plane-stress", pytest.param("3d", marks=pytest.mark.thorough)])
def test_iterative_solves_find_the_points_that_touch(space):
    found = []
    for linear in (Direct(), TwoLevel()):
        case = finger(space, size=4.0, solver=fm.PrimalDualNewton(linear=linear))
        frame = case.simulation.load_displacement(case.force, forces=PULLS).frames[-1]
        path = case.simulation.follow(case.force, until=fm.Until(force=PULLS[-1])).frames
        assert len(path) <= 40
        assert path[-1].displacement == pytest.approx(frame.displacement, rel=1e-7)
        assert frame.stable and path[-1].stable
        assert case.measure(frame)[0][0] > 0.5
        found.append((frame.displacement, frame.iterations))
    assert found[1][0] == pytest.approx(found[0][0], rel=1e-7)
    assert found[1][1] <= found[0][1] + 2


def test_solves_for_points_that_touch_leave_no_vectors_behind(monkeypatch):
    vectors, try_solve = [], NewtonSolver.try_solve

    def solve(self, right, tolerance):
        vectors.append((right, try_solve(self, right, tolerance)))
        return vectors[-1][1]

    monkeypatch.setattr(NewtonSolver, "try_solve", solve)
    case = wrapped()
    (frame,) = case.simulation.load_displacement(case.force, forces=[wrapping_force(0.1)]).frames
    most = 4 * frame.iterations  # solves: with the residual, for the step with contact, and the same for corrections
    assert len(vectors) > 2 * most  # most were for points
    assert sum(bool(right) or bool(x) for right, x in vectors) <= most


def test_corrections_that_stall_with_the_factor_at_hand_are_left_to_the_next_one(monkeypatch):
    stalled, fresh = [], []
    add_stiffness, corrected = ActiveSet.add_stiffness, ActiveSet.corrected

    def add(self, matrix):
        fresh.append(True)
        add_stiffness(self, matrix)

    def correct(self, x, residual, solve, plane=None):
        if fresh:
            fresh.clear()
            return corrected(self, x, residual, solve, plane)
        stalled.append(True)
        return None

    case = finger("plane-stress")
    (start,) = case.simulation.load_displacement(case.force, forces=[0.2]).frames
    newton, control = case.simulation.solver(case.force), LoadControl(0.201)
    expected = newton.solve(start.state, control).state.u
    monkeypatch.setattr(ActiveSet, "add_stiffness", add)
    monkeypatch.setattr(ActiveSet, "corrected", correct)
    found = newton.solve(start.state, control).state.u
    assert stalled
    assert np.abs(found - expected).max() < 1e-8 * np.abs(expected).max()


@pytest.mark.parametrize("stiffness", [None, 10.0, 1000.0])
def test_contact_takes_as_many_iterations_as_bending_however_stiff_the_obstacle_is(stiffness):
    pulled = {}
    for active in (False, True):
        case = finger("plane-stress", stiffness=stiffness, active=active)
        pulled[active] = [f.iterations for f in case.simulation.load_displacement(case.force, forces=PULLS).frames]
    assert sum(pulled[True]) <= sum(pulled[False])


def test_lying_down_takes_few_iterations():
    # the tip comes down on the plane, then the beam lies down on it: points of contact come and go by dozens
    case = cantilever("plane-stress", gap=1.0)
    frames = case.simulation.load_displacement(case.force, forces=[0.05, 0.12, 0.18, 0.3]).frames
    assert sum(frame.iterations for frame in frames) <= 12


def test_the_first_touch_of_a_strip_that_buckles_is_found_once():
    # its motion quickens before it touches: that looks like a snap
    case = channel()
    frames = case.simulation.load_displacement(case.force, forces=[10.0, 20.0, 40.0]).frames
    assert sum(frame.iterations for frame in frames) <= 24
    assert not any(frame.snapped_through for frame in frames)


def test_a_wrapped_cantilever_is_differentiated_by_the_design_field():
    case = wrapped(gap=0.02)  # without a gap points at the clamp are about to touch: the derivative is one-sided
    model = case.simulation.model
    x = model.elastic.shape.function_space.tabulate_dof_coordinates()[:, :2]
    # thicker by waves: where the beam lies, and how stiff it is, both change
    direction = design_field(model, np.outer(x[:, 1] * (1.0 + np.sin(0.1 * x[:, 0])), [0.0, 1.0]))

    def solve(step: float):
        model.reshape(step * direction)
        return case.simulation.load_displacement(case.force, forces=[wrapping_force(0.05)]).frames[-1]

    h = 1e-5
    slope = (_travel(case, solve(h)) - _travel(case, solve(-h))) / (2.0 * h)
    frame = solve(0.0)
    travel, solver = fm.Displacement(case.force).on(model), case.simulation.solver(case.force)
    (gradient,) = Sensitivity(model).gradients(solver, frame.state, LoadControl(frame.force), [travel])
    assert gradient.design @ direction[: len(gradient.design)] == pytest.approx(slope, rel=1e-4)


def test_gaps_are_computed_once_for_each_state(monkeypatch):
    computed, states, value, load = [], [], OneSided.update, EquilibriumSystem.load

    def update(self):
        before = getattr(self, "gaps", None)
        value(self)
        computed.append(self.gaps is not before)

    def count(self, state):
        states.append(state)
        load(self, state)

    monkeypatch.setattr(OneSided, "update", update)
    monkeypatch.setattr(EquilibriumSystem, "load", count)
    case = finger("plane-stress")
    case.simulation.load_displacement(case.force, forces=PULLS)
    assert 0 < sum(computed) <= len(states)
    assert sum(computed) < 0.5 * len(computed)


def test_a_rank_without_cells_has_no_points_but_their_arrays(monkeypatch):
    case = finger("plane-stress")
    fields, empty = case.simulation.model.fields, np.zeros(0)
    (surface,) = case.contact.one_sided(fields)

    class Body:  # of a rank without cells: its fields have no values
        def __init__(self):
            self.shape = self.depth = self.u = SimpleNamespace(x=SimpleNamespace(array=empty))
            self.model = fields.body.model

    dim = fields.dim
    monkeypatch.setattr(surface, "_body", Body())
    monkeypatch.setattr(surface, "_boundary", SimpleNamespace(places=np.zeros((0, dim, dim)), cells=np.zeros(0, int)))
    for name in ("_nodes", "_shape"):
        monkeypatch.setattr(surface, name, csr_matrix((0, 0)))
    monkeypatch.setattr(surface, "_along", [csr_matrix((0, 0))])
    surface.update()
    assert surface.gaps.shape == surface.weights.shape == (0,)


def test_without_contact_no_boundary_is_looked_for():
    case = finger("plane-stress", active=False)
    assert case.simulation.solver(case.force).system.contact is None
    assert case.simulation.model.fields.boundaries == {}
    kinds = {integral.integral_type() for integral in case.simulation.model.elastic.energy_ufl.integrals()}
    assert kinds == {"cell"}


@pytest.mark.thorough
@pytest.mark.parametrize("comm", EACH_COMM)
@pytest.mark.parametrize("space", ["plane-stress", "3d-symmetric", "3d"])
def test_displacements_in_contact_are_differentiated_by_the_design_field(space, comm):
    case = finger(space, comm=comm)
    model = case.simulation.model
    V = model.elastic.shape.function_space
    wave = np.sin(V.tabulate_dof_coordinates()[:, : model.linkage.dim] @ np.diag([0.2, 0.1, 0.3][: model.linkage.dim]))
    base, direction = (design_field(model, field) for field in (0.2 * wave, 0.3 * np.roll(wave, 1, axis=1)))

    def solve(step: float):
        model.reshape(base + step * direction)
        return case.simulation.load_displacement(case.force, forces=PULLS).frames[-1]

    h = 1e-3
    slope = (_travel(case, solve(h)) - _travel(case, solve(-h))) / (2.0 * h)
    frame = solve(0.0)
    assert abs(case.measure(frame)[0][0]) > 0.3
    travel, solver = fm.Displacement(case.force).on(model), case.simulation.solver(case.force)
    (gradient,) = Sensitivity(model).gradients(solver, frame.state, LoadControl(frame.force), [travel])
    found = comm.allreduce(gradient.design @ direction[: len(gradient.design)])
    assert found == pytest.approx(slope, rel=1e-4)


def _travel(case, frame) -> float:
    case.simulation.model.load(frame.state)
    return case.simulation.model.travel(case.force, frame.state)


@pytest.mark.parametrize(
    "space", ["plane-stress", *(pytest.param(s, marks=pytest.mark.thorough) for s in ("3d-symmetric", "3d"))]
)
def test_a_rigid_link_rests_on_its_points(space):
    # a leaf that carries next to nothing holds a table, drawn with its feet a little below the plane
    mechanism = fm.Mechanism("table")
    base, table = mechanism.rigid("base", fixed=True), mechanism.rigid("table")
    leaf = mechanism.flexible(
        "leaf", fm.strip([(-40, 0), (0, 0)], thickness=1.0, depth=2.0), fm.Material("foam", 200.0, 0.3)
    )
    mechanism.weld(base, leaf, at=(-40, 0), interface_radius=1.0)
    mechanism.weld(leaf, table, at=(0, 0), interface_radius=1.0)
    push = mechanism.force(on=table, at=(15, -8), direction=(0, -1))  # below the feet, where it steadies
    contact = Contact(table, HalfPlane((0, -3), (0, 1)), stiffness=50.0, points=[(10, -3.01), (30, -3.01)])
    simulation = fm.Simulation(fm.Scene(mechanism, effects=[contact]), space=space, size=2.0)
    (frame,) = simulation.load_displacement(push, forces=[4.0]).frames
    # the feet carry 3 and 1: they stand 0.06 and 0.02 below the plane, and the force is a quarter of their way apart
    assert frame.displacement == pytest.approx(0.05 - 0.25 * 0.04, rel=2e-3)
    assert frame.iterations <= 10
    assert frame.stable


def test_invalid_descriptions_are_refused():
    mechanism = fm.Mechanism("finger")
    base = mechanism.rigid("base", fixed=True)
    link = mechanism.flexible("link", fm.strip([(0, 0), (20, 0)], thickness=2.0, depth=2.0), fm.ONYX)
    stranger = fm.Mechanism("other").rigid("stranger")
    mechanism.weld(base, link, at=(0, 0), interface_radius=1.0)
    floor = HalfPlane((0, -5), (0, 1))
    refused(lambda: Contact(base, floor), part="'base'", problem="points only", remedy="points=")
    refused(lambda: Contact(base, floor, points=[(0, 0)]), part="'base'", problem="points only", remedy="stiffness=")
    refused(lambda: Contact(link, floor, points=[(0, 0)]), part="'link'", problem="whole surface", remedy="out")
    refused(lambda: Contact(link, floor, -1.0), part="stiffness", problem="not positive", remedy="greater")
    refused(lambda: Contact("link", floor), part="contact", problem="is not a link", remedy="rigid")
    refused(lambda: Contact(link, "floor"), part="'link'", problem="not an obstacle", remedy="HalfPlane")
    refused(lambda: HalfPlane((0, 0), (0, 0)), part="normal", problem="zero length", remedy="somewhere")
    refused(lambda: Cylinder((0, 0, 0), 1.0), part="centre", problem="does not have 2 coordinates", remedy="2 numbers")
    refused(lambda: Cylinder((0, 0), 0.0), part="radius", problem="not positive", remedy="greater")
    for contact, space, problem in (
        (Contact(stranger, floor, 1.0, [(0, 0)]), "3d", "is not a link of"),
        (Contact(link, HalfPlane((0, 0), (0, 0, 1))), "plane-stress", "leaves the plane"),
    ):
        scene = fm.Scene(mechanism, effects=[contact])
        with pytest.raises(fm.DescriptionError, match=problem):
            fm.Simulation(scene, space=space, size=2.0)
