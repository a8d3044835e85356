"""A scene in Python: drop the toy, look at how the fall went, write the last frame as a splat.

python examples/make_toy.py && python examples/drop.py
"""

from pathlib import Path

import gasp_core as gasp

here = Path(__file__).parent
rubber = gasp.Elastic(density=200, youngs_modulus=5e4, poissons_ratio=0.3)
toy = gasp.SplatObject(name="toy", splat=here / "toy.ply", up="+z", height=0.3, position=(0, 0, 0.1), material=rubber)
floor = gasp.Collider(shape=gasp.HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.5)
scene = gasp.Scene(
    duration=0.4,
    frame_rate=25,
    objects=(toy,),
    colliders=(floor,),
    accuracy=gasp.EngineAccuracy(resolution=20),
)
run = gasp.simulate(scene)
for time, frame in zip(run.times, run.diagnostics()):
    print(f"{time:5.2f} s  kinetic energy {frame['kinetic_energy'] or 0:.4f} J  {frame['substeps']} substeps")
gasp.write_splat("toy_after.ply", run.gaussians(run.frame_count - 1))
