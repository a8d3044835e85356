"""GASP: trained Gaussian splats, moved by physics, with any engine.

The public names live in the modules below and are imported when first asked for: ``import gasp_core`` costs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gasp_core.comparison import Comparison, compare
    from gasp_core.engine.contract import EngineAccuracy, Precision
    from gasp_core.engine.forcing import (
        Collider,
        ContactCondition,
        Domain,
        DomainPolicy,
        Driven,
        Impulse,
        Pinned,
        Side,
        Wind,
    )
    from gasp_core.engine.materials import (
        Elastic,
        Fluid,
        Foam,
        Metal,
        NeoHookean,
        Plasticine,
        Rigid,
        Sand,
        Snow,
    )
    from gasp_core.engine.shapes import BoxShape, HalfSpace, SphereShape
    from gasp_core.errors import GaspError
    from gasp_core.gaussians import Gaussians
    from gasp_core.io import read_splat, write_splat
    from gasp_core.recording import Recording
    from gasp_core.rendering.filming import render
    from gasp_core.scene import (
        Bend,
        CameraChoice,
        EngineChoice,
        Floaters,
        FrameSequence,
        MapChoice,
        PythonMotion,
        RecordingChoice,
        Reduction,
        Scene,
        SplatObject,
        Swing,
        Wave,
        load_scene,
        scene_to_toml,
    )
    from gasp_core.simulation import simulate

__all__ = [
    "Bend",
    "BoxShape",
    "CameraChoice",
    "Collider",
    "Comparison",
    "ContactCondition",
    "Domain",
    "DomainPolicy",
    "Driven",
    "Elastic",
    "EngineAccuracy",
    "EngineChoice",
    "Floaters",
    "Fluid",
    "Foam",
    "FrameSequence",
    "GaspError",
    "Gaussians",
    "HalfSpace",
    "Impulse",
    "MapChoice",
    "Metal",
    "NeoHookean",
    "Pinned",
    "Plasticine",
    "Precision",
    "PythonMotion",
    "Recording",
    "RecordingChoice",
    "Reduction",
    "Rigid",
    "Sand",
    "Scene",
    "Side",
    "Snow",
    "SphereShape",
    "SplatObject",
    "Swing",
    "Wave",
    "Wind",
    "compare",
    "load_scene",
    "read_splat",
    "render",
    "scene_to_toml",
    "simulate",
    "write_splat",
]

_HOMES = {
    "gasp_core.comparison": "Comparison compare",
    "gasp_core.engine.contract": "EngineAccuracy Precision",
    "gasp_core.engine.forcing": "Collider ContactCondition Domain DomainPolicy Driven Impulse Pinned Side Wind",
    "gasp_core.engine.materials": "Elastic Fluid Foam Metal NeoHookean Plasticine Rigid Sand Snow",
    "gasp_core.engine.shapes": "BoxShape HalfSpace SphereShape",
    "gasp_core.errors": "GaspError",
    "gasp_core.gaussians": "Gaussians",
    "gasp_core.io": "read_splat write_splat",
    "gasp_core.recording": "Recording",
    "gasp_core.rendering.filming": "render",
    "gasp_core.scene": (
        "Bend CameraChoice EngineChoice Floaters FrameSequence MapChoice PythonMotion RecordingChoice Reduction Scene"
        " SplatObject Swing Wave load_scene scene_to_toml"
    ),
    "gasp_core.simulation": "simulate",
}
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names.split()}


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import importlib

    value = getattr(importlib.import_module(_HOME_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
