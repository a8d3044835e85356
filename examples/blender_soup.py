"""A splat moved by Blender: its triangles are twisted by a modifier, frame by frame. Any other tool will do as well.

gasp soup export plant.ply
blender --background --python examples/blender_soup.py -- plant.soup.ply moved.npy
gasp soup import plant.ply plant.soup.ply moved.npy
"""

import math
import sys

import bpy
import numpy as np

soup, moved = sys.argv[sys.argv.index("--") + 1 :]
bpy.ops.wm.ply_import(filepath=soup)
mesh = bpy.context.object
twist = mesh.modifiers.new("Twist", "SIMPLE_DEFORM")
twist.deform_method, twist.deform_axis = "TWIST", "Z"
frames = []
for angle in range(0, 91, 6):
    twist.angle = math.radians(angle)
    became = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    places = np.empty(3 * len(became.vertices), np.float32)
    became.vertices.foreach_get("co", places)
    frames.append(places.reshape(-1, 3))
np.save(moved, frames)
