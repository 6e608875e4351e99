"""Whether an error about a scene that makes sense is true, judged without the solver.

Each excuse is proven by a number of its own, which the table of scenes gives. Some follow from geometry and springs,
the others from the last equilibrium, which must be one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

import fenicsmech as fm

from .assembly_check import smallest_gap
from .blueprint import Blueprint, Built, CompliancePlan, ContactPlan, GravityPlan, LinkPlan, SpringPlan, build
from .closure import Place
from .draw import length
from .motions import STEP, body_modes, moved
from .potential import Potential
from .reach import beyond_chains, least_stretch
from .residual_check import check, fault
from .stability_check import stiffness_left
from .thresholds import THRESHOLDS
from .unstrained_check import unstrained_motions

HELD = "the point cannot move that way"

# where a path turns shows at a few points of it
_LONG = fm.ArcSteps(first=0.1, largest=0.25, iterations=8)


@dataclass(frozen=True)
class Excuse:
    """Why an error is true.

    Attributes:
        reason: in words.
        proof: the number that shows it.
    """

    reason: str
    proof: str


def true_reason(blueprint: Blueprint, built: Built | None, failure: fm.FenicsmechError) -> Excuse | None:
    """Why the error is right; None if it is not."""
    if isinstance(failure, fm.AssemblyError):
        return unassembled(blueprint)
    if not isinstance(failure, fm.EquilibriumError):
        return None
    for reason in _BY_GEOMETRY:
        if excuse := reason(blueprint, built, failure):
            return excuse
    if failure.last is None or not _proven(blueprint, built, failure.last):
        return None
    for reason in _BY_STATE:
        if excuse := reason(blueprint, built, failure):
            return excuse
    return None


def _proven(blueprint: Blueprint, built: Built, last: fm.Frame) -> bool:
    """Whether the last equilibrium is one, with the share of constant loads that it has."""
    potential = Potential.of(blueprint, built.simulation, last.state.load_factor)
    return not fault(blueprint, last, None, check(potential, last, math.nan))


def unassembled(blueprint: Blueprint) -> Excuse | None:
    """Rigid links cannot be joined where motors are to take them, whatever shape the flexible ones have."""
    if blueprint.spins:  # in space
        return None
    return _excuse("rigid links cannot be joined", "gap over length", smallest_gap(blueprint), above=THRESHOLDS.joined)


def immobile(blueprint: Blueprint, built: Built, failure: fm.EquilibriumError) -> Excuse | None:
    """No admissible motion takes the force's point along its direction, by the geometry of joints alone."""
    last = failure.last
    if blueprint.control == "forces" or last is None:
        return None
    potential = Potential.of(blueprint, built.simulation)
    places = potential.places(last.state.poses)
    u = potential.nodal(potential.fields(last.state.u)[0], places)
    if abs(potential.led_travel(u + 1j * STEP * potential.free, places).imag) > 0.0:
        return None
    rates = [
        potential.led_travel(potential.nodal(u, there), there).imag / STEP
        for there in (moved(places, 1j * STEP * mode) for mode in body_modes(potential, places))
    ]
    rate = float(np.linalg.norm(rates))
    return _excuse(HELD, "travel per motion of bodies", rate, below=THRESHOLDS.immobile)


def adrift(blueprint: Blueprint, built: Built, failure: fm.EquilibriumError) -> Excuse | None:
    """Loads work along a translation of drawn bodies that nothing resists: joints stay closed, work grows for ever.

    Any other free motion ends: bodies that turn about joints stay within reach of the ground, where the work of dead
    loads has a maximum, an equilibrium. Nor is there an excuse where an obstacle may end the translation, or where an
    equilibrium with all loads refutes it.
    """
    last = failure.last
    balanced = last is not None and last.state.load_factor == 1.0
    if balanced and (blueprint.control != "forces" or last.force):
        return None
    if any(isinstance(plan, ContactPlan) for plan in blueprint.effects):
        return None
    potential = Potential.of(blueprint, built.simulation)
    motions = _drawn_motions(potential)
    if not motions:
        return None
    sample = _asked(blueprint, failure) if blueprint.control == "forces" else 0.0
    turns = [
        [blueprint.length * there[body].turn.imag.ravel() / STEP for body in range(len(potential.fixed))]
        for _, there in motions
    ]
    rates = np.vstack([_resistance(potential, motions)[0], np.reshape(turns, (len(motions), -1)).T.astype(float)])
    if blueprint.control != "forces":
        rates = np.vstack([rates, [potential.led_travel(du, there).imag / STEP for du, there in motions]])
    free, _ = _split(rates)
    work = np.zeros(len(motions))
    for k, (du, there) in enumerate(motions):
        done = sum(size * potential.travel(force, du, there) for force, size in potential.acting(sample))
        for plan in blueprint.effects:
            if isinstance(plan, GravityPlan):
                done = done - potential.alone(plan).effect_energy(du, there)
        work[k] = np.imag(done) / STEP
    size = sum(abs(amount) for _, amount in potential.acting(sample)) + potential.weight
    share = float(np.linalg.norm(free @ work)) / max(size, 1e-300)
    reason = "nothing but loads holds the mechanism, and they drive it on without end"
    return _excuse(reason, "work of loads along a free translation", share, above=THRESHOLDS.adrift)


def drowned(blueprint: Blueprint, built: Built, failure: fm.EquilibriumError) -> Excuse | None:
    """A motion of the drawn mechanism that deforms no link is resisted by springs softer than the rounding of links.

    A link of width b and modulus E, in elements about as long as thick, has nodal stiffnesses of E b, each rounded to
    1e-16 of itself; a motion feels those of some thousand nodes: k < 1e-14 E b, k per square of the velocity of what
    moves fastest.
    """
    potential = Potential.of(blueprint, built.simulation)
    rates, stiffnesses = _resistance(potential, _drawn_motions(potential))
    _, resisted = _split(rates)
    if not len(resisted):
        return None
    softest = float(np.linalg.eigvalsh(resisted @ (rates.T * stiffnesses) @ rates @ resisted.T)[0])
    share = softest / max(link.young * link.depth for link in blueprint.flexible)
    reason = "springs softer than the rounding of stiff links"
    return _excuse(reason, "stiffness over the stiffest link's", share, below=THRESHOLDS.drowned)


def outweighed(blueprint: Blueprint, built: Built, failure: fm.EquilibriumError) -> Excuse | None:
    """A soft link resists less than the rounding of stiff ones. The error says so, names them, and its remedy holds.

    What a cantilever of modulus E, length l and second moment I resists at its end, 3 E I / l³, of the softest link
    over the nodal stiffnesses E b of the stiffest one, of width b. Each is rounded to 1e-16, some thousand nodes have
    ten thousand of them, and a hundredth of what resists must stand out of that: 1e-12. With the links that the remedy
    names rigid the scene must end in equilibria.
    """
    if "rounding of the stiffest links" not in failure.remedy:
        return None
    named = {link.name for link in blueprint.flexible if repr(link.name) in failure.remedy}
    softest = min(blueprint.flexible, key=_bending)
    stiffest = max(blueprint.flexible, key=lambda link: link.young * link.depth)
    if stiffest.name not in named or softest.name in named:
        return None
    share = _bending(softest) / (stiffest.young * stiffest.depth)
    if share >= THRESHOLDS.outweighed or not _ends_in_equilibria(blueprint.stiffened(named)):
        return None
    reason = "soft links resist less than the rounding of stiff ones"
    return _excuse(reason, "stiffness over theirs", share, below=THRESHOLDS.outweighed)


def _bending(link: LinkPlan) -> float:
    """3 E I / l³ of a link about the axis along which it is thinner, N/mm."""
    thin, wide = sorted((link.thickness, link.depth))
    return link.young * wide * thin**3 / (4.0 * length(link) ** 3)


def _ends_in_equilibria(blueprint: Blueprint) -> bool:
    """Whether all that the scene asks for is found."""
    try:
        built = build(blueprint)
        frames = built.curve(blueprint).frames
    except fm.FenicsmechError:
        return False
    return all(_proven(blueprint, built, frame) for frame in frames)


def unheard(blueprint: Blueprint, built: Built, failure: fm.EquilibriumError) -> Excuse | None:
    """Motors turn stiff links, and the force is smaller than the rounding of one of their nodal forces.

    Displacements about as large as the mechanism's length ℓ are rounded to 1e-16 of themselves, nodal stiffnesses of
    links of width b and modulus E are E b: F < 1e-16 E b ℓ.
    """
    last = failure.last
    # not on the way to the motors' positions or constant loads
    under_it = "no equilibrium at force" in failure.problem and (last is None or last.state.load_factor == 1.0)
    if blueprint.control != "forces" or not blueprint.motors or not under_it:
        return None
    force = max((abs(size) for _, size in Potential.of(blueprint, built.simulation).acting(_asked(blueprint, failure))))
    share = force / (max(link.young * link.depth for link in blueprint.flexible) * blueprint.length)
    reason = "a force below the rounding of one nodal force of stiff links"
    return _excuse(reason, "force over that", share / THRESHOLDS.unheard, below=1.0)


def at_limit(blueprint: Blueprint, built: Built, failure: fm.EquilibriumError) -> Excuse | None:
    """The last equilibrium, a stable one, has all but lost the stiffness of the softest mode of the unloaded scene.

    Modes are those at the prescribed force or displacement; constant loads are raised before either. Paths go on past
    limit points.
    """
    last = failure.last
    constant = last.state.load_factor < 1.0
    if blueprint.control == "path" and not constant:
        return None
    led = blueprint.control == "displacements" and not constant
    loaded = Potential.of(blueprint, built.simulation, last.state.load_factor)
    unloaded = Potential.of(blueprint, built.simulation, 0.0)
    left = stiffness_left(loaded, last, unloaded, built.simulation.linkage.joints.drawn, led=led)
    if left is None or left < 0.0:
        return None
    return _excuse("at a limit point", "stiffness left", left, below=THRESHOLDS.soft)


def out_of_reach(blueprint: Blueprint, built: Built, failure: fm.EquilibriumError) -> Excuse | None:
    """Rigid links do not reach where the point is prescribed to be; or no pose was found in which it is there and
    flexible links keep their shape.

    Displacements count from the unloaded configuration, travels from the drawn one.
    """
    last = failure.last
    if blueprint.control == "forces" or last.state.load_factor < 1.0:
        return None
    potential = Potential.of(blueprint, built.simulation)
    places = potential.places(last.state.poses)
    travel = float(np.real(potential.led_travel(potential.nodal(potential.fields(last.state.u)[0], places), places)))
    wanted = travel + _asked(blueprint, failure) - last.displacement
    beyond = beyond_chains(blueprint, wanted)
    if excuse := _excuse("out of reach", "beyond rigid links, over length", beyond, above=THRESHOLDS.joined):
        return excuse
    stretch = least_stretch(potential, last.state.u, last.state.poses, wanted)
    return _excuse("out of reach", "least stretch found", stretch, above=THRESHOLDS.unreached)


def inverted(blueprint: Blueprint, built: Built, failure: fm.EquilibriumError) -> Excuse | None:
    """Under a force an element of the last equilibrium is all but turned inside out."""
    if blueprint.control != "forces":
        return None
    potential = Potential.of(blueprint, built.simulation, failure.last.state.load_factor)
    _, least = potential.strained(failure.last.state.u, THRESHOLDS.strained)
    return _excuse("an element all but inverted", "least det F", least, below=THRESHOLDS.inverted)


def overstrained(blueprint: Blueprint, built: Built, failure: fm.EquilibriumError) -> Excuse | None:
    """Under a force part of the links is at a multiple of its length in the last equilibrium, or a fraction of it."""
    if blueprint.control != "forces":
        return None
    potential = Potential.of(blueprint, built.simulation, failure.last.state.load_factor)
    share, _ = potential.strained(failure.last.state.u, THRESHOLDS.strained)
    return _excuse("links strained out of shape", "share of their volume", share, above=THRESHOLDS.strained_share)


def turned_back(blueprint: Blueprint, built: Built, failure: fm.EquilibriumError) -> Excuse | None:
    """A path followed from rest through equilibria that pass the checks turns back before what is asked for, and the
    curve got as far as that.

    Beyond the turn loads and displacements snap, wherever the path goes then. Where constant loads stop the curve, the
    path is that of these, if they are forces alone.
    """
    last = failure.last
    if last.state.load_factor < 1.0:
        blueprint, reached = _constant_forces(blueprint), last.state.load_factor
        if blueprint is None:
            return None
        asked = blueprint.samples[0]
    elif blueprint.control == "path":
        return None
    else:
        asked = _asked(blueprint, failure)
        reached = (last.force if blueprint.control == "forces" else last.displacement) / asked
    name = blueprint.control.removesuffix("s")
    until = fm.Until(**{name: asked}, frames=THRESHOLDS.followed)
    frames = _frames(lambda: built.follow(blueprint, until, _LONG))
    shares = [getattr(frame, name) / asked for frame in frames]
    return _turn(frames, shares, reached, lambda k: _proven(blueprint, built, frames[k]))


def snaps(blueprint: Blueprint, built: Built) -> Excuse | None:
    """The path followed from rest, through equilibria that pass the checks, turns back before the first load."""
    (asked, *_) = blueprint.samples
    frames = _frames(lambda: built.follow(blueprint, fm.Until(force=asked, frames=THRESHOLDS.followed), _LONG))
    return _turn(frames, [frame.force / asked for frame in frames], 1.0, lambda k: _proven(blueprint, built, frames[k]))


def turned_back_by_motors(blueprint: Blueprint, built: Built, failure: fm.EquilibriumError) -> Excuse | None:
    """The same of the path along which motors take a mechanism from the drawing, where nothing else acts."""
    ways = [motor for motor in blueprint.motors if motor.position]
    if failure.last is None or len(ways) != 1 or "of their way" not in failure.problem or _preloaded(blueprint):
        return None
    (way,) = ways
    potential = Potential.of(blueprint, built.simulation)
    places = potential.places(failure.last.state.poses)
    reached = float(np.real(potential.closure.coordinate(blueprint.joint(way.joint), places))) / way.position
    until = fm.Until(position=way.position, frames=THRESHOLDS.followed)
    frames = _frames(lambda: built.simulation.follow(built.motors[way.joint], until=until, steps=_LONG))
    shares = [frame.displacement / way.position for frame in frames]

    def proven(frame: fm.Frame, share: float) -> bool:
        others = [motor for motor in blueprint.motors if motor is not way]
        there = replace(blueprint, motors=(*others, replace(way, position=share * way.position)))
        return _proven(there, built, replace(frame, force=0.0))

    if not proven(failure.last, reached):
        return None
    return _turn(frames, shares, reached, lambda k: proven(frames[k], shares[k]))


def _frames(follow: Callable[[], fm.Curve]) -> tuple[fm.Frame, ...]:
    """Those of a path, also of one that ends early."""
    try:
        return follow().frames
    except fm.EquilibriumError as error:
        return error.frames


def _turn(
    frames: Sequence[fm.Frame], shares: Sequence[float], reached: float, proven: Callable[[int], bool]
) -> Excuse | None:
    """The excuse that a path turns back at a share of its way before the end, where a curve ``reached`` that."""
    # frames at critical points may be all but the same
    apart = [k for k in range(len(shares)) if not k or abs(shares[k] - shares[k - 1]) > THRESHOLDS.reached]
    turns = [
        three
        for three in zip(apart, apart[1:], apart[2:], strict=False)
        if shares[three[0]] < shares[three[1]] > shares[three[2]]
    ]
    if not turns:
        return None
    turn = turns[0][1]
    if shares[turn] >= 1.0 or reached < THRESHOLDS.turned * shares[turn] or not all(map(proven, turns[0])):
        return None
    return Excuse("a path of equilibria turns back", f"share of what is asked for {shares[turn]:.1e}")


def _constant_forces(blueprint: Blueprint) -> Blueprint | None:
    """The scene whose constant forces are those that change, up to what they are; None if other loads are constant."""
    if _preloaded(blueprint):
        return None
    forces = blueprint.forces[len(blueprint.ratios) :]
    sizes = tuple(force.magnitude for force in forces)
    if not forces:
        return None
    if len(forces) == 1:
        return replace(blueprint, forces=forces, ratios=(1.0,), control="forces", samples=sizes)
    return replace(blueprint, forces=forces, ratios=sizes, control="forces", samples=(1.0,))


def _preloaded(blueprint: Blueprint) -> bool:
    """Whether effects load the scene, or may come to."""
    return not all(
        isinstance(plan, CompliancePlan) or (isinstance(plan, SpringPlan) and not plan.rest)
        for plan in blueprint.effects
    )


_Reason = Callable[[Blueprint, Built, fm.EquilibriumError], Excuse | None]
_BY_GEOMETRY: tuple[_Reason, ...] = (immobile, adrift, drowned, unheard, turned_back_by_motors, outweighed)
_BY_STATE: tuple[_Reason, ...] = (at_limit, out_of_reach, inverted, overstrained, turned_back)


def _asked(blueprint: Blueprint, failure: fm.EquilibriumError) -> float:
    """The sample at which the curve failed; that of a path is its end."""
    return blueprint.samples[0 if blueprint.control == "path" else len(failure.frames)]


def _excuse(
    reason: str, name: str, number: float, *, below: float = -math.inf, above: float = math.inf
) -> Excuse | None:
    return Excuse(reason, f"{name} {number:.1e}") if number < below or number > above else None


_Motion = tuple[np.ndarray, list[Place]]


def _drawn_motions(potential: Potential) -> list[_Motion]:
    """Steps along motions of the drawn mechanism that deform no link."""
    poses = np.zeros((len(potential.centres), 3 if potential.blueprint.dim == 2 else 7))
    if potential.blueprint.dim == 3:
        poses[:, 3] = 1.0
    still = np.zeros(potential.mesh.nodes.shape)
    return [(motion.du, motion.there) for motion in unstrained_motions(potential, still, potential.places(poses))]


def _resistance(potential: Potential, motions: list[_Motion]) -> tuple[np.ndarray, np.ndarray]:
    """Rates of springs and joints that give way along motions, (rows, motions), and their stiffnesses, (rows,)."""
    closure, rates, stiffnesses = potential.closure, [], []
    for plan in potential.blueprint.effects:
        match plan:
            case SpringPlan(joint=name, stiffness=stiffness):
                joint = potential.blueprint.joint(name)
                rates.append([[closure.coordinate(joint, there).imag for _, there in motions]])
                stiffnesses.append(stiffness)
            case CompliancePlan(joint=name, compliance=compliance):
                joint = potential.blueprint.joint(name)
                gaps = [closure.gap(joint, there).imag for _, there in motions]
                rates.append(np.reshape(gaps, (len(motions), potential.blueprint.dim)).T)
                stiffnesses += [1.0 / compliance] * potential.blueprint.dim
    rows = np.vstack([np.zeros((0, len(motions))), *rates]).astype(float) / STEP
    return rows, np.array(stiffnesses)


def _split(rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal combinations of motions along which all rates vanish, and those along which they do not."""
    if not rates.shape[1]:
        return np.zeros((0, 0)), np.zeros((0, 0))
    _, values, right = np.linalg.svd(rates.astype(float), full_matrices=True)
    rank = int(np.sum(values > THRESHOLDS.rank * max(values.max(initial=0.0), 1.0)))
    return right[rank:], right[:rank]
