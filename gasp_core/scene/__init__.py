"""What is to happen: objects, what they are made of, what acts on them, and for how long."""

from __future__ import annotations

from gasp_core.scene.body_contacts import ContactRule
from gasp_core.scene.columns import PlyProperty
from gasp_core.scene.loading import load_scene
from gasp_core.scene.model import Scene
from gasp_core.scene.motions import Bend, DMiSoMotion, FrameSequence, Motion, PythonMotion, Swing, Wave
from gasp_core.scene.objects import Floaters, Reduction, SplatObject
from gasp_core.scene.parts import Part
from gasp_core.scene.preset_table import MaterialPreset
from gasp_core.scene.presets import material_preset
from gasp_core.scene.settings import CameraChoice, EngineChoice, MapChoice, RecordingChoice, Viewpoint
from gasp_core.scene.varying import VaryingMaterial
from gasp_core.scene.writing import scene_to_toml

__all__ = [
    "Bend",
    "CameraChoice",
    "ContactRule",
    "DMiSoMotion",
    "EngineChoice",
    "Floaters",
    "FrameSequence",
    "MapChoice",
    "MaterialPreset",
    "Motion",
    "Part",
    "PlyProperty",
    "PythonMotion",
    "RecordingChoice",
    "Reduction",
    "Scene",
    "SplatObject",
    "Swing",
    "VaryingMaterial",
    "Viewpoint",
    "Wave",
    "load_scene",
    "material_preset",
    "scene_to_toml",
]
