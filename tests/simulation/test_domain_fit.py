"""What begins outside of its domain is refused before anything is run."""

import pytest

from gasp_core import Domain, DomainPolicy
from gasp_core.errors import SceneError
from gasp_core.simulation.splat_sources import prepare


def domain(policy, shift=0.0):
    return Domain(lower=(-4 + shift, -4, -4), upper=(4 + shift, 4, 4), policy=policy)


@pytest.mark.parametrize("policy", [DomainPolicy.STOP, DomainPolicy.CLAMP])
def test_far_outside_is_refused(scene_of, cloud, policy):
    scene = scene_of(cloud(200), domain=domain(policy, shift=20.0))
    with pytest.raises(
        SceneError, match=rf'object "thing" begins 1\d\.\d m outside of \[domain\], beyond lower in x.*"{policy.value}"'
    ):
        prepare(scene)


@pytest.mark.parametrize("policy", list(DomainPolicy))
def test_within_it_all_is_well(scene_of, cloud, policy):
    scene = scene_of(cloud(200), domain=domain(policy))
    prepare(scene)


def test_one_that_grows_may_begin_anywhere(scene_of, cloud):
    prepare(scene_of(cloud(200), domain=domain(DomainPolicy.EXPAND, shift=20.0)))


def test_by_less_than_a_cell_matter_is_held_and_where_it_ends_the_run_refused(scene_of, cloud):
    splat = cloud(200)
    reach = float(splat.means[:, 0].max())
    edge = prepare(scene_of(splat)).assembly.problem.points.reference_positions[:, 0].max() - 0.02
    assert abs(edge - reach) < 0.2
    held = Domain(lower=(-2, -2, -2), upper=(float(edge), 2, 2), policy=DomainPolicy.CLAMP)
    assert prepare(scene_of(splat, domain=held)).assembly.spacing > 0.02
    ended = Domain(lower=(-2, -2, -2), upper=(float(edge), 2, 2), policy=DomainPolicy.STOP)
    with pytest.raises(SceneError, match=r"begins 0\.02 m outside of \[domain\], beyond upper in x"):
        prepare(scene_of(splat, domain=ended))
