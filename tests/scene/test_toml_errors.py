"""What is no TOML is quoted, and where it is clear what was meant, that is said."""

import pytest

from gasp_core import load_scene
from gasp_core.errors import SceneError


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("height = .4", r"height = \.4: a number has digits before and after its point"),
        ("velocity = [1., 0, 0]", "a number has digits before and after its point"),
        ("lower=[-.5,-.5,0]", "a number has digits before and after its point"),
        ("height = 0,4  # metres", r"a number has a point, 0\.4"),
        ("material = rubber", 'a text has quotes, "rubber"'),
        ("splat = $GASP_DATA/splats/plant.splat", r'a text has quotes, "\$GASP_DATA/splats/plant\.splat"'),
        ("static = True", "it is written true"),
        ('name = "toy', "ends with the quote that it begins with"),
        ("height = ", "height =$"),
        ("height 4", "height 4$"),
    ],
)
def test_the_line_is_quoted_and_what_was_meant_is_told(tmp_path, line, says):
    (tmp_path / "scene.toml").write_text(f"[scene]\nduration = 1\n[[object]]\n{line}\n")
    with pytest.raises(SceneError, match=rf"is not valid TOML: .*\(at line 4, column \d+\): .*{says}") as error:
        load_scene(tmp_path / "scene.toml")
    assert "\n" not in str(error.value)


def test_a_long_line_is_cut_and_what_terminals_obey_is_escaped(tmp_path):
    (tmp_path / "scene.toml").write_text("[scene]\nduration = nope\x7f" + "x" * 500)
    with pytest.raises(SceneError, match="is not valid TOML") as error:
        load_scene(tmp_path / "scene.toml")
    assert len(str(error.value)) < 400 and "\x7f" not in str(error.value)


@pytest.mark.parametrize(
    ("asked", "there", "meant"),
    [
        ("scne.toml", "scene.toml", "scene.toml"),
        ("nop.toml", "t.toml", None),
        ("scene.tml", "scene.toml", "scene.toml"),
        ("other.toml", "scene.toml", None),
    ],
)
def test_a_file_of_nearly_that_name_is_offered(tmp_path, asked, there, meant):
    (tmp_path / there).touch()
    with pytest.raises(SceneError, match="no such scene file") as error:
        load_scene(tmp_path / asked)
    assert str(error.value).endswith(f"did you mean {meant}?" if meant else "no such scene file")
