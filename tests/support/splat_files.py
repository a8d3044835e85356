"""Small splat files of every format, built from the formats' own descriptions and not by the code under test."""

import gzip
import io
import json
import struct
import zipfile

import numpy as np

BASES = {0: 0, 1: 3, 2: 8, 3: 15, 4: 24}


def ply(properties, rows, *, count=None, order="<", before=b"", after=b"", comments=()):
    """A PLY of one element: properties [(name, type)], rows of numbers."""
    kinds = {"float": "f4", "double": "f8", "uchar": "u1", "int": "i4", "uint": "u4", "short": "i2", "half": "f2"}
    fmt = {"<": "binary_little_endian", ">": "binary_big_endian", "": "ascii"}[order]
    head = ["ply", f"format {fmt} 1.0", *comments, f"element vertex {len(rows) if count is None else count}"]
    head += [f"property {kind} {name}" for name, kind in properties] + ["end_header"]
    if order:
        dtype = np.dtype([(name, order + kinds[kind]) for name, kind in properties])
        body = np.array([tuple(row) for row in rows], dtype).tobytes()
    else:
        real = [kind in ("float", "double") for _, kind in properties]
        lines = (" ".join(repr(float(v)) if r else str(int(v)) for v, r in zip(row, real)) for row in rows)
        body = "\n".join(lines).encode() + b"\n"
    return before + "\n".join(head).encode() + b"\n" + body + after


def inria_names(degree):
    rest = [f"f_rest_{i}" for i in range(3 * BASES[degree])]
    return [*"xyz", "f_dc_0", "f_dc_1", "f_dc_2", *rest, "opacity", *(f"scale_{i}" for i in range(3))] + [
        f"rot_{i}" for i in range(4)
    ]


def spz(version, count=5, degree=2, *, seed=0, head=None, cut=None, bits=12):
    """A .spz of random bytes in every section, and those sections."""
    rng = np.random.default_rng(seed)
    widths = [6 if version == 1 else 9, 1, 3, 3, 3 if version <= 2 else 4, 3 * BASES[degree]]
    sections = [rng.integers(0, 256, count * width, np.uint8).tobytes() for width in widths]
    if version == 1:
        sections[0] = rng.normal(0, 1, 3 * count).astype("<f2").tobytes()
    if version <= 2:
        # |xyz| <= 1, as a packer leaves it: 127.5 +- 70.
        sections[4] = rng.integers(58, 197, 3 * count).astype(np.uint8).tobytes()
    fields = head or (b"NGSP", version, count, degree, bits, 0)
    if version < 4:
        return gzip.compress(struct.pack("<4sIIBBBB", *fields, 0) + b"".join(sections)[:cut], mtime=0), sections
    from numcodecs import Zstd

    packed = [Zstd(level=1).encode(section) for section in sections if section]
    table = b"".join(struct.pack("<QQ", len(p), len(s)) for p, s in zip(packed, [s for s in sections if s]))
    header = struct.pack("<4sIIBBBBI12x", *fields, len(packed), 32)
    return (header + table + b"".join(packed))[: None if cut is None else 32 + cut], sections


def webp(pixels):
    """Lossless WebP of (h, w, 3|4) uint8."""
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "WEBP", lossless=True, exact=True, quality=0, method=0)
    return stream.getvalue()


def sog(version, count=10, degree=1, /, *, seed=0, **changes):
    """Files of a SOG: name to bytes. `changes` are paths into meta.json, with __ between keys."""
    rng = np.random.default_rng(seed)
    side = int(np.ceil(np.sqrt(count)))

    def texture(channels=4):
        return rng.integers(0, 256, (side, side, channels), np.uint8)

    quats = texture()
    quats[..., 3] = rng.integers(252, 256, (side, side))
    labels = np.zeros((side, side, 3), np.uint8)
    labels[..., 0] = rng.integers(0, 128, (side, side))
    files = {
        "means_l.webp": webp(texture(3)),
        "means_u.webp": webp(texture(3)),
        "quats.webp": webp(quats),
        "scales.webp": webp(texture(3)),
        "sh0.webp": webp(texture()),
    }
    means = {"mins": [-1.0, -2.0, -0.5], "maxs": [1.0, 0.5, 3.0], "files": ["means_l.webp", "means_u.webp"]}
    book = sorted(rng.normal(0, 1, 256).tolist())
    if version == 2:
        meta = {
            "version": 2,
            "count": count,
            "means": means,
            "scales": {"codebook": [value - 5 for value in book], "files": ["scales.webp"]},
            "quats": {"files": ["quats.webp"]},
            "sh0": {"codebook": book, "files": ["sh0.webp"]},
        }
    else:
        meta = {
            "means": {**means, "shape": [count, 3]},
            "scales": {"mins": [-9.0, -8.0, -7.0], "maxs": [-1.0, -2.0, 0.0], "files": ["scales.webp"]},
            "quats": {"shape": [count, 4], "files": ["quats.webp"]},
            "sh0": {"mins": [-1.0, -1.5, -2.0, -6.0], "maxs": [2.0, 1.0, 1.5, 7.0], "files": ["sh0.webp"]},
        }
    if degree:
        files["shN_centroids.webp"] = webp(rng.integers(0, 256, (2, 64 * BASES[degree], 3), np.uint8))
        files["shN_labels.webp"] = webp(labels)
        meta["shN"] = {"files": ["shN_centroids.webp", "shN_labels.webp"]}
        meta["shN"] |= (
            {"codebook": book, "bands": degree, "count": 128} if version == 2 else {"mins": -0.5, "maxs": 0.75}
        )
    for place, value in changes.items():
        *outer, last = place.split("__")
        target = meta
        for key in outer:
            target = target[key]
        if value is None:
            target.pop(last)
        else:
            target[last] = value
    files["meta.json"] = json.dumps(meta).encode()
    return files


def zipped(files, compression=zipfile.ZIP_STORED):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", compression) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return stream.getvalue()


def compressed_ply(count=300, degree=1, *, old=False, seed=0, chunks=None, levels=None):
    """A compressed .ply of random words; `levels` overrides the harmonic bytes."""
    rng = np.random.default_rng(seed)
    names = [f"{end}_{axis}" for end in ("min", "max") for axis in "xyz"]
    names += [f"{end}_scale_{axis}" for end in ("min", "max") for axis in "xyz"]
    if not old:
        names += [f"{end}_{axis}" for end in ("min", "max") for axis in "rgb"]
    number = -(-count // 256) if chunks is None else chunks
    bounds = rng.uniform(-3, -1, (number, len(names))).astype("<f4")
    for column, name in enumerate(names):
        if name.startswith("max"):
            bounds[:, column] += 2
    packed = ["packed_position", "packed_rotation", "packed_scale", "packed_color"]
    words = rng.integers(0, 1 << 32, (count, 4), np.uint32)
    head = ["ply", "format binary_little_endian 1.0", f"element chunk {number}"]
    head += [f"property float {name}" for name in names] + [f"element vertex {count}"]
    head += [f"property uint {name}" for name in packed]
    body = bounds.tobytes() + words.astype("<u4").tobytes()
    if degree:
        rest = 3 * BASES[degree]
        head += [f"element sh {count}"] + [f"property uchar f_rest_{i}" for i in range(rest)]
        sh = rng.integers(1, 255, (count, rest), np.uint8) if levels is None else levels
        body += sh.tobytes()
    return "\n".join([*head, "end_header"]).encode() + b"\n" + body


GLTF_TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
KHR = "KHR_gaussian_splatting"


class Gltf:
    """A glTF 2.0 that is put together entry by entry, as its specification has it."""

    def __init__(self):
        self.binary = b""
        self.views, self.accessors, self.meshes = [], [], []

    def view(self, content, **more):
        """Number of a new bufferView."""
        self.binary += bytes(-len(self.binary) % 4)
        self.views.append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(content), **more})
        self.binary += content
        return len(self.views) - 1

    def accessor(self, values, **more):
        """Number of a new accessor of rows."""
        values = np.asarray(values)
        if values.dtype == np.float64:
            values = values.astype("<f4")
        kind = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[1 if values.ndim == 1 else values.shape[1]]
        entry = {"componentType": GLTF_TYPES[values.dtype.str[1:]], "count": len(values), "type": kind}
        self.accessors.append({"bufferView": self.view(values.tobytes()), **entry, **more})
        return len(self.accessors) - 1

    def mesh(self, *primitives):
        """Number of a new mesh."""
        self.meshes.append({"primitives": list(primitives)})
        return len(self.meshes) - 1

    def cloud(self, arrays, **extension):
        """A primitive of points of arrays, or numbers of accessors, by names without that of the extension."""
        named = {n if n in ("POSITION", "COLOR_0") or n[0] == "_" else f"{KHR}:{n}": a for n, a in arrays.items()}
        found = {n: a if isinstance(a, int) else self.accessor(a) for n, a in named.items()}
        about = {"kernel": "ellipse", "colorSpace": "srgb_rec709_display", **extension}
        return {"attributes": found, "mode": 0, "extensions": {KHR: about}}

    def packed(self, nodes=None, **changes):
        """The .glb; a node for each mesh, where none are given."""
        nodes = [{"mesh": k} for k in range(len(self.meshes))] if nodes is None else nodes
        below = {child for node in nodes for child in node.get("children", ())}
        document = {
            "asset": {"version": "2.0"},
            "extensionsUsed": [KHR],
            "scene": 0,
            "scenes": [{"nodes": [k for k in range(len(nodes)) if k not in below]}],
            "nodes": nodes,
            "meshes": self.meshes,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": len(self.binary)}],
            **changes,
        }
        document = {name: entry for name, entry in document.items() if entry is not None}
        return glb(json.dumps(document).encode(), self.binary)


def glb(text, binary):
    """A .glb of a document and of what it speaks of."""
    text, binary = text + b" " * (-len(text) % 4), binary + bytes(-len(binary) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary))
    return head + struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x4E4942) + binary


def cloud_arrays(count=5, degree=1, seed=0):
    """Attributes of random Gaussians, by the names of the Khronos without the extension's."""
    rng = np.random.default_rng(seed)
    quaternions = rng.normal(size=(count, 4))
    found = {
        "POSITION": rng.normal(size=(count, 3)),
        "ROTATION": quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True),
        "SCALE": np.exp(rng.uniform(-5, 0, (count, 3))),
        "OPACITY": rng.uniform(size=count),
    }
    for d in range(degree + 1):
        for n in range(2 * d + 1):
            found[f"SH_DEGREE_{d}_COEF_{n}"] = rng.uniform(-0.9, 0.9, (count, 3))
    return found


def cloud_glb(count=5, degree=1, seed=0, **changes):
    """A .glb of random Gaussians; `changes` of its document."""
    gltf = Gltf()
    gltf.mesh(gltf.cloud(cloud_arrays(count, degree, seed)))
    return gltf.packed(**changes)


def spz_glb(content, name=f"{KHR}_compression_spz_2"):
    """A .glb whose Gaussians are packed as .spz, by an extension of one of three names."""
    gltf = Gltf()
    inner = {name: {"bufferView": gltf.view(content)}}
    within = name.startswith(KHR)
    gltf.mesh(
        {"attributes": {"POSITION": 0}, "mode": 0, "extensions": {KHR: {"extensions": inner}} if within else inner}
    )
    # Accessors are there for what cannot unpack them, and have no numbers.
    return gltf.packed(accessors=[{"componentType": 5126, "count": 7, "type": "VEC3"}])
