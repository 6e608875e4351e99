"""Forces on regions of flexible links: exact averages, uniform stress, equilibrium, beams, sensitivities."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.equilibrium import LoadControl
from fenicsmech.quantities import Sensitivity
from fenicsmech.stress import von_mises

from ..design.in_plane import design_field
from ..oracles.dense import taylor_rates

LENGTH, THICKNESS, DEPTH, CLAMP = 100.0, 8.0, 6.0, 10.0
SPACES = ("plane-stress", "plane-strain", "3d-symmetric", "3d")


class Beam:
    """A straight strip clamped at its left end, with a force on a region."""

    def __init__(
        self, region=None, *, at=(LENGTH, 0.0), along=(0.0, -1.0), nu=0.3, turn=0.0, comm=MPI.COMM_WORLD, **fidelity
    ) -> None:
        c, s = math.cos(turn), math.sin(turn)

        def placed(x, y):
            return (c * x - s * y, s * x + c * y)

        self.mechanism = fm.Mechanism("cantilever")
        ground = self.mechanism.rigid("ground", fixed=True)
        shape = fm.strip([(0.0, 0.0), placed(LENGTH, 0.0)], thickness=THICKNESS, depth=DEPTH)
        self.link = self.mechanism.flexible("beam", shape, fm.Material("plastic", 1000.0, nu))
        self.mechanism.clamp(ground, self.link, end="start", length=CLAMP, name="clamp")
        place = (*placed(*at[:2]), *at[2:])
        self.force = self.mechanism.force(on=self.link, at=place, direction=placed(*along), region=region, name="push")
        self.simulation = fm.Simulation(fm.Scene(self.mechanism), comm=comm, **{"size": 8.0, **fidelity})

    def curve(self, *forces: float) -> fm.Curve:
        return self.simulation.load_displacement(self.force, forces=forces)

    def average(self, function) -> np.ndarray:
        """The average over the region of a function of drawn points, interpolated at the nodes."""
        model = self.simulation.model
        model.elastic.u.x.array[:] = np.broadcast_to(
            function(model.elastic.drawn_nodes)[:, None], (len(model.elastic.drawn_nodes), model.elastic.model.dim)
        ).ravel()
        return model.point(self.force).displacement(model.elastic.u, np.zeros(0))[0]


REGIONS = {
    "disc": (fm.Disc(3.0), (60.0, 0.5)),
    "disc smaller than an element": (fm.Disc(0.2), (60.3, 0.7)),
    "rectangle": (fm.Rectangle(7.0, 3.0, 0.4), (60.0, 0.5)),
    "end face": (fm.Face(), (LENGTH, 1.0)),
    "patch of a side": (fm.Face(within=fm.Rectangle(13.0, 1.0)), (60.0, 0.5 * THICKNESS)),
}


@pytest.mark.parametrize("order", [1, 2, pytest.param(3, marks=pytest.mark.thorough)])
@pytest.mark.parametrize("space", ["plane-stress", pytest.param("3d-symmetric", marks=pytest.mark.thorough)])
@pytest.mark.parametrize("name", REGIONS)
def test_averages_of_polynomials_of_the_elements_degree_are_exact(name, space, order):
    region, (x, y) = REGIONS[name]
    beam = Beam(region, at=(x, y), space=space, order=order)
    assert beam.average(lambda points: 1.0 + 0.0 * points[:, 0]) == pytest.approx(1.0, abs=1e-13)
    centre_y = 0.0 if name == "end face" else y  # all of the face, wherever its point
    assert beam.average(lambda points: points[:, 0]) == pytest.approx(x, rel=1e-11)
    assert beam.average(lambda points: points[:, 1]) == pytest.approx(centre_y, abs=1e-9)
    if order > 1:
        squares = {
            "disc": 3.0**2 / 4,
            "disc smaller than an element": 0.2**2 / 4,
            "rectangle": (7.0**2 * math.cos(0.4) ** 2 + 3.0**2 * math.sin(0.4) ** 2) / 12,
            "end face": 0.0,
            "patch of a side": 13.0**2 / 12,
        }
        # a polygon stands for the disc
        accuracy = 1e-5 if "disc" in name else 1e-9
        assert beam.average(lambda points: (points[:, 0] - x) ** 2) == pytest.approx(
            squares[name], rel=accuracy, abs=1e-10
        )


@pytest.mark.parametrize(
    ("space", "order"), [*((space, 2) for space in SPACES), *(("plane-stress", k) for k in (1, 3)), ("3d-symmetric", 3)]
)
def test_traction_on_the_end_face_gives_uniform_stress(space, order):
    force = 480.0  # 1 % of the modulus
    beam = Beam(fm.Face(), along=(1.0, 0.0), nu=0.0, space=space, order=order)
    (frame,) = beam.curve(force).frames
    model = beam.simulation.model
    model.load(frame.state)
    stress = von_mises(model.elastic.stress_samples()[0])[model.mesh.interface < 0]
    assert stress == pytest.approx(np.full(stress.shape, force / (THICKNESS * DEPTH)), rel=1e-8)


@pytest.mark.parallel
@pytest.mark.parametrize("space", ["plane-stress", "3d-symmetric"])
def test_a_face_ends_where_others_in_its_plane_begin(space):
    """A force on the end of one prong of a fork leaves the other one alone."""
    mechanism = fm.Mechanism("fork")
    base = mechanism.rigid("base", fixed=True)
    outline = [(0, 0), (30, 0), (30, 40), (20, 40), (20, 10), (10, 10), (10, 40), (0, 40)]
    fork = mechanism.flexible("fork", fm.polygon(outline, depth=5.0), fm.Material("plastic", 1000.0, 0.3))
    mechanism.weld(base, fork, at=(15, 4), region=fm.Rectangle(30.0, 8.0))
    pushes = [
        mechanism.force(on=fork, at=(5, 40), direction=(1, 0), region=region, name=f"by {name}")
        for name, region in (
            ("face", fm.Face()),
            ("predicate", fm.Face(where=lambda x: (x[:, 1] > 39.9) & (x[:, 0] < 15))),
        )
    ]
    other = mechanism.output(on=fork, at=(25, 40), direction=(1, 0), region=fm.Face(), name="other prong")
    simulation = fm.Simulation(fm.Scene(mechanism), space=space, order=1, size=5.0)
    found, expected = (simulation.load_displacement(push, forces=[1.0]) for push in pushes)
    assert found.displacements == pytest.approx(expected.displacements, rel=1e-9)
    assert abs(found.frames[0].outputs[other]) < 0.05 * found.displacements[0]


def test_the_region_of_a_curved_edge_is_found_by_a_predicate():
    mechanism = fm.Mechanism("ring")
    ground = mechanism.rigid("ground", fixed=True)
    shape = fm.outline((20.0, 0.0), [fm.Arc((0.0, 20.0), (-20.0, 0.0)), fm.Arc((0.0, -20.0), (20.0, 0.0))], depth=5.0)
    disc = mechanism.flexible("disc", shape, fm.Material("plastic", 1000.0, 0.3))
    mechanism.revolute(ground, disc, at=(0.0, 0.0), interface_radius=4.0)
    upper = fm.Face(where=lambda points: points[:, 1] >= -1e-6)
    force = mechanism.force(on=disc, at=(0.0, 20.0), direction=(0.0, 1.0), region=upper)
    model = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=5.0).model
    model.elastic.u.x.array[:] = model.elastic.drawn_nodes.ravel()
    # centroid of a half circle: 2 r / π
    centroid = model.point(force).displacement(model.elastic.u, np.zeros(0))
    assert centroid == pytest.approx([0.0, 40.0 / math.pi], abs=2e-3)


@pytest.mark.parametrize("name", REGIONS)
@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_reactions_balance_force_and_moment(space, name):
    region, at = REGIONS[name]
    beam = Beam(region, at=at, space=space)
    force = 12.0
    (frame,) = beam.curve(force).frames
    model = beam.simulation.model
    model.load(frame.state)
    moved = model.point(beam.force).displacement(model.elastic.u, frame.state.poses)
    reaction = frame.reactions["clamp"]  # of the ground on the link
    assert abs(moved[1]) > 1.0
    assert reaction.force[:2] == pytest.approx([0.0, force], abs=1e-7)
    x = at[0] + moved[0]  # of the resultant, about the centre of the clamp's end
    assert reaction.moment[-1] == pytest.approx(force * x, rel=1e-6)


@pytest.mark.parametrize("space", ["plane-stress", "3d-symmetric"])
@pytest.mark.parametrize("name", REGIONS)
def test_deflections_are_those_of_a_beam(name, space):
    region, at = REGIONS[name]
    beam = Beam(region, at=at, nu=0.0, space=space)  # Timoshenko's clamp does not block contraction
    force, arm, E = 1e-3, at[0] - CLAMP, 1000.0
    bending = force * arm**3 / (3.0 * E * DEPTH * THICKNESS**3 / 12.0)
    shear = force * arm / (0.5 * E * 5.0 / 6.0 * DEPTH * THICKNESS)
    assert beam.curve(force).displacements[0] == pytest.approx(bending + shear, rel=2e-3)


def test_results_do_not_depend_on_the_frame():
    region = {0.0: fm.Rectangle(7.0, 3.0), 0.7: fm.Rectangle(7.0, 3.0, 0.7)}
    moved = [Beam(region[turn], at=(60.0, 1.0), turn=turn, space="plane-stress").curve(20.0) for turn in region]
    assert moved[1].displacements == pytest.approx(moved[0].displacements, rel=1e-8)


@pytest.mark.parallel
@pytest.mark.parametrize("name", REGIONS)
def test_results_do_not_depend_on_the_number_of_ranks(name):
    region, at = REGIONS[name]
    alone, together = (
        Beam(region, at=at, space="3d-symmetric", comm=comm).simulation for comm in (MPI.COMM_SELF, MPI.COMM_WORLD)
    )
    found = [
        simulation.load_displacement(simulation.scene.mechanism.forces[0], displacements=[2.0]).forces
        for simulation in (alone, together)
    ]
    assert found[1] == pytest.approx(found[0], rel=1e-9)


@pytest.mark.parallel
@pytest.mark.parametrize("space", ["plane-stress", pytest.param("3d-symmetric", marks=pytest.mark.slow)])
def test_derivatives_by_the_design(space):
    beam = Beam(fm.Disc(3.0), at=(90.0, 0.5), space=space, size=14.0)
    output = beam.mechanism.output(
        on=beam.link, at=(60.0, 0.5 * THICKNESS), direction=(0.3, -1.0), region=fm.Face(within=fm.Disc(5.0)), name="pad"
    )
    simulation, model = beam.simulation, beam.simulation.model
    quantities = [fm.Displacement(beam.force), fm.Displacement(output), fm.StrainEnergy()]
    observables = [quantity.on(model) for quantity in quantities]
    space_of_d = model.elastic.shape.function_space
    owned = space_of_d.dofmap.index_map.size_local * space_of_d.dofmap.index_map_bs
    places = space_of_d.tabulate_dof_coordinates()[:, : model.linkage.dim]
    direction = design_field(model, np.sin(places[:, ::-1] * (0.3, 0.07) + (1.0, 2.0)))
    force = 20.0

    def values(t: float) -> np.ndarray:
        model.reshape(t * direction)
        state = simulation.load_displacement(beam.force, forces=[force]).frames[-1].state
        model.load(state)
        return np.concatenate([own.values(state) for own in observables])

    known = {t: values(t) for t in (0.4, 0.2, 0.1, 0.05, 0.0)}
    state = simulation.load_displacement(beam.force, forces=[force]).frames[-1].state
    gradients = Sensitivity(model).gradients(simulation.solver(beam.force), state, LoadControl(force), observables)
    slopes = simulation.comm.allreduce(np.array([gradient.design @ direction[:owned] for gradient in gradients]))
    for place, slope in enumerate(slopes):
        rates = taylor_rates(lambda t, k=place: known[t[0]][k], [0.0], [1.0], [slope], [0.4, 0.2, 0.1, 0.05])
        assert rates.with_gradient[-1] >= 1.95


@pytest.mark.parametrize(
    ("region", "at", "problem"),
    [
        (fm.Face(where=lambda points: points[:, 0] > 2.0 * LENGTH), (LENGTH, 0.0), "no facet"),
        (fm.Face(), (60.0, 0.0), "not on a flat face"),
        (fm.Face(), (LENGTH, 0.5 * THICKNESS), "two faces"),
    ],
)
@pytest.mark.parallel
def test_regions_that_hold_nothing_are_refused(region, at, problem):
    beam = Beam(region, at=at, space="plane-stress")
    with pytest.raises(fm.DescriptionError, match=problem) as error:
        beam.curve(1.0)
    assert "'push'" in str(error.value)


def test_invalid_regions_are_refused():
    for region in (3.0, fm.Disc(-1.0), fm.Rectangle(1.0, 0.0), fm.Face(within=fm.Disc(0.0))):
        with pytest.raises(fm.DescriptionError, match="push"):
            Beam(region, space="plane-stress")
    with pytest.raises(fm.DescriptionError, match="both"):
        fm.Face(within=fm.Disc(1.0), where=lambda points: points[:, 0] > 0.0)
    mechanism = fm.Mechanism("lever")
    lever = mechanism.rigid("lever")
    with pytest.raises(fm.DescriptionError, match="rigid"):
        mechanism.force(on=lever, at=(1.0, 0.0), direction=(0.0, 1.0), region=fm.Disc(1.0))
