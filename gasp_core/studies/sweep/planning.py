"""Which scenes a sweep is of: a setting each, and a digest by which it is known again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from gasp_core.contract import Precision
from gasp_core.discovery.registry import discover
from gasp_core.errors import GaspError, SceneError
from gasp_core.scene.file_digests import file_digest
from gasp_core.scene.files import files_of
from gasp_core.scene.loading import load_scene
from gasp_core.scene.model import Scene
from gasp_core.scene.writing import scene_to_toml
from gasp_core.studies.sweep.settings import Setting

__all__ = ["Planned", "key_of", "planned"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Planned:
    """A setting, and the scene that it makes.

    Parameters
    ----------
    setting
        What is set.
    scene
        As it is to be run; None where it is none.
    digest
        Of that and of its files.
    reason
        Why it is none.
    """

    setting: Setting
    scene: Scene | None
    digest: str = ""
    reason: str = ""


def planned(
    scene: str | Path,
    settings: Sequence[Setting],
    *,
    engine: str | None = None,
    device: str | None = None,
    precision: Precision | None = None,
) -> list[Planned]:
    """The scene of each setting; one that the scene refuses says why.

    Parameters
    ----------
    scene
        Its file.
    settings
        In any order.
    engine, device, precision
        Of all runs, instead of the scenes', see `Scene.with_engine`.

    Raises
    ------
    SceneError
        Where it refuses all of them.
    UnknownEngineError, PluginLoadError
        Where there is no such engine.
    """
    path = Path(scene).absolute()
    registry = discover()
    known: dict[Path, str] = {}
    found: list[Planned] = []
    if engine is not None:
        registry.descriptor(engine)
    for setting in settings:
        try:
            own = load_scene(path, setting.changes)
            descriptor = registry.descriptor(engine or own.engine.name)
            if engine is not None or device is not None or precision is not None:
                own = own.with_engine(descriptor, device=device, precision=precision)
            found.append(Planned(setting=setting, scene=own, digest=_digest(own, known)))
        except GaspError as error:
            found.append(Planned(setting=setting, scene=None, reason=str(error)))
    if not any(each.scene is not None for each in found):
        raise SceneError(found[0].reason if found else "no settings are named: there is nothing to run")
    return found


def key_of(setting: Setting) -> str:
    """Short, and of these settings alone."""
    text = json.dumps(sorted(setting.values.items()))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _digest(scene: Scene, known: dict[Path, str]) -> str:
    """Of a scene and the content of its files, each of which is read once."""
    parts = [scene_to_toml(replace(scene, camera=None))]
    for path in files_of(scene):
        if path not in known:
            known[path] = file_digest(path)
        parts.append(known[path])
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()
