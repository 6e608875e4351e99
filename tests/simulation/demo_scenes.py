"""The scenes of the demos, to be simulated at other fidelities."""

import importlib

import fenicsmech as fm
from fenicsmech.mechanism import Force


def demo(name: str):
    """The module demos/NAME.py."""
    return importlib.import_module(f"demos.{name}")


def describe(name: str) -> tuple[fm.Scene, Force]:
    """The scene of a demo and its first force."""
    scene = demo(name).describe()[0]
    return scene, scene.mechanism.forces[0]
