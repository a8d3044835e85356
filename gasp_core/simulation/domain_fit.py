"""Whether what is simulated begins within its domain."""

from __future__ import annotations

import numpy as np

from gasp_core.contract import DomainPolicy
from gasp_core.errors import SceneError
from gasp_core.reduction.assembly import Assembly

__all__ = ["refuse_outside_domain"]


def refuse_outside_domain(assembly: Assembly) -> None:
    """Refuse matter that begins outside of a domain that lets nothing out.

    One that ends the run would end it in the first frame. One that holds matter within would move all of it there at
    once, which an engine can only take for a fault; by less than a cell it is what colliders do as well.

    Raises
    ------
    SceneError
        With the object, and how far and on which side it is outside.
    """
    problem = assembly.problem
    domain = problem.domain
    if domain is None or domain.policy is DomainPolicy.EXPAND:
        return
    allowed = assembly.spacing if domain.policy is DomainPolicy.CLAMP else 0.0
    for body in assembly.bodies:
        places = problem.points.reference_positions[body.points]
        beyond = np.concatenate([np.array(domain.lower) - places.min(axis=0), places.max(axis=0) - domain.upper])
        worst = int(beyond.argmax())
        if beyond[worst] > allowed:
            side, axis = ("lower", "upper")[worst // 3], "xyz"[worst % 3]
            raise SceneError(
                f'object "{body.name}" begins {beyond[worst]:.3g} m outside of [domain], beyond {side} in {axis}, and'
                f' policy = "{domain.policy.value}" lets nothing out: move it, make the domain larger, or say'
                ' policy = "expand"'
            )
