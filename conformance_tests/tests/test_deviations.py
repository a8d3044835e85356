"""The list of known deviations: where it is looked for, and what may stand in it."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest
from gasp_conformance import deviations
from gasp_conformance.deviations import Deviation, DeviationsError, deviations_of, read_deviations

from gasp_core.contract import Determinism, EngineCapabilities, EngineDescriptor, Precision

TEXT = '[[deviation]]\ncheck = "V12"\nreason = "slides\\n too  far"\n'


def test_a_list_is_read() -> None:
    text = TEXT + '[[deviation]]\ncheck = "V2"\nprecision = "float32"\nreason = "rounds"\n'
    first, second = read_deviations(text, "here")
    assert first == Deviation(check="V12", reason="slides too far", precision=None)
    assert second.precision is Precision.FLOAT32
    assert second.applies(Precision.FLOAT32, "cpu") and not second.applies(Precision.FLOAT64, "cpu")
    assert first.applies(Precision.FLOAT32, "cpu") and first.applies(Precision.FLOAT64, "cuda")
    (third,) = read_deviations(TEXT + 'device = "cuda"', "here")
    assert third.applies(Precision.FLOAT64, "cuda") and not third.applies(Precision.FLOAT64, "cpu")
    assert read_deviations("", "here") == ()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[[deviation]", "is no TOML"),
        ('[[deviations]]\ncheck = "V1"', 'unknown key "deviations"'),
        ('[deviation]\ncheck = "V1"', r"write \[\[deviation\]\]"),
        ("deviation = [3]", r"write \[\[deviation\]\]"),
        ('[[deviation]]\nreason = "x"', "deviation 1: check must be a text"),
        ('[[deviation]]\ncheck = "V1"', "deviation 1: reason must be a text"),
        ('[[deviation]]\ncheck = "V1"\nreason = "  "', "deviation 1: reason must be a text"),
        ('[[deviation]]\ncheck = 1\nreason = "x"', "deviation 1: check must be a text"),
        (TEXT + '[[deviation]]\ncheck = "V1"\nreason = "x"\nwhy = "y"', 'deviation 2: unknown key "why"'),
        ('[[deviation]]\ncheck = "V1"\nreason = "x"\nprecision = "half"', "precision must be float32 or float64"),
        ('[[deviation]]\ncheck = "V1"\nreason = "x"\ndevice = 0', "device must be the name of one, found 0"),
        ('[[deviation]]\ncheck = "V1"\nreason = "x"\nengine = 0', "engine must be the name of one, found 0"),
        (TEXT + 'engine = "flyer"\n' + TEXT, '"V12" is listed more than once'),
        (TEXT + TEXT, '"V12" is listed more than once'),
        (TEXT + TEXT + 'precision = "float32"', '"V12" is listed more than once'),
        (TEXT + 'precision = "float32"\n' + TEXT + 'device = "cuda"', '"V12" is listed more than once'),
    ],
)
def test_a_malformed_list_is_refused_in_one_line(text: str, said: str) -> None:
    with pytest.raises(DeviationsError, match=said) as refused:
        read_deviations(text, "here")
    assert str(refused.value).startswith("here: ") and "\n" not in str(refused.value)


def test_one_check_may_deviate_for_two_reasons_in_two_precisions() -> None:
    text = "".join(f'{TEXT}precision = "{precision}"\n' for precision in ("float32", "float64"))
    assert len(read_deviations(text, "here")) == 2


def test_and_on_two_devices() -> None:
    text = "".join(f'{TEXT}device = "{device}"\n' for device in ("cpu", "cuda"))
    assert len(read_deviations(text, "here")) == 2


def descriptor(package: str, name: str = "flyer") -> EngineDescriptor:
    return EngineDescriptor(
        name=name,
        summary="flies",
        contract_version=(1, 0),
        capabilities=EngineCapabilities(
            materials=frozenset(),
            collider_shapes=frozenset(),
            contact_conditions=frozenset(),
            drives=frozenset(),
            force_fields=frozenset(),
            output_fields=frozenset(),
            conserved=frozenset(),
            devices=("cpu",),
            precisions=(Precision.FLOAT64,),
            determinism=Determinism.BITWISE,
        ),
        factory=f"{package}.inner.engine:Flyer",
    )


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Path:
    """An importable package, found in no other test."""
    folder = tmp_path / "site" / f"deviating_{request.node.name.partition('[')[0]}"
    folder.mkdir(parents=True)
    (folder / "__init__.py").touch()
    monkeypatch.syspath_prepend(folder.parent)
    return folder


def install(site: Path, name: str, origin: dict[str, object]) -> None:
    """What pip leaves of a distribution."""
    folder = site / f"{name.replace('-', '_')}-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (folder / "direct_url.json").write_text(json.dumps(origin))


def test_it_lies_in_the_package(package: Path) -> None:
    (package / "gasp-conformance.toml").write_text(TEXT)
    (found,) = deviations_of(descriptor(package.name), "")
    assert found.check == "V12"
    (package / "gasp-conformance.toml").write_text("[")
    with pytest.raises(DeviationsError, match=f"gasp-conformance.toml of {package.name}: is no TOML"):
        deviations_of(descriptor(package.name), "")
    (package / "gasp-conformance.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DeviationsError, match="cannot be read"):
        deviations_of(descriptor(package.name), "")


def test_it_names_devices_that_the_engine_declares(package: Path) -> None:
    (package / "gasp-conformance.toml").write_text(TEXT + 'device = "cpu"\n')
    (found,) = deviations_of(descriptor(package.name), "")
    assert found.device == "cpu"
    (package / "gasp-conformance.toml").write_text(TEXT + 'device = "cdua"\n')
    with pytest.raises(DeviationsError, match='"V12": device must be cpu, found "cdua"'):
        deviations_of(descriptor(package.name), "")


def test_two_engines_of_one_package_are_told_apart(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flyer, diver = descriptor(package.name), descriptor(package.name, "diver")
    stranger = descriptor("elsewhere", "stranger")
    installed = SimpleNamespace(engines={one.name: one for one in (flyer, diver, stranger)})
    monkeypatch.setattr(deviations, "discover", lambda: installed)
    both = TEXT.replace("V12", "V2")
    (package / "gasp-conformance.toml").write_text(
        f'{TEXT}engine = "flyer"\n{TEXT}engine = "diver"\ndevice = "cpu"\n{both}'
    )
    for one in (flyer, diver):
        assert [(found.check, found.engine) for found in deviations_of(one, "")] == [("V12", one.name), ("V2", None)]
    for name in ("dover", "stranger"):
        (package / "gasp-conformance.toml").write_text(f'{TEXT}engine = "{name}"\n')
        with pytest.raises(
            DeviationsError, match=rf'engine must be one of this package \(diver, flyer\), found "{name}"'
        ):
            deviations_of(flyer, "")


def test_or_beside_the_project_that_is_installed_editable(package: Path, tmp_path: Path) -> None:
    project = tmp_path / "my project"
    project.mkdir()
    (project / "gasp-conformance.toml").write_text(TEXT)
    install(package.parent, "deviating-editable", {"url": project.as_uri(), "dir_info": {"editable": True}})
    (found,) = deviations_of(descriptor(package.name), "deviating-editable")
    assert found.check == "V12"
    # What is in the package is what users get.
    (package / "gasp-conformance.toml").write_text(TEXT.replace("V12", "V13"))
    (found,) = deviations_of(descriptor(package.name), "deviating-editable")
    assert found.check == "V13"


@pytest.mark.parametrize("distribution", ["", "no-such-distribution", "deviating-wheel"])
def test_or_nowhere(package: Path, tmp_path: Path, distribution: str) -> None:
    (tmp_path / "gasp-conformance.toml").write_text(TEXT)
    install(package.parent, "deviating-wheel", {"url": tmp_path.as_uri(), "archive_info": {}})
    assert deviations_of(descriptor(package.name), distribution) == ()
    assert deviations_of(descriptor("no_such_package"), distribution) == ()


def test_an_engine_of_one_module_has_nothing_beside_it(package: Path) -> None:
    (package.parent / "engine_of_one_module.py").write_text("")
    (package.parent / "gasp-conformance.toml").write_text(TEXT)
    assert deviations_of(descriptor("engine_of_one_module"), "") == ()
