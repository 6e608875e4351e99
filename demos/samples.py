"""The bending test of a straight sample: one end clamped, a grip on the other pushed across the sample."""

from dataclasses import replace

import fenicsmech as fm

LENGTH, DEPTH, CLAMP = 60.0, 5.0, 6.0  # mm: free length, width across the bending, length of the clamped ends


def bending_test(thickness, material=fm.ONYX):
    """The scene for a sample ``thickness`` mm thick, and the force on its grip."""
    rig = fm.Mechanism(f"{thickness:g} mm sample")
    bench, grip = rig.rigid("bench", fixed=True), rig.rigid("grip")
    shape = fm.strip([(-CLAMP, 0), (LENGTH + CLAMP, 0)], thickness=thickness, depth=DEPTH)
    sample = rig.flexible("sample", shape, material)
    clamp = fm.Rectangle(CLAMP, 1.5 * thickness)
    rig.weld(bench, sample, at=(-0.5 * CLAMP, 0), region=clamp)
    rig.weld(sample, grip, at=(LENGTH + 0.5 * CLAMP, 0), region=clamp)
    push = rig.force(on=grip, at=(LENGTH, 0), direction=(0, 1), name="push on grip")
    return fm.Scene(rig), push


def of_modulus(E):
    """Onyx with another Young's modulus."""
    return replace(fm.ONYX, law=replace(fm.ONYX.law, E=E))
