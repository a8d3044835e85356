"""Python code that a scene names, by text: it comes with the scene, from whoever wrote that.

A function that is handed over as an object is its caller's own, and is nothing here.
"""

from __future__ import annotations

import dataclasses
import importlib.util
from pathlib import Path
from typing import Any

from gasp_core.errors import SceneError
from gasp_core.scene.model import Scene
from gasp_core.scene.motions import PythonMotion
from gasp_core.scene.objects import SplatObject

__all__ = ["NamedCode", "code_of", "refuse_untrusted", "without_code"]


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class NamedCode:
    """A function that a scene names.

    Parameters
    ----------
    owner
        Name of the object that it moves.
    function
        "module:function", as the scene has it.
    """

    owner: str
    function: str

    def where(self) -> str:
        """The file that would be imported, found without importing anything."""
        module = self.function.rpartition(":")[0]
        if module.endswith(".py"):
            return str(Path(module).absolute())
        # Of a.b, only where a is can be told: to find b, Python would import a.
        return f"the module {module} of {_place_of(module.partition('.')[0])}"


def code_of(scene: Scene) -> list[NamedCode]:
    """What a scene would have imported, in the order of its objects."""
    return [
        NamedCode(owner=item.name, function=item.motion.function)
        for item in scene.objects
        if isinstance(item.motion, PythonMotion) and isinstance(item.motion.function, str)
    ]


def refuse_untrusted(scene: Scene, trust_code: bool) -> None:
    """Refuse a scene that names code, unless whoever runs it trusts that.

    Raises
    ------
    SceneError
        Which file it is, and how to say that it is trusted.
    """
    code = code_of(scene)
    if not code or trust_code:
        return
    more = f", and {len(code) - 1} more" if len(code) > 1 else ""
    raise SceneError(
        f'object "{code[0].owner}": its motion runs code with your rights, {code[0].where()}{more}:'
        " read it, and say --trust-code if you trust it (trust_code=True in Python)"
    )


def without_code(scene: Scene) -> Scene:
    """The scene with what its code would move standing still, to check all else of it before anything is imported.

    Where an object is, and so what of it is inside its region and those of its parts, its code may decide: that is left
    for later.
    """
    owners = {code.owner for code in code_of(scene)}
    objects = tuple(
        _standing(item, item.motion) if item.name in owners and isinstance(item.motion, PythonMotion) else item
        for item in scene.objects
    )
    return dataclasses.replace(scene, objects=objects)


def _standing(item: SplatObject, motion: PythonMotion) -> SplatObject:
    parts = tuple(part for part in item.parts if part.region is None)
    still = dataclasses.replace(motion, function=_still)
    if motion.composition == "driven" and not any(part.driven for part in parts):
        still = dataclasses.replace(still, composition="frozen")
    return dataclasses.replace(item, region=None, parts=parts, motion=still)


def _still(simplices: Any, time: float) -> Any:
    return simplices


def _place_of(package: str) -> str:
    try:
        found = importlib.util.find_spec(package)
    except (ImportError, ValueError):
        found = None
    if found is None:
        return "nowhere that Python looks"
    folders = list(found.submodule_search_locations or [])
    return folders[0] if folders else found.origin or package
