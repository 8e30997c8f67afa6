"""The parts of an alignment: Procrustes on n-tuples, fits on all moments, rivals, the polish on points, the coset."""
