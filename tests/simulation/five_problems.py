"""The five problems that error estimates are judged on: cantilever, arch, truss, claw and Klann leg."""

from .demo_scenes import describe
from .refined import arch, cantilever

LOADS = {"truss": 0.4, "claw": 10.0, "klann": 5.0}


def case(name: str):
    """Scene, force and load of a problem."""
    made = {"cantilever": cantilever, "arch": arch}
    if name in made:
        return made[name]()
    scene, push = describe(name)[:2]
    return scene, push, LOADS[name]
