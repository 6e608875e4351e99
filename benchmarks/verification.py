"""Verification: the tests that compare with exact solutions, benchmarks and other programs, as one table.

    python3 -m benchmarks.verification [--write]

Each line is a test with a bound; the command runs them and says which hold.
"""

import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from fenicsmech.report import format_table

from .table import ROOT, command, publish

HEADERS = ("case", "within", "test", "result", "s")


@dataclass(frozen=True)
class Case:
    """A line of the table.

    Attributes:
        what: the values compared.
        within: the bound that the test asserts.
        test: file, or file::function, below ``tests/``.
    """

    what: str
    within: str
    test: str


CASES = (
    Case(
        "cantilever under a dead tip load up to PL²/EI = 10, against the elastica",
        "0.1 % in the plane, 0.5 % in space",
        "simulation/test_elastica.py::test_dead_load_at_the_tip",
    ),
    Case(
        "cantilever bent into a circle and beyond by a motor: tip, torque, energy",
        "0.5 %",
        "simulation/test_elastica.py::test_motor_at_the_tip_bends_the_link_into_a_circle",
    ),
    Case("45° bend under an out-of-plane force (NAFEMS 3DNLG-5)", "0.5 %", "simulation/test_bend_45.py"),
    Case(
        "curved link pulled and pushed by its pins, thickness/length 1/30, against a geometrically exact beam",
        "1 %",
        "simulation/test_pinned_link.py",
    ),
    Case("two flexible links in a four-bar against CalculiX on the same mesh", "1e-3", "simulation/test_calculix.py"),
    Case(
        "forces on a disc, a rectangle, a face and a patch of a flexible link against CalculiX on the same mesh",
        "1e-3",
        "simulation/test_calculix_regions.py",
    ),
    Case("Cook's membrane, plane strain, P2 on 16 × 16: 14.74 mm at mid-edge", "0.3 %", "elasticity/test_cook.py"),
    Case(
        "rubber, ν → 0.5, mixed u–p: evenly stretched blocks; orders of displacement and pressure in a blown-up tube",
        "1e-9; 0.2 of the order",
        "elasticity/test_incompressible.py",
    ),
    Case(
        "laws of rubber, stretched uniaxially, planar and equibiaxially, in space and in the plane, by hand",
        "1e-9",
        "elasticity/test_hand_curves.py::test_stresses_are_those_by_hand_in_all_models",
    ),
    Case(
        "laws fitted to one of Treloar's tests, against parameters that Steinmann, Hossain and Possart give",
        "2e-4 MPa",
        "design/test_law_fit.py::test_fits_to_one_of_treloars_tests_are_those_of_the_literature",
    ),
    Case(
        "Yeoh's law fitted to all of Treloar's tests, with standard errors, against linear least squares",
        "1e-4",
        "design/test_law_fit.py::test_yeoh_on_treloar_is_the_linear_least_squares_fit",
    ),
    Case(
        "two leaves that warm up, against Timoshenko's bimetal",
        "1e-4",
        "effects/test_temperature.py::test_two_leaves_bend_as_the_bimetal_of_timoshenko",
    ),
    Case("patch test", "1e-9", "elasticity/test_patch.py"),
    Case("rigid motion: no energy, no force", "1e-9", "elasticity/test_rigid_motion.py"),
    Case("convergence orders of P1 and P2 in 2D and 3D", "0.15 of the order", "elasticity/test_convergence.py"),
    Case("buckling load of a pinned column against Euler", "1 %", "equilibrium/test_stability.py"),
    Case(
        "columns by eigenvalues, clamped ends too; sideways buckling of a deep strip against Prandtl and Michell",
        "0.1 %; 3 %",
        "continuation/test_eigen.py",
    ),
    Case(
        "bifurcations of a column; its buckled shapes against the elastica up to half its length",
        "1 %",
        "continuation/test_branching.py",
    ),
    Case(
        "toggle that snaps through and back, against its closed form; limit load of a deep arch",
        "1e-8 N; 1 %",
        "continuation/test_arc_length.py",
    ),
    Case("bistable four-bar with one flexible link against a beam", "1 %", "equilibrium/test_bistable.py"),
    Case("gradient and KKT matrix against finite differences", "1e-6", "equilibrium/test_lagrangian.py"),
    Case(
        "half the depth against all of it, mirrored: displacements, reactions, stress, with every effect",
        "1e-8",
        "simulation/test_symmetric.py",
    ),
    Case("(mm, MPa) against (m, Pa)", "1e-8", "simulation/test_units.py"),
    Case(
        "error estimates of displacements against finer meshes, in the plane",
        "factor 2",
        "estimates/test_element_error.py::test_effectivity_in_the_plane_is_between_a_half_and_two",
    ),
    Case(
        "error estimates of forces at prescribed displacements against finer meshes, in the plane",
        "factor 2",
        "estimates/test_element_error.py::test_effectivity_of_forces_at_prescribed_displacements_is_between_a_half_and_two",
    ),
    Case(
        "error estimates of designed links against their exported parts in finer elements, in the plane and in space",
        "factor 2",
        "design/test_objective_error.py::test_errors_of_designs_are_those_of_their_parts_in_finer_elements",
    ),
    Case(
        "estimate of the error of plane stress against space",
        "factor 2",
        "estimates/test_plane_stress_error.py::test_estimate_is_near_what_space_adds",
    ),
    Case(
        "estimate of the error of plane stress of strips, straight and curved, against space",
        "factor 2",
        "estimates/test_plane_stress_error.py::test_estimate_finds_how_much_stiffer_strips_of_all_depths_are_in_space",
    ),
    Case(
        "estimate of how much curved strips stiffen from beams to plates, against Lamb's closed form",
        "0.95 to 1.3 times",
        "estimates/test_plane_stress_error.py::test_curved_strips_stiffen_from_beams_to_plates_as_in_closed_form",
    ),
    Case("link exported as STEP, imported and simulated again", "0.5 %", "simulation/test_exported_links.py"),
)


def rows(cases: tuple[Case, ...]) -> list[tuple]:
    """The lines of the table: each case's tests, how many passed, and their seconds."""
    with TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        tests = [str(ROOT / "tests" / case.test) for case in cases]
        arguments = ["-q", "-p", "no:cacheprovider", f"--junitxml={report}", *dict.fromkeys(tests)]
        subprocess.run([sys.executable, "-m", "pytest", *arguments], cwd=ROOT, check=False, stdout=sys.stderr)
        found = list(ElementTree.parse(report).iter("testcase"))
    lines = []
    for case in cases:
        file, _, function = case.test.partition("::")
        module = "tests." + file.removesuffix(".py").replace("/", ".")
        own = [t for t in found if t.get("classname") == module and t.get("name", "").startswith(function)]
        passed = sum(not any(child.tag in ("failure", "error", "skipped") for child in test) for test in own)
        seconds = sum(float(test.get("time", 0.0)) for test in own)
        lines.append(
            (case.what, case.within, f"`tests/{case.test}`", f"{passed} of {len(own)} hold", round(seconds, 1))
        )
    return lines


def main() -> None:
    options = command(__doc__).parse_args()
    publish("verification", format_table(HEADERS, rows(CASES)), write=options.write)


if __name__ == "__main__":
    main()
