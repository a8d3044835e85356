"""Cameras that others wrote down: cameras.json of 3DGS, transforms.json of NeRF and its kin."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any, cast

import numpy as np

from gasp_core.errors import RenderingError
from gasp_core.io.format_errors import shown
from gasp_core.io.text_files import read_text
from gasp_core.rendering.camera import Camera
from gasp_core.scene.placement import Placement

__all__ = ["NamedCamera", "choose", "placed", "read_cameras"]

_NUMBER = re.compile(r"[0-9]{1,9}")
_LONGEST_NAME = 200
_FLATTEST = 1e-9
_DEFAULT_SIDE = 800
"""Pixels, where a transforms.json gives an angle and no size, as that of the synthetic NeRF scenes does."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedCamera:
    """A camera of a file, in the frame of the splat that was trained with it."""

    name: str
    camera: Camera


def read_cameras(path: str | Path) -> list[NamedCamera]:
    """All cameras of a cameras.json (a list, as 3DGS trainers write it) or a transforms.json (an object with frames).

    Lens distortion is left out: splats are drawn by a pinhole, and trained on undistorted pictures.

    Raises
    ------
    RenderingError
        Where the file cannot be read or is neither; the message names camera and key.
    """
    path = Path(path)
    name = shown(path)
    try:
        found: Any = json.loads(read_text(path))
    except FileNotFoundError:
        raise RenderingError(
            f"{name}: there is no such camera file: put it there, or name another or a view (--camera front)"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise RenderingError(f"{name}: cannot be read ({shown(error)[:_LONGEST_NAME]})") from None
    except (ValueError, RecursionError) as error:
        raise RenderingError(f"{name}: is not valid JSON ({shown(error)[:_LONGEST_NAME]})") from None
    if isinstance(found, list):
        cameras = [_of_3dgs(_Entry(path, f"camera {k}", entry)) for k, entry in enumerate(cast("list[Any]", found))]
    elif isinstance(found, dict) and isinstance(cast("dict[str, Any]", found).get("frames"), list):
        whole = cast("dict[str, Any]", found)
        frames = cast("list[Any]", whole["frames"])
        cameras = [_of_nerf(_Entry(path, f"frame {k}", entry, whole)) for k, entry in enumerate(frames)]
    else:
        raise RenderingError(
            f"{name}: is no camera file: neither a list of cameras (cameras.json) nor an object with frames"
            " (transforms.json)"
        )
    if not cameras:
        raise RenderingError(f"{name}: holds no camera")
    return cameras


def choose(cameras: list[NamedCamera], view: int | str, path: Path) -> Camera:
    """The camera of a number (from 0) or a name.

    Raises
    ------
    RenderingError
        Where there is none.
    """
    if isinstance(view, str) and _NUMBER.fullmatch(view) and all(entry.name != view for entry in cameras):
        view = int(view)
    if isinstance(view, int):
        if not 0 <= view < len(cameras):
            raise RenderingError(f"{shown(path)}: has cameras 0 to {len(cameras) - 1}, not {view}")
        return cameras[view].camera
    for entry in cameras:
        if view in (entry.name, PurePosixPath(entry.name).stem, PurePosixPath(entry.name).name):
            return entry.camera
    names = ", ".join(entry.name for entry in cameras[:4]) + (", ..." if len(cameras) > 4 else "")
    raise RenderingError(f'{shown(path)}: has no camera "{shown(view)}", its cameras are {names}')


def placed(camera: Camera, placement: Placement) -> Camera:
    """A camera of a splat's own frame, once the splat has been put into the world.

    With x_world = s R x + t and x_camera = C x + c, the camera sees s x_camera = C R^T (x_world - t) + s c: the same
    picture, depths in metres.
    """
    rotation = camera.rotation @ placement.rotation.T
    translation = placement.scale * camera.translation - rotation @ placement.translation
    return replace(camera, rotation=rotation, translation=translation, near=camera.near * placement.scale)


class _Entry:
    """One camera of a file; complains by file, camera and key."""

    def __init__(self, path: Path, where: str, entry: Any, defaults: Mapping[str, Any] | None = None) -> None:
        self.path, self.where = shown(path), where
        if not isinstance(entry, dict):
            raise RenderingError(f"{self.path}: {where} is no object with the camera's values")
        self.values = {**(defaults or {}), **cast("dict[str, Any]", entry)}

    def fail(self, key: str, what: str) -> RenderingError:
        return RenderingError(f"{self.path}: {self.where}: {key}: {what}")

    def number(self, key: str) -> float:
        value = self.values.get(key)
        try:
            number = float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else math.nan
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self.fail(key, f"must be a number, found {shown(value)[:40]}")
        return number

    def name(self, *keys: str) -> str:
        """The first of these keys that is there, fit to be printed."""
        value = next((self.values[key] for key in keys if key in self.values), "")
        if not isinstance(value, (str, int)):
            raise self.fail(keys[0], "must be a text")
        return shown(value)[:_LONGEST_NAME]

    def side(self, key: str) -> int:
        return round(self.number(key))

    def matrix(self, key: str, *shapes: tuple[int, ...]) -> np.ndarray[Any, Any]:
        try:
            matrix = np.array(self.values.get(key), dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            matrix = np.empty(0)
        if matrix.shape not in shapes or not np.isfinite(matrix).all():
            raise self.fail(key, f"must be finite numbers of shape {' or '.join(map(str, shapes))}")
        return matrix

    def camera(self, **values: Any) -> Camera:
        try:
            return Camera(**values)
        except RenderingError as error:
            raise RenderingError(f"{self.path}: {self.where}: {error}") from None


def _of_3dgs(entry: _Entry) -> NamedCamera:
    # The rotation is camera to world, the position that of the eye.
    rotation = entry.matrix("rotation", (3, 3)).T
    eye = entry.matrix("position", (3,))
    width, height = entry.side("width"), entry.side("height")
    camera = entry.camera(
        width=width,
        height=height,
        focal_x=entry.number("fx"),
        focal_y=entry.number("fy"),
        center_x=width / 2,
        center_y=height / 2,
        rotation=rotation,
        translation=-rotation @ eye,
    )
    return NamedCamera(name=entry.name("img_name", "id"), camera=camera)


def _of_nerf(entry: _Entry) -> NamedCamera:
    # Camera to world, with OpenGL's axes: y up, z out of the picture.
    pose = entry.matrix("transform_matrix", (4, 4), (3, 4))
    rotation = (pose[:3, :3] * [1.0, -1.0, -1.0]).T
    width = entry.side("w") if "w" in entry.values else _DEFAULT_SIDE
    height = entry.side("h") if "h" in entry.values else width
    focal_x = entry.number("fl_x") if "fl_x" in entry.values else _focal(entry, "camera_angle_x", width)
    if "fl_y" in entry.values:
        focal_y = entry.number("fl_y")
    else:
        focal_y = _focal(entry, "camera_angle_y", height) if "camera_angle_y" in entry.values else focal_x
    camera = entry.camera(
        width=width,
        height=height,
        focal_x=focal_x,
        focal_y=focal_y,
        center_x=entry.number("cx") if "cx" in entry.values else width / 2,
        center_y=entry.number("cy") if "cy" in entry.values else height / 2,
        rotation=rotation,
        translation=-rotation @ pose[:3, 3],
    )
    return NamedCamera(name=entry.name("file_path"), camera=camera)


def _focal(entry: _Entry, key: str, side: int) -> float:
    angle = entry.number(key)
    # Below, and beyond, a focal length would be infinite.
    if not _FLATTEST < angle < math.pi:
        raise entry.fail(key, f"must be an angle between 0 and pi, found {angle!r}")
    return side / (2 * math.tan(angle / 2))
