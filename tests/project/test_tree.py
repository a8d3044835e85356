"""The shape of the tree: modules that can be read in one go, and no two that need each other."""

from __future__ import annotations

import ast
import graphlib
import importlib
import importlib.util
import subprocess
import sys
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).parents[2]
MOST_LINES = 400


def test_no_module_is_longer_than_one_reads_in_one_go():
    found = [*(ROOT / "gasp_core").rglob("*.py"), *(ROOT / "plugins").rglob("*.py")]
    assert len(found) > 300
    long = {str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines()) for path in found}
    assert {name: lines for name, lines in long.items() if lines > MOST_LINES} == {}


@pytest.mark.parametrize("package", ["gasp_core", "gasp_mpm_host", "gasp_reference_mpm", "gasp_mujoco_flex"])
def test_no_modules_import_each_other_in_a_circle(package):
    """Imports for types alone count too: who reads one of the modules has to know the other."""
    graph = grimp.build_graph(package, exclude_type_checking_imports=False, cache_dir=None)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    graphlib.TopologicalSorter(imports).prepare()


def test_the_contract_needs_numpy_and_nothing_else_that_is_not_pythons():
    code = (
        "import sys; before = set(sys.modules); import gasp_core.contract;"
        " print(*sorted({name.partition('.')[0] for name in set(sys.modules) - before} - sys.stdlib_module_names))"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    # NumPy brings Cython's runtime along under names of its own.
    assert {name for name in told if not name.startswith("_")} - {"cython_runtime"} == {"gasp_core", "numpy"}


def test_scripts_import_nothing_that_has_gone():
    """Benchmarks are run by hand, and seldom: a name that has moved would be missed by nobody until then."""
    scripts = [*(ROOT / "benchmarks").rglob("*.py"), *(ROOT / "examples").glob("*.py")]
    assert len(scripts) > 40
    gone: list[str] = []
    for path in scripts:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("gasp_")):
                continue
            if importlib.util.find_spec(node.module.partition(".")[0]) is None:
                continue
            module = importlib.import_module(node.module)
            for alias in node.names:
                if not hasattr(module, alias.name) and not _is_module(f"{node.module}.{alias.name}"):
                    gone.append(f"{path.relative_to(ROOT)}: {node.module}.{alias.name}")
    assert gone == []


def _is_module(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:
        return False
