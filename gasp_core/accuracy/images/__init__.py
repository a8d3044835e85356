"""Measures between pictures, and between sets of pictures.

A picture is an array (H, W, 3) of display values in 0..1: what a screen is given, gamma and all.

| measure | equal pictures | what it sees |
|---|---|---|
| `psnr` [dB] | inf | differences of single pixels |
| `ssim` | 1 | differences of local mean, contrast and structure |
| `flip` | 0 | what an observer sees who flips between the two on a screen |
| `lpips` | 0 | what a trained network sees, closest to people's judgement of similarity |
| `frechet_distance` | 0 | how two sets of features are spread, whichever picture belongs to which |

`psnr`, `ssim` and `flip` need the extra `images`: ``pip install "gasp-core[images]"``. `lpips` and `alexnet_features`
need trained weights from a file, and no framework.
"""

from gasp_core.accuracy.images.alexnet import LpipsWeights, load_lpips_weights
from gasp_core.accuracy.images.fidelity import flip, psnr, ssim
from gasp_core.accuracy.images.frechet import frechet_distance
from gasp_core.accuracy.images.perceptual import alexnet_features, lpips

__all__ = [
    "LpipsWeights",
    "alexnet_features",
    "flip",
    "frechet_distance",
    "load_lpips_weights",
    "lpips",
    "psnr",
    "ssim",
]
