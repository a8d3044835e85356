"""Stages of USD, read as splats: by hand as text, made by USD itself, and our own."""

import random
import sys

import numpy as np
import pytest

from gasp_core.errors import SplatFormatError
from gasp_core.gaussians import rotation_matrices
from gasp_core.io import memory_limit, read_splat, write_splat
from gasp_core.io.detect import read as read_with_kind
from gasp_core.io.usd import splat_stage
from gasp_core.scene.placement import turned

pytest.importorskip("pxr", reason='no usd-core here: pip install "gasp-core[usd]"')

TEXT = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 0.01
    upAxis = "Z"
)

def Xform "World"
{
    double3 xformOp:translate = (100, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]

    def ParticleField3DGaussianSplat "Splat"
    {
        point3f[] positions = [(0, 0, 0), (1, 2, 3)]
        float3[] scales = [(1, 2, 3), (4, 5, 6)]
        quatf[] orientations = [(1, 0, 0, 0), (0.5, 0.5, 0.5, 0.5)]
        float[] opacities = [0.25, 1]
        uniform int radiance:sphericalHarmonicsDegree = 0
        float3[] radiance:sphericalHarmonicsCoefficients = [(0, 0.5, 1), (-1, 0, 1)]
    }
}
"""


@pytest.fixture
def stage_of(tmp_path):
    """stage_of(text) -> path of a .usda."""

    def write(text, name="a.usda"):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return write


def agree(found, expected, relative):
    """Matrices, each to a share of its own largest entry."""
    assert np.all(np.abs(found - expected).max(axis=(1, 2)) <= relative * np.abs(expected).max(axis=(1, 2)))


def test_a_stage_by_hand(stage_of):
    """Centimetres with z up: x stays, up is -y, and y goes away from the viewer."""
    g, kind = read_with_kind(stage_of(TEXT))
    assert kind == "usd"
    np.testing.assert_allclose(g.means, [[1, 0, 0], [1.01, -0.03, 0.02]], atol=1e-7)
    np.testing.assert_allclose(g.scales, [[0.01, 0.02, 0.03], [0.04, 0.05, 0.06]], rtol=1e-6)
    assert g.opacities.tolist() == [0.25, 1]
    assert g.harmonics[:, 0].tolist() == [[0, 0.5, 1], [-1, 0, 1]]
    turn = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    # (1 + i + j + k) / 2 takes x to y, y to z and z to x.
    sigma = 1e-4 * np.stack([np.diag([1.0, 4, 9]), np.diag([36.0, 16, 25])])
    agree(g.covariances(), turn @ sigma @ turn.T, 1e-6)


@pytest.mark.parametrize("suffix", [".usdc", ".usda", ".usd"])
def test_our_own_comes_back(some, tmp_path, suffix):
    g = some(40, 3)
    path = tmp_path / f"a{suffix}"
    write_splat(path, g)
    found = read_splat(path)
    for name in ("means", "scales", "opacities", "harmonics"):
        assert np.array_equal(getattr(found, name), getattr(g, name))
    # Rotations leave as unit quaternions of float32.
    agree(found.covariances(), g.covariances(), 16 * 2.0**-24)


def test_a_run_comes_back_as_its_first_frame(some, tmp_path):
    """Exported as scenes lie, z up; what is not there yet is left out."""
    g = some(30, 2)
    with splat_stage(tmp_path / "a.usdc", up_axis="Z", frame_rate=10.0) as stage:
        for frame in range(3):
            later = {"later": some(5, 0)} if frame else {}
            stage.add(frame + 4, {"toy": g.with_(means=g.means + np.float32(frame)), **later})
    found, kind = read_with_kind(tmp_path / "a.usdc")
    assert kind == "usd, its first frame"
    back = turned(found, "-y", "+z")
    np.testing.assert_allclose(back.means, g.means, atol=1e-6)
    agree(back.covariances(), g.covariances(), 1e-5)
    np.testing.assert_allclose(back.harmonics, g.harmonics, atol=1e-5)


def splat_of(stage, path, g, half=False):
    """A splat of Gaussians in a stage, by USD's own names."""
    from pxr import Sdf, Vt

    prim = stage.DefinePrim(path, "ParticleField3DGaussianSplat")
    floats, kinds = (np.float16, "h") if half else (np.float32, "")
    vec, quat, one = (
        (Vt.Vec3hArray, Vt.QuathArray, Vt.HalfArray) if half else (Vt.Vec3fArray, Vt.QuatfArray, Vt.FloatArray)
    )
    names = Sdf.ValueTypeNames
    turns = np.roll(g.quaternions, -1, axis=1)
    prim.CreateAttribute("radiance:sphericalHarmonicsDegree", names.Int).Set(g.sh_degree)
    for name, kind, of, values in (
        ("positions", names.Point3hArray if half else names.Point3fArray, vec, g.means),
        ("orientations", names.QuathArray if half else names.QuatfArray, quat, turns),
        ("scales", names.Half3Array if half else names.Float3Array, vec, g.scales),
        ("opacities", names.HalfArray if half else names.FloatArray, one, g.opacities),
        (
            "radiance:sphericalHarmonicsCoefficients",
            names.Half3Array if half else names.Float3Array,
            vec,
            g.harmonics.reshape(-1, 3),
        ),
    ):
        held = of.FromNumpy(np.ascontiguousarray(values, dtype=floats))
        prim.CreateAttribute(name + kinds, kind).Set(held)
    return prim


@pytest.mark.parametrize("suffix", [".usdc", ".usdz"])
def test_several_splats_where_they_stand(some, tmp_path, suffix):
    """Turned, squeezed, seen twice; in half precision; hidden ones and stand-ins are left out."""
    from pxr import Gf, Usd, UsdGeom, UsdUtils

    path = tmp_path / "a.usdc"
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 2.0)
    UsdGeom.SetStageUpAxis(stage, "Y")
    g = some(20, 1)
    splat_of(stage, "/one", g)
    matrix = np.array([[1, 0.3, 0, 4], [0, 2, -0.5, 5], [0.1, 0, 0.5, 6], [0, 0, 0, 1.0]])
    UsdGeom.Xformable(splat_of(stage, "/two", g, half=True)).AddTransformOp().Set(Gf.Matrix4d(matrix.T.tolist()))
    again = stage.DefinePrim("/again")
    again.GetReferences().AddInternalReference("/one")
    again.SetInstanceable(True)
    UsdGeom.Imageable(splat_of(stage, "/hidden", g)).MakeInvisible()
    UsdGeom.Imageable(splat_of(stage, "/stand_in", g)).GetPurposeAttr().Set("proxy")
    stage.GetRootLayer().Save()
    if suffix == ".usdz":
        assert UsdUtils.CreateNewUsdzPackage(str(path), str(tmp_path / "a.usdz"))
    found = read_splat(tmp_path / f"a{suffix}")
    assert len(found) == 60
    turn = np.diag([1.0, -1.0, -1.0])
    for part in (slice(0, 20), slice(40, 60)):
        np.testing.assert_allclose(found.means[part], 2 * g.means @ turn, rtol=1e-6)
        agree(found.covariances()[part], 4 * turn @ g.covariances() @ turn, 1e-6)
    part = slice(20, 40)
    expected = 2 * (g.means @ matrix[:3, :3].T + matrix[:3, 3]) @ turn
    # float16: 2^-11 of each number.
    np.testing.assert_allclose(found.means[part], expected, atol=2.0**-11 * 8 * np.abs(expected).max())
    edges = turn @ matrix[:3, :3] @ rotation_matrices(g.quaternions) * g.scales[:, None]
    agree(found.covariances()[part], 4 * edges @ edges.transpose(0, 2, 1), 2.0**-11 * 32)


def replaced(old, new):
    def change(text):
        assert old in text
        return text.replace(old, new)

    return change


REFUSED = {
    "cut": (lambda text: text[:300], "is no whole stage of USD"),
    "no splat": (replaced("ParticleField3DGaussianSplat", "Scope"), "shows no ParticleField3DGaussianSplat"),
    "a mesh": (replaced("ParticleField3DGaussianSplat", "Mesh"), "holds meshes, no splat; export the mesh as .glb"),
    "lengths differ": (replaced("[0.25, 1]", "[0.25]"), "has 1 of opacities for 2 positions of '/World/Splat', not 2"),
    "no scales": (replaced("float3[] scales = [(1, 2, 3), (4, 5, 6)]", ""), "has 0 of scales for 2"),
    "degree lies": (replaced("Degree = 0", "Degree = 1"), "has 2 of radiance:sphericalHarmonicsCoefficients for 2"),
    "degree absurd": (replaced("Degree = 0", "Degree = 2000000"), "has harmonics of degree 2000000"),
    "degree negative": (replaced("Degree = 0", "Degree = -2"), "has harmonics of degree -2"),
    "logarithms": (replaced("(4, 5, 6)]", "(4, -5, 6)]"), "has negative scales, perhaps logarithms"),
    "opacity": (replaced("0.25", "7"), "Gaussian 0 has the opacity 7"),
    "unit": (replaced("0.01", "-1"), "has 'Z' for its upAxis and -1 for metersPerUnit"),
    "flat": (
        replaced('["xformOp:translate"]', '["xformOp:scale"]\n    float3 xformOp:scale = (1, 0, 1)'),
        "squeezes '/World/Splat' to nothing",
    ),
    "reference": (
        replaced('def Xform "World"\n', 'def Xform "World" (references = @/etc/passwd@)\n'),
        "is made of other files too, such as '/etc/passwd'; make one of them: usdcat --flatten",
    ),
    "sublayer": (replaced('    upAxis = "Z"\n', '    upAxis = "Z"\n    subLayers = [@b.usda@]\n'), "such as 'b.usda'"),
    "payload": (replaced('"World"\n{', '"World" (payload = @c.usd@</x>)\n{'), "such as 'c.usd'"),
    "in a variant": (
        replaced(
            'def Xform "World"\n{',
            'def Xform "World" (variantSets = "v")\n{\n  variantSet "v" = { "a" (references = @d.usd@) { } }\n',
        ),
        "such as 'd.usd'",
    ),
    "clips": (
        replaced(
            'Splat "Splat"\n',
            'Splat "Splat" (clips = { dictionary default = { asset[] assetPaths = [@e.usd@] } })\n',
        ),
        "such as 'clips'",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_in_one_line(stage_of, case):
    change, says = REFUSED[case]
    path = stage_of(change(TEXT))
    with pytest.raises(SplatFormatError, match=says) as refused:
        read_splat(path)
    text = str(refused.value)
    assert text.isprintable()
    assert text.startswith(f"{path}: ")
    assert text.rsplit(";", 1)[-1].strip()


def test_by_another_name(stage_of):
    with pytest.raises(SplatFormatError, match=r"by another name; call it \.usdc or \.usda"):
        read_splat(stage_of(TEXT, "a.txt"))


@pytest.mark.parametrize("suffix", [".usdc", ".usdz"])
def test_damage_gives_gaussians_or_a_refusal(some, tmp_path, suffix):
    """USD itself dies of some, hangs at some and asks for memory without bound at others: not we."""
    from pxr import UsdUtils

    write_splat(tmp_path / "good.usdc", some(9, 1))
    if suffix == ".usdz":
        assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "good.usdc"), str(tmp_path / "good.usdz"))
    good = (tmp_path / f"good{suffix}").read_bytes()
    path = tmp_path / f"a{suffix}"
    for number in range(6):
        chance, content = random.Random(number), bytearray(good)
        for _ in range(4):
            content[chance.randrange(len(content))] = chance.randrange(256)
        path.write_bytes(content[: len(content) if number % 2 else chance.randrange(len(content))])
        try:
            assert len(read_splat(path)) > 0
        except SplatFormatError as error:
            assert str(error).isprintable()


def test_memory_is_bounded_by_the_size(stage_of, tmp_path):
    """Instances of instances: a few lines of text that are 10^8 splats."""
    text = "#usda 1.0\n"
    for level in range(8):
        kind = "" if level else TEXT[TEXT.index("    def Part") : TEXT.rindex("}")]
        inner = kind or "".join(
            f'  def "i{k}" (instanceable = true references = </c{level - 1}>) {{ }}\n' for k in range(10)
        )
        text += f'def Xform "c{level}" {{\n{inner}}}\n'
    with pytest.raises(SplatFormatError) as refused:
        read_splat(stage_of(text))
    assert str(refused.value).isprintable()


def test_memory_that_somebody_allows(some, tmp_path):
    write_splat(tmp_path / "a.usdc", some(2000, 3))
    with memory_limit(100_000), pytest.raises(SplatFormatError, match="0 MB are allowed; allow more with"):
        read_splat(tmp_path / "a.usdc")


def test_without_usd_core(stage_of, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(SplatFormatError, match=r"reading USD takes another package; .*gasp-core\[usd\]"):
        read_splat(stage_of(TEXT))
