"""What a point makes of the grid's velocities: where it is next, how it is deformed, the stress that it then bears."""

from collections.abc import Callable
from typing import Any

from gasp_mpm_host import layout as at

from gasp_core.stepping.flow import CROWDED_VOLUME_RATIO, CROWDING_TOLERANCE
from gasp_taichi_mpm import words
from gasp_taichi_mpm.constitutive import make_response
from gasp_taichi_mpm.contact import kept_out, open_share
from gasp_taichi_mpm.nodes import stand_of
from gasp_taichi_mpm.runtime import taichi as ti
from gasp_taichi_mpm.transfers import cell_of, columns, has_drifted, make_overwrite

__all__ = ["make_move", "make_strain"]

_node4 = ti.types.vector(4, ti.f64)


@ti.func
def true_shift(met: ti.template(), labels: ti.template(), control: ti.template(), p):
    """How far a point's body is from its place in the scene, in cells."""
    return ti.cast(stand_of(met, control, labels[p * at.LABEL_WIDTH + at.HOME] - control[words.LOWER]), ti.f64)


def make_write_response(real: Any) -> Callable[..., None]:
    """Taichi function that stores what `constitutive.make_response` gives."""
    vec4 = ti.types.vector(4, real)
    overwrite = make_overwrite(real)

    @ti.func
    def write_response(points: ti.template(), r, S, dilation, history):
        # Symmetric to the last bit, or it would turn what it acts on.
        overwrite(points, r + words.STRESS, vec4(S[0, 0], S[0, 1], S[0, 2], dilation))
        overwrite(points, r + words.STRESS + 1, vec4(S[0, 1], S[1, 1], S[1, 2], history))
        overwrite(points, r + words.STRESS + 2, vec4(S[0, 2], S[1, 2], S[2, 2], 0))

    return write_response


def make_strain(real: Any, kinds: frozenset[str]) -> Callable[..., None]:
    """Taichi function: the stress that belongs to a point as it is, its velocity gradient taken for C."""
    stress_of = make_response(real, kinds, advance=False)
    write_response = make_write_response(real)

    @ti.func
    def strain_point(points: ti.template(), labels: ti.template(), materials: ti.template(), p):
        r = (p & words.POINT_BITS) * words.POINT_ROWS
        L = columns(points, r + words.AFFINE)
        F = columns(points, r + words.DISPLACEMENT_GRADIENT) + ti.Matrix.identity(real, 3)
        history = points[r + words.HISTORY][3]
        row = labels[p * at.LABEL_WIDTH + at.MATERIAL] * at.MATERIAL_WIDTH
        F, _, tau, dilation = stress_of(F, L, history, real(0.0), materials, row)
        write_response(points, r, tau, dilation, history)

    return strain_point


def make_move(real: Any, kinds: frozenset[str], gather: Callable[..., Any]) -> Callable[..., None]:
    """Taichi function: grid to point, then F, the return mapping and the stress that the next scatter reads."""
    advance = make_response(real, kinds, advance=True)
    overwrite = make_overwrite(real)
    write_response = make_write_response(real)
    flows = bool(kinds - {"elastic", "neo-hookean", "fluid"})
    yields = bool(kinds - {"elastic", "neo-hookean"})

    @ti.func
    def move_point(
        x: ti.template(),
        points: ti.template(),
        labels: ti.template(),
        grid: ti.template(),
        materials: ti.template(),
        batch: ti.template(),
        forcing: ti.template(),
        fields: ti.template(),
        control: ti.template(),
        report: ti.template(),
        met: ti.template(),
        drive_set,
        p,
    ):
        V, CX, CY, CZ, LX, LY, LZ = gather(x, grid, control, 0, p)
        r = (p & words.POINT_BITS) * words.POINT_ROWS
        row = labels[p * at.LABEL_WIDTH + at.MATERIAL] * at.MATERIAL_WIDTH
        dt = ti.cast(batch[words.STEP], real)
        history = points[r + words.HISTORY][3]
        if ti.static(yields):
            kind = ti.cast(materials[row + at.KIND], ti.i32)
            if kind > ti.static(at.KINDS["neo-hookean"]) and control[words.SEEDING] == 0:
                S, SX, SY, SZ, _lx, _ly, _lz = gather(x, grid, control, control[words.CARRIED_AT], p)
                OX = ti.cast(points[r + words.AFFINE], ti.f64)
                OY = ti.cast(points[r + words.AFFINE + 1], ti.f64)
                OZ = ti.cast(points[r + words.AFFINE + 2], ti.f64)
                # The columns of C L, and the symmetric part of it.
                QX = OX * LX[0] + OY * LX[1] + OZ * LX[2]
                QY = OX * LY[0] + OY * LY[1] + OZ * LY[2]
                QZ = OX * LZ[0] + OY * LZ[1] + OZ * LZ[2]
                half = 0.5 * batch[words.STEP]
                FX = half * (QX + _node4(QX[0], QY[0], QZ[0], 0))
                FY = half * (QY + _node4(QX[1], QY[1], QZ[1], 0))
                FZ = half * (QZ + _node4(QX[2], QY[2], QZ[2], 0))
                size = FX.dot(FX) + FY.dot(FY) + FZ.dot(FZ)
                share = ti.f64(0.0)
                if size > 0.0:
                    borne = (CX - SX).dot(FX) + (CY - SY).dot(FY) + (CZ - SZ).dot(FZ)
                    share = ti.min(ti.max(borne / size, 0.0), 1.0)
                faded = ti.max(1.0 - materials[row + at.SUBGRID_DECAY] * batch[words.STEP], 0.0)
                # In the fourth place is the mass that the grid sees.
                still = _node4(faded, faded, faded, 0)
                V += still * (ti.cast(points[r + words.VELOCITY], ti.f64) - S)
                CX += still * (OX - SX - share * FX)
                CY += still * (OY - SY - share * FY)
                CZ += still * (OZ - SZ - share * FZ)
                if ti.static("fluid" in kinds):
                    crowding = materials[row + at.CROWDING_DECAY] * batch[words.STEP]
                    if crowding > 0.0:
                        true = x[p] - true_shift(met, labels, control, p)
                        volume = S[3] * materials[row + at.FULLNESS] * (1.0 + ti.cast(history, ti.f64))
                        excess = volume / open_share(true, forcing, fields, control, drive_set) - 1.0
                        shrinking = ti.cast(crowding * ti.max(excess - ti.f64(CROWDING_TOLERANCE), 0.0), real)
                        shrunk = history - (1 + history) * shrinking / (1 + shrinking)
                        least = ti.cast(ti.f64(CROWDED_VOLUME_RATIO) - ti.f64(1.0), real)
                        history = ti.max(shrunk, ti.min(history, least))
        kept = points[r + words.VELOCITY]
        # Whole rows in one go, before anything branches: what is stored as vectors of four is computed as such.
        damped = 1.0 / (1.0 + materials[row + at.MASS_DAMPING] * batch[words.STEP])
        overwrite(points, r + words.VELOCITY, ti.cast(damped * V, real))
        overwrite(points, r + words.AFFINE, ti.cast(damped * CX, real))
        overwrite(points, r + words.AFFINE + 1, ti.cast(damped * CY, real))
        overwrite(points, r + words.AFFINE + 2, ti.cast(damped * CZ, real))
        shift = dt
        if ti.static("fluid" in kinds):
            # A fluid knows its volume alone.
            shift *= ti.cast(ti.cast(materials[row + at.KIND], ti.i32) != ti.static(at.KINDS["fluid"]), real)
        BX, BY, BZ = ti.cast(LX, real), ti.cast(LY, real), ti.cast(LZ, real)
        for c in ti.static(range(3)):
            H = points[r + words.DISPLACEMENT_GRADIENT + c]
            B = BX if ti.static(c == 0) else BY if ti.static(c == 1) else BZ
            rate = B + (BX * H[0] + BY * H[1] + BZ * H[2])
            overwrite(points, r + words.DISPLACEMENT_GRADIENT + c, H + shift * rate)
        if control[words.SEEDING] == 1:
            points[r + words.VELOCITY] = kept
        else:
            L = ti.Matrix([[BX[0], BY[0], BZ[0]], [BX[1], BY[1], BZ[1]], [BX[2], BY[2], BZ[2]]])
            F = columns(points, r + words.DISPLACEMENT_GRADIENT) + ti.Matrix.identity(real, 3)
            G, history, tau, dilation = advance(F, L, history, dt, materials, row)
            write_response(points, r, tau, dilation, history)
            if ti.static(flows):
                for c in ti.static(range(3)):
                    for d in ti.static(range(3)):
                        # Nothing but what flowed: F - I keeps the digits that F has not.
                        points[r + words.DISPLACEMENT_GRADIENT + c][d] += G[d, c] - F[d, c]
            u = ti.Vector([V[0], V[1], V[2]])
            if ti.static(yields):
                kind = ti.cast(materials[row + at.KIND], ti.i32)
                if kind > ti.static(at.KINDS["neo-hookean"]) and control[words.COLLIDERS] > 0:
                    true = x[p] - true_shift(met, labels, control, p)
                    half_width = ti.cast(points[r + words.HALF_SIDE][3], ti.f64)
                    u = kept_out(u, true, half_width, batch[words.STEP], forcing, fields, control, drive_set)
                    for d in ti.static(range(3)):
                        points[r + words.VELOCITY][d] = ti.cast(u[d], real)
            place = x[p] + batch[words.STEP] * u
            if control[words.CLAMP] == 1:
                held = 0
                stand = stand_of(met, control, labels[p * at.LABEL_WIDTH + at.HOME] - control[words.LOWER])
                for d in ti.static(range(3)):
                    if place[d] < batch[words.WALL_LOW + d] + stand[d]:
                        place[d] = batch[words.WALL_LOW + d] + stand[d]
                        points[r + words.VELOCITY][d] = ti.max(points[r + words.VELOCITY][d], real(0.0))
                        held = 1
                    elif place[d] > batch[words.WALL_HIGH + d] + stand[d]:
                        place[d] = batch[words.WALL_HIGH + d] + stand[d]
                        points[r + words.VELOCITY][d] = ti.min(points[r + words.VELOCITY][d], real(0.0))
                        held = 1
                if held == 1:
                    ti.atomic_add(report[words.CLAMPED], 1)
            x[p] = place
            drift = cell_of(place)
            for d in ti.static(range(3)):
                drift[d] -= labels[p * at.LABEL_WIDTH + at.HOME + d]
            if has_drifted(drift):
                report[words.DRIFTED] = 1

    return move_point
