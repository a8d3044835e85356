"""Renderers of splats: a tile rasteriser in numba, its brute-force reference, and gsplat where there is a GPU."""
