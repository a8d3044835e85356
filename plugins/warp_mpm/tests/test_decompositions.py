import numpy as np
import warp as wp
from gasp_mpm_host.testing import DecompositionTests
from gasp_warp_mpm import runtime
from gasp_warp_mpm.decompositions import algebra, make_decompositions


class TestDecompositions(DecompositionTests):
    def decompose(self, matrices):
        double = matrices.dtype == np.float64
        kind = wp.float64 if double else wp.float32
        tolerance = kind(1e-15 if double else 1e-7)
        mat33 = algebra(kind).mat33
        functions = make_decompositions(kind)
        cofactors, determinant_with = functions.cofactors, functions.determinant_with
        rotation_of, singular_columns = functions.rotation_of, functions.singular_columns

        @wp.kernel(module="unique", enable_backward=False)
        def work(
            given: wp.array(dtype=mat33),
            rotation: wp.array(dtype=mat33),
            columns: wp.array(dtype=mat33),
            right: wp.array(dtype=mat33),
        ):
            p = wp.tid()
            F = given[p]
            K = cofactors(F)
            rotation[p] = rotation_of(F, K, determinant_with(F, K), tolerance, tolerance)
            B, V = singular_columns(F, tolerance)
            columns[p] = B
            right[p] = V

        device = runtime.device_for("cpu")
        given = wp.array(matrices, dtype=mat33, device=device)
        results = [wp.zeros(len(matrices), dtype=mat33, device=device) for _ in range(3)]
        wp.launch(work, dim=len(matrices), inputs=[given, *results], device=device)
        return tuple(result.numpy() for result in results)
