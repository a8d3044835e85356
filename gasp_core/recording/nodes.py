"""Metadata of a recording: ``zarr.json`` of groups and arrays, read with bounds and written with a seal.

A seal is the checksum of all bytes before it, the last attribute of a node. So a node says of itself whether it is
whole: a commit, the header, the status.
"""

from __future__ import annotations

import contextlib
import itertools
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gasp_core.errors import RecordingError
from gasp_core.recording.durable import replace_file
from gasp_core.recording.files import checksum, read_file

__all__ = ["GROUP", "MOST_BYTES", "group", "is_readable", "parsed", "read_attributes", "read_node", "sealed"]
__all__ += ["whole", "write_attributes"]

Node = dict[str, Any]

MOST_BYTES = 8 << 20
"""Of a node: the header of a scene of three thousand objects has six million."""
_BYTES_OF_A_ROW = 48
"""Of a commit, for each simplex without a frame of its own: a pair of numbers."""
_LONGEST = 1 << 30
_MOST_LISTS = 1 << 18
"""Lists and objects of a node: 20 for each object of a scene, 80 with cores of four levels. They take up to 24 times
the memory of their text."""
GROUP = frozenset({"zarr_format", "node_type", "attributes"})
"""All that a group has. Consolidated metadata, which would speak for others, are none of it."""
_DEEPEST = 16
"""Lists within lists; today's nodes have eight."""
_TAIL = b'"}}'
_SEAL = 8 + len(_TAIL)


def group(attributes: Mapping[str, Any]) -> Node:
    """The node of a Zarr group of these attributes."""
    return {"zarr_format": 3, "node_type": "group", "attributes": attributes}


def sealed(node: Mapping[str, Any]) -> bytes:
    """A node as the bytes of a ``zarr.json`` that ends with its seal."""
    attributes = {name: value for name, value in node["attributes"].items() if name != "checksum"}
    others = {name: value for name, value in node.items() if name != "attributes"}
    content = json.dumps({**others, "attributes": {**attributes, "checksum": "0" * 8}}, allow_nan=False).encode()
    before = content[:-_SEAL]
    return before + f"{checksum(before):08x}".encode() + _TAIL


def whole(content: bytes) -> bool:
    """Whether a node's seal is that of its bytes."""
    before, seal = content[:-_SEAL], content[-_SEAL:]
    return seal == f"{checksum(before):08x}".encode() + _TAIL


def parsed(root: Path, key: str, content: bytes, rows: int = 0) -> Node:
    """A node from its bytes; `rows` as of `read_node`.

    Raises
    ------
    RecordingError
        Where it is none, or deeper or of more parts than any that was written.
    """
    node: Any = None
    # Asked before it is parsed, which is what takes the memory.
    if _lists(content) <= _MOST_LISTS + rows:
        with contextlib.suppress(ValueError, RecursionError):
            node = json.loads(content, parse_constant=_refuse_constant)
    if (
        not isinstance(node, dict)
        or _is_deeper(node, _DEEPEST)
        or node.get("zarr_format") != 3
        or not isinstance(node.get("attributes"), dict)
        or (node.get("node_type") == "group" and node.keys() != GROUP)
    ):
        raise RecordingError(f"{root}: {key} is damaged: it is no metadata that GASP writes")
    return node


def read_node(root: Path, key: str, rows: int = 0) -> tuple[Node, bytes]:
    """A node of a recording, and its bytes.

    Parameters
    ----------
    root, key
        The recording, and the ``zarr.json`` in it.
    rows
        Pairs of numbers that it may have in addition to what every node may.

    Raises
    ------
    RecordingError
        Where it is damaged.
    FileNotFoundError
        Where there is none.
    """
    content = read_file(root, key, min(MOST_BYTES + _BYTES_OF_A_ROW * rows, _LONGEST))
    return parsed(root, key, content, rows), content


def read_attributes(root: Path, key: str, rows: int = 0, *, seal: bool) -> dict[str, Any]:
    """Attributes of a group of a recording, less its seal.

    Parameters
    ----------
    root, key, rows
        As of `read_node`.
    seal
        Whether it must have one: from version 6 on.

    Raises
    ------
    RecordingError
        Where it is damaged.
    FileNotFoundError
        Where there is none.
    """
    node, content = read_node(root, key, rows)
    if (seal or "checksum" in node["attributes"]) and not whole(content):
        raise RecordingError(f"{root}: {key} is damaged: its checksum is another")
    if node.get("node_type") != "group":
        raise RecordingError(f"{root}: {key} is damaged: it is no group")
    attributes: dict[str, Any] = node["attributes"]
    attributes.pop("checksum", None)
    return attributes


def write_attributes(folder: Path, attributes: Mapping[str, Any]) -> None:
    """Make a folder a Zarr group of these attributes, sealed, in one step."""
    folder.mkdir(parents=True, exist_ok=True)
    replace_file(folder / "zarr.json", sealed(group(attributes)))


def is_readable(content: bytes) -> bool:
    """Whether a header is none too long, and of none too many parts, to be read again."""
    return len(content) <= MOST_BYTES and _lists(content) <= _MOST_LISTS


def _lists(content: bytes) -> int:
    """At least as many as there are lists and objects."""
    return content.count(b"[") + content.count(b"{")


def _is_deeper(node: Node, most: int) -> bool:
    """Whether there are more lists and objects than that within each other."""
    level: list[Any] = [node]
    for _ in range(most):
        values = itertools.chain.from_iterable(held.values() if isinstance(held, dict) else held for held in level)
        level = [value for value in values if isinstance(value, (dict, list))]
        if not level:
            return False
    return True


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is no JSON")
