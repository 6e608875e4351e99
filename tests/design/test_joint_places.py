"""Positions and axes of joints as numbers of designs: the mechanism is the one drawn with its joints there."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial.transform import Rotation

import fenicsmech as fm
from fenicsmech.design import Correction, MeshQuality, NumberBounds, ShapeBounds, StayClose
from fenicsmech.mechanism import DRAWN, Configuration

from ..oracles.fourbar import FourBar
from .mechanisms import Case, objective, truss
from .refusal import refused

PLASTIC = fm.Material("plastic", 2000.0, 0.35)
EXACT = {"optimiser": fm.LevenbergMarquardt(tolerance=1e-16), "correction": Correction(estimates=False)}
RUBBER = fm.Material("rubber", 2.0, 0.35)
SHIFTS = {"shaft": (2.0, -1.0), "pin": (-3.0, 2.0), "joint": (1.5, 4.0), "axle": (-2.0, 3.0)}


class Machine:
    """A four-bar of rigid links with springs and a pushed coupler, its joints drawn shifted; a motor turns it.

    A clamped leaf takes no part: simulations need a flexible link.
    """

    PLACES = {"shaft": (0, 0), "pin": (5, 30), "joint": (50, 42), "axle": (60, 0)}

    def __init__(self, shifts: dict | None = None, *, driven: bool = True) -> None:
        rig = fm.Mechanism("four-bar")
        ground = rig.rigid("ground", fixed=True)
        self.crank, self.coupler, rocker = (rig.rigid(name) for name in ("crank", "coupler", "rocker"))
        _leaf(rig, ground)
        ends = ((ground, self.crank), (self.crank, self.coupler), (self.coupler, rocker), (ground, rocker))
        self.joints, self.places = {}, {}
        for (name, at), (a, b) in zip(self.PLACES.items(), ends, strict=True):
            self.places[name] = np.array(at, dtype=float) + (shifts or {}).get(name, (0, 0))
            self.joints[name] = rig.revolute(a, b, at=self.places[name], name=name)
        self.push = rig.force(on=self.coupler, at=(25, 60), direction=(1, -0.4))
        self.pull = rig.force(on=self.crank, at=self.PLACES["pin"], direction=(1, 0), name="pull")
        springs = [fm.JointSpring(self.joints["axle"], 4000.0, rest=0.1), fm.JointSpring(self.joints["shaft"], 3000.0)]
        self.scene = fm.Scene(rig, springs)
        self.motor = rig.motor(self.joints["pin"]) if driven else None
        self.place = self.scene.configuration("turned", {self.motor: 0.4}) if driven else DRAWN

    def simulate(self, space: str = "plane-stress") -> fm.Simulation:
        return fm.Simulation(self.scene, space=space, size=6.0, order=1, comm=MPI.COMM_SELF)

    def measured(self, sim: fm.Simulation) -> np.ndarray:
        """Displacements, torques and reactions under two forces."""
        return _measured(sim, self.push, "axle", self.place)


def _leaf(rig: fm.Mechanism, ground: fm.RigidLink) -> None:
    # as soft as the springs: the equations are regularised relative to the mean stiffness
    leaf = rig.flexible("leaf", fm.strip([(0, -30), (20, -30)], thickness=6.0, depth=6.0), RUBBER)
    rig.weld(ground, leaf, at=(3, -30), interface_radius=2.0)


def _measured(sim: fm.Simulation, push, joint: str, place: Configuration = DRAWN) -> np.ndarray:
    frames = sim.load_displacement(push, forces=[5.0, 10.0], configuration=place).frames
    each = [(f.displacement, *f.motors.values(), *f.reactions[joint].force, *f.reactions[joint].moment) for f in frames]
    return np.array(each).ravel()


def chain(turns: dict | None = None, shifts: dict | None = None) -> tuple[fm.Simulation, fm.Force, dict[str, fm.Joint]]:
    """An arm on a hinge and a sled on the arm in space, held by springs, the axes drawn turned and shifted."""
    rig = fm.Mechanism("chain")
    ground, arm, sled = rig.rigid("ground", fixed=True), rig.rigid("arm"), rig.rigid("sled")
    _leaf(rig, ground)

    def axis(name: str, drawn: tuple[float, float, float]) -> np.ndarray:
        return Rotation.from_rotvec((turns or {}).get(name, (0, 0, 0))).apply(drawn)

    def place(name: str, drawn: tuple[float, float, float]) -> np.ndarray:
        return np.add((shifts or {}).get(name, (0, 0, 0)), drawn)

    hinge = rig.revolute(ground, arm, at=place("hinge", (0, 0, 0)), axis=axis("hinge", (0, 0, 1)), name="hinge")
    slider = rig.prismatic(arm, sled, at=place("slider", (40, 5, 0)), axis=axis("slider", (1, 0, 0)), name="slider")
    push = rig.force(on=sled, at=(60, 10, 5), direction=(0.5, 1, 0.3))
    scene = fm.Scene(rig, [fm.JointSpring(hinge, 3000.0, rest=0.2), fm.JointSpring(slider, 4.0)])
    sim = fm.Simulation(scene, space="3d", size=6.0, order=1, comm=MPI.COMM_SELF)
    return sim, push, {"hinge": hinge, "slider": slider}


def designed(sim: fm.Simulation, numbers: dict) -> fm.Simulation:
    """A simulation with other numbers and links of the drawn shape."""
    return sim.with_design(fm.Design(np.zeros_like(sim.model.design.field), numbers))


@pytest.mark.parametrize("space", ["plane-stress", pytest.param("3d", marks=pytest.mark.thorough)])
def test_shifted_joints_of_rigid_links_are_joints_drawn_there(space):
    drawn, there = Machine(), Machine(SHIFTS)
    sim, shifts = drawn.simulate(space), {}
    for name, (x, y) in SHIFTS.items():
        shifts[fm.JointPosition(drawn.joints[name], direction=(2, 0))] = x
        shifts[fm.JointPosition(drawn.joints[name], direction=(0, 1))] = y
    found, wanted = drawn.measured(designed(sim, shifts)), there.measured(there.simulate(space))
    assert found == pytest.approx(wanted, rel=1e-10, abs=1e-10 * np.abs(wanted).max())
    before = drawn.measured(sim)
    assert np.abs(found - before).max() > 0.01 * np.abs(before).max()


def test_derivatives_by_a_joint_that_a_problem_does_not_move_are_those_by_differences():
    case = truss((0.1, 6.0), (0.4, 9.0))
    tip = [joint for joint in case.scene.mechanism.joints if joint.at[:2] == (40, 60)]
    kind, coarse = fm.JointPosition(*tip, direction=(1, 1)), {"size": 6.0, "order": 1}
    problem = case.problem(**coarse)
    found = problem.linearise(problem.initial, numbers=[kind])
    moving = Case(case.scene, [*case.designs, fm.Number(kind, -1.0, 1.0)], case.targets).problem(**coarse)
    below, above = (moving.linearise(np.append(problem.initial, q)) for q in (0.49, 0.51))  # 0.04 mm apart
    assert found.by_numbers[:, 0] == pytest.approx((above.values - below.values) / 0.04, rel=3e-4)
    followed = np.subtract(above.links[0].controls, below.links[0].controls) / 0.04
    assert found.controls_by_numbers[0][..., 0] == pytest.approx(followed, abs=1e-9)
    assert found.jacobian == pytest.approx(problem.linearise(problem.initial).jacobian, rel=1e-9)


def test_places_in_files_are_those_written_to_the_last_digit():
    machine, rng = Machine(), np.random.default_rng(7)
    pair = machine.joints["pin"], machine.joints["axle"]
    for way, other in rng.standard_normal((100, 2, 3)):
        for kind in (
            fm.JointPosition(*pair, direction=way),
            fm.JointPosition(*pair, direction=[way, other]),
            fm.JointAxis(*pair, about=way),
        ):
            assert type(kind).read(machine.scene, kind.words) == kind


def test_joints_keep_their_places_when_links_are_made_of_another_material():
    drawn = Machine()
    moved = {drawn.joints[name]: fm.JointChange(np.array(by), np.zeros(1)) for name, by in SHIFTS.items()}
    there = drawn.simulate().with_shapes({}, moved=moved)
    other = there.with_material(RUBBER, fm.Material("other rubber", 2.0, 0.35))
    assert drawn.measured(other) == pytest.approx(drawn.measured(there), rel=1e-12)


def test_pictures_show_joints_where_numbers_place_them():
    drawn, there = Machine(), Machine(SHIFTS)
    shifts = {
        fm.JointPosition(drawn.joints[name], direction=way): shift
        for name, by in SHIFTS.items()
        for way, shift in zip(((1, 0), (0, 1)), by, strict=True)
    }
    panel = designed(drawn.simulate(), shifts).load_displacement(drawn.push, forces=[0.0]).panel()
    pins = {tuple(np.round(pin.at, 6)) for pin in panel.undeformed.pins}
    assert pins >= {tuple(np.round(at, 6)) for at in there.places.values()}
    (coupler,) = (shape.outline for shape in panel.undeformed.rigid if shape.name == "coupler")
    (x, y), far = there.places["joint"], coupler.max(axis=0)
    assert far[0] > x and far[1] > y


def test_turned_axes_of_rigid_links_are_as_axes_drawn_turned():
    turns = {"hinge": (0.3, -0.4, 0.0), "slider": (0.0, 0.2, 0.5)}
    (sim, push, joints), (there, other, _) = chain(), chain(turns)
    numbers = {
        fm.JointAxis(joints["hinge"], about=(1, 0, 0)): 0.3,
        fm.JointAxis(joints["hinge"], about=(0, 2, 0)): -0.4,
        fm.JointAxis(joints["slider"], about=(0, 0.2, 0.5)): float(np.hypot(0.2, 0.5)),
    }
    for joint in ("hinge", "slider"):
        found, wanted = _measured(designed(sim, numbers), push, joint), _measured(there, other, joint)
        assert found == pytest.approx(wanted, rel=1e-10, abs=1e-10 * np.abs(wanted).max())
        assert np.abs(found - _measured(sim, push, joint)).max() > 0.01 * np.abs(wanted).max()


def test_joints_of_rigid_links_are_shifted_in_all_three_directions():
    turns = {"hinge": (0.6, 0.2, 0.0)}
    shifts = {"hinge": (1.0, -2.0, 4.0), "slider": (0.0, 1.0, -3.0)}
    (there, push, _), (drawn, own_push, joints) = chain(turns, shifts), chain(turns)
    numbers = {
        fm.JointPosition(joints[name], direction=axis): shift
        for name, by in shifts.items()
        for axis, shift in zip(np.eye(3), by, strict=True)
    }
    found, wanted = _measured(designed(drawn, numbers), own_push, "hinge"), _measured(there, push, "hinge")
    assert found == pytest.approx(wanted, rel=1e-9, abs=1e-9 * np.abs(wanted).max())
    before = _measured(drawn, own_push, "hinge")
    assert np.abs(found - before).max() > 0.01 * np.abs(before).max()


@pytest.mark.parametrize("space", ["plane-stress", pytest.param("3d", marks=pytest.mark.thorough)])
def test_derivatives_by_places_of_joints_of_rigid_links_agree_with_differences(space):
    if space == "3d":
        sim, push, joints = chain()
        numbers = [
            fm.Number(fm.JointAxis(joints["hinge"], about=(1, 0, 0)), -0.5, 0.5),
            fm.Number(fm.JointAxis(joints["hinge"], about=(0, 1, 0)), -0.5, 0.6),
            fm.Number(fm.JointAxis(joints["slider"], about=(0, 0, 1)), -0.5, 0.4),
            fm.Number(fm.JointPosition(joints["slider"], direction=(1, 2, 3)), -8.0, 5.0),
        ]
        moments, place = [fm.JointMoment(joints["hinge"]), fm.JointForce(joints["slider"])], DRAWN
    else:
        machine = Machine()
        sim, push, joints, place = machine.simulate(), machine.push, machine.joints, machine.place
        shifts = [(joints[name], along) for name in joints for along in ((1, 0), (0, 1))]
        numbers = [fm.Number(fm.JointPosition(joint, direction=along), -6.0, 5.0) for joint, along in shifts]
        moments = [fm.MotorTorque(machine.motor), fm.JointMoment(joints["pin"])]
    sample = fm.Sample({push: 8.0}, configuration=place)
    quantities = [fm.Displacement(push), *moments, fm.JointForce(joints[next(iter(joints))])]
    sizes = [quantity.size(sim.linkage.dim) for quantity in quantities]
    wanted = [0.0 if size == 1 else (0.0,) * size for size in sizes]
    targets = [fm.Target(q, sample, equals=w, scale=1.0) for q, w in zip(quantities, wanted, strict=True)]
    case = Case(sim.scene, numbers, targets)
    whole, bench = objective(case, StayClose(), space=space, size=6.0, order=1)
    p, direction = bench.design(0.5, seed=3), bench.direction(4)
    jacobian = whole.evaluate(p).jacobian
    pairs = [[whole.evaluate(p + h * direction).residuals for h in (step, -step)] for step in (2e-3, 4e-3)]
    near, far = ((ahead - back) / (2 * h) for (ahead, back), h in zip(pairs, (2e-3, 4e-3), strict=True))
    slopes = (4.0 * near - far) / 3.0
    assert jacobian @ direction == pytest.approx(slopes, rel=1e-6, abs=1e-6 * np.abs(slopes).max())


def test_pivots_are_recovered_from_the_coupler_curve_of_a_known_four_bar():
    known = {"joint": (-4.0, 3.0), "axle": (5.0, -6.0)}
    truth = Machine(known).places
    lengths = [float(np.linalg.norm(truth[b] - truth[a])) for a, b in pairwise(("shaft", "pin", "joint", "axle"))]
    oracle = FourBar((0.0, 0.0), tuple(truth["axle"]), *lengths)
    start, traced = np.arctan2(*truth["pin"][::-1]), np.array([20.0, 55.0])
    unit = (truth["joint"] - truth["pin"]) / oracle.coupler
    arm = traced - truth["pin"]
    place = {"along": float(arm @ unit), "across": float(unit[0] * arm[1] - unit[1] * arm[0])}
    machine, targets = Machine(driven=False), []
    for turn in (-0.5, -0.25, 0.2, 0.4):
        pin = oracle.positions(start + turn)[0]
        moves = oracle.coupler_point(start + turn, **place) - traced
        sample = fm.Sample({machine.pull: fm.at(float(pin[0] - truth["pin"][0]))})
        targets.append(fm.Target(fm.Displacement(machine.coupler, at=tuple(traced)), sample, equals=tuple(moves)))
    kinds = [fm.JointPosition(machine.joints[name], direction=way) for name in known for way in ((1, 0), (0, 1))]
    problem = fm.DesignProblem(machine.simulate(), [fm.Number(kind, -10.0, 10.0) for kind in kinds], targets=targets)
    result = problem.optimise(**EXACT)
    assert result.worst_error < 1e-8
    assert [own.value for own in result.numbers] == pytest.approx([c for at in known.values() for c in at], abs=1e-6)


def prop(shift: tuple[float, float] = (0.0, 0.0), space: str = "plane-stress", size: float = 1.5):
    """A straight strip between a stiffly sprung hinge and a pin to a lever, drawn with the pin shifted.

    Returns:
        The simulation, the pin and a force that bends the strip.
    """
    rig = fm.Mechanism("prop")
    ground, hand = rig.rigid("ground", fixed=True), rig.rigid("hand")
    end = (60.0 + shift[0], shift[1])
    strip = rig.flexible("strip", fm.strip([(0, 0), end], thickness=3.0, depth=5.0), PLASTIC)
    heel = rig.revolute(ground, strip, at=(0, 0), interface_radius=1.5, name="heel")
    pin = rig.revolute(strip, hand, at=end, interface_radius=1.5, name="pin")
    rig.revolute(ground, hand, at=(90, 40), name="pivot")
    push = rig.force(on=hand, at=(90, -10), direction=(1, 0.2))
    scene = fm.Scene(rig, [fm.JointSpring(heel, 4000.0)])
    return fm.Simulation(scene, space=space, size=size, comm=MPI.COMM_SELF), pin, push


def both_ways(pin: fm.Joint) -> list[fm.Number]:
    """Shifts of a joint in the plane."""
    return [fm.Number(fm.JointPosition(pin, direction=way), -20.0, 18.0) for way in ((1, 0), (0, 1))]


@pytest.mark.parametrize(
    ("space", "shift"),
    [
        ("plane-stress", (8.0, 0.0)),
        ("plane-stress", (-6.0, -10.0)),
        pytest.param("3d", (-6.0, -10.0), marks=pytest.mark.thorough),
    ],
)
def test_strips_follow_shifted_joints_as_if_drawn_there(space, shift):
    size = 1.5 if space == "plane-stress" else 3.0
    sim, pin, push = prop(space=space, size=size)
    there, _, other = prop(shift, space, size)
    targets = [fm.Target(push, force=2.0, displacement=1.0)]
    problem = fm.DesignProblem(sim, both_ways(pin), targets=targets)
    design = problem.rest_shape((np.array(shift) + 20.0) / 38.0)  # from 20 mm before to 18 mm beyond
    found = sim.with_design(design).load_displacement(push, forces=[2.0])
    wanted = there.load_displacement(other, forces=[2.0])
    error = max(abs(wanted.error_estimates()[0]), abs(found.error_estimates()[0]))
    assert abs(found.displacements[0] - wanted.displacements[0]) < max(2.0 * error, 2e-4 * abs(wanted.displacements[0]))
    before = sim.load_displacement(push, forces=[2.0]).displacements[0]
    assert abs(before - wanted.displacements[0]) > 0.02 * abs(wanted.displacements[0])


@pytest.mark.thorough
def test_position_is_found_at_which_a_strip_drawn_there_moves_as_wanted_and_is_exported(tmp_path):
    there, _, other = prop((0.0, 8.0), size=2.0)
    wanted = float(there.load_displacement(other, forces=[1.5]).corrected[0])
    sim, pin, push = prop(size=2.0)
    problem = fm.DesignProblem(sim, both_ways(pin)[1:], targets=[fm.Target(push, force=1.5, displacement=wanted)])
    result = problem.verify(problem.optimise(), tmp_path)
    (number,), (target,) = result.numbers, result.targets
    assert number.name == "position of 'pin' along (0, 1)" and number.unit == "mm" and number.drawn == 0.0
    assert result.links[0].parameters == () and result.parameters == 1
    assert number.value == pytest.approx(8.0, abs=0.1)
    assert target.met and target.part.error == pytest.approx(target.error, abs=3e-3)
    result.save(tmp_path / "design.json")
    loaded = fm.DesignResult.load(tmp_path / "design.json")
    once, again = (sim.with_design(own).load_displacement(push, forces=[1.5]) for own in (result, loaded))
    assert once.displacements == pytest.approx([target.reached], rel=1e-9)
    assert again.displacements == pytest.approx(once.displacements, rel=1e-12)


@pytest.mark.thorough
def test_a_position_in_space_is_verified_in_the_part():
    sim, pin, push = prop(space="3d", size=6.0)
    problem = fm.DesignProblem(sim, both_ways(pin)[1:], targets=[fm.Target(push, force=1.5, displacement=1.0)])
    result = problem.optimise(optimiser=fm.LevenbergMarquardt(iterations=1), surrogate=None)
    (target,) = problem.verify(result).targets
    part = target.part.value + target.part.finer_elements_add
    assert part == pytest.approx(target.corrected, rel=0.1)


def shifted_truss() -> Case:
    """The truss finger, whose diagonal may change its shape, and whose joints at the tip may be shifted together."""
    case = truss((0.1, 2.0), (0.4, 3.2))
    link = case.designs[0].link
    joints = [joint for joint in case.scene.mechanism.joints if joint.at[:2] in ((40.0, 60.0), (40, 60))]
    at_tip = [fm.Number(fm.JointPosition(*joints, direction=way), -5.0, 6.0) for way in ((1, 0), (0, 1))]
    ground = next(joint for joint in case.scene.mechanism.joints if link in (joint.a, joint.b) and joint not in joints)
    heel = fm.Number(fm.JointPosition(ground, direction=(1, 1)), -4.0, 5.0)
    return Case(case.scene, [*case.designs, *at_tip, heel], case.targets)


@pytest.mark.parametrize(
    ("space", "size", "shapes"),
    [
        ("plane-stress", 3.0, True),
        ("plane-stress", 3.0, False),
        pytest.param("3d", 4.0, True, marks=pytest.mark.thorough),
    ],
)
def test_gradients_by_shapes_and_shifts_agree_with_central_differences(space, size, shapes):
    case = shifted_truss()
    if not shapes:  # the diagonal follows its joints
        case = Case(case.scene, case.designs[1:], case.targets)
    regulariser = MeshQuality(limit=2.5, width=2.5) + ShapeBounds() + NumberBounds() + 1e-3 * StayClose()
    whole, bench = objective(case, regulariser, space=space, size=size)
    p, direction = bench.design(0.05 if shapes else 1.0, seed=5), bench.direction(6)
    here = whole.evaluate(p)

    def slope(of) -> np.ndarray:
        found = []
        for step in (1e-3, 2e-3):
            ahead, back = (of(whole.evaluate(p + h * direction)) for h in (step, -step))
            found.append((ahead - back) / (2 * step))
        return (4.0 * found[0] - found[1]) / 3.0

    assert here.gradient @ direction == pytest.approx(slope(lambda own: own.value), rel=1e-5)
    residuals = slope(lambda own: own.residuals)
    assert here.jacobian @ direction == pytest.approx(residuals, rel=1e-5, abs=1e-5 * np.abs(residuals).max())


def test_invalid_places_are_refused():
    case = shifted_truss()
    sim, (diagonal,) = case.simulate(size=6.0), case.scene.mechanism.flexible_links
    joints = case.scene.mechanism.joints
    tip = [joint for joint in joints if joint.at[:2] == (40, 60)]

    def problem(kind: fm.NumberKind) -> fm.DesignProblem:
        return fm.DesignProblem(sim, [fm.Number(kind, -1.0, 1.0)], targets=case.targets)

    refused(lambda: fm.JointPosition(tip[0], direction=(0, 0)), part="position", problem="zero length", remedy="vector")
    refused(lambda: fm.JointPosition(direction=(1, 0)), part="position", problem="no part", remedy="Name one")
    other = Machine().joints["pin"]
    refused(
        lambda: problem(fm.JointPosition(other, direction=(1, 0))), part="'pin'", problem="has none", remedy="scene has"
    )
    refused(
        lambda: problem(fm.JointPosition(*tip, direction=(0, 0, 1))),
        part="position",
        problem="leaves the plane",
        remedy="two coordinates",
    )
    spatial = fm.Number(fm.JointPosition(*tip, direction=(0, 0, 1)), -1.0, 1.0)
    refused(
        lambda: fm.DesignProblem(case.simulate("3d", size=6.0), [spatial], targets=case.targets),
        part="position",
        problem=f"{tip[-1].name!r} holds 'diagonal', which is flexible",
        remedy="along x and y, or weld a rigid link",
    )
    refused(lambda: problem(fm.JointAxis(tip[0], about=(1, 0, 0))), part="axis", problem="no axis", remedy="sliders")
    refused(lambda: fm.Number(fm.JointAxis(tip[0]), -4.0, 1.0), part="axis", problem="-4 rad", remedy="half a turn")
    table = fm.Mechanism("table")
    ground, top = table.rigid("ground", fixed=True), table.rigid("top")
    legs, feet = [], []
    for side in (-20, 20):
        line = [(side, 0), (side, 40)]
        legs.append(table.flexible(f"leg {side}", fm.strip(line, thickness=3.0, depth=10.0), PLASTIC))
        feet.append(table.weld(ground, legs[-1], at=line[0], interface_radius=3.0))
        table.weld(top, legs[-1], at=line[-1], interface_radius=3.0)
    shared = fm.SplineDesign(legs[0], 2, same=legs[1])
    target = fm.Target(table.force(on=top, at=(0, 40), direction=(1, 0)), force=1.0, displacement=0.1)
    stand = fm.Simulation(fm.Scene(table), space="plane-stress", size=6.0)

    def shifted(*joints, along) -> fm.DesignProblem:
        shift = fm.Number(fm.JointPosition(*joints, direction=along), -1.0, 1.0)
        return fm.DesignProblem(stand, [shared, shift], targets=[target])

    refused(
        lambda: shifted(feet[1], along=(1, 0)),
        part="position",
        problem="'leg -20' shares the shape",
        remedy="all links",
    )
    refused(
        lambda: shifted(*feet, along=[(1, 0), (-1, 0)]),
        part="position",
        problem="the image of 'leg -20' in 'leg 20'",
        remedy="with the direction (1, 0)",
    )
    refused(
        lambda: shifted(*feet, along=[(1, 0)]), part="direction", problem="1 direction for 2 joints", remedy="for each"
    )
    for given in (1.0, None):
        refused(
            lambda given=given: fm.JointPosition(*feet, direction=given),
            part="direction",
            problem=str(given),
            remedy="Give",
        )
    assert len(tip) == 2 and diagonal in (tip[0].a, tip[0].b, tip[1].a, tip[1].b)
