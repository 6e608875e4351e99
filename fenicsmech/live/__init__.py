"""The live page: a mechanism and its load–displacement curve in a browser, to be dragged.

    python3 -m fenicsmech.live

- ``project``: mechanism, curves, targets and design as plain JSON; ``schema``: what plain data may be
- ``messages``: what page, server and solver process say to each other
- ``session``: project, history, and what a gesture leads to
- ``server``: static files and a WebSocket on 127.0.0.1; ``solver``: the process that computes, ended at any time;
  ``solver_process`` keeps it alive
- ``responses``: linear ones of what the page draws; ``grip``: a point that the pointer holds
- ``cancel``: equilibria that a new gesture ends at their next iteration; ``problems``, with their remedies
- ``solid``: the process that solves in space; ``job``: runs it
- ``build``: the simulation and the design problem of a project; ``script``: the Python script that does the same
- ``stored``: first results for the next start, shown before the solver is up
- ``describe``: the project of a script's design problem; ``carried``: what of it the page does not edit, as plain data
- ``export``: files of a project
- ``page/``: the page itself, modules without a build step

While a target is dragged the page shows the linear preview, from the last derivatives of the curve; when it rests, the
solver follows, and every iterate is shown as it comes. The next gesture ends that at its next iteration.
"""

from fenicsmech.design import DesignProblem, DesignResult
from fenicsmech.errors import DescriptionError
from fenicsmech.live.build import draw
from fenicsmech.live.cancel import Cancellable, Cancelled
from fenicsmech.live.describe import project_of
from fenicsmech.live.export import export
from fenicsmech.live.job import Job
from fenicsmech.live.messages import LARGEST, PER_SECOND, read_message
from fenicsmech.live.project import (
    FORMAT,
    LARGEST_PROJECT,
    MOST_ELEMENTS,
    Project,
    edited,
    example,
    example_names,
    forces_of,
    load_project,
    read_project,
)
from fenicsmech.live.schema import Refused
from fenicsmech.live.script import script
from fenicsmech.live.server import Server, ServerOptions, serve
from fenicsmech.live.session import Answer, Session
from fenicsmech.live.solid import solve_solid
from fenicsmech.live.solver import Solver


def live(
    problem: DesignProblem | Project,
    *,
    result: DesignResult | None = None,
    port: int | None = None,
    browse: bool = True,
    options: ServerOptions | None = None,
) -> None:
    """Opens the live page of a design problem in a browser, and serves it until interrupted.

    The page is at 127.0.0.1, its address has a random token. Problems in 3D that plane stress can describe are shown in
    plane stress. What the page cannot edit it carries: solved, shown in words, saved, and written to the script.

    Args:
        problem: with a force in the sample of one target at least; or a project of the page.
        result: of the problem, whose shape is opened; the drawn one by default.
        port: of 127.0.0.1; a free one by default. Where ``options`` are given, the port is theirs.
        browse: whether a browser is opened; otherwise the address is printed alone.
        options: of the server, such as its limits of time and its port.

    Raises:
        DescriptionError: a part of the problem has no plain data, as a function of the script's own, the result belongs
            to another problem or a project is given with one, a port is given twice, or aiohttp is missing.
    """
    if options is not None and port is not None:
        remedy = f"Give it once: options=fm.ServerOptions(port={port}, …)"
        raise DescriptionError("live page", "a port is given beside the options, which have one", remedy)
    if isinstance(problem, DesignProblem):
        project = project_of(problem, result)
    elif result is not None:
        raise DescriptionError("live page", "a result is given with a project", "Give the problem of the result")
    else:
        project = problem
    serve(project, options=options or ServerOptions(port=port or 0), browse=browse)
