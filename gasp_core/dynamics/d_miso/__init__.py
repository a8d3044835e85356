"""psi of a trained D-MiSo: its folder, its two networks, and the Gaussians that these move.

Waczynska et al., "D-MiSo: Editing Dynamic 3D Scenes using Multi-Gaussians Soup" (2024): core triangles that one network
moves, and Gaussians that are attached to each core, which another network turns.
"""
