"""Laws of rubber fitted to Treloar's tests, beside parameters that the literature gives for the same tests.

    python3 -m benchmarks.laws [--write]

Residuals are root mean squares of differences of nominal stress, per root mean square of the stresses of a specimen.
Those of our parameters and of published ones are from the closed form of incompressible rubber, which shares no code
with the fit:

    P λ₁ = λ₁ ∂W/∂λ₁ − λ₃ ∂W/∂λ₃ = Σ μ (λ₁^α − λ₃^α)     or     2 (λ₁² − λ₃²) (∂W/∂I₁ + λ₂² ∂W/∂I₂).

Fits to all three tests compare stresses relative to the largest one of each test, or in MPa; the others those of one
test in MPa. Ogden's parameters are those usually quoted. Those of Steinmann, Hossain & Possart were read in an example
of simcoon (github.com/3MAH/simcoon), which names their paper, and from which the readings of the tests are, too. Of
Mooney and Rivlin's law the planar test determines C₁₀ + C₀₁ alone, and the uniaxial one has its least squares where
C₁₀ + C₀₁ < 0. No parameters of Yeoh's law for these tests were found in a text that could be read.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

import fenicsmech as fm
from fenicsmech.report import format_table

from .table import ROOT, command, publish

KINDS = ("uniaxial", "planar", "equibiaxial")
FOLDER = ROOT / "tests" / "design" / "treloar"
OGDEN = "Ogden, doi:10.1098/rspa.1972.0026"
STEINMANN = "Steinmann et al., doi:10.1007/s00419-012-0610-z"

HEADERS = (
    "law", "fitted to", "parameters [MPa, –]", "residual: uniaxial, planar, equibiaxial [%]", "published parameters",
    "their residual [%]", "source",
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A fit, and what was published of it.

    Attributes:
        name: of the law.
        law: where the fit starts.
        kinds: of the tests that it is fitted to.
        relative: whether each test counts relative to its largest stress.
        published: parameters, in the order of ``law.constants``; empty if none were found.
        source: of these.
        held: parameters that are not fitted.
    """

    name: str
    law: fm.Law
    kinds: tuple[str, ...] = KINDS
    relative: bool = False
    published: tuple[float, ...] = ()
    source: str = "none found"
    held: tuple[str, ...] = ("nu",)

    def fit(self) -> fm.LawFit:
        """The law fitted to the tests."""
        errors = None if self.relative else 1.0
        tests = [fm.SpecimenTest.read(kind, FOLDER / f"{kind}.csv", errors=errors) for kind in self.kinds]
        return fm.fit_law(self.law, tests, held=self.held, options=fm.LawFitOptions(starts=1))


_THREE_TERMS = fm.Ogden((0.4, 5e-6, -0.005), (1.8, 7.5, -2.2), 0.4999999)
_OGDEN = {"published": (0.63, 0.0012, -0.01, 1.3, 5.0, -2.0), "source": OGDEN}
_YEOH, _MOONEY = fm.Yeoh(0.2, 0.0, 0.0, 0.4999999), fm.MooneyRivlin(0.2, 0.01, 0.4999999)
_ONE_TERM = fm.MooneyRivlin(0.2, 0.0, 0.4999999)
_HELD = ("C01", "nu")

CASES = (
    Case("Ogden, N = 3", _THREE_TERMS, relative=True, **_OGDEN),
    Case("Ogden, N = 3", _THREE_TERMS, **_OGDEN),
    Case("Yeoh", _YEOH, relative=True),
    Case("Yeoh", _YEOH),
    *(
        Case("neo-Hooke, μ/2", _ONE_TERM, (kind,), published=(0.5 * mu, 0.0), source=STEINMANN, held=_HELD)
        for kind, mu in zip(KINDS, (0.5673, 0.3360, 0.4104), strict=True)
    ),
    Case("Mooney–Rivlin", _MOONEY, ("equibiaxial",), published=(0.1713, 0.0047), source=STEINMANN),
)


def closed_form(law: fm.Law, numbers: tuple[float, ...], kind: str, stretches: NDArray) -> NDArray:
    """Nominal stresses of incompressible rubber.

    Args:
        law: says the form.
        numbers: its parameters, but for Poisson's ratio.
    """
    second = {"uniaxial": stretches**-0.5, "planar": np.ones_like(stretches), "equibiaxial": stretches}[kind]
    third = 1.0 / (stretches * second)
    if isinstance(law, fm.Ogden):
        terms = zip(*np.split(np.array(numbers), 2), strict=True)
        return sum(mu * (stretches**alpha - third**alpha) for mu, alpha in terms) / stretches
    if isinstance(law, fm.Yeoh):
        i = stretches**2 + second**2 + third**2 - 3.0
        slope = numbers[0] + 2.0 * numbers[1] * i + 3.0 * numbers[2] * i**2
    else:
        slope = numbers[0] + numbers[1] * second**2
    return 2.0 * (stretches**2 - third**2) * slope / stretches


def residuals(law: fm.Law, numbers: tuple[float, ...], tests: tuple[fm.SpecimenTest, ...]) -> tuple[float, ...]:
    """Relative residual of each test, %."""
    return tuple(
        100.0 * float(np.linalg.norm(closed_form(law, numbers, t.kind, t.stretches) - t.stresses))
        / float(np.linalg.norm(t.stresses))
        for t in tests
    )  # fmt: skip


def rows() -> Iterator[tuple[object, ...]]:
    """Lines of the table."""
    for case in CASES:
        fit = case.fit()
        *numbers, _ = fit.law.parameters.values()
        measure = "all, relative" if case.relative else "all, MPa" if len(case.kinds) > 1 else case.kinds[0]
        yield (
            case.name, measure, tuple(numbers), residuals(case.law, tuple(numbers), fit.tests), case.published or None,
            residuals(case.law, case.published, fit.tests) if case.published else None, case.source,
        )  # fmt: skip


def main() -> None:
    options = command(__doc__).parse_args()
    if MPI.COMM_WORLD.rank == 0:
        publish("laws", format_table(HEADERS, list(rows())), write=options.write)


if __name__ == "__main__":
    main()
