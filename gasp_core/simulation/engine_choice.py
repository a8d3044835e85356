"""Which engine runs a scene, and how it is set."""

from __future__ import annotations

import dataclasses
import importlib.metadata
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from gasp_core.contract import (
    EngineDescriptor,
    PointEngine,
    Precision,
)
from gasp_core.discovery.registry import discover
from gasp_core.engines.opening import open_engine, open_worker
from gasp_core.engines.worker.session import Limits
from gasp_core.errors import SceneError
from gasp_core.scene.model import Scene
from gasp_core.scene.settings import EngineChoice

__all__ = ["ChosenEngine", "choose_engine", "distribution_version"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class ChosenEngine:
    """The engine of a run and how it is set."""

    descriptor: EngineDescriptor
    engine: PointEngine | None
    version: str

    def opened(self, choice: EngineChoice) -> PointEngine:
        """The engine itself; its own code is imported, or its process started, here and not before."""
        if self.engine is not None:
            return self.engine
        if not self.isolated(choice):
            return open_engine(discover().offer(self.descriptor.name))
        limits = Limits() if choice.frame_limit is None else Limits(frame=choice.frame_limit)
        return open_worker(discover().offer(self.descriptor.name), limits)

    def isolated(self, choice: EngineChoice) -> bool:
        """Whether it runs in a process of its own."""
        return choice.isolate or self.descriptor.environment is not None


def choose_engine(
    scene: Scene,
    engine: str | tuple[EngineDescriptor, PointEngine] | None,
    isolate: bool | None,
    device: str | None,
    precision: Precision | None,
) -> tuple[Scene, ChosenEngine]:
    """The engine asked for, and the scene as it runs it."""
    if isolate is not None:
        scene = dataclasses.replace(scene, engine=dataclasses.replace(scene.engine, isolate=isolate))
    if isinstance(engine, tuple):
        descriptor, opened = engine
        chosen = ChosenEngine(descriptor=descriptor, engine=opened, version="")
    else:
        offer = discover().offer(engine or scene.engine.name)
        version = distribution_version(offer.distribution)
        chosen = ChosenEngine(descriptor=offer.descriptor, engine=None, version=version)
    scene = scene.with_engine(chosen.descriptor, device=device, precision=precision)
    name = chosen.descriptor.name
    if chosen.engine is not None and scene.engine.isolate:
        raise SceneError(f'engine "{name}" was handed over as it is and cannot be isolated: install it and name it')
    if scene.engine.frame_limit is not None and not chosen.isolated(scene.engine):
        raise SceneError("frame_limit under [engine] needs isolate = true: only a process of its own can be given up")
    return scene, chosen


def distribution_version(distribution: str) -> str:
    """Version of an installed distribution; empty where there is none of the name."""
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return ""
