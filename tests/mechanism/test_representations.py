"""Parts print themselves in one line: name and figures."""

import pytest

import fenicsmech as fm

from .parts import parts


def described() -> dict[str, object]:
    """Parts by how they print."""
    p = parts()
    m = p.mechanism
    push = m.force(on=p.crank, at=(10.0, 0.5), direction=(0.0, -3.0), name="finger")
    tip = m.output(on=p.rod, at=(40.0, 0.0), direction=(1.0, 0.0), name="tip")
    scene = fm.Scene(m)
    return {
        "RigidLink('base', fixed)": p.base,
        "RigidLink('crank')": p.crank,
        "FlexibleLink('rod': Strip of Onyx)": p.rod,
        "Joint('shaft': revolute, 'base' to 'crank' at (0, 0))": p.shaft,
        "Motor('drive' on 'shaft')": p.motor,
        "Force('finger' on 'crank' at (10, 0.5) along (0, -1))": push,
        "Output('tip' on 'rod' at (40, 0) along (1, 0))": tip,
        "Drive('gears': 1 × 'drive')": fm.Drive("gears", {p.motor: 1.0}),
        "Configuration('as drawn': every motor as drawn)": fm.DRAWN,
        "Configuration('up': 'drive' at 0.5)": scene.configuration("up", {p.motor: 0.5}),
        "Scene('press': no effects)": scene,
        "Scene('press': spring of stiffness 2 in 'shaft')": fm.Scene(m, effects=[fm.JointSpring(p.shaft, 2.0)]),
        "Mechanism('press': 2 rigid links, 1 flexible link, 2 revolute joints, 1 motor, 1 force, 1 output)": m,
        "Mechanism('empty': no parts)": fm.Mechanism("empty"),
    }


@pytest.mark.parametrize(("text", "part"), described().items(), ids=lambda value: str(value)[:12])
def test_parts_print_name_and_figures(text, part):
    assert repr(part) == text


def test_a_mechanism_lists_its_parts():
    m = parts().mechanism
    assert str(m).splitlines() == [
        "Mechanism('press': 2 rigid links, 1 flexible link, 2 revolute joints, 1 motor)",
        "  RigidLink('base', fixed)",
        "  RigidLink('crank')",
        "  FlexibleLink('rod': Strip of Onyx)",
        "  Joint('shaft': revolute, 'base' to 'crank' at (0, 0))",
        "  Joint('pin': revolute, 'crank' to 'rod' at (10, 0))",
        "  Motor('drive' on 'shaft')",
    ]
