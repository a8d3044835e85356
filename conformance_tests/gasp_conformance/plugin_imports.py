"""What importing a plugin drags in, told by a fresh interpreter: `python -m gasp_conformance.plugin_imports MODULE`."""

from __future__ import annotations

import importlib
import importlib.metadata
import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass

from gasp_core.discovery.hookspecs import ENTRY_POINT_GROUP
from gasp_core.discovery.loading import quietly
from gasp_core.discovery.plugins import read_plugin

__all__ = ["PluginImports", "plugin_imports", "plugin_modules"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PluginImports:
    """What came with importing plugin modules and calling their hooks.

    Parameters
    ----------
    engines
        Names of the engines they offer.
    modules
        That were not there before.
    """

    engines: frozenset[str]
    modules: frozenset[str]

    def foreign(self, own: Sequence[str]) -> list[str]:
        """Top-level packages among them that are neither of the standard library, nor the core's, nor `own`."""
        known = {*sys.stdlib_module_names, "gasp_core", *(module.partition(".")[0] for module in own)}
        return sorted({module.partition(".")[0] for module in self.modules} - known)


def plugin_modules(distribution: str) -> list[str]:
    """The plugin modules that a distribution names in its entry points."""
    entries = importlib.metadata.distribution(distribution).entry_points
    return sorted({entry.module for entry in entries if entry.group == ENTRY_POINT_GROUP})


def plugin_imports(modules: Sequence[str]) -> PluginImports:
    """Import plugin modules in a fresh interpreter and call their hooks, as discovery does.

    Raises
    ------
    AssertionError
        Where that fails, with what the interpreter said.
    """
    child = subprocess.run(
        [sys.executable, "-m", __name__, *modules], capture_output=True, text=True, stdin=subprocess.DEVNULL
    )
    if child.returncode != 0:
        said = child.stderr.strip().splitlines() or [f"status {child.returncode}"]
        raise AssertionError(f"importing {', '.join(modules)} in a fresh interpreter fails: {said[-1]}")
    told = json.loads(child.stdout)
    return PluginImports(engines=frozenset(told["engines"]), modules=frozenset(told["modules"]))


def _main() -> None:
    # What the core itself needs to read a plugin is here by now, and no news of the plugin's.
    before = set(sys.modules)
    engines = [
        engine.name
        for module in sys.argv[1:]
        for engine in read_plugin(quietly(lambda module=module: importlib.import_module(module))).engines
    ]
    print(json.dumps({"engines": engines, "modules": sorted(set(sys.modules) - before)}))


if __name__ == "__main__":
    _main()
