"""Sensitivity derivatives of displacements pass Taylor tests in the design field, the moduli and the force."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.design import Gradient, Sensitivity
from fenicsmech.equilibrium import State

from ..oracles.dense import taylor_rates
from .in_plane import design_field

pytestmark = pytest.mark.parallel

COMMS = {"alone": MPI.COMM_SELF, "together": MPI.COMM_WORLD}
PLASTIC = fm.Material("plastic", 2000.0, 0.35)
FORCE = 8.0


class Bench:
    """A four-bar of two flexible links and a rigid, loaded one; the design field is a free function.

    Travels are those of the loaded point, of another point of the same link, and of one on a flexible link.
    """

    def __init__(self, space: str, comm: MPI.Comm, formulation: fm.MixedFormulation | None = None) -> None:
        mechanism = fm.Mechanism("four-bar")
        ground, coupler = mechanism.rigid("ground", fixed=True), mechanism.rigid("coupler")
        left = mechanism.flexible("left", fm.strip([(0, 0), (-4, 15), (0, 30)], thickness=3.0, depth=6.0), PLASTIC)
        right = mechanism.flexible("right", fm.strip([(40, 0), (46, 15), (40, 30)], thickness=3.0, depth=6.0), PLASTIC)
        shaft = mechanism.revolute(ground, left, at=(0, 0), interface_radius=2.0)
        mechanism.revolute(left, coupler, at=(0, 30), interface_radius=2.0)
        mechanism.revolute(ground, right, at=(40, 0), interface_radius=2.0)
        mechanism.revolute(right, coupler, at=(40, 30), interface_radius=2.0)
        motor = mechanism.motor(shaft)
        self.force = mechanism.force(on=coupler, at=(20, 35), direction=(1, 0.3))
        points = (
            mechanism.output(on=coupler, at=(0, 40), direction=(0, 1), name="lift"),
            mechanism.output(on=right, at=(45.5, 15), direction=(1, 0), name="bulge"),
        )
        self.parts = (self.force, *points)
        scene = fm.Scene(mechanism)
        self.turned = scene.configuration("turned", {motor: 0.3})
        self.simulation = fm.Simulation(scene, space=space, size=4.0, formulation=formulation, comm=comm)
        self.model = self.simulation.model
        self.adjoint = Sensitivity(self.model, self.simulation.newton(self.force))
        self.space = self.model.elastic.d.function_space
        self.owned = self.space.dofmap.index_map.size_local * self.space.dofmap.index_map_bs

    def field(self, seed: int) -> np.ndarray:
        """A smooth design field, the same on any number of ranks."""
        random = np.random.default_rng(seed)
        dim = self.model.linkage.dim
        positions = self.space.tabulate_dof_coordinates()
        waves, phases = random.uniform(-0.08, 0.08, (3, dim)), random.uniform(0.0, 6.0, dim)
        return design_field(self.model, 0.3 * np.sin(positions @ waves + phases))

    def state(self, design: np.ndarray, force: float = FORCE) -> State:
        """The equilibrium under ``force`` of the given design."""
        self.model.reshape(design)
        samples = [force / 2, force]
        curve = self.simulation.load_displacement(self.force, forces=samples, configuration=self.turned)
        return curve.frames[-1].state

    def travels(self, design: np.ndarray, force: float = FORCE) -> np.ndarray:
        """How far each point has moved, (points,)."""
        state = self.state(design, force)
        self.model.load(state)
        return np.array([self.model.travel(part, state) for part in self.parts])

    def gradients(self, state: State) -> list[Gradient]:
        """The derivatives of each point's travel."""
        return self.adjoint.gradients(state, [self.model.point_load(part) for part in self.parts])


# with "pressure", links have one of their own
SPACES = ("plane-stress", "plane-strain", "3d-symmetric", "3d", "plane-strain pressure", "3d pressure")


@pytest.fixture(scope="module", params=[(s, c) for s in SPACES for c in COMMS], ids="-".join)
def bench(request) -> Bench:
    (space, *pressure), comm = request.param[0].split(), request.param[1]
    made = Bench(space, COMMS[comm], fm.MixedFormulation(above=0.3) if pressure else None)
    assert bool(made.model.pressure_dofs) == bool(pressure)
    return made


def assert_slopes(travels: Callable[[float], np.ndarray], slopes: Sequence[float], steps: Sequence[float]) -> None:
    """Taylor tests of the derivative of each point's travel by one number."""
    values = {h: travels(h) for h in (0.0, *steps)}
    for point, slope in enumerate(slopes):
        # the field of a rank is part of the number: t alone is common to all of them
        rates = taylor_rates(lambda t, point=point: values[t[0]][point], [0.0], [1.0], [slope], steps)
        assert np.all(rates.without >= 0.95)
        assert np.all(rates.with_gradient >= 1.95)


@pytest.mark.thorough
def test_derivatives_by_the_design_field_away_from_the_drawn_shape(bench):
    base, direction = bench.field(1), bench.field(2)
    gradients = bench.gradients(bench.state(base))
    shares = np.array([gradient.design @ direction[: bench.owned] for gradient in gradients])
    slopes = bench.simulation.comm.allreduce(shares, op=MPI.SUM)
    assert_slopes(lambda t: bench.travels(base + t * direction), slopes, [0.4, 0.2, 0.1, 0.05])


@pytest.mark.thorough
@pytest.mark.parametrize(("constant", "steps"), [("E", (16.0, 8.0, 4.0)), ("nu", (0.016, 0.008, 0.004))])
def test_derivatives_by_the_moduli_of_one_link(bench, constant, steps):
    base, index = bench.field(1), 1
    gradients = bench.gradients(bench.state(base))
    values = bench.model.elastic.parameters[constant].x.array
    inside, before = bench.model.mesh.link == index, values.copy()

    def changed(t: float) -> np.ndarray:
        values[inside] = before[inside] + t
        travels = bench.travels(base)
        values[:] = before
        return travels

    assert_slopes(changed, [gradient.parameters[constant][index] for gradient in gradients], steps)


@pytest.mark.thorough
def test_derivatives_by_the_force(bench):
    base = bench.field(1)
    slopes = [gradient.force for gradient in bench.gradients(bench.state(base))]
    assert_slopes(lambda t: bench.travels(base, FORCE + t), slopes, [0.4, 0.2, 0.1])
