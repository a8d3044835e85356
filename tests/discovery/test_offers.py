"""What a single plugin can get wrong, given to the registry as modules."""

import dataclasses
from types import ModuleType

import pytest

from gasp_core.contract import CONTRACT_VERSION, Elastic
from gasp_core.discovery import hookspecs
from gasp_core.discovery.hookspecs import Command, RendererDescriptor, hookimpl
from gasp_core.discovery.plugins import hook_names
from gasp_core.discovery.registry import Registry


def plugin(name="gasp_sketch", **functions):
    module = ModuleType(name)
    for hook, function in functions.items():
        function.__name__ = hook
        setattr(module, hook, hookimpl(function))
    return module


@pytest.fixture
def descriptor(fake_module):
    (one,) = fake_module("ballistic", "fake_ballistic").gasp_point_engines()
    return one


def refused(module):
    """The one failure of a registry of this module alone."""
    registry = Registry.of([module])
    (failure,) = registry.failures
    assert not registry.offers
    return failure.error


def test_every_hook_is_documented():
    assert hook_names() == ["gasp_commands", "gasp_point_engines", "gasp_splat_renderers"]
    for name in hook_names():
        text = getattr(hookspecs, name).__doc__ or ""
        assert len(text.split()) >= 15, f"hook {name} says nothing of when it is called and what it returns"


def test_every_exported_hook_is_a_hook():
    import pluggy

    manager = pluggy.PluginManager(hookspecs.PROJECT)
    manager.add_hookspecs(hookspecs)
    assert sorted(name for name in vars(manager.hook) if name.startswith("gasp_")) == hook_names()


def test_engines_are_sorted_by_name(descriptor):
    names = ["b", "a", "c"]
    registry = Registry.of(
        [plugin(gasp_point_engines=lambda: [dataclasses.replace(descriptor, name=name) for name in names])]
    )
    assert list(registry.engines) == ["a", "b", "c"]


def test_two_engines_of_one_name_in_one_plugin_are_a_duplicate(descriptor):
    registry = Registry.of([plugin(gasp_point_engines=lambda: [descriptor, descriptor])])
    assert not registry.engines
    assert "gasp_sketch and gasp_sketch" in registry.duplicate("ballistic")


@pytest.mark.parametrize(
    ("returned", "said"),
    [
        (None, "returned nothing"),
        (3, "returned 3, not a list of EngineDescriptor"),
        (["engine"], "returned 'engine', not a list of EngineDescriptor"),
        ("engine", "not a list of EngineDescriptor"),
    ],
)
def test_hook_that_returns_something_else(returned, said):
    assert said in refused(plugin(gasp_point_engines=lambda: returned))


def test_hook_that_returns_one_descriptor_alone(descriptor):
    assert "return a list" in refused(plugin(gasp_point_engines=lambda: descriptor))


def test_hook_that_raises():
    def broken():
        raise ZeroDivisionError("of all things")

    assert "ZeroDivisionError: of all things" in refused(plugin(gasp_point_engines=broken))


def test_hook_with_arguments_it_should_not_have(descriptor):
    assert "hook" in refused(plugin(gasp_point_engines=lambda registry: [descriptor]))


def test_plugin_without_any_hook():
    assert "implements no hook" in refused(ModuleType("gasp_empty"))


def test_same_module_twice(descriptor):
    module = plugin(gasp_point_engines=lambda: [descriptor])
    registry = Registry.of([module, module])
    assert "ballistic" in registry.engines
    assert "names the same module" in registry.failures[0].error


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"contract_version": (CONTRACT_VERSION[0] - 1, 9)}, "update the plugin"),
        ({"contract_version": (CONTRACT_VERSION[0] + 1, 0)}, "update gasp-core"),
        ({"contract_version": "1.0"}, "two whole numbers"),
        ({"contract_version": (1,)}, "two whole numbers"),
        ({"contract_version": (True, False)}, "two whole numbers"),
        ({"name": "two words"}, "not one word"),
        ({"name": ""}, "not one word"),
        ({"name": None}, "not one word"),
        ({"factory": "module.attribute"}, "package.module:attribute"),
        ({"factory": None}, "package.module:attribute"),
        ({"capabilities": {"materials": []}}, "must be EngineCapabilities"),
    ],
)
def test_descriptor_that_is_refused(descriptor, change, said):
    assert said in refused(plugin(gasp_point_engines=lambda: [dataclasses.replace(descriptor, **change)]))


def test_newer_minor_version_is_accepted(descriptor):
    version = (CONTRACT_VERSION[0], CONTRACT_VERSION[1] + 1)
    newer = dataclasses.replace(descriptor, contract_version=version)
    assert Registry.of([plugin(gasp_point_engines=lambda: [newer])]).engines["ballistic"] is newer


def test_a_refused_engine_leaves_the_others_of_its_plugin(descriptor):
    old = dataclasses.replace(descriptor, name="old", contract_version=(0, 1))
    registry = Registry.of([plugin(gasp_point_engines=lambda: [old, descriptor])])
    assert list(registry.engines) == ["ballistic"]
    assert [failure.name for failure in registry.failures] == ["old"]


def test_renderers_and_commands(descriptor):
    renderer = RendererDescriptor(name="splatter", summary="Draws.", contract_version=(1, 0), factory="a.b:C")
    command = Command(name="view", summary="Look.", factory="a.b:view")
    first = plugin("gasp_first", gasp_splat_renderers=lambda: [renderer], gasp_commands=lambda: [command])
    second = plugin("gasp_second", gasp_commands=lambda: [command])
    registry = Registry.of([first, second])
    assert {name: offer.descriptor for name, offer in registry.renderers.items()} == {"splatter": renderer}
    assert registry.commands["view"].distribution == "gasp_first"
    assert [(failure.name, failure.distribution) for failure in registry.failures] == [("view", "gasp_second")]


def test_descriptor_lists_its_options(descriptor):
    assert descriptor.option_names() == ["time_scale"]


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"materials": frozenset({"elastic"})}, "capabilities.materials must be a frozenset of classes of Material"),
        ({"materials": [Elastic]}, "capabilities.materials must be a frozenset"),
        ({"output_fields": frozenset({"positions"})}, "capabilities.output_fields must be a frozenset of Field"),
        ({"collider_shapes": frozenset({"plane"})}, "capabilities.collider_shapes"),
        ({"devices": "cpu"}, "capabilities.devices must be a tuple like"),
        ({"precisions": ("float64",)}, "capabilities.precisions must be a tuple like"),
        ({"precisions": ()}, "capabilities.precisions must be a tuple like"),
        ({"determinism": True}, "capabilities.determinism must be a Determinism, found True"),
        ({"checkpoints": "yes"}, "capabilities.checkpoints must be True or False, found 'yes'"),
        ({"bodies_meet": False, "pair_contacts": True}, "capabilities.bodies_meet is False, and body_contacts or"),
        ({"stable_step": 1e-3}, "capabilities.stable_step must be a function or None"),
    ],
)
def test_what_an_engine_declares_in_a_wrong_way_is_its_own_fault(descriptor, wrong, says):
    """And of nobody else: another engine of the same registry is offered."""
    right = dataclasses.replace(descriptor, name="right")
    bad = dataclasses.replace(descriptor, capabilities=dataclasses.replace(descriptor.capabilities, **wrong))
    module = plugin(gasp_point_engines=lambda: [bad])
    assert says in refused(module)
    both = Registry.of([module, plugin("gasp_other", gasp_point_engines=lambda: [right])])
    assert [failure.error for failure in both.failures] == [refused(module)]
    assert list(both.offers) == ["right"]
