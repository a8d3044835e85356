"""How the objects of a scene meet: tables of `[[contact]]`, and what they are to an engine."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from gasp_core.contract import DEFAULT_BODY_CONTACT, BodyContact
from gasp_core.errors import SceneError

__all__ = ["ContactRule", "check_rules", "default_contact", "pair_contacts"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactRule(BodyContact):
    """How two objects meet, or all that no other rule is about.

    Parameters
    ----------
    between
        Names of two objects; None: the rule of all other pairs.
    """

    between: tuple[str, str] | None = None

    @property
    def body_contact(self) -> BodyContact:
        """What an engine is given, without the names."""
        return BodyContact(contact=self.contact, friction=self.friction)


def check_rules(rules: Sequence[ContactRule], names: Sequence[str], still: Sequence[str]) -> None:
    """Refuse rules of which no object, or more than one rule, can be meant.

    Parameters
    ----------
    rules
        Of the scene.
    names
        Of all its objects.
    still
        Of those that stand still.

    Raises
    ------
    SceneError
        For an unknown name, a pair of one object, an object that stands still, two rules of one pair.
    """
    seen: set[frozenset[str] | None] = set()
    for number, rule in enumerate(rules, start=1):
        where = f"Scene.contacts: contact {number}"
        for name in rule.between or ():
            if name not in names:
                raise SceneError(f'{where} is between "{name}", which the scene does not have: {", ".join(names)}')
            if name in still:
                raise SceneError(
                    f'{where} is between "{name}", which stands still: say how it is touched in its own'
                    " collider = { contact, friction }"
                )
        pair = None if rule.between is None else frozenset(rule.between)
        if pair is not None and len(pair) == 1:
            raise SceneError(f"{where} must be between two objects: what touches itself holds together")
        if pair in seen:
            whom = "all other objects" if pair is None else " and ".join(f'"{name}"' for name in sorted(pair))
            raise SceneError(f"{where} is the second one of {whom}: leave one out")
        seen.add(pair)


def default_contact(rules: Sequence[ContactRule]) -> BodyContact:
    """How bodies meet that no rule names."""
    return next((rule.body_contact for rule in rules if rule.between is None), DEFAULT_BODY_CONTACT)


def pair_contacts(rules: Sequence[ContactRule], bodies: Sequence[str]) -> Mapping[tuple[int, int], BodyContact]:
    """As `PointProblem.pair_contacts` has them; `bodies` are names of objects in the order of their bodies' numbers."""
    found: dict[tuple[int, int], BodyContact] = {}
    for rule in rules:
        if rule.between is not None:
            own, others = ([row for row, name in enumerate(bodies) if name == each] for each in rule.between)
            for low, high in map(sorted, itertools.product(own, others)):
                found[low, high] = rule.body_contact
    return found
