"""What all installed plugins offer together; a broken one is kept with its error and breaks nothing else."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType, ModuleType

from gasp_core.contract import EngineDescriptor
from gasp_core.discovery.hookspecs import Command, RendererDescriptor
from gasp_core.discovery.loading import how_to_mend, one_line, quietly
from gasp_core.discovery.plugins import FoundPlugin, PluginOffers, installed_plugins, offer_fault, read_plugin
from gasp_core.errors import DuplicateEngineError, PluginLoadError, UnknownEngineError

__all__ = ["EngineOffer", "FoundPlugin", "PluginFailure", "Registry", "discover"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PluginFailure:
    """A plugin, or one offer of a plugin, that cannot be used.

    Parameters
    ----------
    name
        Of the entry point, or of the engine (renderer, command) where only that one is at fault.
    distribution
        That brings it.
    error
        One line: what is wrong and what to do.
    """

    name: str
    distribution: str
    error: str


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineOffer:
    """An engine and the distribution that brings it."""

    descriptor: EngineDescriptor
    distribution: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RendererOffer:
    """A renderer and the distribution that brings it."""

    descriptor: RendererDescriptor
    distribution: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandOffer:
    """A subcommand and the distribution that brings it."""

    command: Command
    distribution: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Registry:
    """What the plugins offer.

    Parameters
    ----------
    offers
        Engines by name; more than one offer of a name is an error once that name is asked for.
    renderers, commands
        By name; the first plugin to offer a name has it, the next is a failure.
    failures
        What cannot be used, and why.
    """

    offers: Mapping[str, tuple[EngineOffer, ...]]
    renderers: Mapping[str, RendererOffer]
    commands: Mapping[str, CommandOffer]
    failures: tuple[PluginFailure, ...]

    @classmethod
    def of(cls, plugins: Iterable[FoundPlugin | ModuleType]) -> Registry:
        """The registry of these plugins; a module stands for itself, under its own name."""
        collected = _Collected()
        for plugin in plugins:
            collected.add(_as_found(plugin) if isinstance(plugin, ModuleType) else plugin)
        return cls(
            offers=MappingProxyType({name: tuple(collected.engines[name]) for name in sorted(collected.engines)}),
            renderers=MappingProxyType(dict(sorted(collected.renderers.items()))),
            commands=MappingProxyType(dict(sorted(collected.commands.items()))),
            failures=tuple(collected.failures),
        )

    @property
    def engines(self) -> Mapping[str, EngineDescriptor]:
        """Engines by name, sorted; a name offered twice is left out."""
        return MappingProxyType({name: own[0].descriptor for name, own in self.offers.items() if len(own) == 1})

    def offer(self, name: str) -> EngineOffer:
        """The one offer of an engine.

        Raises
        ------
        DuplicateEngineError
            Where two plugins offer it; both distributions are named.
        PluginLoadError
            Where a plugin of that name was found, but cannot be used.
        UnknownEngineError
            Where nobody offers it; the known names are listed.
        """
        offers = self.offers.get(name, ())
        if len(offers) == 1:
            return offers[0]
        if offers:
            raise DuplicateEngineError(self.duplicate(name))
        for failure in self.failures:
            if failure.name == name:
                raise PluginLoadError(
                    f'engine "{name}" of {failure.distribution} is installed but cannot be used: {failure.error}'
                )
        raise UnknownEngineError(self._unknown(name))

    def descriptor(self, name: str) -> EngineDescriptor:
        """The descriptor of an engine; raises as `offer` does."""
        return self.offer(name).descriptor

    def duplicate(self, name: str) -> str:
        """One line about an engine that is offered more than once: by whom, and what to do."""
        homes = " and ".join(sorted(offer.distribution for offer in self.offers[name]))
        return f'engine "{name}" is offered more than once, by {homes}: uninstall all but one'

    def _unknown(self, name: str) -> str:
        if not self.offers:
            return f'no engine named "{name}": none is installed, install one, e.g. pip install gasp-reference-mpm'
        import difflib

        close = difflib.get_close_matches(name, self.offers, n=1)
        hint = f'did you mean "{close[0]}"?' if close else "or install the plugin that offers it"
        return f'no engine named "{name}" is installed; choose one of {", ".join(self.offers)} ({hint})'


@functools.cache
def discover() -> Registry:
    """The registry of everything installed, made once a process."""
    return Registry.of(installed_plugins())


class _Collected:
    """The registry while it is put together."""

    def __init__(self) -> None:
        self.engines: dict[str, list[EngineOffer]] = {}
        self.renderers: dict[str, RendererOffer] = {}
        self.commands: dict[str, CommandOffer] = {}
        self.failures: list[PluginFailure] = []
        self._modules: dict[int, FoundPlugin] = {}

    def add(self, found: FoundPlugin) -> None:
        """Import one plugin and sort in what it offers, or the reason why it cannot be used."""
        try:
            offers = self._read(found)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # an ExceptionGroup of exits, a GeneratorExit: nothing may take the program down
            # A fault of our own naming says what to do already.
            remedy = "" if isinstance(error, PluginLoadError) else f"; {how_to_mend(found.distribution)}"
            self._fail(found, found.name, one_line(error) + remedy)
            return
        for descriptor in offers.engines:
            if self._sound(found, descriptor):
                offer = EngineOffer(descriptor=descriptor, distribution=found.distribution)
                self.engines.setdefault(descriptor.name, []).append(offer)
        for renderer in offers.renderers:
            if self._sound(found, renderer, taken=self.renderers):
                self.renderers[renderer.name] = RendererOffer(descriptor=renderer, distribution=found.distribution)
        for command in offers.commands:
            if self._sound(found, command, taken=self.commands):
                self.commands[command.name] = CommandOffer(command=command, distribution=found.distribution)

    def _read(self, found: FoundPlugin) -> PluginOffers:
        plugin = quietly(found.load)
        twin = self._modules.setdefault(id(plugin), found)
        if twin is not found:
            raise PluginLoadError(
                f'names the same module as entry point "{twin.name}" of {twin.distribution}: remove one of the two'
            )
        return read_plugin(plugin)

    def _sound(
        self,
        found: FoundPlugin,
        offer: EngineDescriptor | RendererDescriptor | Command,
        taken: Mapping[str, object] | None = None,
    ) -> bool:
        fault = offer_fault(offer)
        if fault is None and taken is not None and offer.name in taken:
            fault = f'another plugin offers "{offer.name}" already: uninstall one of the two'
        if fault is not None:
            self._fail(found, str(offer.name), fault)
        return fault is None

    def _fail(self, found: FoundPlugin, name: str, error: str) -> None:
        self.failures.append(PluginFailure(name=name, distribution=found.distribution, error=error))


def _as_found(module: ModuleType) -> FoundPlugin:
    name = module.__name__
    return FoundPlugin(name=name, distribution=name, load=lambda: module)
