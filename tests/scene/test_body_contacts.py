"""How objects meet, as a scene says it."""

import pytest

from gasp_core.contract import DEFAULT_BODY_CONTACT, BodyContact, ContactCondition
from gasp_core.errors import SceneError
from gasp_core.scene.body_contacts import ContactRule, default_contact, pair_contacts
from gasp_core.scene.loading import read_scene
from gasp_core.scene.writing import scene_to_toml

TEXT = """
[scene]
duration = 1.0
frame_rate = 10
""" + "".join(
    f"""
[[object]]
name = "{name}"
splat = "a.ply"
material = {{ model = "elastic", density = 400, youngs_modulus = 5e4, poissons_ratio = 0.3 }}
"""
    for name in ("a", "b", "c")
)
TABLE = """
[[object]]
name = "table"
splat = "a.ply"
static = true
collider = true
"""


def read(text):
    return read_scene(TEXT + TABLE + text, file="a.toml", folder=None)


def test_what_nobody_names_meets_as_by_default():
    assert default_contact(read("").contacts) == DEFAULT_BODY_CONTACT
    scene = read("[[contact]]\nfriction = 0.7")
    assert default_contact(scene.contacts) == BodyContact(friction=0.7)
    assert not pair_contacts(scene.contacts, ["a", "b", "c"])


def test_a_pair_meets_as_its_own_rule_says_in_whatever_order_it_is_named():
    scene = read(
        '[[contact]]\nbetween = ["c", "a"]\ncontact = "stick"\n[[contact]]\nbetween = ["a", "b"]\nfriction = 0.1'
    )
    assert default_contact(scene.contacts) == DEFAULT_BODY_CONTACT
    assert pair_contacts(scene.contacts, ["a", "b", "c"]) == {
        (0, 2): BodyContact(contact=ContactCondition.STICK),
        (0, 1): BodyContact(friction=0.1),
    }


def test_rules_are_written_as_they_were_read():
    scene = read('[[contact]]\nfriction = 0.7\n[[contact]]\nbetween = ["a", "b"]\ncontact = "slip"')
    assert read_scene(scene_to_toml(scene), file="b.toml", folder=None).contacts == scene.contacts


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ('between = ["a", "d"]', '"d", which the scene does not have: a, b, c, table'),
        ('between = ["a", "a"]', "between two objects"),
        ('between = ["a", "table"]', '"table", which stands still'),
        ('between = "a"', 'contact[0].between: must be the names of two objects, e.g. ["bucket", "sand"]'),
        ('between = ["a", "b", "c"]', "must be the names of two objects"),
        ('contact = "weld"', "contact[0].contact: must be"),
        ("friction = -1", "friction"),
        ('contact = "stick"\nfriction = 0.3', "no meaning with contact"),
        ('between = ["a", "b"]\n[[contact]]\nbetween = ["b", "a"]', 'second one of "a" and "b"'),
        ("friction = 0.1\n[[contact]]\nfriction = 0.2", "second one of all other objects"),
        ("frction = 0.1", "contact[0].frction"),
    ],
)
def test_a_rule_that_cannot_be_meant_is_refused(text, wanted):
    with pytest.raises(SceneError) as caught:
        read("[[contact]]\n" + text)
    assert wanted in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_order_of_bodies_is_that_of_the_engine():
    rules = (ContactRule(between=("z", "y"), friction=0.2),)
    assert pair_contacts(rules, ["y", "x", "z"]) == {(0, 2): BodyContact(friction=0.2)}
