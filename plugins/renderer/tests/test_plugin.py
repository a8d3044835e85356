import importlib.util
import subprocess
import sys

import gasp_renderer.plugin as plugin
import pytest
from gasp_renderer.rasteriser import NumbaRenderer
from gasp_renderer.reference import ReferenceRenderer

from gasp_core.discovery.loading import import_factory
from gasp_core.discovery.plugins import offer_fault


def test_listing_the_renderers_imports_no_backend():
    script = (
        "import sys, gasp_renderer.plugin as plugin; plugin.gasp_splat_renderers();"
        "print(sorted({'numba', 'llvmlite', 'gsplat', 'torch'} & set(sys.modules)))"
    )
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


@pytest.mark.parametrize("installed", [set(), {"gsplat"}, {"torch"}, {"gsplat", "torch"}])
def test_gsplat_is_offered_where_it_could_run(installed, monkeypatch):
    monkeypatch.setattr(
        plugin, "find_spec", lambda name: importlib.util.find_spec("math") if name in installed else None
    )
    offers = plugin.gasp_splat_renderers()
    names = [offer.name for offer in offers]
    assert names == ["numba", "reference"] + (["gsplat"] if installed == {"gsplat", "torch"} else [])
    assert [offer_fault(offer) for offer in offers] == [None] * len(offers)


def test_the_factories_make_the_renderers():
    kinds = [import_factory(offer.factory, offer.name, "gasp-renderer") for offer in plugin.gasp_splat_renderers()[:2]]
    assert kinds == [NumbaRenderer, ReferenceRenderer]
