"""Error estimates of displacements and forces: within a factor of two of the true errors, at half a frame at most."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.equilibrium import EquilibriumSolver
from fenicsmech.files import read_csv

from ..simulation.demo_scenes import describe
from ..simulation.five_problems import case
from ..simulation.refined import arch, cantilever, refine


def estimated(
    name: str, space: str, order: int, size: float, *, comm: MPI.Comm = MPI.COMM_WORLD
) -> tuple[float, float]:
    """Displacement at the load, and its estimated error."""
    scene, push, load = case(name)
    simulation = fm.Simulation(scene, space=space, order=order, size=size, comm=comm)
    curve = simulation.load_displacement(push, forces=[0.5 * load, load])
    return curve.displacements[-1], curve.error_estimates()[-1]


def reference(name: str, space: str, size: float) -> float:
    scene, push, load = case(name)
    simulation = fm.Simulation(scene, space=space, order=3, size=size)
    return simulation.load_displacement(push, forces=[0.5 * load, load]).displacements[-1]


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "order", "size"),
    [
        ("cantilever", 1, 1.0),
        ("arch", 1, 1.0),
        ("arch", 2, 4.0),
        ("truss", 2, 4.0),
        ("cantilever", 2, 2.0),
        ("arch", 2, 2.0),
        ("truss", 2, 2.0),
        ("claw", 2, 2.0),
        ("cantilever", 2, 1.5),
    ],
)
def test_effectivity_in_the_plane_is_between_a_half_and_two(name, order, size, monkeypatch):
    value, estimate = estimated(name, "plane-stress", order, size)
    refine(monkeypatch, 2 if size > 2.0 else 1)
    error = reference(name, "plane-stress", size) - value
    assert 0.5 < estimate / error < 2.0


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["cantilever", "arch"])
def test_effectivity_of_forces_at_prescribed_displacements_is_between_a_half_and_two(name, monkeypatch):
    scene, push, load = case(name)
    simulation = fm.Simulation(scene, space="plane-stress", size=2.0)
    reached = simulation.load_displacement(push, forces=[0.5 * load, load]).displacements
    curve = simulation.load_displacement(push, displacements=list(reached))
    estimates = curve.error_estimates()
    refine(monkeypatch, 1)
    finer = fm.Simulation(scene, space="plane-stress", order=3, size=2.0)
    errors = finer.load_displacement(push, displacements=list(reached)).forces - curve.forces
    effectivity = estimates / errors
    assert np.all((effectivity > 0.5) & (effectivity < 2.0))


def test_errors_of_force_and_displacement_differ_by_the_stiffness():
    """η_f = −η_u df/du."""
    scene, push, load = arch()
    simulation = fm.Simulation(scene, space="plane-stress", size=3.0)
    loads = load * np.array([0.999, 1.0, 1.001])
    curve = simulation.load_displacement(push, forces=list(loads))
    at_force = curve.error_estimates()[1]
    held = simulation.load_displacement(push, displacements=[curve.displacements[1]])
    at_displacement = held.error_estimates()[0]
    stiffness = (loads[2] - loads[0]) / (curve.displacements[2] - curve.displacements[0])
    assert at_displacement == pytest.approx(-stiffness * at_force, rel=1e-4)


@pytest.mark.thorough
@pytest.mark.parametrize("held", ["force", "displacement"])
def test_effectivity_of_the_displacement_of_an_output_is_between_a_half_and_two(held, monkeypatch):
    scene, push, load = arch()
    (link,) = scene.mechanism.flexible_links
    crown = scene.mechanism.output(on=link, at=(20, 9), direction=(0, 1))
    samples = {"forces": [load]} if held == "force" else {"displacements": [0.05]}
    simulation = fm.Simulation(scene, space="plane-stress", size=4.0)
    curve = simulation.load_displacement(push, **samples)
    (estimate,) = curve.error_estimates(output=crown)
    refine(monkeypatch, 2)
    finer = fm.Simulation(scene, space="plane-stress", order=3, size=4.0)
    error = finer.load_displacement(push, **samples).frames[0].outputs[crown] - curve.frames[0].outputs[crown]
    assert 0.5 < estimate / error < 2.0


@pytest.mark.thorough
def test_curve_file_names_what_the_errors_are_of(tmp_path):
    scene, push, load = cantilever()
    simulation = fm.Simulation(scene, space="plane-stress", size=3.0)
    curve = simulation.load_displacement(push, forces=[load])
    followed = simulation.follow(push, until=fm.Until(displacement=curve.displacements[0]))
    held = simulation.load_displacement(push, displacements=list(curve.displacements))
    headers = []
    for number, made in enumerate((curve, held, followed)):
        made.write_csv(tmp_path / f"{number}.csv", errors=True)
        (header,) = [name for name in read_csv(tmp_path / f"{number}.csv") if name.startswith("finer")]
        headers.append(header)
    assert headers == ["finer elements add to the displacement [mm]", *2 * ["finer elements add to the force [N]"]]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "size"), [("cantilever", 3.0), ("cantilever", 2.0), ("arch", 3.0), ("arch", 2.0), ("claw", 3.0)]
)
def test_effectivity_in_space_is_between_a_half_and_two(name, size):
    value, estimate = estimated(name, "3d", 2, size)
    assert 0.5 < estimate / (reference(name, "3d", size) - value) < 2.0


@pytest.mark.thorough
@pytest.mark.parallel
@pytest.mark.parametrize("space", ["plane-stress", "3d-symmetric", "3d"])
def test_estimate_is_the_same_on_any_number_of_processes(space):
    shared = estimated("claw", space, 2, 4.0)[1]
    alone = estimated("claw", space, 2, 4.0, comm=MPI.COMM_SELF)[1]
    assert shared == pytest.approx(alone, rel=1e-5)


def test_estimate_falls_with_the_mesh_and_vanishes_without_load():
    scene, push, load = cantilever()
    estimates = []
    for size in (3.0, 1.5):
        simulation = fm.Simulation(scene, space="plane-stress", size=size)
        curve = simulation.load_displacement(push, forces=[0.0, load])
        estimates.append(curve.error_estimates())
    assert np.all(np.abs(np.array(estimates)[:, 0]) < 1e-12)
    assert estimates[0][1] > 2.0 * estimates[1][1] > 0.0


@pytest.mark.parametrize("space", ["plane-stress", pytest.param("3d", marks=pytest.mark.thorough)])
def test_estimate_takes_half_of_the_factors_of_its_frame_at_most(space, monkeypatch):
    scene, push = describe("claw")
    simulation, forces = fm.Simulation(scene, space=space, size=3.0), list(np.linspace(1.0, 10.0, 10))
    factored, refactor = [], EquilibriumSolver.factor
    monkeypatch.setattr(
        EquilibriumSolver, "factor", lambda *args, **options: factored.append(1) or refactor(*args, **options)
    )
    curve = simulation.load_displacement(push, forces=forces)
    frames = len(factored)
    curve.error_estimates()
    assert len(factored) - frames == len(forces) <= 0.5 * frames
