"""Solvers on hard cases: the default against the augmented Lagrangian, plain Newton and PETSc's SNES.

    OPENBLAS_NUM_THREADS=1 python3 -m benchmarks.solvers [CASE …] [--limit SECONDS]

One table: for each case and solver the KKT systems factored on the way, in brackets the load steps that failed and
were halved, and the processor's time relative to the default solver (the shorter of two, all solvers taking turns).
"fails" where a sample was not reached, "stopped" at the time limit; "elsewhere" where the
solver ended in an equilibrium other than the default one's.
"""

from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from math import inf, pi
from time import perf_counter, process_time

import numpy as np
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.equilibrium import EquilibriumMethod, EquilibriumPoint, EquilibriumSolver, LoadControl, NotConverged
from fenicsmech.report import format_table

from ..mechanisms import mechanism
from ..table import command, publish
from . import SNES, AugmentedLagrangian, Globalisation, KKTNewton

SOLVERS = {
    "default": fm.PrimalDualNewton(),
    "without predicted stress": fm.PrimalDualNewton(predicted_stress=False, watchdog=4),
    "augmented Lagrangian": AugmentedLagrangian(),
    "KKT Newton": KKTNewton(),
    "with backtracking": KKTNewton(backtracking=True),
    **{f"SNES {kind.value}": SNES(iterations=25, globalisation=kind) for kind in Globalisation},
}
SAME = 1e-6  # of the largest displacement, or force, on the curve
ROUNDS = 2
LIMIT = 60.0  # s, of a run
COMPILING = 300.0  # s more for the first one


class Stopped(Exception):
    """A run took longer than it may."""


@dataclass
class Count:
    """The cost of a run, in linear systems and failed solves, and the time at which it has to end."""

    iterations: int = 0
    failures: int = 0
    deadline: float = inf

    def start(self, limit: float) -> None:
        """Counts anew, for a run of at most ``limit`` seconds."""
        self.iterations = self.failures = 0
        self.deadline = perf_counter() + limit


@dataclass(frozen=True, kw_only=True)
class Counted(EquilibriumMethod):
    """Another method, counted."""

    method: EquilibriumMethod
    count: Count = field(default_factory=Count)

    def solver(self, system) -> EquilibriumSolver:
        bound = self.method.solver(system)
        solve = bound.solve

        def counted(*arguments, **options) -> EquilibriumPoint:
            if perf_counter() > self.count.deadline:
                raise Stopped
            try:
                solution = solve(*arguments, **options)
            except NotConverged as failure:
                self.count.iterations += failure.iterations
                self.count.failures += 1
                raise
            self.count.iterations += solution.iterations
            return solution

        bound.solve = counted
        return bound


Run = Callable[[], list[float]]  # solves a case, returns the displacements it found


def curve(scene, force, *, configurations=(fm.DRAWN,), size, space="plane-stress", order=2, **samples):
    """A case: the curves of a scene, loaded in adaptive steps."""

    def prepare(solver) -> Run:
        sim = fm.Simulation(scene, space=space, order=order, size=size, solver=solver)

        def run():
            curves = [sim.load_displacement(force, configuration=place, **samples) for place in configurations]
            return [value for c in curves for value in (c.displacements if "forces" in samples else c.forces)]

        run()  # compiles
        return run

    return prepare


def at_once(scene, force, load, *, size, space="plane-stress", seeds=(None,)):
    """A case: one solve for the whole load from the unloaded state, disturbed at random for each of ``seeds``."""

    def prepare(solver) -> Run:
        sim = fm.Simulation(scene, space=space, size=size, solver=solver)
        rest = sim.load_displacement(force, forces=[0.0]).frames[0].state
        bound = sim.solver(force)

        def run():
            found = []
            for seed in seeds:
                start = rest if seed is None else disturbed(sim, rest, load, seed)
                state = bound.solve(start, LoadControl(load)).state
                sim.model.load(state)
                found.append(bound.system.load_displacement(state))
            return found

        return run

    return prepare


def disturbed(sim, state, load, seed):
    """``state`` with every body moved by up to 0.5 mm and 0.015 rad, and random multipliers."""
    random = np.random.default_rng(seed)
    joints = sim.linkage.joints
    z = joints.unknowns(state.poses)
    z = z + 0.015 * random.uniform(-1.0, 1.0, len(z)) * np.where(joints.pose_scale == 1.0, 1.0, 30.0)
    multipliers = load * random.uniform(-1.0, 1.0, joints.rows)
    return replace(state, poses=joints.with_unknowns(state.poses, z), multipliers=multipliers)


def cantilever(slenderness, parameter):
    """A clamped strip under a dead tip load P L² / EI = ``parameter``: scene, force, load."""
    length, young = 100.0, 12000.0
    thickness = length / slenderness
    made = fm.Mechanism("cantilever")
    base, hand = made.rigid("base", fixed=True), made.rigid("hand")
    shape = fm.strip([(-thickness, 0), (length + thickness, 0)], thickness=thickness, depth=1.0)
    beam = made.flexible("beam", shape, fm.Material("steel", young, 0.3))
    clamp = fm.Rectangle(thickness, 1.5 * thickness)
    made.weld(base, beam, at=(-0.5 * thickness, 0), region=clamp)
    made.weld(beam, hand, at=(length + 0.5 * thickness, 0), region=clamp)
    force = made.force(on=hand, at=(length, 0), direction=(0, 1))
    return fm.Scene(made), force, parameter * young * thickness**3 / 12.0 / length**2


def column():
    """A pinned column, bowed by a hundredth of its thickness, on a slide; Euler's load."""
    length, thickness, young = 100.0, 2.0, 1000.0
    made = fm.Mechanism("column")
    base, head = made.rigid("base", fixed=True), made.rigid("head")
    shape = fm.strip([(0, 0), (length / 2, 0.01 * thickness), (length, 0)], thickness=thickness, depth=1.0)
    strut = made.flexible("strut", shape, fm.Material("steel", young, 0.3))
    made.revolute(base, strut, at=(0, 0), interface_radius=0.5 * thickness)
    made.revolute(strut, head, at=(length, 0), interface_radius=0.5 * thickness)
    made.prismatic(base, head, at=(length, 0), axis=(1, 0))
    push = made.force(on=head, at=(length, 0), direction=(-1, 0))
    return fm.Scene(made), push, pi**2 * young * thickness**3 / 12.0 / length**2


def contrast():
    """A parallelogram with a soft diagonal and a leg a million times stiffer."""
    made = fm.Mechanism("contrast")
    base, left, tip = made.rigid("base", fixed=True), made.rigid("left"), made.rigid("tip")
    soft = made.flexible(
        "soft", fm.strip([(0, 0), (18, 34), (40, 60)], thickness=3.0, depth=20.0), fm.Material("soft", 0.2, 0.45)
    )
    stiff = made.flexible(
        "stiff", fm.strip([(40, 0), (40, 60)], thickness=3.0, depth=20.0), fm.Material("stiff", 2e5, 0.3)
    )
    made.revolute(base, left, at=(0, 0))
    made.revolute(base, stiff, at=(40, 0), interface_radius=3.0)
    made.revolute(left, tip, at=(0, 60))
    made.revolute(stiff, tip, at=(40, 60), interface_radius=3.0)
    made.revolute(base, soft, at=(0, 0), interface_radius=3.0)
    made.revolute(soft, tip, at=(40, 60), interface_radius=3.0)
    return fm.Scene(made), made.force(on=tip, at=(20, 70), direction=(1, 0))


def four_bar(ends):
    """A spatial four-bar, its flexible coupler joined by ``ends``, held by a flexible strut."""
    made = fm.Mechanism("four-bar")
    base, left, right = made.rigid("base", fixed=True), made.rigid("left"), made.rigid("right")
    material = fm.Material("plastic", 1000.0, 0.35)
    coupler = made.flexible("coupler", fm.strip([(0, 40), (50, 45)], thickness=4.0, depth=6.0), material)
    strut = made.flexible("strut", fm.strip([(0, 0), (22, 16), (50, 45)], thickness=3.0, depth=6.0), material)
    made.revolute(base, left, at=(0, 0))
    made.revolute(base, right, at=(55, 0))
    ends(made, left, coupler, (0, 40))
    ends(made, right, coupler, (50, 45))
    made.revolute(base, strut, at=(0, 0), interface_radius=3.0)
    made.revolute(strut, right, at=(50, 45), interface_radius=3.0)
    return fm.Scene(made), made.force(on=left, at=(0, 40), direction=(1, 0))


def hinged(made, rigid, flexible, at):
    made.revolute(rigid, flexible, at=at, interface_radius=3.0)


def balled(made, rigid, flexible, at):
    made.spherical(rigid, flexible, at=at, interface_radius=3.0)


def arch():
    """A shallow arch between pins, its crown pushed past the limit of the load; its path turns back at 5.37 mm."""
    span, rise, thickness = 60.0, 3.0, 1.0
    points = [(x, 4.0 * rise * x / span * (1.0 - x / span)) for x in np.linspace(0.0, span, 9)]
    made = fm.Mechanism("arch")
    base = made.rigid("base", fixed=True)
    bow = made.flexible("bow", fm.strip(points, thickness=thickness, depth=2.0), fm.Material("steel", 1000.0, 0.3))
    made.revolute(base, bow, at=points[0], interface_radius=0.5 * thickness)
    made.revolute(base, bow, at=points[-1], interface_radius=0.5 * thickness)
    push = made.force(on=bow, at=(0.5 * span, rise), direction=(0, -1))
    return fm.Scene(made), push, [1.3, 2.6, 3.9, 5.2]


def rubber_band():
    """A silicone strip pulled to three times its length."""
    made = fm.Mechanism("band")
    base, cart = made.rigid("base", fixed=True), made.rigid("cart")
    band = made.flexible("band", fm.strip([(-4, 0), (34, 0)], thickness=6.0, depth=4.0), fm.SMOOTH_SIL_950)
    made.weld(base, band, at=(-2, 0), region=fm.Rectangle(4.0, 9.0))
    made.weld(band, cart, at=(32, 0), region=fm.Rectangle(4.0, 9.0))
    made.prismatic(base, cart, at=(32, 0), axis=(1, 0))
    return fm.Scene(made), made.force(on=cart, at=(32, 0), direction=(1, 0))


def cases():
    """Name → function from a solver to its run."""
    (strut, push, euler), (bent, tip, load), (bow, crown, travel) = column(), cantilever(100, 10.0), arch()
    truss, claw, klann = map(mechanism, ("truss", "claw", "klann"))
    finger, grasp = (truss.scene, truss.force), (claw.scene, claw.force)
    return {
        "truss": curve(*finger, size=3.0, forces=truss.loads),
        "claw": curve(*grasp, size=3.0, forces=claw.loads),
        "Klann, 3 curves": curve(
            klann.scene, klann.force, configurations=klann.configurations, size=2.2, forces=klann.loads
        ),
        "claw, whole load at once": at_once(*grasp, claw.loads[-1], size=3.0),
        "truss, whole load at once": at_once(*finger, truss.loads[-1], size=3.0),
        "truss, five random starts": at_once(*finger, 0.1, size=3.0, seeds=range(5)),
        "elastica, thickness/length 1/100": curve(bent, tip, size=2.0, forces=[load]),
        "elastica, at once": at_once(bent, tip, load, size=2.0),
        "elastica, a tenth of it at once": at_once(bent, tip, 0.1 * load, size=2.0),
        "column past buckling": curve(strut, push, size=2.0, forces=[f * euler for f in (0.5, 0.9, 1.1, 1.5)]),
        "stiffness contrast 1e6": curve(*contrast(), size=3.0, forces=[0.002, 0.005, 0.01]),
        "redundant loop, 3D": curve(*four_bar(hinged), space="3d", order=1, size=4.0, forces=[2.0, 5.0]),
        "free spin, 3D": curve(*four_bar(balled), space="3d", order=1, size=4.0, forces=[2.0, 5.0]),
        "arch through its limit point": curve(bow, crown, size=1.0, displacements=travel),
        "silicone stretched threefold": curve(*rubber_band(), size=2.0, displacements=[15.0, 30.0, 60.0]),
    }


def measure(name, prepare, limit):
    """One row of the table; no run takes longer than ``limit`` seconds."""
    runs, seconds, counts, found, ends = {}, {}, {}, {}, {}
    for solver, options in SOLVERS.items():
        counted = Counted(method=options)
        counted.count.start(COMPILING + limit)
        with judged(ends, solver, limit):
            runs[solver] = counted, prepare(counted)
    for _ in range(ROUNDS):
        for solver, (counted, run) in runs.items():
            if solver in ends:
                continue
            counted.count.start(limit)
            start = process_time()
            with judged(ends, solver, limit):
                found[solver] = run()
                seconds[solver] = min(process_time() - start, seconds.get(solver, inf))
                counts[solver] = replace(counted.count)
    cells = [name]
    for solver in SOLVERS:
        if solver in ends:
            cells.append(ends[solver])
        elif "default" in found and np.ptp([found[solver], found["default"]], axis=0).max() > SAME * largest(found):
            cells.append("elsewhere")
        else:
            count = counts[solver]
            halved = f" ({count.failures})" if count.failures else ""
            cells.append(f"{count.iterations}{halved} · {seconds[solver] / seconds.get('default', np.nan):.1f}")
    return cells


@contextmanager
def judged(ends, solver, limit):
    """Notes how a run of ``solver`` ended, unless it reached all samples."""
    try:
        yield
    except (fm.EquilibriumError, NotConverged):
        ends[solver] = "fails"
    except Stopped:
        ends[solver] = f"stopped after {limit:.0f} s"


def largest(found):
    """The largest displacement or force that the default solver found."""
    return np.abs(found["default"]).max()


def main():
    parser = command(__doc__)
    made = cases()
    parser.add_argument("case", nargs="*", help=f"of {', '.join(made)}; all by default")
    parser.add_argument("--limit", type=float, default=LIMIT, metavar="SECONDS", help="of every run")
    options = parser.parse_args()
    if MPI.COMM_WORLD.size > 1:
        parser.error("it goes by the time of one process; run it without mpirun")
    rows = []
    for name in options.case or made:
        rows.append(measure(name, made[name], options.limit))
    publish("solvers", format_table(("case", *SOLVERS), rows), write=options.write)


if __name__ == "__main__":
    main()
