"""D-MiSo checkpoints: what is evaluated, what is refused, what is played."""

import importlib.util
import math
import pickle
import re
import shutil
import zipfile
from pathlib import Path

import flying_points
import numpy as np
import pytest

from gasp_core import DMiSoMotion, Elastic, EngineAccuracy, Reduction, Scene, SplatObject, load_scene, simulate
from gasp_core.dynamics.d_miso.checkpoint import read_checkpoint
from gasp_core.dynamics.d_miso.folder import read_arguments
from gasp_core.dynamics.d_miso.motion import CheckpointMotion
from gasp_core.errors import SceneError, SplatFormatError
from gasp_core.gaussians import rotation_matrices
from gasp_core.io import read_splat
from gasp_core.io.torch_archives import read_archive
from gasp_core.simulation.splat_sources import prepare

EXAMPLES = Path(__file__).parents[2] / "examples"
JELLY = Elastic(density=100, youngs_modulus=1e4, poissons_ratio=0.3)
ALL = Reduction(mode="all")
MODEL = "point_cloud/iteration_best/model_params.pt"
DEFORMATION = "deform/iteration_best/deform.pth"
TURNS = "time_net/iteration_best/deform.pth"


def example():
    spec = importlib.util.spec_from_file_location("make_dancer", EXAMPLES / "make_dancer.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


MAKER = example()


def random_weights(generator, synthetic, width=32, depth=8):
    """Of both networks, in the shapes of the paper's supplement."""

    def linear(name, inputs, outputs):
        return {
            f"{name}.weight": generator.normal(size=(outputs, inputs)) / math.sqrt(inputs),
            f"{name}.bias": generator.normal(size=outputs),
        }

    time = 1 + 2 * (6 if synthetic else 10)
    turning = {name[2:]: array for name, array in linear("a", 4 + time, 4).items()}
    weights = {}
    if synthetic:
        weights |= linear("timenet.0", time, 256) | linear("timenet.2", 256, 30)
        time = 30
    for layer in range(depth):
        given = 63 + time if layer == 0 else width + (63 + time if layer == depth // 2 + 1 else 0)
        weights |= linear(f"linear.{layer}", given, width)
    for name, outputs in (("gaussian_warp", 3), ("gaussian_v2", 3), ("gaussian_v3", 3), ("gaussian_rot", 4)):
        weights |= linear(name, width, outputs)
    return weights, turning


def random_model(generator, cores=7, attached=3, degree=1):
    count = cores * attached
    return {
        "pseudomesh": generator.normal(size=(cores, 3, 3)),
        "alpha": generator.normal(size=(cores, attached, 3)),
        "attached_scale": generator.normal(size=(count, 3)),
        "attached_rotation": generator.normal(size=(count, 4)),
        "attached_opacity": generator.normal(size=(count, 1)),
        "attached_features_dc": generator.normal(size=(count, 1, 3)),
        "attached_features_rest": generator.normal(size=(count, (degree + 1) ** 2 - 1, 3)),
        "num_splats": attached,
        "use_attached_gauss": True,
    }


def write(folder, model, weights, turning, told="is_blender=False", iteration="best"):
    MAKER.save(folder / f"point_cloud/iteration_{iteration}/model_params.pt", model)
    MAKER.save(folder / f"deform/iteration_{iteration}/deform.pth", weights)
    MAKER.save(folder / f"time_net/iteration_{iteration}/deform.pth", turning)
    (folder / "cfg_args").write_text(f"Namespace({told})")
    return folder


@pytest.fixture(params=[False, True], ids=["real", "synthetic"])
def trained(request, tmp_path):
    generator = np.random.default_rng(3)
    model, (weights, turning) = random_model(generator), random_weights(generator, request.param)
    rounded = [
        {
            name: np.float64(np.float32(value)) if isinstance(value, np.ndarray) else value
            for name, value in each.items()
        }
        for each in (model, weights, turning)
    ]
    return write(tmp_path / "trained", model, weights, turning, f"is_blender={request.param}, sh_degree=1"), *rounded


def expected(model, weights, turning, synthetic, t):
    """The formulas of the paper and its supplement for one time, core by core."""

    def encode(x, frequencies):
        parts = [np.asarray(x, float)]
        for k in range(frequencies):
            parts += [np.sin(2**k * parts[0]), np.cos(2**k * parts[0])]
        return np.concatenate(parts)

    def linear(name, x):
        return weights[f"{name}.weight"] @ x + weights[f"{name}.bias"]

    encoded_time = encode([t], 6 if synthetic else 10)
    time = encoded_time
    if synthetic:
        time = linear("timenet.2", np.maximum(linear("timenet.0", time), 0))
    means, axes = [], []
    attached = model["alpha"].shape[1]
    for core, (v1, v2, v3) in enumerate(model["pseudomesh"]):
        first = np.concatenate([encode(v1, 10) * encode(v2, 10) * encode(v3, 10), time])
        h = first
        for layer in range(8):
            h = np.maximum(linear(f"linear.{layer}", h), 0)
            if layer == 4:
                h = np.concatenate([first, h])
        d1, d2, d3 = (linear(name, h) for name in ("gaussian_warp", "gaussian_v2", "gaussian_v3"))
        turn = rotation_matrices(linear("gaussian_rot", h)[None])[0]
        e2, e3 = turn @ (v2 - v1), turn @ (v3 - v1)
        v1, v2, v3 = v1 + d1, v2 + d1 + d2 * e2 / np.linalg.norm(e2), v3 + d1 + d3 * e3 / np.linalg.norm(e3)
        e2, e3 = v2 - v1, v3 - v1
        n = np.cross(e2, e3) / np.linalg.norm(np.cross(e2, e3))
        r2 = e2 / np.linalg.norm(e2)
        r3 = e3 - (e3 @ n) * n - (e3 @ r2) * r2
        r3 /= np.linalg.norm(r3)
        lengths = np.array([1e-8, np.linalg.norm(e2) + 1e-8, abs(e3 @ r3)])
        for k in range(attached):
            row = core * attached + k
            a = model["alpha"][core, k]
            means.append(v1 + a[0] * n + a[1] * e2 / np.linalg.norm(e2) + a[2] * e3 / np.linalg.norm(e3))
            given = np.concatenate([model["attached_rotation"][row], encoded_time])
            own = rotation_matrices((turning["weight"] @ given + turning["bias"])[None])[0]
            axes.append(own @ np.stack([n, r2, r3], axis=1) * (np.exp(model["attached_scale"][row]) * lengths))
    return np.array(means), np.array(axes)


@pytest.mark.parametrize("time", [0.0, 0.3, 1.0])
def test_evaluates_the_published_networks(trained, time):
    folder, model, weights, turning = trained
    checkpoint, _ = read_checkpoint(folder)
    found = checkpoint.at(time)
    means, axes = expected(model, weights, turning, "timenet.0.weight" in weights, time)
    assert len(checkpoint) == len(means) == 21
    # All is float64, from the same float32: rounding alone, some hundred operations of numbers of about 10.
    assert np.abs(found.means - means).max() < 1e-11
    assert np.abs(found.covariances() - axes @ axes.transpose(0, 2, 1)).max() < 1e-11
    simplices = CheckpointMotion(checkpoint, 2.0, 4).simplices(2 * time)
    assert np.abs(simplices[:, 1:] - simplices[:, :1] - axes.transpose(0, 2, 1)).max() < 1e-11
    opacities = 1 / (1 + np.exp(-model["attached_opacity"][:, 0]))
    assert np.abs(found.opacities - opacities).max() < 1e-7
    assert np.array_equal(found.harmonics[:, 1:], np.float32(model["attached_features_rest"]))


def test_velocity_is_that_of_a_fine_difference(trained):
    checkpoint, _ = read_checkpoint(trained[0])
    motion = CheckpointMotion(checkpoint, 1.0, 3)
    h = motion.step

    def difference(step):
        return (motion.simplices(0.4 + step) - motion.simplices(0.4 - step)) / (2 * step)

    # The highest frequency of the encoding of time bounds the error of the difference, (512 h)^2 / 6 = 4e-6 of it; but
    # where a rectifier bends in between.
    off = np.abs(difference(h) - difference(h / 4)).max(axis=(1, 2))
    assert np.median(off) <= 1e-5 * np.abs(difference(h)).max()


def test_iterations(tmp_path):
    generator = np.random.default_rng(0)
    parts = random_model(generator), *random_weights(generator, False)
    for iteration in ("7000", "30000"):
        write(tmp_path, *parts, iteration=iteration)
    assert "iteration_30000" in str(read_checkpoint(tmp_path)[1].model)
    assert "iteration_7000" in str(read_checkpoint(tmp_path, "7000")[1].model)
    with pytest.raises(SplatFormatError, match="has no iteration '8000'; there are 7000, 30000"):
        read_checkpoint(tmp_path, "8000")
    write(tmp_path, *parts)
    assert "iteration_best" in str(read_checkpoint(tmp_path)[1].model)
    with pytest.raises(SplatFormatError, match=r"is a folder of training.*d-miso"):
        read_splat(tmp_path)


def test_arguments_may_be_gone(trained):
    (trained[0] / "cfg_args").unlink()
    assert len(read_checkpoint(trained[0])[0]) == 21


CALLS = [
    "Namespace(sh_degree=__import__('pathlib').Path({sentinel!r}).touch())",
    "__import__('pathlib').Path({sentinel!r}).touch()",
    "Namespace(**{{'a': open({sentinel!r}, 'w')}})",
    "Namespace(1)",
    "Namespace(a=[" + "[" * 300 + "]" * 300 + "])",
    "dict(a=1)",
    "Namespace(a=1",
    "\x00",
]


@pytest.mark.parametrize("told", CALLS, ids=range(len(CALLS)))
def test_arguments_are_never_run(told, tmp_path):
    sentinel = tmp_path / "run"
    (tmp_path / "cfg_args").write_text(told.format(sentinel=str(sentinel)))
    with pytest.raises(SplatFormatError, match="is not what training wrote") as caught:
        read_arguments(tmp_path / "cfg_args")
    assert "\n" not in str(caught.value)
    assert not sentinel.exists()


def test_arguments_of_training(tmp_path):
    path = tmp_path / "cfg_args"
    path.write_text("Namespace(data_device='cuda', is_blender=True, resolution=-1, images='images', alpha_lr=0.001)")
    assert read_arguments(path) == {
        "data_device": "cuda", "is_blender": True, "resolution": -1, "images": "images", "alpha_lr": 0.001,
    }  # fmt: skip


def test_networks_of_another_model(trained):
    folder, _, weights, _ = trained
    synthetic = "timenet.0.weight" in weights
    (folder / "cfg_args").write_text(f"Namespace(is_blender={not synthetic})")
    with pytest.raises(SplatFormatError, match=f"says is_blender={not synthetic}, but deform.pth has"):
        read_checkpoint(folder)


def changed(folder, file, **changes):
    """The same checkpoint with some arrays of a file exchanged, or taken away."""
    values = {**read_archive(folder / file), **{name.replace("__", "."): value for name, value in changes.items()}}
    MAKER.save(folder / file, {name: value for name, value in values.items() if value is not None})


NAN = np.full((7, 3, 3), np.nan)
FAULTS = {
    "no cores": (MODEL, {"pseudomesh": None}, "has no pseudomesh"),
    "not finite": (MODEL, {"pseudomesh": NAN}, "63 numbers of its pseudomesh are not finite"),
    "of another number": (MODEL, {"attached_scale": np.zeros((20, 3))}, "its attached_scale is 20 x 3, not 21 x 3"),
    "of another shape": (MODEL, {"alpha": np.zeros((7, 9))}, "its alpha is 7 x 9, not 7 x any x 3"),
    "without edges": (MODEL, {"pseudomesh": np.zeros((7, 3, 3))}, "7 of its 7 cores have no edges"),
    "nothing attached": (MODEL, {"use_attached_gauss": False}, "cores alone"),
    "no Gaussians": (MODEL, {"alpha": np.zeros((7, 0, 3))}, "holds no Gaussians"),
    "too large": (MODEL, {"attached_scale": np.full((21, 3), 1e4)}, "scales beyond"),
    "odd harmonics": (MODEL, {"attached_features_rest": np.zeros((21, 4, 3))}, "has 5 harmonics"),
    "a truth for an array": (MODEL, {"pseudomesh": True}, "has no pseudomesh"),
    "no layer": (DEFORMATION, {"linear__3__weight": None}, "the published network has"),
    "no head": (DEFORMATION, {"gaussian_rot__bias": None}, "has no gaussian_rot.bias"),
    "turns of three": (DEFORMATION, {"gaussian_rot__weight": np.zeros((3, 32))}, "gaussian_rot is of shape"),
    "rigid": (DEFORMATION, {"branch_w__weight": np.zeros((3, 32))}, "is_6dof"),
    "weights not finite": (DEFORMATION, {"linear__0__bias": np.full(32, np.inf)}, "no finite numbers"),
    "of another encoding": (TURNS, {"weight": np.zeros((4, 9))}, "the layer is of shape"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_refuses(fault, trained):
    file, changes, said = FAULTS[fault]
    changed(trained[0], file, **changes)
    with pytest.raises(SplatFormatError, match=re.escape(said)) as caught:
        read_checkpoint(trained[0])
    assert Path(file).name in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("file", [MODEL, DEFORMATION, TURNS])
def test_refuses_what_is_cut_off_or_gone(file, trained):
    path = trained[0] / file
    whole = path.read_bytes()
    for length in [0, 10, len(whole) // 3, len(whole) - 30]:
        path.write_bytes(whole[:length])
        with pytest.raises(SplatFormatError, match=path.name):
            read_checkpoint(trained[0])
    path.unlink()
    with pytest.raises(SplatFormatError, match="is not there; all files of an iteration are needed"):
        read_checkpoint(trained[0])


class _Code:
    def __init__(self, sentinel):
        self._sentinel = sentinel

    def __reduce__(self):
        return Path.touch, (self._sentinel,)


def test_code_in_a_checkpoint_is_not_run(trained, tmp_path):
    path, sentinel = trained[0] / DEFORMATION, tmp_path / "run"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("deform/data.pkl", pickle.dumps({"weight": _Code(sentinel)}, 2))
    with pytest.raises(SplatFormatError, match="which is no part of a tensor; it may be code, and was not run"):
        read_checkpoint(trained[0])
    assert not sentinel.exists()
    pickle.loads(pickle.dumps(_Code(sentinel), 2))
    assert sentinel.exists(), "the pickle does nothing: the test shows nothing"


@pytest.fixture(scope="module")
def dancer(tmp_path_factory):
    """The dancer of the examples, of fewer Gaussians, and how she is at rest."""
    folder = tmp_path_factory.mktemp("dance") / "dancer"
    bear = MAKER.make_toy(2400)
    cores, rows = MAKER.core_triangles(bear.means.astype(np.float64))
    weights, error = MAKER.train(cores)
    # Of a motion by a quarter of her height.
    assert error < 0.02
    bear = bear.select(rows)
    MAKER.write(folder, bear, cores, weights)
    return folder, bear


def test_the_example_is_its_bear_at_rest(dancer):
    """Where the networks say nothing, attached Gaussians are those that were: to float32, and to 1e-8 that is added."""
    folder, bear = dancer
    weights = read_archive(folder / DEFORMATION)
    still = {name: 0 * array if name.startswith("gaussian_") else array for name, array in weights.items()}
    copy = shutil.copytree(folder, folder.parent / "still", dirs_exist_ok=True)
    MAKER.save(copy / DEFORMATION, {**still, "gaussian_rot.bias": np.array([1.0, 0, 0, 0])})
    found = read_checkpoint(copy)[0].at(0.7)
    assert np.abs(found.means - bear.means).max() < 1e-6
    assert np.abs(found.covariances() - bear.covariances()).max() < 1e-6 * bear.covariances().max()


@pytest.mark.parametrize("composition", ["frozen", "carried"])
def test_a_checkpoint_is_played(dancer, tmp_path, composition):
    """Frame 0 is psi(s0), and under points that fly by themselves later frames are what the composition says."""
    folder, _ = dancer
    motion = DMiSoMotion(duration=2.0, start=0.6, composition=composition)
    item = SplatObject(
        name="it", splat=folder, up="+z", metres_per_unit=1.0, material=JELLY, motion=motion, reduction=ALL, vertices=4
    )
    scene = Scene(objects=(item,), duration=0.2, frame_rate=10, gravity=(0, 0, 0))
    engine = (flying_points.descriptor(checkpoints=False, fields=frozenset()), flying_points.Ballistic())
    run = simulate(scene, engine=engine, out=tmp_path / "run.gasp", progress=False)
    checkpoint, _ = read_checkpoint(folder)
    begun, later = checkpoint.at(0.3), checkpoint.at(0.4)
    # Drifts are float32 of numbers up to 0.3.
    assert np.abs(run.gaussians(0).means - begun.means).max() < 1e-6
    assert np.abs(run.gaussians(0).covariances() - begun.covariances()).max() < 1e-6
    if composition == "carried":
        assert np.abs(run.gaussians(2).means - later.means).max() < 1e-6
        return
    h = 1e-5
    rates = (checkpoint.at(0.3 + h).means - checkpoint.at(0.3 - h).means) / (2 * h) / 2.0
    assert np.abs(run.gaussians(2).means - (begun.means + 0.2 * rates)).max() < 1e-5


def test_the_dance_is_what_she_was_taught(dancer):
    folder, bear = dancer
    checkpoint, _ = read_checkpoint(folder)
    for time in (0.15, 0.3, 0.72):
        taught = MAKER.dance(bear.means.astype(np.float64), time)
        off = checkpoint.at(time).means - taught
        # What the fit leaves, and what is attached goes along with edges that do not stretch.
        assert np.sqrt((off**2).mean()) < 0.04 * np.abs(taught - bear.means).max()


@pytest.mark.thorough
def test_the_dancer_dropped_leaves_with_the_swing_she_has(dancer, tmp_path):
    """With a real engine, in free flight: its points' centre of mass goes on as psi would have had it go at s0."""
    folder, _ = dancer
    item = SplatObject(
        name="it", splat=folder, up="+z", metres_per_unit=1.0, material=JELLY, reduction=ALL, vertices=4,
        motion=DMiSoMotion(start=0.3, composition="frozen"),
    )  # fmt: skip
    scene = Scene(
        objects=(item,), duration=0.1, frame_rate=20, gravity=(0, 0, 0), accuracy=EngineAccuracy(resolution=16)
    )
    weights = prepare(scene).assembly.problem.points.reference_volumes
    run = simulate(scene, engine="reference-mpm", out=tmp_path / "run.gasp", progress=False)
    rate = np.average(run.points(run.frame_count - 1) - run.points(0), axis=0, weights=weights) / 0.1
    motion = CheckpointMotion(read_checkpoint(folder)[0], 1.0, 4)
    h = 1e-5
    rates = (motion.simplices(0.3 + h) - motion.simplices(0.3 - h)).reshape(-1, 3) / (2 * h)
    expected = np.average(rates, axis=0, weights=weights)
    assert np.linalg.norm(expected) > 0.2
    assert np.linalg.norm(rate - expected) < 0.01 * np.linalg.norm(expected)


def test_the_example_scene(dancer, tmp_path):
    scene = load_scene(EXAMPLES / "dancer.toml", changes=[f"object.bear.splat={dancer[0]}"])
    (item,) = scene.objects
    assert item.motion == DMiSoMotion(duration=2.0, start=0.6, composition="frozen")


def test_refused_in_a_scene():
    with pytest.raises(SceneError, match="wants the folder of a trained D-MiSo for a splat, found Gaussians"):
        SplatObject(name="it", splat=MAKER.make_toy(16), material=JELLY, motion=DMiSoMotion())
    with pytest.raises(SceneError, match='iteration must be "best" or a number in quotes, found 7'):
        DMiSoMotion(iteration=7)
    with pytest.raises(SceneError, match=r"DMiSoMotion\.duration"):
        DMiSoMotion(duration=0)
