"""A first curve and a short optimisation of the truss finger, as two calls whose executed files can be counted."""

import fenicsmech as fm


def prepare():
    """The calls ``curve`` and ``design``, both without arguments, on the finger in plane stress."""
    finger = fm.Mechanism("truss finger")
    base = finger.rigid("base", fixed=True)
    left, right, tip = (finger.rigid(name) for name in ("left", "right", "tip"))
    shape = fm.strip([(0, 0), (18, 34), (40, 60)], thickness=3.0, depth=20.0)
    diagonal = finger.flexible("diagonal", shape, fm.SMOOTH_SIL_950)
    for a, b, at in ((base, left, (0, 0)), (base, right, (40, 0)), (left, tip, (0, 60)), (right, tip, (40, 60))):
        finger.revolute(a, b, at=at)
    finger.revolute(base, diagonal, at=(0, 0), interface_radius=3.0)
    finger.revolute(diagonal, tip, at=(40, 60), interface_radius=3.0)
    push = finger.force(on=tip, at=(20, 70), direction=(1, 0))
    sim = fm.Simulation(fm.Scene(finger, effects=[]), space="plane-stress", size=3.0)
    targets = [fm.Target(push, force=0.1, displacement=2.0)]
    problem = fm.DesignProblem(sim, [fm.SplineDesign(diagonal, segments=3, thickness=(1.5, 6.0))], targets=targets)

    def curve():
        return sim.load_displacement(push, forces=[0.1, 0.2])

    def design():
        return problem.optimise(optimiser=fm.LevenbergMarquardt(iterations=2))

    return curve, design
