"""Where load steps start; if nothing but loads holds a mechanism, in the rigid pose that these prefer (``RestSearch``).

Dead loads on a flexible link, those whose energy is linear in displacements, are replaced by their potential as the
link moves rigidly, from their sum and moments. Other loads prefer no pose if they balance on each link, as pressure on
a closed part does, and contact as long as nothing touches: no point meets an obstacle on a way that is shorter than its
gaps at both ends together. The pose as drawn remains the start, and the log says so, where they do not on the way; the
last start does where loads drive the mechanism on without end, or no pose is found.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from mpi4py import MPI

from fenicsmech.collective import from_one
from fenicsmech.continuation import LoadStepper
from fenicsmech.equilibrium import Control, EquilibriumSystem, State
from fenicsmech.log import logger
from fenicsmech.mechanism import Force, ForceGroup, PrescribedPart, in_dimension
from fenicsmech.model import MechanismModel
from fenicsmech.multibody import DeadLoad, PosePotential, RestEnding, RestSearch, TravelSpring, count_freedom

_log = logger(__name__)
_Gaps = list[tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, eq=False)
class RestPose:
    """A configuration without loads.

    Attributes:
        state: the equilibrium there.
        loads_resist: whether loads resist all zero-energy modes there, once they are not zero.
        short: prescribed displacement that is beyond that there; 0 where it is reached, without force.
        reached: whether one is prescribed and reached.
    """

    state: State
    loads_resist: bool = False
    short: float = 0.0
    reached: bool = False


@dataclass(frozen=True)
class Effort:
    """What steps on the way to a frame took.

    Attributes:
        iterations: KKT systems factored and solved.
        snaps: number of times the path turned back.
        seconds: wall-clock time.
        phases: wall-clock time by phase.
    """

    iterations: int = 0
    snaps: int = 0
    seconds: float = 0.0
    phases: Mapping[str, float] = field(default_factory=dict)

    def __add__(self, other: Effort) -> Effort:
        names = {**self.phases, **other.phases}
        phases = {name: self.phases.get(name, 0.0) + other.phases.get(name, 0.0) for name in names}
        seconds = self.seconds + other.seconds
        return Effort(self.iterations + other.iterations, self.snaps + other.snaps, seconds, phases)


@dataclass(frozen=True, eq=False)
class CurveStart:
    """Where load steps start.

    Attributes:
        rest: the pose without loads.
        state: the equilibrium there under constant loads.
        steps: load steps from there.
    """

    rest: RestPose
    state: State
    steps: LoadStepper


class RestPoses:
    """The poses of one configuration that loads prefer.

    Args:
        model: of the mechanism.
        system: its equations.
        unloaded: its rigid assembly.
        motors: of the linkage with rigid links, (connections,).
        constant: other forces and their magnitudes, which act as effects do.
        part: the controlled force, or motors.
        where: the part and the configuration, for messages.
    """

    def __init__(
        self,
        model: MechanismModel,
        system: EquilibriumSystem,
        unloaded: State,
        motors: np.ndarray,
        constant: Iterable[tuple[Force, float]],
        part: PrescribedPart,
        where: str,
    ) -> None:
        self._model, self._system, self._unloaded, self._motors = model, system, unloaded, motors
        self._others, self._where, self._search = dict(constant), where, RestSearch()
        self._ratios = dict(part.ratios) if isinstance(part, Force | ForceGroup) else {}
        self._last: tuple[bool, float, RestPose | None] | None = None  # what was wanted, and the pose

    def under(self, control: Control) -> RestPose | None:
        """The pose that constant loads prefer, and the controlled force as it starts from zero, by its sign.

        Where a displacement is prescribed, from the drawing, it is the pose nearest to it. None if none is found.
        """
        wanted = control.prescribed
        if not control.constrained:
            wanted = math.copysign(1.0, wanted) if wanted else 0.0
        if self._last is not None:
            constrained, before, rest = self._last
            # beyond one that is out of reach, displacements pull from the same pose
            if constrained == control.constrained and (
                wanted == before or (rest is not None and rest.short * (wanted - before) > 0.0)
            ):
                return rest
        rest = self._turned(control.constrained, wanted)
        self._last = control.constrained, wanted, rest
        return rest

    def balanced(self, factor: float = 0.0) -> State | None:
        """The pose in which all loads balance, and springs, none of them far stronger than others; None if that is the
        pose as drawn, or none is found.

        Args:
            factor: of the controlled force.
        """
        model, rigid, unloaded = self._model, self._model.linkage.rigid, self._unloaded
        levels = ((), (*model.spring_potentials, *self._constant, *self._dead(self._ratios, factor)))
        turn = from_one(model.mesh.mesh.comm, lambda: self._search.pose(rigid, unloaded.poses, self._motors, levels))
        still = np.array_equal(turn.way[-1], unloaded.poses)
        if still or turn.ending is not RestEnding.AT_REST or any(True for _ in self._met_on(turn.way)):
            return None
        return self._at(turn.way[-1])

    def same(self, a: RestPose, b: RestPose) -> bool:
        """Whether steps under load that start from one may start from the other as well."""
        if a.reached or b.reached or a.loads_resist != b.loads_resist:
            return False
        rigid, poses = self._model.linkage.rigid, (a.state.poses, b.state.poses)
        apart = from_one(self._model.mesh.mesh.comm, lambda: self._search.distance(rigid, *poses))
        return apart <= self._search.same

    def _turned(self, constrained: bool, wanted: float) -> RestPose | None:
        model, rigid, unloaded = self._model, self._model.linkage.rigid, self._unloaded
        spring = TravelSpring([*self._dead(self._ratios)], wanted)
        weak: list[PosePotential] = [spring] if constrained else [*self._dead(self._ratios, wanted)]
        levels = (model.spring_potentials, self._constant, weak)
        loads = [potential for level in levels for potential in level]

        def search():
            turn = self._search.pose(rigid, unloaded.poses, self._motors, levels)
            free = count_freedom(rigid, turn.way[-1], self._motors, loads, self._system.idle).zero_energy
            near, short = self._search.near * model.linkage.length, spring.short(turn.way[-1])
            return turn, not free, short if constrained and abs(short) > near else 0.0

        # of one process: decisions that depend on rounding are the same on all
        turn, resist, short = from_one(model.mesh.mesh.comm, search)
        reached = constrained and not short
        if turn.ending is not RestEnding.AT_REST:
            value = f"displacement {spring.short(unloaded.poses):g}" if constrained else f"forces of sign {wanted:g}"
            unsettled = turn.ending is RestEnding.NOT_CONVERGED
            _log.log(
                logging.WARNING if unsettled else logging.INFO,
                "%s, %s: %s%s; load steps start where the last ones did, or as drawn. "
                "Draw it nearer to rest, or add a spring",
                self._where,
                value,
                turn.ending.value,
                f" ({self._search.steps} steps)" if unsettled else "",
            )
            return None
        if np.array_equal(turn.way[-1], unloaded.poses):
            return RestPose(unloaded, resist, short, reached)
        for met in self._met_on(turn.way):
            _log.info("%s: load steps start from the pose as drawn: on the way, %s", self._where, met)
            return RestPose(unloaded)
        return RestPose(self._at(turn.way[-1]), resist, short, reached)

    def _at(self, poses: np.ndarray) -> State:
        rest = self._model.assembled_state(poses, self._unloaded.motors)
        return replace(self._unloaded, u=rest.u, poses=poses)

    def _met_on(self, way: Sequence[np.ndarray]) -> Iterator[str]:
        """What flexible links meet on the way between poses of all bodies."""
        for poses in way if self._model.elastic.has_other_than_dead_loads else ():
            if link := self._disturbed(self._at(poses)):
                yield f"{link!r} meets loads that are not dead"
        if not self._system.surfaces:
            return
        for before, after in pairwise((poses, self._gaps(poses)) for poses in way):
            if link := self._obstructed(before, after):
                yield f"{link!r} meets an obstacle, or passes it closely"

    def _obstructed(self, before: tuple[np.ndarray, _Gaps], after: tuple[np.ndarray, _Gaps]) -> str | None:
        """The first flexible link that may meet an obstacle on the way from poses of all bodies to others, with their
        gaps.

        The way is bisected until each point's gaps at both ends, together, are larger than its motion by a quarter:
        spheres of these radii around both ends, which are clear, then hold any way between them that is up to a quarter
        longer than the straight one. Between poses that are near each other, points may meet an obstacle only if they
        are in it at an end.
        """
        model, comm, search = self._model, self._model.mesh.mesh.comm, self._search
        rigid, inside = model.linkage.rigid, -search.same * model.linkage.length
        close: set[str] = set()
        met: set[str] = set()
        for surface, (start, gaps), (end, others) in zip(self._system.surfaces, before[1], after[1], strict=True):
            if np.any(1.25 * np.linalg.norm(end - start, axis=1) > gaps + others):
                close.add(surface.link.name)
            if np.any(np.minimum(gaps, others) < inside):
                met.add(surface.link.name)
        close, met = (set().union(*comm.allgather(names)) for names in (close, met))
        if met or not close:
            return min(met, default=None)
        if from_one(comm, lambda: search.distance(rigid, before[0], after[0])) <= search.clear:
            return None
        arguments = before[0], after[0], self._motors, model.spring_potentials
        poses = from_one(comm, lambda: search.halfway(rigid, *arguments))
        if poses is None:
            return min(close)
        middle = poses, self._gaps(poses)
        return self._obstructed(before, middle) or self._obstructed(middle, after)

    def _gaps(self, poses: np.ndarray) -> _Gaps:
        """Of each surface, this rank's points at the ``poses`` of all bodies, (n, dim), and their gaps, (n,)."""
        self._model.load(self._at(poses))
        for surface in self._system.surfaces:
            surface.update()
        return [(surface.places, surface.gaps) for surface in self._system.surfaces]

    def _disturbed(self, state: State) -> str | None:
        """The first flexible link on which loads that are not dead, of obstacles too, do not balance in a loaded
        ``state``."""
        model, dim = self._model, self._model.linkage.dim
        model.load(state)
        _, others = model.elastic.effect_loads()
        moved = state.u[: model.interfaces.owned * model.interfaces.block].reshape(model.interfaces.owned, -1)
        for link, (_, force, moments, size) in zip(
            model.linkage.interfaces, self._resultants(others, moved[:, :dim]), strict=True
        ):
            largest = max(np.linalg.norm(force), np.linalg.norm(moments - moments.T) / model.linkage.length)
            if largest > self._search.balanced * size:
                return link.name
        return None

    def _dead(self, forces: Mapping[Force, float], factor: float = 1.0) -> Iterator[DeadLoad]:
        model, dim = self._model, self._model.linkage.dim
        for force, magnitude in forces.items():
            if factor * magnitude:
                point = model.linkage.point(force.on, model.rest_position(force).tolist())
                yield DeadLoad.at(point, factor * magnitude * np.array(in_dimension(force.direction, dim)))

    @cached_property
    def _constant(self) -> list[PosePotential]:
        """Potentials of dead loads that grow with the load factor, and of poses."""
        model = self._model
        found = [*self._dead(self._others), *(potential for potential in model.potentials if not potential.holds)]
        if model.elastic.effects_ufl is None:
            return found
        loads = self._resultants(model.elastic.effect_loads()[0])
        space = model.linkage.joints.space
        return found + [DeadLoad(body, force, moments, space) for body, force, moments, size in loads if size]

    def _resultants(
        self, loads: np.ndarray, moved: np.ndarray | float = 0.0
    ) -> Iterator[tuple[int, np.ndarray, np.ndarray, float]]:
        """Of each flexible link with nodal ``loads`` f_i, flat: the body with the centre c that moves with it, Σ f_i,
        Σ f_i ⊗ (X_i + u_i − c), u_i as ``moved`` (owned nodes, dim), and Σ |f_i|."""
        model, linkage = self._model, self._model.linkage
        owned, dim, comm = model.interfaces.owned, linkage.dim, model.mesh.mesh.comm
        nodal = loads.reshape(owned, -1)[:, :dim]
        drawn = model.elastic.drawn_nodes + model.design_nodes.values(model.elastic.design)
        positions = drawn[:owned, :dim] + moved
        for index, (body, *_) in enumerate(linkage.interfaces.values()):
            nodes = np.flatnonzero(model.node_link[:owned] == index)
            own, offsets = nodal[nodes], positions[nodes] - np.array(linkage.bodies[body].centre)
            sums = np.concatenate([own.sum(axis=0), (own.T @ offsets).ravel(), [np.abs(own).sum()]])
            total = comm.allreduce(sums, op=MPI.SUM)
            yield body, total[:dim], total[dim:-1].reshape(dim, dim), float(total[-1])
