"""The files that a scene names."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

from gasp_core.scene.columns import Column
from gasp_core.scene.file_shapes import FileShape
from gasp_core.scene.model import Scene
from gasp_core.scene.motions import PythonMotion
from gasp_core.scene.objects import SplatObject, with_columns
from gasp_core.scene.writing import MEMORY

__all__ = ["files_of", "with_files"]


def with_files(scene: Scene, change: Callable[[Path], Path]) -> Scene:
    """The same with the path of every file changed: splats and their folders, meshes, columns, shapes of colliders, the
    camera's file, files of Python functions; not modules that Python finds by their names."""

    def moved(column: Column) -> Column:
        return _changed(column, change) if isinstance(column, Path) else column

    def elsewhere(item: SplatObject) -> SplatObject:
        reduction = item.reduction
        if reduction.mesh is not None:
            reduction = dataclasses.replace(reduction, mesh=change(reduction.mesh))
        splat = _changed(item.splat, change) if isinstance(item.splat, Path) else item.splat
        motion = _with_code(item.motion, change) if isinstance(item.motion, PythonMotion) else item.motion
        return dataclasses.replace(with_columns(item, moved), splat=splat, reduction=reduction, motion=motion)

    colliders = tuple(
        dataclasses.replace(one, shape=dataclasses.replace(one.shape, file=change(one.shape.file)))
        if isinstance(one.shape, FileShape)
        else one
        for one in scene.colliders
    )
    camera = scene.camera
    if camera is not None and camera.file is not None:
        camera = dataclasses.replace(camera, file=change(camera.file))
    objects = tuple(map(elsewhere, scene.objects))
    return dataclasses.replace(scene, objects=objects, colliders=colliders, camera=camera)


def files_of(scene: Scene) -> list[Path]:
    """Their paths, each once, in the order of the scene."""
    found: list[Path] = []

    def note(path: Path) -> Path:
        found.append(path)
        return path

    with_files(scene, note)
    return list(dict.fromkeys(found))


def _changed(path: Path, change: Callable[[Path], Path]) -> Path:
    """What was in memory is in no file."""
    return path if str(path).startswith(MEMORY) else change(path)


def _with_code(motion: PythonMotion, change: Callable[[Path], Path]) -> PythonMotion:
    file = motion.file
    if file is None:
        return motion
    return dataclasses.replace(motion, function=f"{change(file)}:{str(motion.function).rpartition(':')[2]}")
