"""The scenes of the demos, to be simulated at other fidelities."""

import importlib
import sys
from pathlib import Path

import fenicsmech as fm
from fenicsmech.mechanism import Force

DEMOS = Path(__file__).parents[2] / "demos"


def demo(name: str):
    """The module demos/NAME.py."""
    sys.path.insert(0, str(DEMOS))  # where it finds what the demos share
    try:
        return importlib.import_module(name)
    finally:
        sys.path.remove(str(DEMOS))


def describe(name: str) -> tuple[fm.Scene, Force]:
    """The scene of a demo and its first force."""
    scene = demo(name).describe()[0]
    return scene, scene.mechanism.forces[0]
