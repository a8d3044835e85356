"""Meshes as splats: covered, coloured, and gone with; damaged ones refused in a line."""

import numpy as np
import pytest

from gasp_core.accuracy.images import psnr
from gasp_core.errors import SplatFormatError
from gasp_core.io.activations import dc_to_colour
from gasp_core.io.mesh_splats import bind_to_mesh, splat_of_mesh
from gasp_core.io.painted_meshes import is_mesh, read_painted_mesh
from gasp_core.render_input import RenderInput
from gasp_core.rendering.camera import look_at
from gasp_core.rendering.renderers import open_renderer
from gasp_core.toy import make_toy

trimesh = pytest.importorskip("trimesh")
Image = pytest.importorskip("PIL.Image")


def bumpy(cells):
    """A ball with bumps, 2 cells^2 faces, and a texture of waves and checks all around it."""
    u, v = np.meshgrid(*2 * [np.linspace(0, 1, cells + 1)], indexing="ij")
    turn, tilt = 2 * np.pi * u, np.pi * v
    radius = 1 + 0.15 * np.sin(4 * turn) * np.sin(3 * tilt)
    flat = np.sin(tilt)
    places = radius[..., None] * np.stack([flat * np.cos(turn), flat * np.sin(turn), np.cos(tilt)], axis=-1)
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).reshape(-1)
    faces = [first[:, None] + np.array(corners) for corners in ((0, 1, cells + 2), (0, cells + 2, cells + 1))]
    y, x = np.mgrid[0:512, 0:512] / 512
    checks = ((8 * x).astype(int) + (8 * y).astype(int)) % 2
    picture = np.stack(
        [0.5 + 0.5 * np.sin(8 * np.pi * x), 0.5 + 0.5 * np.sin(6 * np.pi * y + 3 * x), 0.2 + 0.6 * checks], axis=-1
    )
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=Image.fromarray((255 * picture).astype(np.uint8)), baseColorFactor=[1.0, 1.0, 1.0, 1.0]
    )
    visual = trimesh.visual.TextureVisuals(uv=np.stack([u, v], axis=-1).reshape(-1, 2), material=material)
    return trimesh.Trimesh(places.reshape(-1, 3), np.concatenate(faces), process=False, visual=visual)


def drawn(mesh, camera, samples=2):
    """The mesh, another way: every face at every sample of its box, of which the nearest is seen."""
    size = samples * np.array([camera.width, camera.height])
    seen = mesh.vertices @ camera.rotation.T + camera.translation
    flat = [camera.focal_x, camera.focal_y] * seen[:, :2] / seen[:, 2:] + [camera.center_x, camera.center_y]
    corners, depths = (samples * flat)[mesh.faces], seen[mesh.faces][:, :, 2]
    first = np.floor(corners.min(axis=1)).astype(int)
    spans = np.ceil(corners.max(axis=1)).astype(int) - first
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    nearest, picture = np.full(size.prod(), np.inf), np.ones((size.prod(), 3))
    for step in np.ndindex(*(spans.max(axis=0) + 1)):
        rows = np.flatnonzero((spans >= step).all(axis=1) & (np.abs(area) > 1e-12))
        place = first[rows] + step
        arm = place + 0.5 - corners[rows, 0]
        u = (arm[:, 0] * other[rows, 1] - arm[:, 1] * other[rows, 0]) / area[rows]
        v = (one[rows, 0] * arm[:, 1] - one[rows, 1] * arm[:, 0]) / area[rows]
        inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (place >= 0).all(axis=1) & (place < size).all(axis=1)
        rows, place, u, v = rows[inside], place[inside], u[inside], v[inside]
        weights = np.stack([1 - u - v, u, v], axis=1) / depths[rows]
        depth = 1 / weights.sum(axis=1)
        pixels = place[:, 1] * size[0] + place[:, 0]
        np.minimum.at(nearest, pixels, depth)
        wins = depth <= nearest[pixels]
        picture[pixels[wins]] = mesh.colours(rows[wins], weights[wins] * depth[wins, None], 1e-12)
    return picture.reshape(camera.height, samples, camera.width, samples, 3).mean(axis=(1, 3))


@pytest.mark.thorough
def test_a_textured_mesh_looks_like_itself(tmp_path):
    """50,000 faces through a .glb. What is left lies on the outline, which splats draw half a pixel wider."""
    pytest.importorskip("gasp_renderer")
    bumpy(158).export(tmp_path / "bumpy.glb")
    mesh = read_painted_mesh(tmp_path / "bumpy.glb")
    # Those at one of the poles have no area.
    assert len(mesh.faces) == 49_770 and mesh.notes == ()
    camera = look_at((2.6, -1.8, 1.2), (0, 0, 0), width=1080, height=1080, field_of_view=45)
    splat = splat_of_mesh(mesh, 200_000).gaussians
    found = open_renderer().render(RenderInput.of(splat), camera).over(np.ones(3))
    expected = drawn(mesh, camera)
    value = psnr(expected, np.clip(found, 0, 1))
    print(f"{value:.1f} dB")
    assert value >= 28
    inside = (expected.min(axis=2) < 0.99)[::8, ::8].mean()
    assert inside > 0.2, "there is next to nothing in the picture"


@pytest.mark.parametrize("count", [100, 2_000, 50_000])
def test_moved_affinely(count):
    """Fewer Gaussians than faces, about as many, and more."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    mesh = painted(ball)
    binding = splat_of_mesh(mesh, count)
    assert 0.9 * count <= len(binding.gaussians) <= count + len(mesh.faces)
    gradient, shift = np.array([[1.2, 0.5, 0], [0, 0.8, 0.1], [0.3, 0, 1]]), np.array([1.0, -2, 3])
    moved = binding.moved(mesh.vertices @ gradient.T + shift)
    still = binding.gaussians
    assert np.abs(moved.means - (still.means @ gradient.T + shift)).max() < 1e-12
    seen = gradient @ still.covariances() @ gradient.T
    # A triangle keeps the thickness that it has, a ten-thousandth of its width.
    assert np.abs(moved.covariances() - seen).max() < 1e-6 * seen.max()
    at_rest = binding.moved(mesh.vertices)
    assert np.abs(at_rest.covariances() - still.covariances()).max() < 1e-6 * still.covariances().max()
    # They lie on the faces.
    radii = np.linalg.norm(still.means, axis=1)
    assert radii.max() < 1 + 1e-9 and radii.min() > 0.98


def painted(mesh):
    from gasp_core.io.painted_meshes import PaintedMesh

    faces = np.asarray(mesh.faces)
    return PaintedMesh(
        vertices=np.asarray(mesh.vertices), faces=faces, corner_colours=np.full((len(faces), 3, 3), 0.5), textures=(),
        texture_of=np.full(len(faces), -1), places=np.zeros((len(faces), 3, 2)),
    )  # fmt: skip


@pytest.mark.parametrize("flat", [True, False])
def test_a_splat_bound_to_a_mesh_goes_with_it(flat):
    """One that lies beside the faces and is not flat, too: affinely, and rigidly."""
    toy = make_toy(500)
    if flat:
        toy = toy.with_(scales=toy.scales * np.float32([1, 1, 1e-5]))
    box = trimesh.creation.box(extents=(0.6, 0.5, 1.1)).subdivide()
    vertices = np.asarray(box.vertices) + [0, 0, 0.5]
    binding = bind_to_mesh(toy, vertices, np.asarray(box.faces))
    assert binding.coefficients.shape[1:] == ((3, 3) if flat else (4, 3))
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    moved = binding.moved(vertices @ turn.T + 2)
    assert np.abs(moved.means - (toy.means @ turn.T + 2)).max() < 1e-9
    expected = turn @ toy.covariances() @ turn.T
    assert np.abs(moved.covariances() - expected).max() < 1e-6 * expected.max()
    with pytest.raises(SplatFormatError, match="expected"):
        binding.moved(vertices[:3])
    with pytest.raises(SplatFormatError, match="not finite"):
        binding.moved(vertices * np.nan)


def test_colours_of_vertices_faces_and_materials(tmp_path):
    box = trimesh.creation.box()
    box.visual.vertex_colors = np.tile([255, 0, 51, 255], (8, 1))
    box.export(tmp_path / "vertices.ply")
    faces = trimesh.creation.box()
    faces.visual.face_colors = np.tile([0, 255, 0, 255], (12, 1))
    faces.export(tmp_path / "faces.ply")
    (tmp_path / "a.mtl").write_text("newmtl red\nKd 1 0 0\n")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    trimesh.creation.box().export(tmp_path / "plain.stl")
    for name, colour in (
        ("vertices.ply", [1, 0, 0.2]),
        ("faces.ply", [0, 1, 0]),
        ("a.obj", [1, 0, 0]),
        ("plain.stl", [0.7, 0.7, 0.7]),
    ):
        mesh = read_painted_mesh(tmp_path / name)
        splat = splat_of_mesh(mesh, 100).gaussians
        assert np.abs(dc_to_colour(splat.harmonics[:, 0]) - colour).max() < 0.01, name
        assert mesh.notes == (("has no colours: it is grey",) if name == "plain.stl" else ())


def test_nothing_is_read_beyond_the_folder(tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "out.mtl").write_text("newmtl red\nKd 1 0 0\n")
    (tmp_path / "in" / "a.obj").write_text("mtllib ../out.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    mesh = read_painted_mesh(tmp_path / "in" / "a.obj")
    assert not np.allclose(mesh.corner_colours, [1, 0, 0])


def test_holes_and_faces_without_area(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=2)
    kept = np.asarray(ball.faces)[:200]
    faces = np.concatenate([kept, [[0, 0, 1], [2, 2, 2]]])
    trimesh.Trimesh(ball.vertices, faces, process=False).export(tmp_path / "a.ply")
    mesh = read_painted_mesh(tmp_path / "a.ply")
    assert len(mesh.faces) == 200
    splat = splat_of_mesh(mesh, 1000).gaussians
    assert all(np.isfinite(getattr(splat, name)).all() for name in ("means", "quaternions", "scales"))


@pytest.mark.parametrize("suffix", [".obj", ".glb", ".stl", ".ply"])
@pytest.mark.parametrize("kept", [0, 1, 17, 84, 200])
def test_a_truncated_file_says_so_in_a_line(tmp_path, suffix, kept):
    path = tmp_path / f"mesh{suffix}"
    trimesh.creation.box().export(path)
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(SplatFormatError) as caught:
        read_painted_mesh(path)
    assert path.name in str(caught.value) and "\n" not in str(caught.value)


def test_which_files_are_meshes(tmp_path):
    from gasp_core.io import write_splat

    trimesh.creation.box().export(tmp_path / "mesh.ply")
    write_splat(tmp_path / "splat.ply", make_toy(16))
    assert is_mesh(tmp_path / "mesh.ply") and not is_mesh(tmp_path / "splat.ply")
    assert not is_mesh(tmp_path / "nowhere.ply") and not is_mesh(tmp_path / "a.sog")


def test_a_million_faces():
    ball = trimesh.creation.icosphere(subdivisions=8)
    mesh = painted(ball)
    assert len(mesh.faces) == 1_310_720
    splat = splat_of_mesh(mesh, 50_000).gaussians
    assert len(splat) == 50_000
    # Evenly spread: as many on each eighth of the ball.
    octants = np.bincount((splat.means > 0) @ [1, 2, 4], minlength=8)
    assert np.abs(octants - 6250).max() < 200
