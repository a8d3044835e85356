"""Installed plugins, and what one of them offers; everything a plugin can get wrong is said of that plugin alone."""

from __future__ import annotations

import importlib.metadata
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar, cast

import pluggy

from gasp_core.contract import CONTRACT_VERSION, EngineCapabilities, EngineDescriptor
from gasp_core.discovery import hookspecs
from gasp_core.discovery.capability_faults import capability_fault
from gasp_core.discovery.hookspecs import (
    COMMAND_VERSION,
    ENTRY_POINT_GROUP,
    PROJECT,
    RENDERER_VERSION,
    Command,
    RendererDescriptor,
)
from gasp_core.discovery.loading import quietly
from gasp_core.errors import PluginLoadError

__all__ = ["FoundPlugin", "PluginOffers", "hook_names", "installed_plugins", "offer_fault", "read_plugin"]

_Kind = TypeVar("_Kind")

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+-]*")
_FACTORY = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*(\.[A-Za-z_]\w*)*")


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundPlugin:
    """A plugin before it is imported.

    Parameters
    ----------
    name
        Of the entry point.
    distribution
        That brings it, as one would install it.
    load
        Imports and returns the plugin module.
    """

    name: str
    distribution: str
    load: Callable[[], object]


@dataclass(frozen=True, slots=True, kw_only=True)
class PluginOffers:
    """What one plugin offers, not yet compared with what others do."""

    engines: tuple[EngineDescriptor, ...]
    renderers: tuple[RendererDescriptor, ...]
    commands: tuple[Command, ...]


def installed_plugins() -> list[FoundPlugin]:
    """Entry points of group ``gasp``, in the order of the import path; nothing is imported.

    Pluggy's own loader stops at the first plugin that fails, so the walk is done here.
    """
    found: list[FoundPlugin] = []
    homes: set[str] = set()
    for distribution in importlib.metadata.distributions():
        try:
            text = distribution.read_text("entry_points.txt")
        except (OSError, UnicodeDecodeError):
            # Unreadable metadata of something; nothing says it is ours.
            continue
        # Most distributions have nothing to do with this one, and parsing them all costs more than importing us.
        if text is None or ENTRY_POINT_GROUP not in text:
            continue
        own = [entry for entry in distribution.entry_points if entry.group == ENTRY_POINT_GROUP]
        if not own:
            continue
        name = distribution.name
        home = re.sub(r"[-_.]+", "-", name).lower()
        # As for imports, what comes first on the path hides the same distribution further on.
        if home in homes:
            continue
        homes.add(home)
        found += [FoundPlugin(name=entry.name, distribution=name, load=entry.load) for entry in own]
    return found


def read_plugin(plugin: object) -> PluginOffers:
    """What an imported plugin offers.

    Raises
    ------
    PluginLoadError
        Where it implements a hook that does not exist, or none, or returns something else than the hook asks for.
    Exception
        Whatever the plugin's own functions raise.
    """
    hooks = _hooks(plugin)
    return PluginOffers(
        engines=_offered(hooks, "gasp_point_engines", EngineDescriptor),
        renderers=_offered(hooks, "gasp_splat_renderers", RendererDescriptor),
        commands=_offered(hooks, "gasp_commands", Command),
    )


def hook_names() -> list[str]:
    """Names of all hooks, sorted."""
    return sorted(name for name in hookspecs.__all__ if name.startswith("gasp_"))


def offer_fault(offer: EngineDescriptor | RendererDescriptor | Command) -> str | None:
    """Why one offer is refused, in one line, or None: its name, its factory's form, its version, what it declares."""
    # A plugin's fields hold whatever its author wrote, whatever their annotations say.
    name, factory = cast("tuple[object, object]", (offer.name, offer.factory))
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        return f"the name {name!r:.60} is not one word of letters, digits and - . _ +"
    if not isinstance(factory, str) or not _FACTORY.fullmatch(factory):
        return f'the factory {factory!r:.60} is not of the form "package.module:attribute"'
    if isinstance(offer, EngineDescriptor) and not isinstance(cast(object, offer.capabilities), EngineCapabilities):
        return f"capabilities must be EngineCapabilities, found {offer.capabilities!r:.60}"
    what, spoken = _spoken(offer)
    fault = _version_fault(offer.contract_version, what, spoken)
    # Of another version, what it declares is judged by that.
    if fault is None and isinstance(offer, EngineDescriptor):
        fault = capability_fault(offer.capabilities)
    return fault


def _spoken(offer: EngineDescriptor | RendererDescriptor | Command) -> tuple[str, tuple[int, int]]:
    """What such an offer is written against, and in which version this GASP has it."""
    if isinstance(offer, EngineDescriptor):
        return "contract", CONTRACT_VERSION
    if isinstance(offer, RendererDescriptor):
        return "renderer contract", RENDERER_VERSION
    return "command contract", COMMAND_VERSION


def _version_fault(version: Any, what: str, spoken: tuple[int, int]) -> str | None:
    speaks = ".".join(str(part) for part in spoken)
    try:
        major, minor = version
    except (TypeError, ValueError):
        major = minor = None
    if type(major) is not int or type(minor) is not int:
        return f"contract_version must be two whole numbers, e.g. {spoken}, found {version!r:.60}"
    if major == spoken[0]:
        return None
    behind = "the plugin" if major < spoken[0] else "gasp-core"
    return f"written against {what} {major}.{minor}, but this GASP speaks {speaks}: update {behind}"


def _hooks(plugin: object) -> pluggy.HookRelay:
    """The hooks of one plugin, registered alone.

    A manager of its own for each plugin: what one does wrong is told of that one, and none can wrap another's hooks.
    """
    known = ", ".join(hook_names())
    manager = pluggy.PluginManager(PROJECT)
    manager.add_hookspecs(hookspecs)
    manager.register(plugin)
    implemented = {caller.name for caller in manager.get_hookcallers(plugin) or ()}
    try:
        manager.check_pending()
    except pluggy.PluginValidationError as error:
        unknown = ", ".join(sorted(implemented.difference(hook_names())))
        raise PluginLoadError(f"implements unknown hook {unknown}; the hooks are {known}: correct the name") from error
    for name in hook_names():
        if callable(getattr(plugin, name, None)) and name not in implemented:
            raise PluginLoadError(f"function {name} is not marked as a hook: put @hookimpl above it")
    if not implemented:
        raise PluginLoadError(f"implements no hook; the hooks are {known}: mark one with @hookimpl")
    return manager.hook


def _offered(hooks: pluggy.HookRelay, name: str, kind: type[_Kind]) -> tuple[_Kind, ...]:
    """What one plugin's hook returns, checked."""
    caller: pluggy.HookCaller = getattr(hooks, name)
    if not caller.get_hookimpls():
        return ()
    results = cast("list[Any]", quietly(caller))
    if not results:
        # Pluggy leaves None out of the results: a forgotten `return` must not pass for "nothing to offer".
        raise PluginLoadError(f"{name} returned nothing: return a list of {kind.__name__}")
    try:
        items: tuple[object, ...] = tuple(results[0])
    except TypeError:
        items = (results[0],)
    for item in items:
        if not isinstance(item, kind):
            raise PluginLoadError(f"{name} returned {item!r:.60}, not a list of {kind.__name__}")
    if items and items[0] is results[0]:
        raise PluginLoadError(f"{name} returned one {kind.__name__}: return a list of them")
    return cast("tuple[_Kind, ...]", items)
