"""Steps along the arc go round corners, where other points touch, and do not jump to branches on which others do."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.continuation import ArcLengthStepper, Finish
from fenicsmech.equilibrium import ArcLengthControl, EquilibriumPoint, LoadControl, NotConverged, Stability, State, Step

REFUSED = "bends too sharply, or another one is too near"
SHARP = math.radians(75.0)  # more than steps along smooth paths may turn


@dataclass
class Plate:
    """Paths in the plane of a displacement and a force, given by their points, as ``ArcLengthStepper`` sees them.

    Args:
        paths: points of each, (n, 2), and whether something touches on the piece that begins at each of them.
        until: the displacement up to which solves end on the first path; beyond, on the other one.
        modes: unstable ones of each path.
        lost: the displacement beyond which tangents are not finite.
        wall: the displacement beyond which something touches.
    """

    paths: list[tuple[np.ndarray, np.ndarray]]
    until: float = math.inf
    modes: tuple[int, ...] = (0, 0)
    lost: float = math.inf
    wall: float = math.inf
    potentials, comm, ideal_compliance = (), MPI.COMM_SELF, 0.0

    turning = None  # no other steps

    def __post_init__(self) -> None:
        self.system = self.contact = self
        self.joints = self.unknowns = self
        self.length, self.unit = 1.0, 1e3

    # -- a system with one displacement ---------------------------------------------------------------------------

    def size(self, step: Step) -> float:
        return float(np.abs(step.u).max())

    def mean_product(self, a: Step, b: Step) -> float:
        return float(a.u @ b.u)

    def difference(self, later: State, earlier: State) -> Step:
        return Step(later.u - earlier.u, np.zeros(0), np.zeros(0), later.force - earlier.force)

    settled_difference = difference  # no link spins

    def settled(self, step: Step, state: State) -> Step:
        return step

    def moved(self, state: State, step: Step) -> State:
        return State(state.u + step.u, state.poses, state.multipliers, state.force + step.force, state.motors)

    def touching(self, state: State) -> np.ndarray:
        return state.u > self.wall

    # -- a solver in closed form ----------------------------------------------------------------------------------

    def point(self, place: np.ndarray, way: np.ndarray, touches: bool, control, modes: int) -> EquilibriumPoint:
        tangent = Step(way[:1], np.zeros(0), np.zeros(0), float(way[1]))
        state = State(place[:1], np.zeros((0, 1)), np.zeros(0), float(place[1]), np.zeros(0))
        rate, stability = float(way[0]), Stability(modes, modes)
        return EquilibriumPoint(state, control, tangent, rate, stability, 1, (0.0,), None, np.array([touches]))

    def linearise(self, state: State, control: LoadControl):
        places, touches = self.paths[0]
        k = int(np.flatnonzero(touches == self.touching(state)[0])[0])
        way = (places[k + 1] - places[k]) / (places[k + 1] - places[k])[1]
        if isinstance(control, ArcLengthControl) and way[0] * control.normal.u[0] < 0.0:
            way = -way
        found = self.point(places[k], way, bool(touches[k]), control, self.modes[0])
        return type("At", (), {"residual": None, "point": staticmethod(lambda residuals, iterations: found)})

    def relative(self, residual: None) -> float:
        return 0.0

    def solve(self, guess: State, control) -> EquilibriumPoint:
        """Where the plane through the guess meets the path, nearest to it."""
        metric, normal = control.metric, control.normal
        on = int(guess.u[0] > self.until)
        places, touches = self.paths[on]
        scale = np.array([1.0 / metric.motion**2, 1.0 / metric.value**2])
        across = np.array([normal.u[0], normal.force]) * scale
        heights = (places - [guess.u[0], guess.force]) @ across
        met = list[tuple[float, EquilibriumPoint]]()
        for k in range(len(places) - 1):
            if heights[k] * heights[k + 1] <= 0.0 and heights[k] != heights[k + 1]:
                part = heights[k] / (heights[k] - heights[k + 1])
                way = places[k + 1] - places[k]
                way = way / math.sqrt(way**2 @ scale) * (1.0 if way @ across > 0.0 else -1.0)
                place = places[k] + part * (places[k + 1] - places[k])
                way = way * (math.nan if place[0] > self.lost else 1.0)
                away = float((place - [guess.u[0], guess.force]) ** 2 @ scale)
                met.append((away, self.point(place, way, bool(touches[k]), control, self.modes[on])))
        if not met:
            raise NotConverged("the plane meets no path", 1)
        return min(met, key=lambda found: found[0])[1]


def stepper(plate: Plate, **options: float) -> ArcLengthStepper:
    start = State(plate.paths[0][0][0][:1], np.zeros((0, 1)), np.zeros(0), 0.0, np.zeros(0))
    return ArcLengthStepper(plate, LoadControl(), start, steps=fm.ArcSteps(**options), value=1.0, conjugate=None)


def walked(path: ArcLengthStepper, end: float) -> np.ndarray:
    """Displacements and forces of points of a path until a force."""
    finish = Finish(path.value, path.value_rate, end, 1.0)
    ends = list(path.follow(path.start, [finish], most=200))
    return np.array([[point.state.u[0], point.state.force] for _, point in ends])


def turned(places: list[tuple[float, float]], touching: list[bool]) -> tuple[np.ndarray, np.ndarray]:
    return np.array(places), np.array(touching)


def corner(angle: float) -> tuple[np.ndarray, np.ndarray]:
    """A path along the displacement axis's diagonal that turns by ``angle`` towards the force where it touches."""
    way = math.radians(45.0)
    met = np.array([0.303, 0.303])
    before = np.array([0.0, 0.0])
    after = met + 5.0 * np.array([math.cos(way + angle), math.sin(way + angle)])
    return turned([before, met, after], [False, True, True])


def test_a_corner_where_something_touches_is_passed_in_whole_steps():
    path = stepper(Plate([corner(math.radians(60.0))]))
    places = walked(path, 1.0)
    assert len(places) < 60 and places[-1][1] == pytest.approx(1.0)


def test_a_path_that_turns_back_at_a_corner_goes_on_beyond_it():
    path = stepper(Plate([corner(math.radians(130.0))], wall=0.303))
    places = walked(path, 0.6)
    assert len(places) < 150 and places[-1][1] == pytest.approx(0.6)
    back = places[places[:, 1] > 0.3031]
    assert len(back) > 20 and back[:, 0] == pytest.approx(0.303 - (back[:, 1] - 0.303) / math.tan(math.radians(5.0)))


def test_no_step_takes_another_branch_on_which_something_touches():
    # beside the corner that the path would have, another path passes at a distance of a fifth of a step
    straight = turned([(0.0, 0.0), (0.303, 0.303), (2.0, 2.0)], [False, False, False])
    other = np.array([0.33, 0.28])
    way = math.radians(45.0) + SHARP
    branch = turned([other, other + 5.0 * np.array([math.cos(way), math.sin(way)])], [True, True])
    path = stepper(Plate([straight, branch], until=0.32))
    with pytest.raises(NotConverged, match=REFUSED):
        walked(path, 1.0)


def test_a_step_that_hardly_turns_does_not_take_a_less_stable_branch_on_which_something_touches():
    # a parallel branch at a distance of half a step, which the stability tells from the path
    straight = turned([(0.0, 0.0), (2.0, 2.0)], [False, False])
    branch = turned([(0.06, 0.0), (2.06, 2.0)], [True, True])
    with pytest.raises(NotConverged, match=REFUSED):
        walked(stepper(Plate([straight, branch], until=0.32, modes=(0, 1))), 1.0)


def test_a_step_to_a_point_without_a_tangent_is_not_taken():
    straight = turned([(0.0, 0.0), (2.0, 2.0)], [False, False])
    with pytest.raises(NotConverged, match=REFUSED):
        walked(stepper(Plate([straight], lost=0.32)), 1.0)
