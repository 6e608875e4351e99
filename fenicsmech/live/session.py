"""A session: the project, its history, and the task that each message leads to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fenicsmech.live.project import Project, edited, example, example_names, read_project, wants
from fenicsmech.live.schema import Refused

_STEPS = 200  # of undo; a project has a few thousand bytes


@dataclass(frozen=True)
class Answer:
    """What a message leads to.

    Attributes:
        changed: whether the project is another one.
        task: for the solver, without its number; None if it goes on.
        stop: whether the solver stops.
    """

    changed: bool = False
    task: Mapping[str, Any] | None = None
    stop: bool = False


@dataclass(frozen=True)
class _Opened:
    """A project as it was opened, which one it is, from 1, and its curves by number, as far as they are solved."""

    project: Project
    number: int
    curves: dict[int, dict[str, Any]] = field(default_factory=dict)


class Session:
    """The project of a page.

    Args:
        project: the first one.

    Attributes:
        project: the present one.
        task: what the solver was asked for last, but for pushes, without its number.
        solved: whether that is done.
    """

    def __init__(self, project: Project) -> None:
        self.project = read_project(project)
        self._opened, self._count = _Opened(self.project, 1), 1
        self._past: list[tuple[Project, _Opened]] = []
        self._future: list[tuple[Project, _Opened]] = []
        self._before: Project | None = None  # of a gesture that lasts
        self._interrupted = False  # whether that gesture has interrupted a fit
        self.solved, self._stopped = False, False
        self.task: Mapping[str, Any] = self._solve(fit=project["fit"] and project["design"] is None)

    @property
    def opened(self) -> int:
        """Which of the projects that were opened the present one is made of, from 1."""
        return self._opened.number

    @property
    def first_curves(self) -> dict[int, dict[str, Any]]:
        """Curves of the project as it was opened, by number, to be noted here; they last as long as the history."""
        return self._opened.curves

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to undo."""
        return bool(self._past) or self._before is not None

    @property
    def can_redo(self) -> bool:
        """Whether there is a step to redo."""
        return bool(self._future)

    @property
    def untouched(self) -> bool:
        """Whether the project is as it was opened, but for what the solver has found."""
        design = {"design": None}
        return {**self.project, **design} == {**self._opened.project, **design}

    def answer(self, message: Mapping[str, Any]) -> Answer:
        """Applies a message that ``messages.read_message`` has checked.

        Raises:
            Refused: it does not fit the project, which stays.
        """
        match message["kind"]:
            case "edit":
                return self._edit(message)
            case "cancel":
                return self._cancel()
            case "undo":
                return self._undo()
            case "redo":
                return self._redo()
            case "reset":
                return self._replace(self._opened.project, opened=False)
            case "open":
                return self._replace(read_project(message["project"]), opened=True)
            case "example":
                if message["name"] not in example_names():
                    raise Refused("name", "there is no such example")
                return self._replace(example(message["name"]), opened=True)
            case "push":
                return Answer(task=self._push(message))
            case "release":
                return Answer() if self.solved else Answer(task=self.task)
            case "fit":
                return self._fit()
            case _:
                self._stopped = True
                return Answer(stop=True)

    def settle(self) -> bool:
        """Ends a gesture where it rests, for a page that does not; whether there was one."""
        if self._before is None:
            return False
        self._step(self._before)
        return True

    def _fit(self) -> Answer:
        task = self._solve(fit=True)
        if task["fit"]:
            self._step(self._before or self.project)
        return self._asked(task)

    def _push(self, message: Mapping[str, Any]) -> Mapping[str, Any]:
        self.check_curve(message["curve"])
        held = message.get("at")
        if held is not None and all(link["name"] != held["link"] for link in self.project["links"]):
            raise Refused("at.link", f"there is no {held['link']!r}")
        pushed = {"kind": "push", "curve": message["curve"], "force": message["force"], "at": held}
        return {**pushed, "by": message.get("by", [0.0, 0.0]), "project": self.project, "fit": False}

    def check_curve(self, number: int) -> None:
        """Refuses the number of a curve that the project does not have."""
        if number >= len(self.project["curves"]):
            raise Refused("curve", f"there is no curve {number}")

    def designed(self, design: Mapping[str, Any]) -> None:
        """Takes a design that the solver has found for the present project."""
        self.project = {**self.project, "design": design}
        self.task = {**self.task, "project": self.project}

    def _edit(self, message: Mapping[str, Any]) -> Answer:
        project = edited(self.project, message["changes"])
        by_hand = any(change["path"][0] in ("design", "fit") for change in message["changes"])
        fit = message.get("fit", project["fit"] and not by_hand)
        rested = self._before is not None
        if not message["settled"]:
            if self._before is None:
                self._before = self.project
                self._interrupted = bool(self.task["fit"]) and not self.solved and not self._stopped
        else:
            self._step(self._before or self.project)
        self.project = project
        task = self._solve(fit=fit)
        if rested and task == self.task and not self._stopped:
            return Answer(changed=True)  # where the gesture rested: what was asked for there goes on
        return self._asked(task)

    def _step(self, before: Project) -> None:
        self._past = [*self._past[1 - _STEPS :], (before, self._opened)]
        self._future, self._before = [], None

    def _cancel(self) -> Answer:
        if self._before is None:
            return Answer()  # it was settled, or replaced by another page
        self.project, self._before = self._before, None
        return self._asked(self._solve(fit=self._interrupted))

    def _undo(self) -> Answer:
        if not self.can_undo:
            raise Refused("", "there is nothing to undo")
        self._future.append((self.project, self._opened))
        self.project, self._opened = (self._before, self._opened) if self._before else self._past.pop()
        self._before = None
        return self._asked(self._solve(fit=False))

    def _redo(self) -> Answer:
        if not self._future:
            raise Refused("", "there is nothing to redo")
        self._past.append((self._before or self.project, self._opened))
        (self.project, self._opened), self._before = self._future.pop(), None
        return self._asked(self._solve(fit=False))

    def _replace(self, project: Project, *, opened: bool) -> Answer:
        self._step(self._before or self.project)
        self.project = project
        if opened:
            self._count += 1
            self._opened = _Opened(project, self._count)
        return self._asked(self._solve(fit=project["fit"] and project["design"] is None))

    def _solve(self, *, fit: bool) -> Mapping[str, Any]:
        return {"kind": "solve", "project": self.project, "fit": bool(fit and wants(self.project))}

    def _asked(self, task: Mapping[str, Any], *, changed: bool = True) -> Answer:
        self.task, self.solved, self._stopped = task, False, False
        return Answer(changed=changed, task=task)
