"""How far the force's point may get: by the lengths of rigid links, and by the least stretch that is found for flexible
ones.

Joints at pins x₀ on the ground, x₁, … of a chain of rigid links keep a point P of its last one within

    |P − x₀| ≤ ρ = |x₁ − x₀| + … + |P − xₙ|,

so that it travels by no more than d · (x₀ − P) ± ρ along d, which is exact. A hinge at x₀ of axis a leaves x₁ a circle
about it, and P no more than |d × a| times its radius in place of |x₁ − x₀|, about its centre. Points P_i of links that
turn about the same hinge by one angle travel by

    Σ d_i · (R(θ) − 1) r_i,     |Σ d_i · R(θ) r_i| ≤ |Σ (d_i · r_i + i d_i · (a × r_i))|,

r_i from the axis to P_i.

A flexible link is replaced by strings between its joints and the point of the force, s the length of link between the
ends of a string and d their distance: nothing resists while d < s. Rigid links, joints and motors are as they are;
springs are left out. Then the minimum over all poses, m strings,

    c = min Σ ⟨d / s − 1⟩² + w² (|gaps of joints|² + |travel − wanted|²)

is zero or else at least one link is stretched by 1 + √(c / m), wherever the equilibrium is: where joints are closed and
the travel is as wanted, the second term vanishes, and the first one is no less than c. Least squares finds local
minima: from a known pose on, and from some at random about it, always the same. The least of them bounds the stretch
only if it is the global one, which nothing here proves.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
from scipy.optimize import OptimizeResult, least_squares
from scipy.spatial.transform import Rotation

from .blueprint import Blueprint, CompliancePlan, JointPlan, LinkPlan
from .closure import Place, unit_axis
from .potential import Potential
from .thresholds import THRESHOLDS

_STEPS = 8  # from the travel that is known to the wanted one
_STARTS, _APART = 6, np.pi  # poses at random, and by how many rad or lengths of the mechanism they are off at most
_EVALUATIONS, _TOLERANCE = 100, 1e-6  # of a fit
_WITHIN = 0.9  # of an interface's radius: meshes have polygons for circles
_CLOSE = 1e-3  # between the stretches of fits to the same minimum


@dataclass(frozen=True)
class _String:
    """Between two points, each a body's centre (0, index) or a force's point (1, index), ``length`` apart at most."""

    ends: tuple[tuple[int, int], tuple[int, int]]
    length: float


@dataclass(frozen=True)
class _Chain:
    """Where rigid links let a point get: within ``ball`` of a circle about an ``axis`` through ``centre``, on which
    ``arm`` ends as drawn; by the angle of a ``hinge``."""

    centre: np.ndarray
    ball: float = 0.0
    arm: np.ndarray = field(default_factory=lambda: np.zeros(3))
    axis: np.ndarray = field(default_factory=lambda: np.array((0.0, 0.0, 1.0)))
    hinge: str = ""

    def reach(self, direction: np.ndarray) -> float:
        """How far from the centre along a ``direction``, of any length, at most."""
        return self.ball * float(np.linalg.norm(direction)) + abs(self.turning(direction))

    def turning(self, direction: np.ndarray) -> complex:
        """d · r + i d · (a × r), whose phase the angle of the hinge adds to."""
        return complex(direction @ self.arm, direction @ np.cross(self.axis, self.arm))


def beyond_chains(scene: Blueprint, travel: float) -> float:
    """How far a ``travel`` of the forces' points from the drawn configuration is beyond the reach of rigid links on the
    ground, over the mechanism's length; −∞ where flexible links, slides or joints that give way are in between.

    A point in the interface of a flexible link's joint moves with that as a rigid body. Welds, and joints whose motors
    stay as drawn, make one body of two; motors from the ground on put links at places."""
    soft = {plan.joint for plan in scene.effects if isinstance(plan, CompliancePlan)}
    positions = {motor.joint: motor.position for motor in scene.motors}
    stiff = [joint for joint in scene.joints if joint.name not in soft]
    welds = {joint.name for joint in stiff if joint.kind == "weld" or positions.get(joint.name) == 0.0}
    held = _held(scene, stiff, positions)

    def chains(link: LinkPlan, point: np.ndarray, passed: tuple[str, ...]) -> Iterator[_Chain]:
        """Those that end at a ``point`` of a link."""
        if link.name in held:
            yield _Chain(_moved(held[link.name], point))
            return
        for joint in stiff:
            pinned = joint.kind != "prismatic" or joint.name in welds
            if pinned and link.name in (joint.a, joint.b) and joint.name not in passed:
                other, pin = scene.link(joint.b if link.name == joint.a else joint.a), _in_space(joint.at)
                arm = float(np.linalg.norm(point - pin))
                radius = joint.interface if isinstance(joint.interface, float) else 0.0  # clamps are not turned about
                if link.centreline and not arm < _WITHIN * radius:
                    continue
                if other.name in held and joint.kind == "revolute" and joint.name not in welds:
                    there, axis = held[other.name], unit_axis(joint)
                    if joint.name in positions:
                        motion = there @ _driven(joint, positions[joint.name], onward=other.name == joint.a)
                        yield _Chain(_moved(motion, point))
                        continue
                    centre = pin + axis * (axis @ (point - pin))
                    turned, across = there[:3, :3] @ axis, there[:3, :3] @ (point - centre)
                    yield _Chain(_moved(there, centre), arm=across, axis=turned, hinge=joint.name)
                    continue
                at, own = (point, 0.0) if joint.name in welds else (pin, arm)
                for chain in chains(other, at, (*passed, joint.name)):
                    yield replace(chain, ball=chain.ball + own)

    least = most = 0.0
    together: list[dict[str, np.ndarray]] = []  # middles and turnings of points on links that a hinge turns alone
    for ratio, force in zip(scene.ratios, scene.forces, strict=False):
        point, direction = _in_space(force.at), _in_space(force.direction)
        direction *= ratio / np.linalg.norm(direction)
        ends = [(direction @ (chain.centre - point), chain) for chain in chains(scene.link(force.on), point, ())]
        least += max((middle - chain.reach(direction) for middle, chain in ends), default=-np.inf)
        most += min((middle + chain.reach(direction) for middle, chain in ends), default=np.inf)
        alone = [(middle, chain) for middle, chain in ends if chain.hinge and not chain.ball]
        together.append({chain.hinge: np.array((middle, chain.turning(direction))) for middle, chain in alone})
    for hinge in set(together[0]).intersection(*together[1:]):
        middle, turning = sum(own[hinge] for own in together)
        least, most = max(least, middle.real - abs(turning)), min(most, middle.real + abs(turning))
    return max(travel - most, least - travel) / scene.length


def _held(scene: Blueprint, stiff: Sequence[JointPlan], positions: dict[str, float]) -> dict[str, np.ndarray]:
    """Motions of the rigid links that joints and motors hold, one after the other from the ground on: (4, 4), of
    homogeneous coordinates."""
    held = {link.name: np.eye(4) for link in scene.links if link.fixed}
    for _ in scene.links:
        for joint in stiff:
            if joint.kind != "weld" and joint.name not in positions:
                continue
            for base, link in ((joint.a, joint.b), (joint.b, joint.a)):
                if base in held and link not in held and not scene.link(link).centreline:
                    own = _driven(joint, positions.get(joint.name, 0.0), onward=base == joint.a)
                    held[link] = held[base] @ own
    return held


def _driven(joint: JointPlan, position: float, *, onward: bool) -> np.ndarray:
    """Motion of a joint's link b against a, to the ``position`` of its motor; ``onward`` or else of a against b."""
    motion, way = np.eye(4), (position if onward else -position) * unit_axis(joint)
    if joint.kind == "prismatic":
        motion[:3, 3] = way
        return motion
    turn, pin = Rotation.from_rotvec(way).as_matrix(), _in_space(joint.at)
    motion[:3, :3], motion[:3, 3] = turn, pin - turn @ pin
    return motion


def _moved(motion: np.ndarray, point: np.ndarray) -> np.ndarray:
    return motion[:3, :3] @ point + motion[:3, 3]


def _in_space(vector: tuple[float, ...]) -> np.ndarray:
    return np.array((*vector, 0.0)[:3])


def least_stretch(potential: Potential, u: np.ndarray, poses: np.ndarray, travel: float) -> float:
    """The least stretch 1 + √(c / m) of the links that was found; one if they need none.

    NaN if no fit converged to it.

    Args:
        potential: of the scene.
        u: nodal displacements of a known state, flat.
        poses: of its bodies.
        travel: of the force's point from the drawn configuration, wanted.
    """
    dim, length = potential.blueprint.dim, potential.blueprint.length
    turns = 1 if dim == 2 else 3
    start = potential.places(poses)
    nodal = potential.nodal(potential.fields(u)[0], start)
    known = float(np.real(potential.led_travel(nodal, start)))
    forces = potential.blueprint.forces[: len(potential.blueprint.ratios)]
    free = [i for i, fixed in enumerate(potential.fixed) if not fixed]
    loose = [k for k, force in enumerate(forces) if force.on in potential.rows]
    drawn = {k: np.array((*forces[k].at, 0.0)[:dim]) for k in loose}
    moved = {k: potential.moved(forces[k], nodal)[:dim] for k in loose}
    strings = _strings(potential)

    def pose(unknowns: np.ndarray) -> tuple[list[Place], dict[tuple[int, int], np.ndarray]]:
        """Bodies, and where the ends of strings are."""
        places, parts = list(start), unknowns[: len(free) * (dim + turns)].reshape(len(free), dim + turns)
        for body, part in zip(free, parts, strict=True):
            vector, old = np.zeros(3), start[body]
            vector[3 - turns :] = part[dim:]
            turn = Rotation.from_rotvec(vector).as_matrix()[:dim, :dim] @ old.turn
            places[body] = Place(old.centre, old.shift + length * part[:dim], turn, old.angle + vector[2])
        ends = {(0, i): np.array(body.centre + body.shift, dtype=float) for i, body in enumerate(places)}
        shifts = unknowns[len(free) * (dim + turns) :].reshape(len(loose), dim)
        for k, shift in zip(loose, shifts, strict=True):
            ends[1, k] = drawn[k] + moved[k] + length * shift
        return places, ends

    def residual(unknowns: np.ndarray, wanted: float) -> np.ndarray:
        places, ends = pose(unknowns)
        way = 0.0
        for k, (ratio, force) in enumerate(zip(potential.blueprint.ratios, forces, strict=True)):
            direction = np.array((*force.direction, 0.0)[:dim])
            if k in loose:
                way += ratio * (direction / np.linalg.norm(direction)) @ (ends[1, k] - drawn[k])
            else:
                way += ratio * float(np.real(potential.travel(force, nodal, places)))
        slack = [np.linalg.norm(ends[s.ends[0]] - ends[s.ends[1]]) / s.length - 1.0 for s in strings]
        held = np.append(potential.closure.residual(places).astype(float), (way - wanted) / length)
        return np.concatenate([np.maximum(slack, 0.0), THRESHOLDS.tied * held])

    def fitted(unknowns: np.ndarray, wanted: float) -> OptimizeResult | None:
        """None where a fit runs off beyond all numbers."""
        try:
            return least_squares(residual, unknowns, args=(wanted,), xtol=1e-12, ftol=_TOLERANCE, max_nfev=_EVALUATIONS)
        except ValueError:
            return None

    unknowns = np.zeros(len(free) * (dim + turns) + len(loose) * dim)
    for share in np.linspace(0.0, 1.0, _STEPS + 1)[1:]:
        fit = fitted(unknowns, known + share * (travel - known))
        unknowns = unknowns if fit is None else fit.x
    starts = np.random.default_rng(0).uniform(-_APART, _APART, (_STARTS, unknowns.size))
    fits = [own for own in (fit, *(fitted(start, travel) for start in starts)) if own is not None]
    stretches = 1.0 + np.sqrt([2.0 * fit.cost / max(len(strings), 1) for fit in fits])
    least, converged = float(stretches.min(initial=np.inf)), stretches[[fit.success for fit in fits]]
    return least if converged.min(initial=np.inf) < least + _CLOSE else np.nan


def _strings(potential: Potential) -> list[_String]:
    """Between all joints of a link, and points of forces on it."""
    strings, led = [], potential.blueprint.forces[: len(potential.blueprint.ratios)]
    for link in potential.blueprint.flexible:
        ends = []
        for joint in potential.blueprint.joints:
            if link.name in (joint.a, joint.b):
                body = potential.closure.ends[joint.name][int(link.name == joint.b)]
                ends.append(((0, body), _along(link, joint.at)))
        ends += [((1, k), _along(link, force.at)) for k, force in enumerate(led) if force.on == link.name]
        for (a, first), (b, second) in combinations(ends, 2):
            # arcs through the points of a centreline are longer than the polygon, by less than a fifth
            length = 1.2 * abs(second - first) + link.thickness
            strings.append(_String((a, b), length))
    return strings


def _along(link: LinkPlan, at: tuple[float, ...]) -> float:
    """Where a point is along the polygon through the points of a centreline."""
    point, nearest, where, passed = np.array(at[:2]), np.inf, 0.0, 0.0
    for a, b in zip(link.centreline, link.centreline[1:], strict=False):
        start, side = np.array(a[:2]), np.array(b[:2]) - np.array(a[:2])
        share = float(np.clip((point - start) @ side / (side @ side), 0.0, 1.0))
        if (distance := float(np.linalg.norm(point - start - share * side))) < nearest:
            nearest, where = distance, passed + share * float(np.linalg.norm(side))
        passed += float(np.linalg.norm(side))
    return where
