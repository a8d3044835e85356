"""Materials by what people call them: which model, which numbers, where these are from and how far they range.

Numbers are of matter at room temperature. The hardening of a metal is the difference between its tensile and its yield
strength over its elongation at fracture. A modulus or a ratio that would ask for far smaller steps, and that nobody can
see, is replaced by one that costs less; which, and why, is said beside it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field

from gasp_core.contract import Elastic, Fluid, Foam, Material, Metal, NeoHookean, Plasticine, Sand, Snow

__all__ = ["PRESETS", "MaterialPreset"]


@dataclass(frozen=True, slots=True, kw_only=True)
class MaterialPreset:
    """A material that has a name.

    Parameters
    ----------
    material
        Its model and numbers, with the name.
    summary
        One line: what is meant.
    source
        Where the numbers and ranges can be looked up.
    ranges
        What each number is in reality, lowest and highest, by field of the material; parameters of a model that
        nothing is measured of range over what the source uses.
    stand_ins
        Why a number is not the one of reality, by field: only these may be outside their range.
    aliases
        Other names of it.
    """

    material: Material
    summary: str
    source: str
    ranges: Mapping[str, tuple[float, float]]
    stand_ins: Mapping[str, str] = field(default_factory=dict[str, str])
    aliases: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """As messages say it."""
        return self.material.name

    @property
    def numbers(self) -> dict[str, float]:
        """The material's numbers, by field; without those that are what a model has by default and nobody gave."""
        fields = [each for each in dataclasses.fields(self.material) if each.name != "name"]
        values = {each.name: (getattr(self.material, each.name), each.default) for each in fields}
        return {name: value for name, (value, default) in values.items() if name in self.ranges or value != default}


_ASHBY = "Ashby, Materials Selection in Mechanical Design (4th ed. 2011), appendix A"
_KAYE = "Kaye and Laby, Tables of Physical and Chemical Constants (16th ed. 1995), 2.2.2"
_CRC = "CRC Handbook of Chemistry and Physics"
_TERZAGHI = "Terzaghi, Peck and Mesri, Soil Mechanics in Engineering Practice (3rd ed. 1996)"
_BOWLES = "Bowles, Foundation Analysis and Design (5th ed. 1996), table 2-8"
_MONAGHAN = (
    "1e6 lets sound go ten times as fast as what has fallen {fall} m, so that densities change by 1 % there"
    " (Monaghan 1994, 10.1006/jcph.1994.1034), and steps be {longer} times as long"
)
_NEARLY = "its volume hardly changes; at {used} it changes by {share} % of a strain, and steps are {longer}"

PRESETS: tuple[MaterialPreset, ...] = (
    MaterialPreset(
        material=NeoHookean(name="rubber", density=930, youngs_modulus=2e6, poissons_ratio=0.47),
        summary="natural rubber, vulcanised, of a Shore hardness of A 45",
        source=f"{_ASHBY}; Gent 1958, Rubber Chem. Technol. 31, 896: Shore A 30 to 70; Treloar, The Physics of Rubber"
        " Elasticity (3rd ed. 1975)",
        ranges={"density": (920, 1250), "youngs_modulus": (1.1e6, 5.5e6), "poissons_ratio": (0.499, 0.4999)},
        stand_ins={"poissons_ratio": _NEARLY.format(used=0.47, share=6, longer="8 times as long")},
        aliases=("natural rubber",),
    ),
    MaterialPreset(
        material=NeoHookean(name="soft rubber", density=1070, youngs_modulus=4e5, poissons_ratio=0.47),
        summary="cast silicone rubber, of a Shore hardness of A 10",
        source="Gent 1958, Rubber Chem. Technol. 31, 896: Shore A 0 to 30; Treloar, The Physics of Rubber Elasticity"
        " (3rd ed. 1975)",
        ranges={"density": (1000, 1250), "youngs_modulus": (1.6e5, 1.1e6), "poissons_ratio": (0.499, 0.4999)},
        stand_ins={"poissons_ratio": _NEARLY.format(used=0.47, share=6, longer="8 times as long")},
        aliases=("silicone", "silicone rubber"),
    ),
    MaterialPreset(
        material=Elastic(name="jelly", density=1050, youngs_modulus=1e4, poissons_ratio=0.45),
        summary="gelatine in water, some 5 % by weight, as it is eaten",
        source="Hall, Bilgen, Insana and Krouskop 1997, IEEE Trans. Ultrason. Ferroelectr. Freq. Control 44, 1355",
        ranges={"density": (1000, 1100), "youngs_modulus": (1e3, 1e5), "poissons_ratio": (0.499, 0.49999)},
        stand_ins={"poissons_ratio": _NEARLY.format(used=0.45, share=10, longer="10 times as long")},
        aliases=("gelatin", "gelatine"),
    ),
    MaterialPreset(
        material=Elastic(name="flesh", density=1060, youngs_modulus=2e4, poissons_ratio=0.45),
        summary="muscle at rest and fat, no skin and no bones",
        source="McKee, Last, Russell and Murphy 2011, Tissue Eng. B 17, 155; Fung, Biomechanics: Mechanical Properties"
        " of Living Tissues (2nd ed. 1993)",
        ranges={"density": (900, 1090), "youngs_modulus": (1e3, 2e5), "poissons_ratio": (0.499, 0.49999)},
        stand_ins={"poissons_ratio": _NEARLY.format(used=0.45, share=10, longer="10 times as long")},
        aliases=("muscle",),
    ),
    MaterialPreset(
        material=Elastic(name="foam rubber", density=30, youngs_modulus=1e5, poissons_ratio=0.3),
        summary="flexible polyurethane foam of cushions and sponges; it does not collapse when it is crushed",
        source=f"{_ASHBY}; Gibson and Ashby, Cellular Solids (2nd ed. 1997), chapter 5; Mills, Polymer Foams Handbook"
        " (2007)",
        ranges={"density": (16, 70), "youngs_modulus": (3e4, 1e6), "poissons_ratio": (0.0, 0.4)},
        aliases=("sponge", "polyurethane foam", "soft foam"),
    ),
    MaterialPreset(
        material=Elastic(name="cork", density=180, youngs_modulus=2e7, poissons_ratio=0.05),
        summary="cork of bottles, pressed along its axis",
        source=f"{_ASHBY}; Gibson, Easterling and Ashby 1981, Proc. R. Soc. A 377, 99",
        ranges={"density": (120, 240), "youngs_modulus": (1.3e7, 5e7), "poissons_ratio": (0.0, 0.5)},
    ),
    MaterialPreset(
        material=Elastic(name="leather", density=930, youngs_modulus=2e8, poissons_ratio=0.4),
        summary="tanned leather",
        source=_ASHBY,
        ranges={"density": (810, 1050), "youngs_modulus": (1e8, 5e8), "poissons_ratio": (0.2, 0.49)},
        stand_ins={"poissons_ratio": "leather has another one along every direction; that of soft polymers is taken"},
    ),
    MaterialPreset(
        material=Elastic(name="wood", density=600, youngs_modulus=1e10, poissons_ratio=0.37),
        summary="hard wood, dry; it does not split",
        source=f"Wood Handbook, USDA Forest Products Laboratory FPL-GTR-190 (2010), chapter 5; {_ASHBY}",
        ranges={"density": (350, 850), "youngs_modulus": (6e9, 2e10), "poissons_ratio": (0.3, 0.5)},
        stand_ins={"youngs_modulus": "that along the grain; across it is a tenth or less. The models have no grain"},
        aliases=("timber",),
    ),
    MaterialPreset(
        material=Elastic(name="plastic", density=1050, youngs_modulus=2.3e9, poissons_ratio=0.39),
        summary="ABS, of which toys and casings are; it neither yields nor breaks",
        source=f"{_ASHBY}; Ashby and Jones, Engineering Materials 1 (4th ed. 2012)",
        ranges={"density": (1010, 1210), "youngs_modulus": (1.1e9, 2.9e9), "poissons_ratio": (0.35, 0.42)},
        aliases=("abs",),
    ),
    MaterialPreset(
        material=Plasticine(
            name="plasticine", density=1800, youngs_modulus=5e6, poissons_ratio=0.45, yield_stress=1.2e5, softening=0.0,
            residual=1.0,
        ),
        summary="modelling clay on oil, kneaded by hand",
        source="Green 1951, Phil. Mag. 42, 365; Sofuoglu and Rasty 2000, Tribol. Int. 33, 523",
        ranges={
            "density": (1700, 1900), "youngs_modulus": (1e6, 1e7), "poissons_ratio": (0.4, 0.5),
            "yield_stress": (5e4, 2.5e5), "softening": (0, 0), "residual": (1, 1),
        },
        aliases=("modelling clay", "modeling clay"),
    ),
    MaterialPreset(
        material=Plasticine(
            name="clay", density=1900, youngs_modulus=5e6, poissons_ratio=0.45, yield_stress=4e4, softening=1.0,
            residual=0.5,
        ),
        summary="soft clay full of water, as on a potter's wheel",
        source=f"{_TERZAGHI}: unconfined strength; {_BOWLES}; Skempton and Northey 1952, Geotechnique 3, 30",
        ranges={
            "density": (1700, 2100), "youngs_modulus": (2e6, 2.5e7), "poissons_ratio": (0.4, 0.5),
            "yield_stress": (2.5e4, 5e4), "softening": (0, 1), "residual": (0.25, 1),
        },
        stand_ins={"softening": "a choice: it is remoulded when it has been sheared for good by half"},
        aliases=("wet clay", "potters clay"),
    ),
    MaterialPreset(
        material=Sand(name="dry sand", density=1600, youngs_modulus=1e6, poissons_ratio=0.3, friction_angle=35),
        summary="dry sand of sharp grains, neither loose nor dense; no cohesion",
        source=f"{_TERZAGHI}; {_BOWLES}; Klar et al. 2016 (10.1145/2897824.2925906) take 3.5e5 Pa",
        ranges={
            "density": (1430, 1860), "youngs_modulus": (1e7, 8e7), "poissons_ratio": (0.2, 0.4),
            "friction_angle": (27.5, 45),
        },
        stand_ins={
            "youngs_modulus": "what flows goes by friction and weight alone; at 1e6 a heap of 0.3 m is pressed by less"
            " than half a per cent, and steps are 3 to 9 times as long"
        },
        aliases=("sand",),
    ),
    MaterialPreset(
        material=Sand(
            name="wet sand", density=1700, youngs_modulus=1e6, poissons_ratio=0.3, friction_angle=35, cohesion=1e3
        ),
        summary="moist sand of sand castles: it stands upright and slumps where it is too high or too steep",
        source="Lu, Wu and Tan 2007, J. Geotech. Geoenviron. Eng. 133, 144; Moller and Bonn 2007, Europhys. Lett. 80,"
        " 38002; Pakpour et al. 2012, Sci. Rep. 2, 549 (10.1038/srep00549)",
        ranges={
            "density": (1500, 1950), "youngs_modulus": (2e5, 3e6), "poissons_ratio": (0.2, 0.4),
            "friction_angle": (27.5, 45), "cohesion": (5e2, 2e3),
        },
        aliases=("damp sand", "moist sand"),
    ),
    MaterialPreset(
        material=Snow(name="snow", density=400, youngs_modulus=1.4e5, poissons_ratio=0.2),
        summary="snow that packs, as of snowballs",
        source="Stomakhin et al. 2013 (10.1145/2461912.2461948), section 6; densities: Cuffey and Paterson, The Physics"
        " of Glaciers (4th ed. 2010)",
        ranges={
            "density": (50, 400), "youngs_modulus": (4.8e4, 1.4e5), "poissons_ratio": (0.2, 0.2),
            "critical_compression": (0.019, 0.025), "critical_stretch": (0.005, 0.0075), "hardening": (5, 10),
        },
    ),
    MaterialPreset(
        material=Foam(
            name="shaving foam", density=80, youngs_modulus=700, poissons_ratio=0.45, yield_stress=50,
            plastic_viscosity=20,
        ),
        summary="shaving foam: it keeps its shape until it is pushed",
        source="Hohler and Cohen-Addad 2005, J. Phys. Condens. Matter 17, R1041; Yue et al. 2015 (10.1145/2751541)",
        ranges={
            "density": (50, 120), "youngs_modulus": (600, 1200), "poissons_ratio": (0.498, 0.4995),
            "yield_stress": (35, 105), "plastic_viscosity": (2, 60),
        },
        stand_ins={
            "poissons_ratio": "the air in it is a thousand times as stiff as the foam, and nobody sees it give way",
            "plastic_viscosity": "of a straight line through a curve, at shear rates of some 1/s",
        },
        aliases=("shaving cream",),
    ),
    MaterialPreset(
        material=Fluid(name="water", density=998, bulk_modulus=1e6, viscosity=1e-3),
        summary="water at 20 C, without surface tension",
        source=_CRC,
        ranges={"density": (958, 1000), "bulk_modulus": (1.9e9, 2.3e9), "viscosity": (2.8e-4, 1.8e-3)},
        stand_ins={"bulk_modulus": _MONAGHAN.format(fall=0.5, longer=47)},
    ),
    MaterialPreset(
        material=Fluid(name="oil", density=913, bulk_modulus=1e6, viscosity=0.08),
        summary="olive oil at 20 C, without surface tension",
        source=_CRC,
        ranges={"density": (905, 920), "bulk_modulus": (1.5e9, 1.8e9), "viscosity": (0.06, 0.09)},
        stand_ins={"bulk_modulus": _MONAGHAN.format(fall=0.55, longer=40)},
        aliases=("olive oil", "vegetable oil"),
    ),
    MaterialPreset(
        material=Fluid(name="honey", density=1420, bulk_modulus=1e6, viscosity=10),
        summary="runny honey at 25 C, a sixth of it water",
        source="Yanniotis, Skaltsi and Karaburnioti 2006, J. Food Eng. 72, 372",
        ranges={"density": (1380, 1450), "bulk_modulus": (2e9, 6e9), "viscosity": (2, 25)},
        stand_ins={"bulk_modulus": _MONAGHAN.format(fall=0.35, longer="45 or more")},
    ),
    MaterialPreset(
        material=Metal(
            name="steel", density=7850, youngs_modulus=2.1e11, poissons_ratio=0.29, yield_stress=2.5e8, hardening=8e8
        ),
        summary="mild steel; it yields and does not break",
        source=f"{_ASHBY}; {_KAYE}",
        ranges={
            "density": (7800, 7900), "youngs_modulus": (2e11, 2.16e11), "poissons_ratio": (0.28, 0.3),
            "yield_stress": (2.5e8, 4e8), "hardening": (2e8, 1.3e9),
        },
        aliases=("mild steel",),
    ),
    MaterialPreset(
        material=Metal(
            name="aluminium", density=2700, youngs_modulus=7e10, poissons_ratio=0.345, yield_stress=1.5e8, hardening=2e8
        ),
        summary="an aluminium alloy of medium strength; it yields and does not break",
        source=f"{_ASHBY}; {_KAYE}",
        ranges={
            "density": (2500, 2900), "youngs_modulus": (6.8e10, 8.2e10), "poissons_ratio": (0.32, 0.36),
            "yield_stress": (3e7, 5e8), "hardening": (6e7, 1e9),
        },
        aliases=("aluminum",),
    ),
    MaterialPreset(
        material=Metal(
            name="copper", density=8940, youngs_modulus=1.3e11, poissons_ratio=0.343, yield_stress=7e7, hardening=3e8
        ),
        summary="soft copper; it yields and does not break",
        source=f"{_ASHBY}; {_KAYE}",
        ranges={
            "density": (8930, 8940), "youngs_modulus": (1.12e11, 1.48e11), "poissons_ratio": (0.34, 0.35),
            "yield_stress": (3e7, 5e8), "hardening": (1e8, 1e9),
        },
    ),
    MaterialPreset(
        material=Metal(
            name="lead", density=11300, youngs_modulus=1.6e10, poissons_ratio=0.44, yield_stress=1e7, hardening=2e7
        ),
        summary="lead; it yields and does not break",
        source=f"{_ASHBY}; {_KAYE}",
        ranges={
            "density": (10000, 11400), "youngs_modulus": (1.25e10, 1.61e10), "poissons_ratio": (0.42, 0.44),
            "yield_stress": (8e6, 1.4e7), "hardening": (7e6, 4e7),
        },
    ),
    MaterialPreset(
        material=Elastic(name="glass", density=2480, youngs_modulus=7e10, poissons_ratio=0.22),
        summary="window glass; it does not break",
        source=f"{_ASHBY}; {_KAYE}",
        ranges={"density": (2440, 2490), "youngs_modulus": (6.8e10, 7.2e10), "poissons_ratio": (0.2, 0.24)},
    ),
    MaterialPreset(
        material=Elastic(name="ice", density=917, youngs_modulus=9.3e9, poissons_ratio=0.325),
        summary="ice of water, below -10 C; it does not break",
        source="Schulson and Duval, Creep and Fracture of Ice (2009); Petrovic 2003, J. Mater. Sci. 38, 1",
        ranges={"density": (910, 920), "youngs_modulus": (9e9, 1.12e10), "poissons_ratio": (0.29, 0.33)},
    ),
    MaterialPreset(
        material=Elastic(name="stone", density=2700, youngs_modulus=5e10, poissons_ratio=0.25),
        summary="marble, granite or limestone; it does not break",
        source="Goodman, Introduction to Rock Mechanics (2nd ed. 1989), table 6.1; Jaeger, Cook and Zimmerman,"
        " Fundamentals of Rock Mechanics (4th ed. 2007)",
        ranges={"density": (2200, 2800), "youngs_modulus": (1.9e10, 7.4e10), "poissons_ratio": (0.18, 0.4)},
        aliases=("rock", "marble", "granite", "limestone"),
    ),
    MaterialPreset(
        material=Elastic(name="concrete", density=2400, youngs_modulus=3e10, poissons_ratio=0.2),
        summary="concrete; it does not crack",
        source=f"{_ASHBY}; EN 1992-1-1 (Eurocode 2), 3.1.3",
        ranges={"density": (2200, 2600), "youngs_modulus": (2.5e10, 3.8e10), "poissons_ratio": (0.15, 0.2)},
    ),
)  # fmt: skip
