"""Write the splat the example scenes use: a toy bear of 4,000 flat Gaussians.

python examples/make_toy.py
"""

from pathlib import Path

import gasp_core as gasp
from gasp_core.toy import make_toy

path = Path(__file__).with_name("toy.ply")
gasp.write_splat(path, make_toy(4000))
print(f"wrote {path}; now: gasp run {path.with_name('two_toys.toml')}")
