"""Where things lie in the flat arrays that kernels share with the host: rows of points, of what acts, of a survey."""

from __future__ import annotations

__all__: list[str] = []

# One point's row of reals. What points give to the grid comes first.
VELOCITY = 0
AFFINE = 3
"""C, (3, 3)."""
MASS = 12
STRESS = 13
"""Scaled Kirchhoff stress without the part of the mean dilation: xx, yy, zz, xy, xz, yz."""
DILATION = 19
"""What is averaged where matter keeps its volume: J - 1 or ln J, and its rate by the damping."""
HISTORY = 20
"""What matter remembers beside F. Sand: the logarithm of the volume it gained in the projection. Snow: ln J_P. Metal,
plasticine: equivalent plastic strain. Fluid: J - 1, which keeps the digits that J loses in float32."""
DISPLACEMENT_GRADIENT = 21
"""F - I, (3, 3): beside I the increments of a slow load would round away in float32. What stands upright keeps all of
its digits; what is turned, those of F."""
MEAN_PRESSURE = 30
"""What the mean dilation adds to the stress in the step that is being done; nothing is kept in it."""
HALF_SIDE = 31
"""Of the cube that a point stands for at rest [cells]."""
POINT_WIDTH = 32
LAYOUT = 6
"""Grows whenever the meaning of a row of points or labels changes, or of their cells: checkpoints hold them as they
are."""

# One point's row of integers.
MATERIAL = 0
HOME = 1
LABEL_WIDTH = 4

# One shape: kind, then two vectors. A field: its first node, its spacing, and where it begins in the table of fields:
# there are the numbers of its nodes along the axes, then the distances [cells].
PLANE = 0
BOX = 1
SPHERE = 2
EVERYWHERE = 3
FIELD = 4

# A collider: shape, contact, friction, side, whether it moves; then its centre in the scene, where that is now, its
# transposed rotation (9), velocity, angular velocity, and `gasp_core.stepping.rigid_motion.Pose.inward`.
STICK = 0
SLIP = 1
SEPARATE = 2
COLLIDER_WIDTH = 36
# A wind: shape, velocity, drag times step.
WIND_WIDTH = 12
# A drive: shape, centre at the start, centre now, transposed rotation (9), velocity, angular velocity, `Pose.inward`.
DRIVE_WIDTH = 32

# A material.
KIND = 0
SHEAR = 1
LAME = 2
"""Of the points' own dilation; of a fluid, the bulk modulus."""
VISCOSITY = 3
CONE = 4
"""Of sand: sqrt(2/3) M / 3."""
INVERSE_BOUND = 5
"""1 / (largest stable step)^2 at rest."""
MEAN_STIFFNESS = 6
"""Square root of the lambda that acts on the mean dilation, scaled as the stress of a material of lightness 1."""
LIGHTNESS = 7
"""One over the density, relative."""
YIELD = 8
"""|dev tau| that is borne: sqrt(2/3) of the yield stress."""
HARDENING = 9
"""By how much that grows per unit of plastic strain; of snow, xi."""
RESIDUAL = 10
"""To how much that may fall."""
RELAXATION = 11
"""Of foam: the time in which what is above falls to 1/e, eta / (2 mu)."""
LEAST_STRETCH = 12
GREATEST_STRETCH = 13
"""Of snow's box."""
SUBGRID_DECAY = 14
"""Of matter that flows, per unit of time; nought where nothing of the sub-grid velocities is kept."""
CROWDING_DECAY = 15
"""Of a fluid, per unit of time."""
FULLNESS = 16
"""What mass at a node is, of that of a cell full of it, in units of a point's."""
BULK_VISCOSITY = 17
"""What stands before tr D I where VISCOSITY stands before 2 D: of elastic matter that is damped."""
MASS_DAMPING = 18
"""Per unit of time."""
LOOSEST_STRAIN = 19
"""Of sand: ln J at the tip of its cone."""
STIFFNESS_DAMPING = 20
"""Of elastic matter, in units of time: with it the rate of the mean dilation acts as the mean dilation does."""
VISCOUS_SHARE = 21
"""Of a fluid, of its rate at rest (`gasp_core.stepping.time_step.viscous_share`)."""
MATERIAL_WIDTH = 22

KINDS = {
    "elastic": 0,
    "neo-hookean": 1,
    "sand": 2,
    "fluid": 3,
    "snow": 4,
    "metal": 5,
    "plasticine": 6,
    "foam": 7,
}

# A row of the survey of a chunk of points.
SURVEY_STIFFNESS = 0
SURVEY_SPEED = 1
SURVEY_GRADIENT = 2
SURVEY_BAD = 3
SURVEY_INVERTED = 4
SURVEY_LOW = 5
SURVEY_HIGH = 8
SURVEY_DRIFT = 11
"""How far, in cells and along one axis, a point is outside its home."""
SURVEY_CRUSHED = 12
"""Elastic points at `stepping.session.CRUSHED_VOLUME` or below."""
SURVEY_WIDTH = 13
SURVEY_CHUNK = 1024

TOUCH = 1e-3
"""Signed distance [cells] up to which a node counts as touched by a face it lies on."""
SMALLEST_STRETCH = 1e-4
"""Floor of a principal stretch under a logarithm."""
LEAST_MASS = 1e-30
"""Below this (in mean point masses) a node's velocity is the quotient of two denormals."""
