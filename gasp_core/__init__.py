"""GASP: trained Gaussian splats, moved by physics, with any engine.

The public names live in the modules below and are imported when first asked for: ``import gasp_core`` costs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gasp_core.contract import (
        BoxShape,
        Collider,
        ContactCondition,
        Domain,
        DomainPolicy,
        Driven,
        Elastic,
        EngineAccuracy,
        Fluid,
        Foam,
        FrictionCone,
        HalfSpace,
        Impulse,
        KeyframedMotion,
        Metal,
        NeoHookean,
        Pinned,
        Plasticine,
        Precision,
        Rigid,
        Sand,
        Side,
        Snow,
        SphereShape,
        SteadyMotion,
        Wind,
    )
    from gasp_core.errors import GaspError
    from gasp_core.gaussians import Gaussians
    from gasp_core.io import memory_limit, read_splat, write_splat
    from gasp_core.moving.packing import pack
    from gasp_core.moving.reading import MovingSplat
    from gasp_core.recording import Recording
    from gasp_core.recording.rigid_fits import RigidFit, rigid_fit
    from gasp_core.rendering.filming import render
    from gasp_core.scene import (
        Bend,
        CameraChoice,
        ContactRule,
        DMiSoMotion,
        EngineChoice,
        Floaters,
        FrameSequence,
        MapChoice,
        Part,
        PlyProperty,
        PythonMotion,
        RecordingChoice,
        Reduction,
        Scene,
        SplatObject,
        Swing,
        VaryingMaterial,
        Viewpoint,
        Wave,
        load_scene,
        material_preset,
        scene_to_toml,
    )
    from gasp_core.simulation.driver import simulate
    from gasp_core.solid import SolidOptions
    from gasp_core.studies.comparison import Comparison, compare

__all__ = [
    "Bend",
    "BoxShape",
    "CameraChoice",
    "Collider",
    "Comparison",
    "ContactCondition",
    "ContactRule",
    "DMiSoMotion",
    "Domain",
    "DomainPolicy",
    "Driven",
    "Elastic",
    "EngineAccuracy",
    "EngineChoice",
    "Floaters",
    "Fluid",
    "Foam",
    "FrictionCone",
    "FrameSequence",
    "GaspError",
    "Gaussians",
    "HalfSpace",
    "Impulse",
    "KeyframedMotion",
    "MapChoice",
    "Metal",
    "MovingSplat",
    "NeoHookean",
    "Part",
    "Pinned",
    "Plasticine",
    "PlyProperty",
    "Precision",
    "PythonMotion",
    "Recording",
    "RecordingChoice",
    "Reduction",
    "Rigid",
    "RigidFit",
    "Sand",
    "Scene",
    "Side",
    "Snow",
    "SolidOptions",
    "SphereShape",
    "SplatObject",
    "SteadyMotion",
    "Swing",
    "VaryingMaterial",
    "Viewpoint",
    "Wave",
    "Wind",
    "compare",
    "load_scene",
    "material_preset",
    "memory_limit",
    "pack",
    "read_splat",
    "render",
    "rigid_fit",
    "scene_to_toml",
    "simulate",
    "write_splat",
]

_HOMES = {
    "gasp_core.studies.comparison": "Comparison compare",
    "gasp_core.contract": (
        "BoxShape Collider ContactCondition Domain DomainPolicy Driven Elastic EngineAccuracy Fluid Foam FrictionCone"
        " HalfSpace Impulse KeyframedMotion Metal NeoHookean Pinned Plasticine Precision Rigid Sand Side Snow"
        " SphereShape SteadyMotion Wind"
    ),
    "gasp_core.errors": "GaspError",
    "gasp_core.gaussians": "Gaussians",
    "gasp_core.io": "memory_limit read_splat write_splat",
    "gasp_core.moving.packing": "pack",
    "gasp_core.moving.reading": "MovingSplat",
    "gasp_core.recording": "Recording",
    "gasp_core.recording.rigid_fits": "RigidFit rigid_fit",
    "gasp_core.rendering.filming": "render",
    "gasp_core.scene": (
        "Bend CameraChoice ContactRule DMiSoMotion EngineChoice Floaters FrameSequence MapChoice Part PlyProperty"
        " PythonMotion RecordingChoice Reduction Scene SplatObject Swing VaryingMaterial Viewpoint Wave load_scene"
        " material_preset scene_to_toml"
    ),
    "gasp_core.simulation": "simulate",
    "gasp_core.solid": "SolidOptions",
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
