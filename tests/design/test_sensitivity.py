"""Adjoint derivatives of displacements pass Taylor tests in the design field, the moduli and the force."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.design.sensitivity import Adjoint

from ..oracles.dense import taylor_rates

PLASTIC = fm.Material("plastic", 2000.0, 0.35)
FORCE = 8.0


class Bench:
    """A four-bar of two flexible links and a rigid, loaded one; the design field is a free function."""

    def __init__(self, space: str) -> None:
        mechanism = fm.Mechanism("four-bar")
        ground, coupler = mechanism.rigid("ground", fixed=True), mechanism.rigid("coupler")
        left = mechanism.flexible("left", fm.strip([(0, 0), (-4, 15), (0, 30)], thickness=3.0, depth=6.0), PLASTIC)
        right = mechanism.flexible("right", fm.strip([(40, 0), (46, 15), (40, 30)], thickness=3.0, depth=6.0), PLASTIC)
        shaft = mechanism.revolute(ground, left, at=(0, 0), radius=2.0)
        mechanism.revolute(left, coupler, at=(0, 30), radius=2.0)
        mechanism.revolute(ground, right, at=(40, 0), radius=2.0)
        mechanism.revolute(right, coupler, at=(40, 30), radius=2.0)
        motor = mechanism.motor(shaft)
        self.force = mechanism.force(on=coupler, at=(20, 35), direction=(1, 0.3))
        scene = fm.Scene(mechanism)
        self.turned = scene.configuration("turned", {motor: 0.3})
        self.simulation = fm.Simulation(scene, space=space, size=4.0)
        self.model = self.simulation.model
        self.adjoint = Adjoint(self.model, self.simulation.newton(self.force))
        self.space = self.model.elastic.d.function_space
        self.owned = self.space.dofmap.index_map.size_local * self.space.dofmap.index_map_bs

    def field(self, seed: int) -> np.ndarray:
        """A smooth design field, the same on any number of ranks."""
        random = np.random.default_rng(seed)
        dim = self.model.linkage.dim
        positions = self.space.tabulate_dof_coordinates()
        waves, phases = random.uniform(-0.08, 0.08, (3, dim)), random.uniform(0.0, 6.0, dim)
        return (0.3 * np.sin(positions @ waves + phases)).ravel()

    def state(self, design: np.ndarray, force: float = FORCE):
        """The last frame of the curve to ``force`` of the given design."""
        self.model.reshape(design)
        samples = [force / 2, force]
        return self.simulation.load_displacement(self.force, forces=samples, configuration=self.turned).frames[-1]

    def gradient(self, frame):
        """The derivatives of the displacement of the loaded point."""
        return self.adjoint.gradients(frame.state, [self.simulation.newton(self.force).system.controlled])[0]


@pytest.fixture(scope="module", params=["plane-stress", "plane-strain", "3d"])
def bench(request) -> Bench:
    return Bench(request.param)


@pytest.mark.parallel
def test_derivative_by_the_design_field_away_from_the_drawn_shape(bench):
    base, direction = bench.field(1), bench.field(2)
    gradient = bench.gradient(bench.state(base))
    slope = bench.simulation.comm.allreduce(float(gradient.design @ direction[: bench.owned]), op=MPI.SUM)
    rates = taylor_rates(
        lambda t: bench.state(base + t[0] * direction).displacement,
        np.zeros(1),
        np.ones(1),
        np.array([slope]),
        [0.4, 0.2, 0.1, 0.05],
    )
    assert np.all(rates.without >= 0.95)
    assert np.all(rates.with_gradient >= 1.95)


@pytest.mark.parametrize(
    ("constant", "steps"), [("youngs_modulus", (80.0, 40.0, 20.0)), ("poissons_ratio", (0.02, 0.01, 0.005))]
)
def test_derivatives_by_the_moduli_of_one_link(bench, constant, steps):
    base, index = bench.field(1), 1
    frame = bench.state(base)
    gradient = bench.gradient(frame)
    slope = {"youngs_modulus": gradient.youngs_moduli, "poissons_ratio": gradient.poissons_ratios}[constant][index]
    values = getattr(bench.model.elastic, constant).x.array
    inside, before = bench.model.mesh.link == index, values.copy()

    def changed(t: np.ndarray) -> float:
        values[inside] = before[inside] + t[0]
        displacement = bench.state(base).displacement
        values[:] = before
        return displacement

    rates = taylor_rates(changed, np.zeros(1), np.ones(1), np.array([slope]), steps)
    assert np.all(rates.with_gradient >= 1.95)
    assert np.all(rates.without >= 0.95)


def test_derivative_by_the_force(bench):
    base = bench.field(1)
    slope = bench.gradient(bench.state(base)).force
    rates = taylor_rates(
        lambda t: bench.state(base, FORCE + t[0]).displacement,
        np.zeros(1),
        np.ones(1),
        np.array([slope]),
        [2.0, 1.0, 0.5],
    )
    assert np.all(rates.with_gradient >= 1.95)
