"""Files that appear complete or not at all: text and bytes, plain data as JSON, columns of numbers as CSV."""

from __future__ import annotations

import csv
import json
import math
import os
import re
import secrets
import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fenicsmech.errors import DescriptionError, counted, finite, real_array

_LONGEST = 150
"""Bytes of a name of a file that is made from another name: file systems take 255, with ends and those of copies."""


def file_name(name: str, taken: Iterable[str] = ()) -> str:
    """A name of a file, without its ending, for a part of any name: of letters and digits, ``.``, ``_`` and ``-``.

    Args:
        name: whose other characters become ``-``; a path in it leads nowhere.
        taken: names of files that it differs from, in more than upper case: some file systems ignore it.
    """
    safe = re.sub(r"[^\w.-]", "-", unicodedata.normalize("NFC", name)).lstrip(".-")
    stem = safe.encode()[:_LONGEST].decode(errors="ignore").rstrip(".") or "part"
    folded = {own.casefold() for own in taken}
    found, number = stem, 1
    while found.casefold() in folded:
        found, number = f"{stem}-{number + 1}", number + 1
    return found


def file_names(names: Iterable[str]) -> list[str]:
    """Names of files in one folder, without their endings, for parts of these names."""
    found: list[str] = []
    for name in names:
        found.append(file_name(name, found))
    return found


@contextmanager
def atomic_write(path: str | Path, *, binary: bool = False) -> Iterator[IO]:
    """Opens ``path`` for UTF-8 text or bytes; it is replaced only when the block ends without an error.

    The data go to a hidden file in the same folder, synchronised with the disk and then renamed, and so is the folder:
    an interrupted run leaves the old file untouched and nothing beside it, a killed one leaves a hidden ``.tmp``.
    Missing parent folders are created.
    """
    target = Path(path)
    text: dict[str, Any] = {} if binary else {"encoding": "utf-8", "newline": "\n"}
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_name(f".{target.name}.{secrets.token_hex(6)}.tmp")
    # not mkstemp: its files are private (0600), results should follow the user's umask
    descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
    try:
        with open(descriptor, "wb" if binary else "w", **text) as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, target)
        _synchronise(target.parent)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _synchronise(folder: Path) -> None:
    """Writes the names of a folder's files to the disk, where the system can."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with suppress(OSError):  # some file systems of networks refuse it
            os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_json(path: str | Path, data: Mapping[str, object]) -> None:
    """Writes ``data`` as JSON: mappings, sequences, arrays, finite numbers, strings, flags, None and paths, nested."""
    text = json.dumps(_plain("", data), indent=2, ensure_ascii=False, allow_nan=False)
    with atomic_write(path) as file:
        file.write(text + "\n")


def read_json(path: str | Path, noun: str, *, form: str, remedy: str) -> dict:
    """The mapping in a JSON file whose entry "format" is ``form``.

    Raises:
        DescriptionError: there is no such file, or it is not the ``noun`` that it should be; with this ``remedy``.
    """
    part = f"{noun} {str(path)!r}"
    try:
        data = json.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DescriptionError(part, "there is no such file", remedy) from None
    except (UnicodeDecodeError, json.JSONDecodeError):
        data = None
    if not isinstance(data, dict) or data.get("format") != form:
        raise DescriptionError(part, f"it does not hold a {noun} of this program", remedy)
    return data


def _plain(key: str, value: object) -> object:
    """``value`` in the types of JSON; ``key`` is its path, for messages."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        if math.isfinite(value):
            return value
        raise _error(key, f"the value is {value}", "Use None for unknown values")
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Mapping):
        for name in value:
            if not isinstance(name, str):
                raise _error(key, f"the key {name!r} is not a string", "Use strings as keys")
        return {name: _plain(f"{key}.{name}" if key else name, item) for name, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, bytes | bytearray):
        return [_plain(f"{key}[{index}]", item) for index, item in enumerate(value)]
    raise _error(key, f"{type(value).__name__} has no JSON form", "Convert it to numbers, strings, lists or mappings")


def _error(key: str, problem: str, remedy: str) -> DescriptionError:
    return DescriptionError(f"entry '{key}' of a file" if key else "the data of a file", problem, remedy)


def write_csv(path: str | Path, columns: Mapping[str, ArrayLike]) -> None:
    """Writes ``columns``, (n,) finite numbers by header; floats keep every digit, flags become 0 and 1."""
    if not columns:
        raise DescriptionError(f"table '{path}'", "there are no columns", "Give at least one")
    rows = None
    checked = []
    for header, values in columns.items():
        column = real_array(f"column '{header}' of '{path}'", values, rows)
        rows = len(column)
        exact = np.asarray(values)
        checked.append(exact.astype(int) if exact.dtype.kind in "bui" else column)
    with atomic_write(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*(column.tolist() for column in checked), strict=True))


def read_csv(path: str | Path) -> dict[str, NDArray[np.float64]]:
    """Reads a file of :func:`write_csv`, or a spreadsheet's export of the same form.

    Blank lines and lines that start with # are skipped.

    Returns:
        header to (n,) values, in the order of the file.

    Raises:
        DescriptionError: no header, a repeated header, a row of another length, or a field that is not a finite number.
        OSError: the file cannot be read.
    """
    with open(path, encoding="utf-8-sig", newline="") as file:  # -sig: spreadsheets put a byte-order mark first
        reader = csv.reader(file)
        lines = [(reader.line_num, row) for row in reader]
    rows = [(line, row) for line, row in lines if "".join(row).strip() and not row[0].lstrip().startswith("#")]
    if not rows:
        raise DescriptionError(f"table '{path}'", "it is empty", "Start it with a line of headers")
    headers = [header.strip() for header in rows[0][1]]
    if len(set(headers)) < len(headers) or "" in headers:
        raise DescriptionError(f"table '{path}'", f"the headers are {headers}", "Give each column its own name")
    values = np.empty((len(rows) - 1, len(headers)))
    for index, (line, row) in enumerate(rows[1:]):
        part = f"table '{path}', line {line}"
        if len(row) != len(headers):
            raise DescriptionError(
                part, f"{counted(len(row), 'field')} for {counted(len(headers), 'column')}", "Complete the line"
            )
        values[index] = [finite(part, field) for field in row]
    return {header: values[:, k].copy() for k, header in enumerate(headers)}


def column(part: str, table: Mapping[str, NDArray[np.float64]], *beginnings: str) -> str:
    """The one header of ``table``, from ``read_csv``, that begins with one of ``beginnings``; case does not matter.

    Raises:
        DescriptionError: there is none, or there are several.
    """
    found = [header for header in table if header.lower().startswith(beginnings)]
    if len(found) != 1:
        problem = f"{counted(len(found), 'column')} of {' or '.join(beginnings)} among {', '.join(table)}"
        raise DescriptionError(part, problem, "Give one column whose header begins so")
    return found[0]
