"""Where an engine's author says which checks it does not pass, and why: `gasp-conformance.toml`.

    [[deviation]]
    check = "V12[24 degrees]"
    reason = "friction is taken at the cell's middle, the way is 2 % long"

It lies in the engine's package, so that whoever installs the engine has it, or beside its pyproject.toml. Where a
package has several engines, `engine` says which one an entry is about.
"""

from __future__ import annotations

import importlib.metadata
import importlib.resources
import json
import tomllib
from dataclasses import dataclass
from importlib.resources.abc import Traversable
from itertools import combinations
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from urllib.request import url2pathname

from gasp_core.contract import EngineDescriptor, Precision
from gasp_core.discovery.registry import discover
from gasp_core.errors import GaspError

__all__ = ["FILE_NAME", "Deviation", "DeviationsError", "deviations_of", "read_deviations"]

FILE_NAME = "gasp-conformance.toml"
_KEYS = ("check", "reason", "engine", "precision", "device")


class DeviationsError(GaspError):
    """An engine's list of deviations is malformed, or lists what cannot be excused."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """A check that an engine is known not to pass.

    Parameters
    ----------
    check
        Its whole name, e.g. "V8[4 cells]".
    reason
        For whoever reads the report.
    engine, precision, device
        The one it fails in; None for every one.
    """

    check: str
    reason: str
    engine: str | None = None
    precision: Precision | None = None
    device: str | None = None

    def applies(self, precision: Precision, device: str) -> bool:
        """Whether it is about a run in this precision on this device."""
        return self.precision in (None, precision) and self.device in (None, device)

    def overlaps(self, other: Deviation) -> bool:
        """Whether both are about one check in one run."""
        pairs = ((self.engine, other.engine), (self.precision, other.precision), (self.device, other.device))
        return self.check == other.check and all(None in pair or len(set(pair)) == 1 for pair in pairs)


def deviations_of(descriptor: EngineDescriptor, distribution: str) -> tuple[Deviation, ...]:
    """What an engine's own file lists of it; nothing where there is no file.

    Raises
    ------
    DeviationsError
        Where the file is malformed, names an engine that its package does not have, or a device that the engine does
        not declare.
    """
    package = _package(descriptor)
    for where, text in (_beside(package), _in_project(distribution)):
        if text is not None:
            listed = read_deviations(text, where)
            for one in listed:
                if one.engine not in (None, descriptor.name):
                    _check_engine(one, package, where)
            found = tuple(one for one in listed if one.engine in (None, descriptor.name))
            devices = descriptor.capabilities.devices
            for one in found:
                if one.device not in (None, *devices):
                    raise DeviationsError(
                        f'{where}: "{one.check}": device must be {" or ".join(devices)}, found "{one.device}"'
                    )
            return found
    return ()


def read_deviations(text: str, where: str) -> tuple[Deviation, ...]:
    """The deviations of a TOML document found at `where`.

    Raises
    ------
    DeviationsError
        Where it is no TOML, a key is unknown or missing, a reason is empty, or a check is listed twice.
    """
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise DeviationsError(f"{where}: is no TOML: {error}") from error
    for key in document:
        if key != "deviation":
            raise DeviationsError(f'{where}: unknown key "{key}"; the file holds [[deviation]] tables alone')
    tables = document.get("deviation", [])
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise DeviationsError(f"{where}: deviation must be a list of tables: write [[deviation]]")
    found = tuple(_deviation(table, f"{where}: deviation {number}") for number, table in enumerate(tables, start=1))
    for one, other in combinations(found, 2):
        if one.overlaps(other):
            raise DeviationsError(f'{where}: "{one.check}" is listed more than once: keep one entry')
    return found


def _package(descriptor: EngineDescriptor) -> str:
    return descriptor.factory.partition(":")[0].partition(".")[0]


def _check_engine(one: Deviation, package: str, where: str) -> None:
    """Refuse an entry that is about nobody: it would excuse nothing and never be found."""
    names = sorted(other.name for other in discover().engines.values() if _package(other) == package)
    if one.engine not in names:
        raise DeviationsError(
            f'{where}: "{one.check}": engine must be one of this package'
            f' ({", ".join(names) or "none is installed"}), found "{one.engine}"'
        )


def _deviation(table: dict[str, Any], where: str) -> Deviation:
    for key in table:
        if key not in _KEYS:
            raise DeviationsError(f'{where}: unknown key "{key}"; the keys are {", ".join(_KEYS)}')
    for key in ("check", "reason"):
        value = table.get(key)
        if not isinstance(value, str) or not value.strip():
            raise DeviationsError(f"{where}: {key} must be a text that says something, found {value!r}")
    precision = table.get("precision")
    known = [one.value for one in Precision]
    if precision is not None and precision not in known:
        raise DeviationsError(f"{where}: precision must be {' or '.join(known)}, found {precision!r}")
    for key in ("engine", "device"):
        if not isinstance(table.get(key, ""), str):
            raise DeviationsError(f"{where}: {key} must be the name of one, found {table[key]!r}")
    return Deviation(
        check=table["check"].strip(),
        reason=" ".join(table["reason"].split()),
        engine=table.get("engine"),
        precision=None if precision is None else Precision(precision),
        device=table.get("device"),
    )


def _beside(package: str) -> tuple[str, str | None]:
    try:
        file = importlib.resources.files(package) / FILE_NAME
        return f"{FILE_NAME} of {package}", _text(file, f"{FILE_NAME} of {package}") if file.is_file() else None
    except (ModuleNotFoundError, TypeError):
        # TypeError: an engine of one module, which has nothing beside it.
        return package, None


def _in_project(distribution: str) -> tuple[str, str | None]:
    """The file in the folder that a distribution was installed from "editable"."""
    try:
        origin = importlib.metadata.distribution(distribution).read_text("direct_url.json") if distribution else None
    except importlib.metadata.PackageNotFoundError:
        return distribution, None
    said = json.loads(origin or "{}")
    if not said.get("dir_info", {}).get("editable"):
        return distribution, None
    file = Path(url2pathname(urlsplit(said["url"]).path)) / FILE_NAME
    return str(file), _text(file, str(file)) if file.is_file() else None


def _text(file: Traversable, where: str) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise DeviationsError(f"{where}: cannot be read: {error}") from error
