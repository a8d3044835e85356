"""The two networks of D-MiSo, evaluated: of a time and the cores at rest, how cores move and Gaussians turn."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

__all__ = ["CoreNetwork", "TurnNetwork", "encoded"]

Array = NDArray[Any]
Refuse = Callable[[str], NoReturn]
"""What is said of weights that are not those of the network."""

_POSITION_FREQUENCIES = 10
_TIME_FREQUENCIES = {True: 6, False: 10}
"""With and without a network of the time's own, which synthetic data have."""


def encoded(values: Array, frequencies: int) -> Array:
    """Positional encoding (Mildenhall et al., 2020, eq. 4, without pi): x, then sin(2^k x) and cos(2^k x) for each k.

    Parameters
    ----------
    values : (..., D)
    frequencies
        k goes from 0 to one less.

    Returns
    -------
    (..., D (1 + 2 frequencies))
    """
    waves = [wave(2.0**k * values) for k in range(frequencies) for wave in (np.sin, np.cos)]
    return np.concatenate([values, *waves], axis=-1)


@dataclass(frozen=True, slots=True)
class _Linear:
    """x -> W x + b."""

    weight: Array
    bias: Array

    def __call__(self, values: Array) -> Array:
        return values @ self.weight.T + self.bias


class _Weights:
    """Named arrays, each checked as it is taken."""

    def __init__(self, weights: Any, refuse: Refuse) -> None:
        if not isinstance(weights, Mapping):
            refuse("holds no weights of a network")
        self._weights: Mapping[str, Any] = weights
        self._refuse = refuse

    def has(self, name: str) -> bool:
        return f"{name}.weight" in self._weights

    def count(self, name: str) -> int:
        return sum(bool(re.fullmatch(rf"{name}\.\d+\.weight", str(key))) for key in self._weights)

    def linear(self, name: str, inputs: int | None = None, outputs: int | None = None) -> _Linear:
        weight, bias = (self._array(f"{name}.{part}" if name else part) for part in ("weight", "bias"))
        shape = (outputs or weight.shape[0], inputs or weight.shape[-1])
        if weight.shape != shape or bias.shape != shape[:1]:
            self._refuse(f"{name or 'the layer'} is of shape {weight.shape}, the published network has {shape}")
        return _Linear(weight, bias)

    def _array(self, name: str) -> Array:
        array = self._weights.get(name)
        if not isinstance(array, np.ndarray):
            self._refuse(f"has no {name}, which the published network has")
        if array.ndim == 0 or array.dtype.kind != "f" or not np.isfinite(array).all():
            self._refuse(f"its {name} are no finite numbers")
        return array.astype(np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class CoreNetwork:
    """Of the cores at rest and a time: how far their vertices go.

    Parameters
    ----------
    time_layers
        What becomes of the encoded time before it goes in; none for real scenes.
    layers
        With rectifiers after each. What goes in goes in once more after the middle one.
    mean, second, third, turn
        Linear maps of what comes out.
    """

    time_layers: tuple[_Linear, ...]
    layers: tuple[_Linear, ...]
    mean: _Linear
    second: _Linear
    third: _Linear
    turn: _Linear

    @classmethod
    def of(cls, weights: Any, refuse: Refuse) -> CoreNetwork:
        """Of the weights as they are saved, which are checked against the published shapes."""
        found = _Weights(weights, refuse)
        if found.has("branch_w"):
            refuse("is of a model with is_6dof, which the published code cannot play either")
        synthetic = found.has("timenet.0")
        time = 1 + 2 * _TIME_FREQUENCIES[synthetic]
        time_layers: tuple[_Linear, ...] = ()
        if synthetic:
            first = found.linear("timenet.0", time)
            time_layers = (first, found.linear("timenet.2", len(first.bias)))
            time = len(time_layers[1].bias)
        own = 3 * (1 + 2 * _POSITION_FREQUENCIES) + time
        depth = max(found.count("linear"), 1)
        layers = [found.linear("linear.0", own)]
        for number in range(1, depth):
            before = len(layers[-1].bias) + (own if number - 1 == depth // 2 else 0)
            layers.append(found.linear(f"linear.{number}", before))
        last = len(layers[-1].bias) + (own if depth - 1 == depth // 2 else 0)
        return cls(
            time_layers=time_layers,
            layers=tuple(layers),
            mean=found.linear("gaussian_warp", last, 3),
            second=found.linear("gaussian_v2", last, 3),
            third=found.linear("gaussian_v3", last, 3),
            turn=found.linear("gaussian_rot", last, 4),
        )

    @property
    def time_frequencies(self) -> int:
        """Of the encoding of time."""
        return _TIME_FREQUENCIES[bool(self.time_layers)]

    def __call__(self, triangles: Array, time: float) -> tuple[Array, Array, Array, Array]:
        """Offsets of the mean, and along the second and third edges, (C, 3) each; quaternions (C, 4), not normalised.

        Parameters
        ----------
        triangles : (C, 3, 3)
            Cores at rest.
        time
            From 0 to 1.
        """
        moment = encoded(np.array([time]), self.time_frequencies)
        if self.time_layers:
            first, second = self.time_layers
            moment = second(np.maximum(first(moment), 0.0))
        places = encoded(triangles, _POSITION_FREQUENCIES).prod(axis=1)
        given = np.concatenate([places, np.broadcast_to(moment, (len(places), moment.shape[-1]))], axis=1)
        values = given
        for number, layer in enumerate(self.layers):
            values = np.maximum(layer(values), 0.0)
            if number == len(self.layers) // 2:
                values = np.concatenate([given, values], axis=1)
        return self.mean(values), self.second(values), self.third(values), self.turn(values)


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnNetwork:
    """Of a quaternion that was learnt and a time: how what is attached is turned against its core."""

    layer: _Linear
    time_frequencies: int

    @classmethod
    def of(cls, weights: Any, time_frequencies: int, refuse: Refuse) -> TurnNetwork:
        """Of the weights as they are saved."""
        layer = _Weights(weights, refuse).linear("", 4 + 1 + 2 * time_frequencies, 4)
        return cls(layer=layer, time_frequencies=time_frequencies)

    def __call__(self, quaternions: Array, time: float) -> Array:
        """Quaternions (N, 4), not normalised, at a time from 0 to 1."""
        moment = encoded(np.array([time]), self.time_frequencies)
        return quaternions @ self.layer.weight[:, :4].T + (moment @ self.layer.weight[:, 4:].T + self.layer.bias)
