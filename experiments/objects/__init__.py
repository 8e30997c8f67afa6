"""What is looked at: shapes, models, molecules and drawings, each with the symmetry that it was built with."""
