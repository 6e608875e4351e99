"""Parameters of a material law from tests of specimens.

With nominal stresses P_k(λ; θ) of the law at parameters θ and measured stresses P̄, both at the measured stretches,

    min Σ ((P_k(λ; θ) − P̄) / s)²,     s the size of the stress's error, up to a factor that all share,

which is maximum likelihood if stretches are exact and stresses have independent normal errors of these sizes. Intervals
are those of ``regression``.

Minima of Ogden's law are not unique: the search starts from several laws, and the best minimum counts. The law is
judged over the range of the tests: where the stress of a specimen falls as it is stretched, it is unstable.

Source: Ogden, Saccomandi & Sgura (doi:10.1007/s00466-004-0593-y) for what fits of rubber leave open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq, least_squares

from fenicsmech.collective import from_one
from fenicsmech.design.regression import error_sizes, regression
from fenicsmech.elasticity import SPECIMENS, Specimen, check_kind, specimen_stress
from fenicsmech.errors import DescriptionError, EquilibriumError, counted, expect, real_array, set_fields, set_options
from fenicsmech.files import column, read_csv
from fenicsmech.laws import Law, drucker_stability
from fenicsmech.plot import PALETTE, CurveSeries, plot_curve


@dataclass(frozen=True, eq=False)
class SpecimenTest:
    """Measured stresses of one specimen.

    Args:
        kind: "uniaxial" (free sides), "planar" (one side kept, pure shear) or "equibiaxial" (free across the sheet).
        stretches: (n,) deformed length per undeformed length.
        stresses: (n,) nominal, force per undeformed area.
        errors: size of the stresses' errors, one or (n,), up to a factor common to all tests; None: the largest
            stress of this test, so that tests count alike. 1 in all tests compares stresses as they are, ``stresses``
            (without zeros) relative to each.
        name: in messages and plots; empty: the kind.

    Raises:
        DescriptionError: another kind, as many stretches as stresses are not given, a stretch or error that is not
            positive, or no stress.
    """

    kind: str
    stretches: NDArray[np.float64]
    stresses: NDArray[np.float64]
    errors: Any = None
    name: str = ""

    def __post_init__(self) -> None:
        check_kind(self.kind)
        name = self.name or self.kind
        part = f"test {name!r}"
        stretches = real_array(f"stretches of {part}", self.stretches, None)
        stresses = real_array(f"stresses of {part}", self.stresses, len(stretches))
        if np.any(stretches <= 0.0):
            remedy = "Give positive stretches, 1 + strain: length per undeformed length"
            raise DescriptionError(f"stretches of {part}", f"one is {stretches.min():g}", remedy)
        if not np.any(stresses):
            raise DescriptionError(f"stresses of {part}", "there are none but zeros", "Give readings under load")
        errors = error_sizes(part, self.errors, stresses)
        set_fields(self, name=name, stretches=stretches, stresses=stresses, errors=errors)

    @classmethod
    def read(cls, kind: str, path: str | Path, *, errors: ArrayLike | None = None, name: str = "") -> SpecimenTest:
        """The test in a CSV file, as ``read_csv`` takes it. Local.

        Args:
            path: with one column whose header begins with "stretch" or "strain" (engineering strain, in percent if
                the header has %), and one that begins with "stress" (nominal); units may follow: "stress [MPa]".

        Raises:
            DescriptionError: no such columns, or what ``SpecimenTest`` refuses.
            OSError: the file cannot be read.
        """
        table, part = read_csv(path), f"test in '{path}'"
        stretches = column(part, table, "stretch", "strain")
        stresses = column(part, table, "stress")
        values = table[stretches]
        if stretches.lower().startswith("strain"):
            values = 1.0 + values * (0.01 if "%" in stretches else 1.0)
        return cls(kind, values, table[stresses], errors, name or Path(path).stem)


@dataclass(frozen=True)
class LawFitOptions:
    """Options of ``fit_law``.

    Attributes:
        starts: laws that the search starts from at most, the given one first; it ends when the best minimum is found
            again.
        spread: standard deviation of the logarithm of the others' parameters from the given ones; signs are kept.
        seed: of these.
        evaluations: of the law from each start, at most; a start that needs more does not count.
        tolerance: relative change of parameters, and of the sum of squares, at which the search from a start ends.
        same: relative difference of the sums of squares of equal minima.
        confidence: probability of intervals.
        points: of each specimen's curve at which its slope is looked at.
    """

    starts: int = 6
    spread: float = 0.5
    seed: int = 0
    evaluations: int = 300
    tolerance: float = 1e-10
    same: float = 1e-6
    confidence: float = 0.95
    points: int = 200

    def __post_init__(self) -> None:
        set_options(self, "the fit of a law", below_one=("confidence",), starts=1, seed=0, evaluations=1, points=2)


@dataclass(frozen=True)
class LawFit:
    """A law fitted to tests.

    Attributes:
        law: with the fitted parameters.
        tests: those given.
        standard_errors: of each fitted parameter, by its name in ``Law.parameters``.
        intervals: confidence interval of each.
        residuals: stress of the law minus measured stress, of each test.
        relative_rms: root mean square of the residuals per root mean square of the stresses, of each test.
        spread: standard deviation of the residuals relative to the tests' ``errors``.
        remarks: ranges beyond which the law is extrapolated, kinds of specimens that were not tested, and stretches
            within the range of the tests at which a specimen's stress falls, or the law is unstable.
    """

    law: Law
    tests: tuple[SpecimenTest, ...]
    standard_errors: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    residuals: tuple[tuple[float, ...], ...]
    relative_rms: tuple[float, ...]
    spread: float
    remarks: tuple[str, ...]

    @property
    def values(self) -> dict[str, float]:
        """Each fitted parameter by its name."""
        return {name: self.law.parameters[name] for name in self.intervals}

    def plot(
        self, path: str | Path, *, stress: str = "nominal stress", title: str = "", comm: MPI.Comm = MPI.COMM_WORLD
    ) -> None:
        """Draws the tests as points and the law as faint lines over their ranges, as a PNG.

        Args:
            stress: label of the axis, with the unit.
            title: a line above the plot.
        """
        series = []
        for test, colour in zip(self.tests, PALETTE * len(self.tests), strict=False):
            low, high = _range(test)
            stretches = np.linspace(low, high, 200)
            law = specimen_stress(self.law, test.kind, stretches)
            series.append(CurveSeries(stretches, law, colour=colour, faint=True))
            series.append(CurveSeries(test.stretches, test.stresses, test.name, joined=False, colour=colour))
        plot_curve(path, series, xlabel="stretch", ylabel=stress, title=title, comm=comm)


_OPTIONS = LawFitOptions()


def fit_law(
    law: Law,
    tests: SpecimenTest | Sequence[SpecimenTest],
    *,
    held: str | Sequence[str] | None = None,
    options: LawFitOptions = _OPTIONS,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> LawFit:
    """Fits the parameters of ``law`` to tests of specimens.

    Args:
        law: initial guess, which also says the number of Ogden's terms. Parameters that are zero are so in every
            start.
        tests: one or several, with at least one reading more than parameters, in all.
        held: names of parameters in ``law.parameters`` that keep their values, one or several; by default "nu" of laws
            that have it, as these tests say little of Poisson's ratio of rubber, and none of others.

    Raises:
        DescriptionError: an unknown parameter is held, all are, there are too few readings, or the tests do not
            determine a parameter.
        EquilibriumError: from no start is a minimum found that the law accepts.
    """
    expect("fit of a law", law, Law, "a law", "Give an initial guess, such as Yeoh(…)")
    what = f"fit of {type(law).__name__}"
    tests = (tests,) if isinstance(tests, SpecimenTest) else tuple(tests)
    if held is None:
        held = ("nu",) if "nu" in law.parameters else ()
    elif isinstance(held, str):
        held = (held,)
    for test in tests:
        expect(what, test, SpecimenTest, "a test of a specimen", "Give SpecimenTest(kind, stretches, stresses)")
    names = tuple(name for name in law.constants if name not in held)
    unknown = sorted(set(held) - set(law.parameters))
    if unknown or not names:
        problem = f"{unknown[0]!r} is held, which is none of its parameters" if unknown else "all parameters are held"
        raise DescriptionError(what, problem, f"Its parameters are {', '.join(law.parameters)}")
    readings = sum(len(test.stresses) for test in tests)
    if readings <= len(names):
        problem = f"{counted(readings, 'reading')} for {counted(len(names), 'parameter')}"
        raise DescriptionError(what, problem, "Give more readings than parameters: intervals need them")
    return from_one(comm, partial(_Search(what, law, tests, names, options).best))


class _Search:
    """The minimum of the sum of squares over the parameters ``names`` of a law."""

    def __init__(
        self, what: str, law: Law, tests: tuple[SpecimenTest, ...], names: tuple[str, ...], options: LawFitOptions
    ) -> None:
        self._what, self._law, self._tests, self._names, self._options = what, law, tests, names, options
        self._specimens = [Specimen(law, test.kind, names) for test in tests]
        self._start = np.array([law.parameters[name] for name in names])
        self._known: tuple[bytes, NDArray, NDArray] | None = None

    def best(self) -> LawFit:
        options, generator = self._options, np.random.default_rng(self._options.seed)
        laws, least, unfinished = None, np.inf, 0
        for trial in range(options.starts):
            factors = np.exp(options.spread * generator.standard_normal(len(self._start))) if trial else 1.0
            start = self._start * factors
            if not np.all(np.isfinite(self._residuals(start))):
                continue
            found = least_squares(
                self._residuals,
                start,
                self._jacobian,
                x_scale="jac",
                ftol=options.tolerance,
                xtol=options.tolerance,
                gtol=None,
                max_nfev=options.evaluations,
            )
            if found.status == 0:  # out of evaluations, not at a minimum
                unfinished += 1
                continue
            law = self._accepted(found.x)
            again = laws is not None and law is not None and abs(found.cost - least) <= options.same * least
            if law is not None and found.cost < least:
                laws, least = (law, found.x), found.cost
            if again:
                break
        if laws is None:
            if unfinished:
                raise EquilibriumError(
                    self._what,
                    f"from {counted(unfinished, 'start')} the search is not at a minimum after "
                    f"{counted(options.evaluations, 'evaluation')}, and from none it is",
                    "Give LawFitOptions(evaluations=…) more, or a law nearer to the tests, in their units",
                )
            raise EquilibriumError(
                self._what,
                f"from none of {counted(options.starts, 'start')} does the search end at a law that can be",
                "Give a law nearer to the tests, in their units",
            )
        return self._fit(*laws)

    def _law_of(self, x: NDArray) -> Law:
        values = dict(zip(self._names, x.tolist(), strict=True))
        return self._law.with_parameters({**self._law.parameters, **values})

    def _accepted(self, x: NDArray) -> Law | None:
        """The law with its numbers checked; None if it refuses them."""
        try:
            return replace(self._law_of(x))
        except DescriptionError:
            return None

    def _evaluate(self, x: NDArray) -> tuple[NDArray, NDArray]:
        if self._known is None or self._known[0] != x.tobytes():
            law, rows, slopes = self._law_of(x), [], []
            for test, specimen in zip(self._tests, self._specimens, strict=True):
                stress, by = specimen.response(law, test.stretches)
                rows.append((stress - test.stresses) / test.errors)
                slopes.append(by / np.asarray(test.errors)[:, None])
            self._known = x.tobytes(), np.concatenate(rows), np.concatenate(slopes)
        return self._known[1:]

    def _residuals(self, x: NDArray) -> NDArray:
        return self._evaluate(x)[0]

    def _jacobian(self, x: NDArray) -> NDArray:
        return self._evaluate(x)[1]

    def _fit(self, law: Law, x: NDArray) -> LawFit:
        scaled, J = self._evaluate(x)
        found = regression(self._what, self._names, x, scaled, J, self._options.confidence)
        ends = np.cumsum([len(test.stresses) for test in self._tests])[:-1]
        residuals = [r * test.errors for r, test in zip(np.split(scaled, ends), self._tests, strict=True)]
        sizes_of = [
            np.linalg.norm(r) / np.linalg.norm(test.stresses) for r, test in zip(residuals, self._tests, strict=True)
        ]
        return LawFit(
            law=law,
            tests=self._tests,
            standard_errors=found.standard_errors,
            intervals=found.intervals,
            residuals=tuple(tuple(r.tolist()) for r in residuals),
            relative_rms=tuple(float(size) for size in sizes_of),
            spread=found.spread,
            remarks=tuple(self._remarks(law)),
        )

    @staticmethod
    def _stability(law: Law, kind: str, stretches: NDArray) -> NDArray:
        sides = Specimen(law, kind).sides(law, stretches)
        return drucker_stability(law, sides[:, :, None] * np.eye(3))

    def _remarks(self, law: Law) -> list[str]:
        found = []
        most = max(_invariant(test.kind, stretch) for test in self._tests for stretch in test.stretches)
        for kind in SPECIMENS:
            ranges = [_range(test) for test in self._tests if test.kind == kind]
            if ranges:
                low, high = min(r[0] for r in ranges), max(r[1] for r in ranges)
                found.append(f"{kind}: beyond stretches of {low:.4g} to {high:.4g} the law is extrapolated")
            else:
                # in tension, as far as the tests go in Ī₁
                low, high = 1.0, brentq(lambda s, kind=kind: _invariant(kind, s) - most, 1.0, most)
                found.append(f"{kind}: not tested")
            stretches = np.linspace(low, high, self._options.points)
            stresses = specimen_stress(law, kind, stretches)
            falling = ~(np.diff(stresses) > 0.0)
            if np.any(falling):
                where = stretches[:-1][falling]
                ends = f"stretch {where.min():.4g} to {where.max():.4g}"
                found.append(f"{kind}: the stress falls from {ends}; the specimen is unstable there")
            if np.any(unstable := ~(self._stability(law, kind, stretches) > 0.0)):
                ends = f"stretch {stretches[unstable].min():.4g} to {stretches[unstable].max():.4g}"
                found.append(f"{kind}: by Drucker the law is unstable from {ends}")
        return found


def _range(test: SpecimenTest) -> tuple[float, float]:
    """Stretches of a test, with that of the specimen before it."""
    return min(1.0, float(test.stretches.min())), max(1.0, float(test.stretches.max()))


def _invariant(kind: str, stretch: float) -> float:
    """Ī₁ of a specimen that keeps its volume."""
    other = {"uniaxial": stretch**-0.5, "planar": 1.0, "equibiaxial": stretch}[kind]
    return float(stretch**2 + other**2 + (stretch * other) ** -2)
