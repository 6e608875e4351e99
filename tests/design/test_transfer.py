"""Equilibria found from those of another simulation: the same as loaded from zero, in fewer iterations, or refused."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.design import Infeasible, SampleEquilibria
from fenicsmech.equilibrium import NewtonSolver
from fenicsmech.joints import RIGID_SPACES

from ..equilibrium.arch import RISE, arch, lowered
from .alike import assert_alike
from .mechanisms import Case, bench, bow, objective, sprung, strained, truss, turned_beam

CASES = {
    "truss": lambda: truss((0.1, 1.0), (0.4, 2.0)),
    "force on a link": lambda: bow(20.0, 60.0),
    "strained by motors": lambda: strained(1.0, 3.0),
    "springs wound up by motors": lambda: sprung(1.0, 3.0),
    "turned by 135°": lambda: turned_beam(1.0, 3.0, -2.0),
    "held": lambda: held(),
}
QUICK = [("3d-symmetric", "truss"), ("3d-symmetric", "strained by motors")]


def held() -> Case:
    """The truss with a displacement of its tip, whose force is wanted."""
    case = truss((0.1, 1.0))
    (push,) = case.scene.mechanism.forces
    return Case(
        case.scene, case.designs, [fm.Target(fm.ForceMagnitude(push), fm.Sample({push: fm.at(1.0)}), equals=0.1)]
    )


@pytest.fixture
def iterations(monkeypatch) -> list[int]:
    """Newton's iterations of each solve."""
    counts, iterate = [], NewtonSolver.iterate

    def counted(solver, start, control):
        point = iterate(solver, start, control)
        counts.append(point.iterations)
        return point

    monkeypatch.setattr(NewtonSolver, "iterate", counted)
    return counts


def spent(counts: list[int]) -> int:
    total = sum(counts)
    counts.clear()
    return total


@pytest.mark.parametrize(
    ("space", "name"),
    [
        pytest.param(space, name, marks=() if (space, name) in QUICK else pytest.mark.thorough)
        for space, names in (("3d-symmetric", CASES), ("3d", ("force on a link", "springs wound up by motors")))
        for name in names
    ],
)
def test_equilibria_in_space_from_plane_stress_are_those_loaded_from_zero(space, name, iterations):
    case = CASES[name]()
    flat, solid = (bench(case, case.simulate(kind, size=4.0)) for kind in ("plane-stress", space))
    for both in (flat, solid):
        both.rest.place(both.design(0.03, seed=1), None)
    found = flat.equilibria.whole(flat.equilibria.from_zero())
    spent(iterations)
    traced = solid.equilibria.from_zero()
    from_zero = spent(iterations)
    guessed = solid.equilibria.from_other(found)
    assert spent(iterations) < from_zero
    assert_alike(guessed, traced)


def test_meshes_may_differ():
    case = CASES["truss"]()
    coarse, fine = (SampleEquilibria(case.simulate(size=size), case.targets) for size in (5.0, 2.0))
    assert_alike(fine.from_other(coarse.whole(coarse.from_zero())), fine.from_zero())


@pytest.mark.parallel
@pytest.mark.thorough
def test_two_ranks_transfer_equilibria_of_one_and_of_both():
    case = CASES["turned by 135°"]()
    found = [
        equilibria.whole(equilibria.from_zero())
        for comm in (MPI.COMM_SELF, MPI.COMM_WORLD)
        for equilibria in [SampleEquilibria(case.simulate(size=4.0, comm=comm), case.targets)]
    ]
    solid = SampleEquilibria(case.simulate("3d-symmetric", size=4.0, comm=MPI.COMM_WORLD), case.targets)
    traced = solid.from_zero()
    for other in found:
        assert_alike(solid.from_other(other), traced)


@pytest.mark.parallel
def test_every_process_gets_the_equilibria_of_all_samples():
    """Under a motor, samples of another process are not equal to one's own."""
    case = CASES["turned by 135°"]()
    shared, own = objective(case, fm.StayClose(), comm=MPI.COMM_WORLD, size=4.0)
    shared.evaluate(own.rest.initial)
    solid = SampleEquilibria(case.simulate("3d-symmetric", size=4.0, comm=MPI.COMM_WORLD), case.targets)
    assert_alike(solid.from_other(shared.equilibria()), solid.from_zero())


@pytest.fixture(scope="module")
def nearly_snapping():
    """An arch under 0.97 of its limit load, and its equilibria."""
    simulation, push = arch()
    limit = simulation.follow(push, until=fm.Until(displacement=0.7 * RISE)).limit_points[0].frame
    target = fm.Target(push, force=0.97 * limit.force, displacement=limit.displacement)
    own = SampleEquilibria(simulation, [target])
    return simulation, own, own.whole(own.from_zero())


@pytest.mark.parametrize("fall", [pytest.param(0.012, marks=pytest.mark.thorough), 0.015, 0.3])
def test_equilibrium_beyond_a_fold_is_refused(nearly_snapping, fall):
    """Arches lower by a part of the rise, whose limit may be lower."""
    simulation, own, found = nearly_snapping
    lowered(simulation.model, fall)
    if fall > 0.012:
        with pytest.raises(Infeasible, match="fold"):
            own.from_other(found)
    else:
        assert own.values(own.from_other(found)) == pytest.approx(own.values(own.from_zero()), rel=1e-7)


def test_poses_in_the_plane_and_in_space_are_the_same_motion():
    plane, space = RIGID_SPACES[2], RIGID_SPACES[3]
    poses = np.random.default_rng(1).uniform(-3.0, 3.0, (5, 3))
    offsets = np.random.default_rng(2).standard_normal((7, 3))
    lifted = space.converted(poses)
    for flat, solid in zip(poses, lifted, strict=True):
        moved = space.displace(solid, offsets)
        assert moved[:, :2] == pytest.approx(plane.displace(flat, offsets[:, :2]), abs=1e-14)
        assert moved[:, 2] == pytest.approx(0.0, abs=1e-14)
    assert plane.converted(lifted) == pytest.approx(poses, abs=1e-14)
    assert space.converted(lifted) is lifted and plane.converted(poses) is poses
