"""Train a D-MiSo of a bear that dances, in seconds, and write it as training writes one.

    python examples/make_dancer.py

The bear is the toy of `gasp demo`. Its motion is known: it sways and turns, more the higher up, as `dance` says. The
network that moves its cores is the published one, its last layer fitted to the cores' triangles at many times. What is
attached to the cores is attached exactly. No PyTorch is needed: the files are what `torch.save` would write.

Then: gasp run examples/dancer.toml --render dancer.webm
"""

import math
import pickle
import struct
import zipfile
from pathlib import Path

import numpy as np

from gasp_core.dynamics.d_miso.networks import encoded
from gasp_core.gaussians import rotation_matrices, rotation_quaternions
from gasp_core.io.activations import logit
from gasp_core.toy import make_toy

GAUSSIANS, ATTACHED = 6000, 30
WIDTH, DEPTH = 900, 4
SMOOTH = 2, 3
"""Frequencies of place and time that the network listens to; it would hear noise in the others."""


def main():
    """Train the dancer, and write her."""
    folder = Path(__file__).parent / "dancer"
    bear = make_toy(GAUSSIANS)
    cores, groups = core_triangles(bear.means.astype(np.float64))
    weights, error = train(cores)
    write(folder, bear.select(groups), cores, weights)
    print(f"{folder}: {len(cores)} cores, {ATTACHED} Gaussians each, off by {error:.1%} of its largest motion")


def dance(points, time):
    """Where the bear's points (..., 3) are at a time from 0 to 1, its height 1."""
    beat = 2 * math.pi * time
    sway, turn = (0.5 * math.sin(beat + shift) * points[..., 2] for shift in (0.0, 1.0))
    x, y, z = np.moveaxis(points, -1, 0)
    x, y = np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y
    return np.stack([np.cos(sway) * x + np.sin(sway) * z, y, np.cos(sway) * z - np.sin(sway) * x], axis=-1)


def core_triangles(means):
    """Triangles (C, 3, 3) of cores, and the Gaussians attached to each, one core after the other.

    Halves of halves along the longest side, until each holds as many as are attached to a core.
    """
    parts = [np.arange(len(means) // ATTACHED * ATTACHED)]
    while any(len(part) > ATTACHED for part in parts):
        halves = []
        for part in parts:
            if len(part) == ATTACHED:
                halves.append(part)
                continue
            ordered = part[np.argsort(means[part, np.argmax(np.ptp(means[part], axis=0))])]
            middle = len(part) // ATTACHED // 2 * ATTACHED
            halves += [ordered[:middle], ordered[middle:]]
        parts = halves
    centres = np.stack([means[part].mean(axis=0) for part in parts])
    # An edge grows along itself, component by component: none of them is small.
    edges = 0.1 * np.array([[0.8, 0.5, 0.4], [-0.5, 0.6, 0.7]])
    return np.stack([centres, centres + edges[0], centres + edges[1]], axis=1), np.concatenate(parts)


def targets(cores, time):
    """What the network is to say: offsets of the means, and of both edges along themselves, (C, 9)."""
    moved = dance(cores, time)
    edges, new = cores[:, 1:] - cores[:, :1], moved[:, 1:] - moved[:, :1]
    lengthening = (new - edges) / (edges / np.linalg.norm(edges, axis=2, keepdims=True))
    return np.concatenate([moved[:, 0] - cores[:, 0], lengthening[:, 0], lengthening[:, 1]], axis=1)


def inputs(cores, time):
    """What goes into the network, (C, 84)."""
    moment = np.broadcast_to(encoded(np.array([time]), 10), (len(cores), 21))
    return np.concatenate([encoded(cores, 10).prod(axis=1), moment], axis=1)


def train(cores, seed=0):
    """Weights and biases of each layer and of the last, and the root mean square error over the largest motion.

    The first layer is drawn, the last is fitted by least squares, those in between pass on what they are given: an
    extreme learning machine (Huang et al., 2006), which no descent has to be waited for.
    """
    times = np.linspace(0, 1, 61)
    given = np.concatenate([inputs(cores, time) for time in times])
    wanted = np.concatenate([targets(cores, time) for time in times])
    heard = np.concatenate([np.arange(63) < 3 * (1 + 2 * SMOOTH[0]), np.arange(21) < 1 + 2 * SMOOTH[1]])
    centre, spread = given[:, heard].mean(axis=0), given[:, heard].std(axis=0)
    generator = np.random.default_rng(seed)
    weight, drawn = np.zeros((WIDTH, len(heard))), generator.normal(size=(WIDTH, heard.sum())) / spread
    weight[:, heard] = drawn * math.sqrt(2 / heard.sum())
    bias = 0.5 * generator.normal(size=WIDTH) - weight[:, heard] @ centre
    passed = [(np.eye(WIDTH), np.zeros(WIDTH)) for _ in range(DEPTH - 1)]
    # What goes into the network goes into this layer once more.
    passed[DEPTH // 2] = (np.eye(WIDTH, len(heard) + WIDTH, k=len(heard)), np.zeros(WIDTH))
    features = np.maximum(given @ weight.T + bias, 0)
    features = np.concatenate([features, np.ones((len(features), 1))], axis=1)
    solution = np.linalg.lstsq(features, wanted, rcond=1e-10)[0]
    off = (features @ solution - wanted)[:, :3]
    layers = [(weight, bias), *passed]
    return (layers, (solution[:-1].T, solution[-1])), np.sqrt((off**2).mean()) / np.abs(wanted[:, :3]).max()


def write(folder, bear, cores, weights):
    """The folder that training leaves."""
    second, third = (cores[:, vertex] - cores[:, 0] for vertex in (1, 2))
    lengths = [np.linalg.norm(edge, axis=1, keepdims=True) for edge in (second, third)]
    normals = np.cross(second, third)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    edges = np.stack([normals, second / lengths[0], third / lengths[1]], axis=1)
    other = np.cross(normals, edges[:, 1])
    frames = np.stack([normals, edges[:, 1], other], axis=2)
    scales = np.stack([np.full(len(cores), 1e-8), lengths[0][:, 0], np.einsum("ci,ci->c", third, other)], axis=1)
    offsets = bear.means.reshape(len(cores), ATTACHED, 3) - cores[:, :1]
    # The thin axis comes first; a cyclic change of axes keeps them right-handed.
    matrices = rotation_matrices(bear.quaternions)[:, :, [2, 0, 1]]
    turns = matrices @ np.repeat(frames, ATTACHED, axis=0).transpose(0, 2, 1)
    model = {
        "pseudomesh": cores,
        "alpha": offsets @ np.linalg.inv(edges),
        "attached_scale": np.log(bear.scales[:, [2, 0, 1]] / np.repeat(scales, ATTACHED, axis=0)),
        "attached_rotation": rotation_quaternions(turns),
        "attached_opacity": logit(bear.opacities)[:, None],
        "attached_features_dc": bear.harmonics[:, :1],
        "attached_features_rest": bear.harmonics[:, 1:],
        "num_splats": ATTACHED,
        "use_attached_gauss": True,
    }
    layers, head = weights
    deformation = {}
    for number, (weight, bias) in enumerate(layers):
        deformation |= {f"linear.{number}.weight": weight, f"linear.{number}.bias": bias}
    for name, rows in (("gaussian_warp", slice(0, 3)), ("gaussian_v2", slice(3, 6)), ("gaussian_v3", slice(6, 9))):
        deformation |= {f"{name}.weight": head[0][rows], f"{name}.bias": head[1][rows]}
    # Edges grow along themselves: the quaternion is that of no rotation, and so is the other network.
    deformation |= {"gaussian_rot.weight": np.zeros((4, WIDTH)), "gaussian_rot.bias": np.array([1.0, 0, 0, 0])}
    turning = {"weight": np.eye(4, 25), "bias": np.zeros(4)}
    kept = "iteration_best"
    save(folder / "point_cloud" / kept / "model_params.pt", model)
    save(folder / "deform" / kept / "deform.pth", deformation)
    save(folder / "time_net" / kept / "deform.pth", turning)
    told = f"Namespace(deform_depth={DEPTH}, deform_width={WIDTH}, is_6dof=False, is_blender=False, sh_degree=1)"
    (folder / "cfg_args").write_text(told)


def save(path, values):
    """What `torch.save` writes of a dict of arrays, numbers and truths: a pickle, and the bytes of each tensor."""
    path.parent.mkdir(parents=True, exist_ok=True)
    said, stored = bytearray(pickle.PROTO + b"\x02" + pickle.EMPTY_DICT + pickle.MARK), []
    for name, value in values.items():
        said += text(name)
        if isinstance(value, bool):
            said += pickle.NEWTRUE if value else pickle.NEWFALSE
        elif isinstance(value, int):
            said += number(value)
        else:
            array = np.ascontiguousarray(value, "<f4")
            said += b"ctorch._utils\n_rebuild_tensor_v2\n" + pickle.MARK + pickle.MARK + text("storage")
            said += b"ctorch\nFloatStorage\n" + text(str(len(stored))) + text("cpu") + number(array.size)
            said += pickle.TUPLE + pickle.BINPERSID + number(0)
            for lengths in (array.shape, [stride // 4 for stride in array.strides]):
                said += pickle.MARK + b"".join(map(number, lengths)) + pickle.TUPLE
            said += pickle.NEWFALSE + b"ccollections\nOrderedDict\n" + pickle.EMPTY_TUPLE + pickle.REDUCE
            said += pickle.TUPLE + pickle.REDUCE
            stored.append(array.tobytes())
    said += pickle.SETITEMS + pickle.STOP
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(f"{path.stem}/data.pkl", bytes(said))
        archive.writestr(f"{path.stem}/byteorder", "little")
        for key, data in enumerate(stored):
            archive.writestr(f"{path.stem}/data/{key}", data)
        archive.writestr(f"{path.stem}/version", "3\n")


def text(value):
    """A text, pickled."""
    return pickle.BINUNICODE + struct.pack("<I", len(value)) + value.encode()


def number(value):
    """A whole number, pickled."""
    return pickle.BININT + struct.pack("<i", value)


if __name__ == "__main__":
    main()
