"""Numbers that turn with the object: moments, quadrature over meshes, harmonics."""
