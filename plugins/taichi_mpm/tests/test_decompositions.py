import numpy as np
from gasp_mpm_host.testing import DecompositionTests
from gasp_taichi_mpm import runtime

ti = runtime.taichi


class TestDecompositions(DecompositionTests):
    def decompose(self, matrices):
        from gasp_taichi_mpm.decompositions import cofactors, determinant_with, rotation_of, singular_columns

        runtime.acquire("cpu")
        double = matrices.dtype == np.float64
        kind = ti.f64 if double else ti.f32
        tolerance, cosine = (1e-15, 1e-15) if double else (1e-7, 1e-7)
        Matrices = ti.types.ndarray(dtype=ti.types.matrix(3, 3, kind), ndim=1)

        @ti.kernel
        def work(given: Matrices, rotation: Matrices, columns: Matrices, right: Matrices):
            for p in given:
                F = given[p]
                K = cofactors(F)
                rotation[p] = rotation_of(F, K, determinant_with(F, K), kind(tolerance), kind(cosine))
                B, V = singular_columns(F, kind(cosine))
                columns[p] = B
                right[p] = V

        results = tuple(np.zeros_like(matrices) for _ in range(3))
        work(matrices, *results)
        runtime.release()
        return results
