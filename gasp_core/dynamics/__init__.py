"""Scenes that already move: psi, and phi after psi.

psi(V, s) moves the simplices V of an object over the scene time s, the engine's phi moves points over the simulated
time t. Simulation begins at the scene time s0. What phi is given, and so what a run records at t = 0, is always
X = psi(V, s0); with s = s0 + rate t, or as a schedule has it, what is seen at t is, vertex by vertex, by the
composition that is asked for:

frozen
    x(t) = phi(X, t). psi stops at s0. By default the engine begins with the velocity rate dpsi/ds at s0: a dancer falls
    with the swing that she has. Exact; psi after s0 is lost.
carried
    x(t) = phi(X, t) + F(X, t) (psi(V, s) - X), F = dphi/dX. psi goes on in the matter's own frame, which phi moves and
    strains. This is phi continued linearly from X to psi(V, s), and so phi after psi exactly where phi is affine around
    X: where nothing happens it is psi, rigid motion turns psi along, free fall adds to it. Else it is off by
    |d^2 phi/dX^2| |psi(V, s) - X|^2 / 2. Forces and contacts meet the matter at phi(X), not at x: what psi moves far in
    a collider's way goes through it, and the engine knows nothing of the inertia of psi. The velocity of psi is in the
    second term, so that the engine is not given it.
driven
    x(t) = psi(V, s) in the parts that are driven, phi(X, t) elsewhere, phi being the motion of matter of which the
    driven parts go with psi whatever acts on them: a dancer whose skirt is physics. The engine leads the points of
    these parts, `gasp_core.contract.Trajectories`. What is free begins with the velocity of psi, and psi elsewhere is
    lost.

F is the gradient of the motion that the points show, for each Gaussian one, by affine least squares over those around
it; see `gasp_core.reduction`. It belongs to the matter that is there at rest: for sand or water that has flowed apart
carried is meaningless, frozen is not.
"""
