"""Constrained optimisers compared: this package's SQP, scipy's SLSQP and trust-constr, NLopt's MMA and CCSA.

    OPENBLAS_NUM_THREADS=1 python3 -m benchmarks.constrained [--limit EVALUATIONS] [--methods NAME …]

Two tables: evaluations until each method ends by itself, on formulas with known optima and on designs of the truss
finger in plane stress. In brackets the relative error of the objective, of designs against the best that a method
found, or "no" where that is above 1 % or inequalities of formulas are violated by more than 0.001; of designs, by how
much they are. NLopt takes part if it is installed (python3-nlopt).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np
import sympy
from scipy import optimize

import fenicsmech as fm
from fenicsmech.design import (
    Evaluation,
    Inequalities,
    Infeasible,
    Iterate,
    Plain,
    Problem,
    Quadratic,
    Reason,
    Start,
    TooHigh,
)
from fenicsmech.report import format_table
from fenicsmech.symbolic import SmoothFunction

from .mechanisms import Case, mechanism
from .table import command, publish

ENOUGH = 0.01  # relative error that counts as solved
SATISFIED = 1e-3  # largest value of an inequality that counts as satisfied


@dataclass(frozen=True)
class Formulas:
    """Residuals, objective and inequalities c ≤ 0 as formulas in x1, x2, …, and the known optimum.

    Attributes:
        domain: where it is not positive there is no value.
    """

    start: tuple[float, ...]
    optimum: tuple[float, ...]
    inequalities: tuple[str, ...]
    objective: str = "0"
    residuals: tuple[str, ...] = ()
    domain: str = "1"


# HSn: W. Hock & K. Schittkowski, Test Examples for Nonlinear Programming Codes (doi:10.1007/978-3-642-48320-2)
KNOWN = {
    "HS12": Formulas((0, 0), (2, 3), ("(4*x1**2 + x2**2 - 25)/25",), "x1**2/2 + x2**2 - x1*x2 - 7*x1 - 7*x2"),
    "HS22": Formulas((2, 2), (1, 1), ("x1 + x2 - 2", "x1**2 - x2"), "(x1 - 2)**2 + (x2 - 1)**2"),
    "HS22 as least squares": Formulas((2, 2), (1, 1), ("x1 + x2 - 2", "x1**2 - x2"), residuals=("x1 - 2", "x2 - 1")),
    "HS29": Formulas((1, 1, 1), (4, 8**0.5, 2), ("(x1**2 + 2*x2**2 + 4*x3**2 - 48)/48",), "-x1*x2*x3"),
    "HS43": Formulas(
        (0, 0, 0, 0),
        (0, 1, 2, -1),
        (
            "(x1**2 + x2**2 + x3**2 + x4**2 + x1 - x2 + x3 - x4 - 8)/8",
            "(x1**2 + 2*x2**2 + x3**2 + 2*x4**2 - x1 - x4 - 10)/10",
            "(2*x1**2 + x2**2 + x3**2 + 2*x1 - x2 - x4 - 5)/5",
        ),
        "x1**2 + x2**2 + 2*x3**2 + x4**2 - 5*x1 - 5*x2 - 21*x3 + 7*x4",
    ),
    "HS100": Formulas(
        (1, 2, 0, 4, 0, 1, 1),
        (2.330499, 1.951372, -0.4775414, 4.365726, -0.6244870, 1.038131, 1.594227),
        (
            "(2*x1**2 + 3*x2**4 + x3 + 4*x4**2 + 5*x5 - 127)/127",
            "(7*x1 + 3*x2 + 10*x3**2 + x4 - x5 - 282)/282",
            "(23*x1 + x2**2 + 6*x6**2 - 8*x7 - 196)/196",
            "4*x1**2 + x2**2 - 3*x1*x2 + 2*x3**2 + 5*x6 - 11*x7",
        ),
        "(x1 - 10)**2 + 5*(x2 - 12)**2 + x3**4 + 3*(x4 - 11)**2 + 10*x5**6 + 7*x6**2 + x7**4- 4*x6*x7 - 10*x6 - 8*x7",
    ),
    "banana in a disc": Formulas(
        (-1.2, 1.0), (0.907234, 0.822755), ("x1**2 + x2**2 - 1.5",), residuals=("10*(x2 - x1**2)", "1 - x1")
    ),
    # K. Svanberg's cantilever of five hollow boxes: least mass under a largest deflection (doi:10.1002/nme.1620240207)
    "stepped cantilever": Formulas(
        (5, 5, 5, 5, 5),
        (6.0160, 5.3092, 4.4943, 3.5015, 2.1527),
        ("61/x1**3 + 37/x2**3 + 19/x3**3 + 7/x4**3 + 1/x5**3 - 1",),
        "0.0624*(x1 + x2 + x3 + x4 + x5)",
        domain="x1*x2*x3*x4*x5",
    ),
    "two inequalities of which one follows from the other": Formulas(
        (3, 3), (1, 1), ("x1 + x2 - 2", "(x1 + x2 - 2)/2", "x1 + x2 - 4"), "x1**2 - 4*x1 + x2**2 - 4*x2"
    ),
}


class FormulaProblem:
    """``formulas`` in units: of the objective, and of each parameter.

    Attributes:
        start: p at the start, (n,).
        asked, outside: number of evaluations, and of infeasible ones.
    """

    def __init__(self, formulas: Formulas, *, unit: float = 1.0, units: float | np.ndarray = 1.0) -> None:
        symbols = {f"x{k + 1}": sympy.Symbol(f"p{k}", real=True) for k in range(len(formulas.start))}
        self._parts = [
            SmoothFunction([sympy.sympify(text, symbols) for text in texts], list(symbols.values()), [])
            for texts in ((formulas.objective, formulas.domain), formulas.residuals, formulas.inequalities)
        ]
        self.names, self.unit, self.units = formulas.inequalities, unit, units
        self.lengths = np.maximum(1.0, np.abs(formulas.start)) * units
        self.start = np.array(formulas.start) * units
        self.asked, self.outside = 0, 0

    def evaluate(
        self, parameters: np.ndarray, below: float = np.inf, penalties: np.ndarray | float = 0.0
    ) -> Evaluation:
        """O and c with their derivatives."""
        self.asked += 1
        x = parameters / self.units
        (f, domain), r, c = (part.value(x, np.empty(0)) for part in self._parts)
        if domain <= 0.0:
            self.outside += 1
            raise Infeasible("outside")
        (df, _), dr, dc = (part.gradient(x, np.empty(0)) / self.units for part in self._parts)
        root = self.unit**0.5
        found = Evaluation(
            parameters,
            root * r,
            root * dr,
            self.regulariser,
            plain=Plain(self.unit * float(f), self.unit * df),
            inequalities=Inequalities(self.names, c, dc),
        )
        return _limited(found, below, penalties)

    def regulariser(self, parameters: np.ndarray) -> Quadratic:
        """R = 0."""
        return Quadratic.zero(len(parameters))


def _limited(found: Evaluation, below: float, penalties: np.ndarray | float) -> Evaluation:
    if (height := found.merit(penalties)) > below:
        raise TooHigh(height)
    return found


@dataclass(frozen=True)
class Library(fm.Optimiser):
    """A library's method, which sees one objective in which regulariser and residuals are summed up.

    Attributes:
        method: its name: scipy's, or nlopt's with LD_.
        tolerance: relative change of the objective at which it ends.
        iterations: most evaluations.
    """

    method: str
    tolerance: float

    @property
    def least_reduction(self) -> float:
        return self.tolerance

    def minimise(self, problem: Problem, start: Start, *, watch: Callable[[Iterate], None]) -> Iterate:
        points = _Points(problem, start.parameters, self.iterations)
        watch(Iterate(start.number, start.evaluations + 1, points.best, np.zeros(0), np.inf, None))
        x, reason = start.parameters / problem.lengths, Reason.CONVERGED
        try:
            self._nlopt(points, x) if self.method.startswith("LD_") else self._scipy(points, x)
        except _Enough:
            reason = Reason.ITERATIONS
        except (RuntimeError, ValueError):
            reason = Reason.NO_DESCENT
        asked = start.evaluations + points.asked
        last = Iterate(asked, asked, points.best, np.zeros(0), 0.0, reason)
        watch(last)
        return last

    def _scipy(self, points: _Points, x: np.ndarray) -> None:
        options = {"maxiter": 1000, "ftol" if self.method == "SLSQP" else "gtol": self.tolerance}
        below = optimize.NonlinearConstraint(points.inequalities, -np.inf, 0.0, jac=points.rows, hess=optimize.BFGS())
        hessian = {} if self.method == "SLSQP" else {"hess": optimize.BFGS()}
        optimize.minimize(
            points.value, x, jac=points.gradient, method=self.method, constraints=below, options=options, **hessian
        )

    def _nlopt(self, points: _Points, x: np.ndarray) -> None:
        import nlopt

        def objective(x: np.ndarray, gradient: np.ndarray) -> float:
            if gradient.size:
                gradient[:] = points.gradient(x)
            return points.value(x)

        def inequalities(values: np.ndarray, x: np.ndarray, rows: np.ndarray) -> None:
            if rows.size:
                rows[:] = points.rows(x)
            values[:] = points.inequalities(x)

        search = nlopt.opt(getattr(nlopt, self.method), len(x))
        search.set_min_objective(objective)
        search.add_inequality_mconstraint(inequalities, np.full(len(points.inequalities(x)), 1e-4))
        search.set_ftol_rel(self.tolerance)
        search.optimize(x)


class _Enough(Exception):
    """The evaluations ran out."""


class _Points:
    """Values and derivatives for libraries, in units of lengths and of the first objective; infeasible ones are inf."""

    def __init__(self, problem: Problem, start: np.ndarray, limit: int) -> None:
        self._problem, self._limit, self.asked = problem, limit, 1
        self.best = self._last = self._now = problem.evaluate(start)
        self._at, self._infeasible = start / problem.lengths, False
        self._unit = max(abs(self.best.value), float(np.linalg.norm(problem.lengths * self.best.gradient)))

    def value(self, x: np.ndarray) -> float:
        found = self._evaluation(x)
        return np.inf if self._infeasible else found.value / self._unit

    def gradient(self, x: np.ndarray) -> np.ndarray:
        return self._evaluation(x).gradient * self._problem.lengths / self._unit

    def inequalities(self, x: np.ndarray) -> np.ndarray:
        return self._evaluation(x).inequalities.values

    def rows(self, x: np.ndarray) -> np.ndarray:
        return self._evaluation(x).inequalities.jacobian * self._problem.lengths

    def _evaluation(self, x: np.ndarray) -> Evaluation:
        """The evaluation at ``x``, or the one before if that is infeasible."""
        if not np.array_equal(x, self._at):
            if self.asked >= self._limit:
                raise _Enough
            self._at, self.asked = np.array(x), self.asked + 1
            try:
                self._last, self._infeasible = self._problem.evaluate(x * self._problem.lengths), False
            except Infeasible:
                self._infeasible = True
            self.best = min(self.best, self._last, key=_rank)
        return self._last


def _rank(found: Evaluation) -> tuple[float, float]:
    violation = float(np.max(found.inequalities.values, initial=0.0))
    return (0.0, found.value) if violation <= SATISFIED else (violation, found.value)


def methods(limit: int, tolerance: float, chosen: Sequence[str] | None = None) -> dict[str, fm.Optimiser]:
    """The optimisers that are installed, or those ``chosen`` of them, by their names in the tables."""
    names = {"scipy SLSQP": "SLSQP", "scipy trust-constr": "trust-constr"}
    if find_spec("nlopt"):
        names |= {"NLopt SLSQP": "LD_SLSQP", "NLopt MMA": "LD_MMA", "NLopt CCSA": "LD_CCSAQ"}
    found = {"SQP": fm.SQP(iterations=limit, tolerance=tolerance)} | {
        name: Library(iterations=limit, method=method, tolerance=tolerance) for name, method in names.items()
    }
    return {name: found[name] for name in chosen or found}


def on_formulas(limit: int, chosen: Sequence[str]) -> list[list[str]]:
    """Rows: evaluations of each method, with the relative error of the objective."""
    rows = []
    for name, formulas in KNOWN.items():
        cells = []
        best = FormulaProblem(formulas).evaluate(np.array(formulas.optimum, dtype=float)).value
        for optimiser in methods(limit, 1e-6, chosen).values():
            problem = FormulaProblem(formulas)
            found = optimiser.minimise(problem, Start(problem.start), watch=lambda iterate: None).evaluation
            error = abs(found.value - best) / max(1.0, abs(best))
            solved = error <= ENOUGH and np.max(found.inequalities.values) <= SATISFIED
            cells.append(f"{problem.asked} ({error:.0e})" if solved else f"{problem.asked} (no)")
        rows.append([name, *cells])
    return rows


def known(truss: Case, sim: fm.Simulation, displacement: float) -> tuple[float, float]:
    """Displacement and mass of a design that moves by about ``displacement``, found by least squares alone."""
    mass = fm.LinkMass(truss.designs[0].link)
    targets = [fm.Target(truss.force, force=0.4, displacement=displacement)]
    targets += [fm.Target(mass, equals=1e-6, weight=1e-6)]  # for its value: it changes the design by little
    found = fm.DesignProblem(sim, truss.designs, targets=targets).optimise(optimiser=fm.LevenbergMarquardt())
    moved, weighed = (target.corrected for target in found.targets)
    return moved, weighed


def inequalities_of(truss: Case, sim: fm.Simulation) -> dict[str, list[fm.Target]]:
    """Targets of the truss finger under inequalities, by their names in the table; a known design satisfies each."""
    mass, moved, sample = (
        fm.LinkMass(truss.designs[0].link),
        fm.Displacement(truss.force),
        fm.Sample({truss.force: 0.4}),
    )
    light = fm.Target(mass, least=True)
    stiff, soft, (far, heavy) = known(truss, sim, 1.0)[0], known(truss, sim, 3.1)[0], known(truss, sim, 2.0)
    return {
        f"least mass, displacement at most {stiff:.3g} mm": [light, fm.Target(moved, sample, at_most=stiff)],
        f"least mass, displacement from {0.97 * soft:.3g} to {1.03 * soft:.3g} mm": [
            light,
            fm.Target(moved, sample, at_least=0.97 * soft),
            fm.Target(moved, sample, at_most=1.03 * soft),
        ],
        f"displacement of {far:.3g} mm, mass at most {1e6 * heavy:.3g} g": [
            fm.Target(moved, sample, equals=far),
            fm.Target(mass, at_most=heavy),
        ],
    }


def on_designs(limit: int, size: float, chosen: Sequence[str]) -> list[list[str]]:
    """Rows: evaluations of each method through the public calls, with the relative error of the objective."""
    truss, rows = mechanism("truss"), []
    sim = fm.Simulation(truss.scene, space="plane-stress", size=size)
    for name, targets in inequalities_of(truss, sim).items():
        found = []
        for optimiser in methods(limit, 1e-4, chosen).values():
            try:
                found.append(fm.DesignProblem(sim, truss.designs, targets=targets).optimise(optimiser=optimiser))
            except fm.EquilibriumError:  # it ended where nothing carries the loads
                found.append(None)
        best = min((result.objective[1] for result in found if result is not None and _kept(result)), default=np.inf)
        rows.append([name, *(_cell(result, best) for result in found)])
    return rows


def _cell(result: fm.DesignResult | None, best: float) -> str:
    if result is None:
        return "no equilibrium"
    if not _kept(result):
        return f"{result.evaluations} (violated by {result.worst_error:.0e})"
    error = (result.objective[1] - best) / max(best, 1e-3)  # below that, all targets are met
    return f"{result.evaluations} ({f'{error:.0e}' if error <= ENOUGH else 'no'})"


def _kept(result: fm.DesignResult) -> bool:
    return all(abs(target.error) <= SATISFIED for target in result.targets if target.relation != "equals")


def main() -> None:
    parser, names = command(__doc__), tuple(methods(1, 1.0))
    parser.add_argument("--limit", type=int, default=100, help="most evaluations (default 100)")
    parser.add_argument("--size", type=float, default=3.0, metavar="MM", help="element size (default 3 mm)")
    parser.add_argument("--methods", nargs="+", choices=names, metavar="NAME", help=f"of {', '.join(names)}")
    options = parser.parse_args()
    chosen = options.methods or names
    tables = [
        format_table(("formulas", *chosen), on_formulas(options.limit, chosen)),
        format_table(("design", *chosen), on_designs(options.limit, options.size, chosen)),
    ]
    publish("constrained", "\n\n".join(tables), write=options.write)


if __name__ == "__main__":
    main()
