"""Which runs a sweep has."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gasp_core.errors import SceneError
from gasp_core.studies.sweep import settings_from_table, settings_of


def changes(settings):
    return [setting.changes for setting in settings]


def test_a_grid_has_every_combination():
    found = settings_of(["a.b=1,2", "c=x,y"])
    assert changes(found) == [("a.b=1", "c=x"), ("a.b=1", "c=y"), ("a.b=2", "c=x"), ("a.b=2", "c=y")]
    assert found[0].columns() == {"a.b": 1, "c": "x"}


def test_commas_within_brackets_and_quotes_are_of_a_value():
    found = settings_of(["g=[0,0,-9.81],[0, 0, -1.62]", 'm={ preset = "rubber", density = 9 },ice', 's="a,b"'])
    assert changes(found)[0] == ("g=[0,0,-9.81]", 'm={ preset = "rubber", density = 9 }', 's="a,b"')
    assert len(found) == 4
    assert found[0].columns()["g"] == "[0,0,-9.81]"


def test_zipped():
    found = settings_of(["a=1,2", "b=3,4", "c=5"], zipped=True)
    assert changes(found) == [("a=1", "b=3", "c=5"), ("a=2", "b=4", "c=5")]
    assert changes(settings_of(["a=1"], zipped=True)) == [("a=1",)]


@pytest.mark.parametrize(
    ("given_", "zipped", "said"),
    [
        (["a"], False, "must be KEY=VALUE"),
        (["=1"], False, "must be KEY=VALUE"),
        (["a=1,"], False, "must be KEY=VALUE"),
        (["a=1", "a=2"], False, "is there twice"),
        (["a=1,2", "b=1,2,3"], True, "a has 2, b has 3"),
        (["a=1,1"], False, "the same settings, a=1"),
        (["a=" + ",".join(map(str, range(2000))), "b=" + ",".join(map(str, range(2000)))], False, "4,000,000 runs"),
    ],
)
def test_what_is_no_setting(given_, zipped, said):
    with pytest.raises(SceneError, match=said):
        settings_of(given_, zipped=zipped)


def test_a_table(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text('object.toy.height, scene.gravity\n0.3,"[0, 0, -1]"\n,"[0, 0, -2]"\n\n0.5,\n', encoding="utf-8")
    assert changes(settings_from_table(path)) == [
        ("object.toy.height=0.3", "scene.gravity=[0, 0, -1]"),
        ("scene.gravity=[0, 0, -2]",),
        ("object.toy.height=0.5",),
    ]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "has no settings"),
        (b"a,b\n", "has no settings"),
        (b"a,b\n1\n", "line 2 has 1 cells, the first 2"),
        (b"a,b\r\n1,2\r\n\r\n# 3\r\n", "line 4 has 1 cells, the first 2"),
        (b"a;b\n1;0,3\n", "separated by semicolons: commas are wanted"),
        (b"a,a\n1,2\n", "each once"),
        (b"a\n1\n1\n", "the same settings"),
        (b"\xff\xfe\x00", "no table of settings"),
    ],
)
def test_what_is_no_table(tmp_path, content, said):
    (tmp_path / "a.csv").write_bytes(content)
    with pytest.raises(SceneError, match=said) as caught:
        settings_from_table(tmp_path / "a.csv")
    assert "a.csv" in str(caught.value) or "same settings" in said
    with pytest.raises(SceneError, match=r"none\.csv: cannot be read"):
        settings_from_table(tmp_path / "none.csv")


WORDS = st.text(st.characters(codec="ascii", categories=("L", "N")), min_size=1, max_size=5)


@given(st.lists(st.lists(WORDS, min_size=1, max_size=4, unique=True), min_size=1, max_size=3))
def test_every_combination_is_there_once(values):
    found = settings_of([f"k{index}={','.join(own)}" for index, own in enumerate(values)])
    count = 1
    for own in values:
        count *= len(own)
    assert len({setting.changes for setting in found}) == len(found) == count
