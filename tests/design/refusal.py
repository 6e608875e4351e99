"""Parts of a refusal: part, problem, remedy."""

from __future__ import annotations

from collections.abc import Callable

import pytest

import fenicsmech as fm


def refused(describe: Callable[[], object], *, part: str, problem: str, remedy: str) -> None:
    """Calls ``describe``, which must raise an error with these words in its parts (``problem`` a pattern)."""
    with pytest.raises(fm.DescriptionError, match=problem) as caught:
        describe()
    assert part in caught.value.part
    assert remedy in caught.value.remedy
