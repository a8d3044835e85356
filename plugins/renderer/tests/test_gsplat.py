"""gsplat is not run here: a stand-in draws what it is asked for with the reference, so the request must be right."""

import sys
from dataclasses import replace
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from gasp_renderer.cuda import GsplatRenderer, hidden

from gasp_core.errors import RenderingError
from gasp_core.gaussians import rotation_matrices
from gasp_core.harmonics import basis
from gasp_core.render_input import RenderInput
from gasp_core.rendering.camera import Camera


class Tensor(np.ndarray):
    """As much of a tensor as is asked of one."""

    def cpu(self):
        return self

    def numpy(self):
        return np.asarray(self)


class OutOfMemoryError(RuntimeError):
    """torch's."""


@pytest.fixture
def gsplat(monkeypatch, oracle):
    """Stand-ins for gsplat and torch; `calls` holds what gsplat.rasterization was asked for."""
    torch, gsplat, calls = ModuleType("torch"), ModuleType("gsplat"), []

    def tensor(values, *, dtype, device):
        assert device == "cuda"
        return np.array(values, dtype=dtype).view(Tensor)

    def spherical_harmonics(degree, directions, coefficients):
        unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        return np.einsum("nk,nkc->nc", basis(unit, degree), coefficients).astype(np.float32).view(Tensor)

    def rasterization(**asked):
        calls.append(asked)
        count = len(asked["means"])
        assert asked["viewmats"].shape == (1, 4, 4) and asked["Ks"].shape == (1, 3, 3)
        assert asked["means"].shape == asked["colors"].shape == (count, 3)
        assert asked["opacities"].shape == (count,)
        assert asked["render_mode"] == "RGB+ED" and not asked["packed"] and asked["eps2d"] == 0.3
        assert all(value.dtype == np.float32 for value in asked.values() if isinstance(value, np.ndarray))
        shape = {"quaternions": asked["quats"], "scales": asked["scales"]}
        if asked["covars"] is not None:
            assert asked["covars"].shape == (count, 3, 3) and asked["quats"] is asked["scales"] is None
            rows, columns = np.triu_indices(3)
            shape = {"covariances": asked["covars"][:, rows, columns]}
        camera = Camera(
            width=asked["width"],
            height=asked["height"],
            focal_x=asked["Ks"][0, 0, 0],
            focal_y=asked["Ks"][0, 1, 1],
            center_x=asked["Ks"][0, 0, 2],
            center_y=asked["Ks"][0, 1, 2],
            rotation=asked["viewmats"][0, :3, :3],
            translation=asked["viewmats"][0, :3, 3],
            near=asked["near_plane"],
        )
        flat = (asked["colors"][:, None] - 0.5) / 0.28209479177387814
        drawn = oracle.render(
            RenderInput(means=asked["means"], opacities=asked["opacities"], harmonics=flat, **shape), camera
        )
        depth = np.where(drawn.alpha > 0, drawn.depth, 0)
        picture = np.concatenate([drawn.colour, depth[:, :, None]], axis=2)[None].view(Tensor)
        return picture, drawn.alpha[None, :, :, None].view(Tensor), {}

    torch.float32, torch.tensor, torch.einsum = np.float32, tensor, np.einsum
    torch.clamp = lambda values, *, min: np.maximum(values, min)
    torch.cuda = SimpleNamespace(is_available=lambda: True, OutOfMemoryError=OutOfMemoryError)
    gsplat.rasterization, gsplat.spherical_harmonics, gsplat.calls = rasterization, spherical_harmonics, calls
    monkeypatch.setitem(sys.modules, "torch", torch)
    monkeypatch.setitem(sys.modules, "gsplat", gsplat)
    return gsplat


@pytest.mark.parametrize("kind", ["axes", "covariances", "turned", "far"])
def test_what_gsplat_is_asked_for_is_the_picture(kind, gsplat, cloud, front, oracle, psnr):
    splats, camera = cloud(50, degree=3), replace(front(), center_x=20.0, center_y=17.0, near=0.5)
    if kind == "covariances":
        axes = np.random.default_rng(1).normal(scale=0.1, size=(50, 3, 3))
        rows, columns = np.triu_indices(3)
        covariances = (axes @ axes.transpose(0, 2, 1))[:, rows, columns]
        splats = replace(splats, quaternions=None, scales=None, covariances=covariances)
    if kind == "turned":
        splats = replace(splats, turns=rotation_matrices(np.random.default_rng(2).normal(size=(50, 4))))
    if kind == "far":
        offset = np.array([1e5, 0, -1e5])
        splats = replace(splats, means=splats.means + offset)
        camera = replace(camera, translation=camera.translation - camera.rotation @ offset)
    found, wanted = GsplatRenderer().render(splats, camera), oracle.render(splats, camera)
    assert len(gsplat.calls) == 1
    # float32 around the eye: a ten-millionth of 50 pixels, and at most a Gaussian at the floor of alpha.
    assert psnr(found.colour, wanted.colour)[0] >= 60
    assert psnr(found.alpha, wanted.alpha)[0] >= 60
    assert (np.isinf(found.depth) == (found.alpha == 0)).all()
    assert found.colour.dtype == found.alpha.dtype == found.depth.dtype == np.float32


def test_gaussians_behind_an_occluder_are_left_out(gsplat, cloud, front):
    splats, camera = cloud(200), front()
    walls = np.full((40, 48), 6.0)
    walls[:, :20] = np.inf
    GsplatRenderer().render(splats, camera, occluders=walls)
    places, depths = camera.project(splats.means)
    behind = [0 <= x < 48 and 0 <= y < 40 and depth > walls[int(y), int(x)] for (x, y), depth in zip(places, depths)]
    assert 20 < sum(behind) < 180
    np.testing.assert_array_equal(gsplat.calls[0]["opacities"], np.where(behind, 0, splats.opacities))


def test_means_outside_the_picture_or_in_the_eye_are_not_behind_anything(front):
    camera = front()
    outside = camera.position + np.array([[0, 0, 0], camera.rotation[0], -camera.rotation[2], [1e30, 1, 1]])
    assert not hidden(outside, camera, np.zeros((40, 48))).any()


def test_no_gaussians_ask_gsplat_for_nothing(gsplat, cloud, front):
    none = cloud(0)
    picture = GsplatRenderer().render(none, front())
    assert not gsplat.calls
    assert picture.colour.shape == (40, 48, 3) and picture.alpha.max() == 0 and np.isinf(picture.depth).all()


def test_a_quaternion_of_length_zero_turns_nothing(gsplat, cloud, front):
    splats = cloud(3)
    splats.quaternions[1] = 0
    GsplatRenderer().render(splats, front())
    np.testing.assert_array_equal(gsplat.calls[0]["quats"][1], [1, 0, 0, 0])


def test_a_full_gpu_is_told(gsplat, cloud, front):
    def full(**_asked):
        raise OutOfMemoryError

    gsplat.rasterization = full
    with pytest.raises(RenderingError, match="48 x 40 pixels and 40 Gaussians do not fit on the GPU"):
        GsplatRenderer().render(cloud(), front())


def test_without_a_gpu_it_says_so(gsplat):
    sys.modules["torch"].cuda.is_available = lambda: False
    with pytest.raises(RenderingError, match=r'needs an NVIDIA GPU .* take "numba"'):
        GsplatRenderer()


def test_without_gsplat_it_says_so(monkeypatch):
    monkeypatch.setitem(sys.modules, "gsplat", None)
    with pytest.raises(RenderingError, match=r"cannot be imported .*pip install"):
        GsplatRenderer()
