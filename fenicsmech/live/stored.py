"""First results of opened projects, stored from one start to the next: the page moves before the solver is up.

What is stored are messages of the solver about the project as it was opened, under a key of the project, the code and
the cards of this package, and the version of dolfinx: what other code has computed is never shown. The solver computes
them anew.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from time import time

from fenicsmech.compat import DOLFINX
from fenicsmech.files import atomic_write
from fenicsmech.live.project import Project

_MOST = 20  # files, some 150 kB each
_LEFT = 3600.0  # s, after which a file that is not complete was left by a process that was killed

PACKAGE = Path(__file__).parents[1]

Kept = tuple[str, int | None]
"""Event of a message, and the number of its curve."""


def user_cache() -> Path | None:
    """The folder for what can be computed again, by the XDG Base Directory Specification; None without a home."""
    given = Path(os.environ.get("XDG_CACHE_HOME", ""))
    try:
        return (given if given.is_absolute() else Path.home() / ".cache") / "fenicsmech" / "live"
    except RuntimeError:
        return None


class StoredResults:
    """Results of projects in a folder, the newest of them.

    Args:
        folder: made when something is stored; None: nothing is.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folder, self._code = folder, hashlib.sha256(DOLFINX.encode())  # of this start, whatever is edited later
        if folder is not None:
            for path in sorted(own for kind in ("*.py", "*.toml") for own in PACKAGE.rglob(kind)):
                self._code.update(path.read_bytes())

    def find(self, project: Project) -> dict[Kept, str]:
        """Messages of the solver by their event and curve; none if the project's results are not stored."""
        if self._folder is None:
            return {}
        try:
            found = json.loads(self._path(self._folder, project).read_text(encoding="utf-8"))
            return {((event := json.loads(text))["event"], event.get("curve")): text for text in found}
        except (OSError, ValueError, TypeError, KeyError):
            return {}

    def store(self, project: Project, messages: Mapping[Kept, str]) -> None:
        """Stores messages of the solver; where the disk does not allow it, the next start computes them again."""
        if self._folder is None:
            return
        with suppress(OSError):
            self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            with atomic_write(self._path(self._folder, project)) as file:
                json.dump(list(messages.values()), file)
            newest = sorted(self._folder.glob("*.json"), key=lambda path: path.stat().st_mtime, reverse=True)
            left = [path for path in self._folder.glob(".*.tmp") if time() - path.stat().st_mtime > _LEFT]
            for path in (*newest[_MOST:], *left):
                path.unlink(missing_ok=True)

    def _path(self, folder: Path, project: Project) -> Path:
        key = self._code.copy()
        key.update(json.dumps(project, sort_keys=True).encode())
        return folder / f"{key.hexdigest()[:32]}.json"
